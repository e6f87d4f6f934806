#pragma once

#include <limits>

#include "common/core/primitive.h"
#include "offline/model/contact_law.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// The longest integration step that contact allows on a motion.
struct ContactSteps {
  double step_s = std::numeric_limits<double>::infinity();
  double time_s = 0;  ///< When the motion has the pose that decides.
};

/// How joints with a motor move: by their paths, as rollouts have it, or by torques, as a twin
/// does, where contact meets the mass of a foot and not that of the robot.
enum class JointMoves { kByPath, kByTorque };

/// AdvisableStep with the smallest mass that contact meets in the poses on a primitive's paths, at
/// 20 ms or closer: legs that are folded or stretched in the middle of a motion may be lighter than
/// where it begins and ends. Joints without a motor are where the motion begins.
/// @param law  of the simulation, which may be another one than the problem's.
ContactSteps ContactStepsOf(const Problem& problem, const Primitive<double>& primitive,
                            const ContactLaw& law, JointMoves moves);

}  // namespace tumbler
