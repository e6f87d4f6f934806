#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "offline/problem/task_toml.h"

namespace tumbler {

/// A robot stands so long before the motion of an excitation begins in its primitive.
inline constexpr double kExcitationStands_s = 0.4;

/// The task of an excitation: the given one's robot, start, limits and ground, with an end at the
/// start and no other aim than to rest there.
std::string TextOfExcitation(const Task& given, double duration_s);

/// Two waves for each joint.
struct WaveShape {
  struct Wave {
    double hz = 0, phase = 0, part = 0;
  };
  std::vector<std::array<Wave, 2>> joints;
};

/// A shape as numbers of size 1, by joint and wave: rate between the slowest and the fastest, phase
/// in turns, part.
using MotionGenes = std::vector<double>;

/// The genes with this number of those that a seed gives.
MotionGenes DrawGenes(std::size_t joints, std::uint64_t seed, std::uint64_t index);
WaveShape ShapeOf(const MotionGenes& genes, std::size_t joints);

}  // namespace tumbler
