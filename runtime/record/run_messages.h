#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <tumbler/run_t.hpp>
#include <tumbler/space_truth_t.hpp>
#include <tumbler/state_t.hpp>

#include "runtime/record/proto_message.h"

namespace tumbler {

/// The project's own types of messages in MCAP: Tick, Joint, Run, Truth and TruthInSpace. Fields of
/// a tick and a joint are those of a table of ticks (runtime/record/state_columns.h), with their
/// units and meanings as comments. The files come in the order of their imports.
[[nodiscard]] std::vector<ProtoFile> RunFiles();

/// A message tumbler.Tick: everything of a tick but its joints.
[[nodiscard]] std::string EncodeTick(std::uint64_t time_ns, const state_t& state);

/// A message tumbler.Joint.
/// @param measured             whether its drive has measured anything yet; if not, what would be
/// measurements is NaN.
/// @param following_error_rad  the measured position less the setpoint that it answers; NaN where
/// there is none.
[[nodiscard]] std::string EncodeJoint(std::uint64_t time_ns, const joint_state_t& joint,
                                      bool measured, double following_error_rad);

/// A message tumbler.Run: load of the bus, latencies and losses of a run so far.
[[nodiscard]] std::string EncodeRun(std::uint64_t time_ns, const run_t& run);

/// A message tumbler.Truth, or tumbler.TruthInSpace: the true state of a simulated robot.
[[nodiscard]] std::string EncodeTruth(std::uint64_t time_ns, const space_truth_t& truth);

}  // namespace tumbler
