#pragma once

#include <cstdint>

#include "common/files/sequence_toml.h"
#include "offline/problem/simulated_motion.h"
#include "tests/support/files.h"

namespace tumbler::testing {

constexpr std::int64_t kMs = 1'000'000;  ///< A millisecond [ns].

/// The tumbler's mass [kg] and weight per mass [m/s^2].
constexpr double kMass = 1.8, kGravity = 9.81;

/// The nominal gait.
inline const SimulatedMotion& Gait() {
  static const SimulatedMotion gait(LoadMotion(SourcePath("primitives/nominal/gait.toml")));
  return gait;
}

}  // namespace tumbler::testing
