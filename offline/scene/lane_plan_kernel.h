#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "offline/scene/lane_robot.h"
#include "offline/scene/look_points.h"
#include "offline/scene/packet.h"
#include "offline/scene/space_lanes.h"

namespace tumbler {

/// The weights of a joint's control points in its position, velocity and acceleration at one time.
struct LanePathWeights {
  static constexpr std::size_t kMost = 8;  ///< Degree 7.
  std::size_t first = 0;                   ///< The control point that the first weight is for.
  std::array<std::array<double, kMost>, 3> of{};
};

/// The steps of plans in lanes, which all lanes share: motions whose joints are prescribed, and
/// then held at their ends.
struct LanePlan {
  enum class Scheme {
    kRungeKutta,         ///< kClassical (tableau.h).
    kFifthOrder,         ///< kDormandPrince, without its error estimate.
    kSemiImplicitEuler,  ///< One evaluation of the dynamics for each step.
  };
  Scheme scheme = Scheme::kRungeKutta;
  std::size_t stages = 4;           ///< Of a step of the scheme.
  std::size_t points_per_step = 2;  ///< As Timetable's.
  std::vector<double> steps;        ///< Their lengths [s].
  std::size_t motion_steps = 0;     ///< So many of them; joints are held in the others.
  /// The steps before which the state is kept, in their order; the number of all steps is the end.
  std::vector<std::size_t> looks;
  std::size_t weights = 0;  ///< Of a path at one time: its degree and one.
  /// For each joint, the index of its first control point among those of all joints.
  std::array<std::size_t, LaneModel::kMaxJoints> first_point{};
  /// For each joint, its weights at the points of each step of the motion, one after the other, and
  /// at its end: points_per_step motion_steps + 1.
  std::array<std::span<const LanePathWeights>, LaneModel::kMaxJoints> paths;
  /// Where each joint is held: at its last control point.
  std::array<std::size_t, LaneModel::kMaxJoints> last_point{};
};

/// What comes of plans in lanes. Spans are as long as is said; torques are of the motors.
/// @tparam State  LaneState or SpaceLaneState.
template <class S, class State = LaneState<S>>
struct LanePlanRecord {
  std::span<S> torque;       ///< At each stage, by step, then stage, then joint [N m].
  std::span<S> depth;        ///< Of the deepest contact at each stage likewise, in layers.
  std::span<State> at_look;  ///< At each of LanePlan::looks.
  S effort{};                ///< The integral of the sum of the squares of torques.
  S work{};                  ///< In space, that of the power that motors give [J].
  S loaded_slip{};           ///< In space, that of ContactForces::LoadedSlip [N m].
  S largest{};               ///< Of all positions and rates of the root, their size.
};

/// The smooth maximum of a recorded quantity (SmoothMaximum), for all lanes.
template <class S>
struct LanePeaks {
  enum class Of {
    kSize,  ///< The quantity's size, divided by `unit`: SmoothMaximum::Of::kSize.
    /// Of a quantity that is not negative, above zero: what SmoothDepth makes of a contact of that
    /// depth, divided by `unit`; SmoothMaximum::Of::kAboveZero.
    kDepth,
  };
  Of of = Of::kSize;
  std::span<const S> quantity;  ///< At each stage, by step, then stage, as of LanePlanRecord.
  std::size_t count = 1;        ///< Of such quantities at a stage,
  std::size_t which = 0;        ///< and which of them it is.
  double unit = 1;
  double sharpness = 0;
  double least = 0;    ///< Of a depth: SmoothDepth::least,
  double shallow = 0;  ///< and an exponent below this is one of no contact.
  /// Steps whose exponents are so much below the largest are left out; of the others, times at
  /// which they are `nothing` below.
  double negligible = 0, nothing = 0;
  std::span<const StepPoints* const> looks;  ///< Of each step.
  std::span<S> sizes;                        ///< Gets the largest size at a stage of each step.

  S at_start{};  ///< The largest size of the quantity at the start of a step.
  S largest{};   ///< As SmoothMaximum's.
  S sum{};       ///< Likewise.
};

/// The simulation of plans in lanes, compiled for one kind of vectors; as LaneKernel.
template <class S>
struct LanePlanKernel {
  /// As LaneKernel::name.
  const char* name;
  /// @param points  control points of all joints, one joint's after the other [rad].
  /// @param start   the root's position and velocity; the joints' are those of their paths.
  void (*run)(const LaneModel& model, const LaneRobot<S>& robot, const LanePlan& plan,
              std::span<const S> points, const LaneState<S>& start, LanePlanRecord<S>& record);
  /// The same in space.
  void (*run_in_space)(const SpaceLaneModel& model, const SpaceLaneRobot<S>& robot,
                       const LanePlan& plan, std::span<const S> points,
                       const SpaceLaneState<S>& start,
                       LanePlanRecord<S, SpaceLaneState<S>>& record);
  void (*find_peaks)(const LanePlan& plan, LanePeaks<S>& peaks);
};

/// The kernel for one robot.
const LanePlanKernel<double>& OneRobotPlanKernel();
/// The kernels for packets that this processor can run, the fastest first.
std::vector<const LanePlanKernel<Packet>*> PacketPlanKernels();

}  // namespace tumbler
