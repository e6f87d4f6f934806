#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "offline/scene/lane_robot.h"
#include "offline/scene/packet.h"
#include "offline/scene/space_lanes.h"

namespace tumbler {

/// Lengths of the steps of a simulation in lanes.
struct LaneSteps {
  double tick_s = 1e-3;  ///< From one setpoint to the next.
  int per_tick = 4;      ///< Integration steps in a tick.
  /// Integration steps for which a drive keeps the torque of its law: those of a drive whose loop
  /// is slower than they are.
  int law_every = 1;
  /// Whether steps are those of the explicit midpoint rule, with the torque that the law had at the
  /// beginning of the step, as drives keep theirs; else they are semi-implicit Euler's.
  bool midpoint = false;
};

/// The setpoints that the drives of a robot obey.
template <class S>
using HeldSetpoints = std::array<LaneSetpoint<S>, LaneModel::kMaxJoints>;

/// What a simulation has seen since it began.
template <class S>
struct LaneWatch {
  S depth{};                                      ///< Largest, in thicknesses of the layer.
  std::array<S, LaneModel::kMaxJoints> torque{};  ///< Largest |torque| of each motor [N m].
  S root_speed{};  ///< Largest of the root's velocities [m/s, rad/s].
};

/// The simulation of robots in lanes, compiled for one kind of vectors. All kinds give the same
/// bits, those of the kernel for one robot.
template <class S>
struct LaneKernel {
  /// "one robot", "SSE2", "NEON", "AVX2" or "AVX-512"
  const char* name;

  /// Drives robots along setpoints, one for each joint and tick, joint by joint. A setpoint acts
  /// from its tick and the joint's delay on; before that acts the one before, `held` at first. The
  /// drive's law is that of MIT drives, at every integration step or less often:
  ///
  ///   torque = kp (position - measured) + kd (velocity - measured) + feed-forward,
  ///
  /// within the limit. `held` is then the last setpoint.
  void (*drive)(const LaneModel& model, const LaneRobot<S>& robot, const LaneSteps& steps,
                std::span<const LaneSetpoint<S>> setpoints, HeldSetpoints<S>& held,
                LaneState<S>& state, LaneWatch<S>& watch);

  /// The same by the classical Runge-Kutta method, of which no step begins before its setpoint
  /// acts: where that comes within a step, the one before acts to the step's end. Nothing is
  /// watched.
  /// @param lanes  how many of a packet's robots are to move, from the first on; the others may.
  void (*drive_classically)(const LaneModel& model, const LaneRobot<S>& robot,
                            const LaneSteps& steps, std::span<const LaneSetpoint<S>> setpoints,
                            HeldSetpoints<S>& held, LaneState<S>& state, std::size_t lanes);

  /// The same in space.
  void (*drive_classically_in_space)(const SpaceLaneModel& model, const SpaceLaneRobot<S>& robot,
                                     const LaneSteps& steps,
                                     std::span<const LaneSetpoint<S>> setpoints,
                                     HeldSetpoints<S>& held, SpaceLaneState<S>& state,
                                     std::size_t lanes);

  /// Moves robots whose joints are prescribed exactly, as plans have them: setpoints are positions,
  /// velocities and accelerations for each joint and step.
  /// @param torques  gets the torques of the motors, one for each setpoint.
  void (*prescribe)(const LaneModel& model, const LaneRobot<S>& robot, double step_s,
                    std::span<const LaneSetpoint<S>> setpoints, LaneState<S>& state,
                    LaneWatch<S>& watch, std::span<S> torques);
};

/// LaneKernel::drive in single precision, for twice as many robots that all obey the same
/// setpoints, in less time than that takes for one packet: to rank motions by what comes of robots.
/// Of 4800 robots that played a handstand none came to another end than in double precision (a test
/// plays 480 of them). All kinds of vectors give the same bits.
struct RankingKernel {
  const char* name;  ///< As LaneKernel::name.
  void (*drive)(const LaneModel& model, const LaneRobot<WidePacket>& robot, const LaneSteps& steps,
                std::span<const LaneSetpoint<float>> setpoints, HeldSetpoints<float>& held,
                LaneState<WidePacket>& state, LaneWatch<WidePacket>& watch);
};

/// The kernel for one robot.
const LaneKernel<double>& OneRobotKernel();
/// The kernels for packets that this processor can run, the fastest first.
std::vector<const LaneKernel<Packet>*> PacketKernels();
std::vector<const RankingKernel*> RankingKernels();

}  // namespace tumbler
