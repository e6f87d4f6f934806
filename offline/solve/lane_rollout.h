#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "offline/problem/problem.h"
#include "offline/scene/lane_plan_kernel.h"
#include "offline/scene/packet.h"
#include "offline/scene/step_grid.h"
#include "offline/solve/rollout_result.h"

namespace tumbler {

/// Up to eight motions of a problem at once, in the lanes of vectors: what Rollout::Run and
/// Rollout::Estimate compute for one, by the same schemes with the same equal steps, for a fraction
/// of the price.
///
/// Problems in space go through the same steps, outputs and paths as those in the plane; their
/// dynamics are SpaceLaneDynamics.
///
/// Everything agrees with a Rollout to rounding but the penetration, which takes the deepest
/// contact where a Rollout takes a smooth maximum of all. Every kind of vectors gives the same
/// bits, and a motion's do not depend on what is in the other lanes.
///
/// Not thread-safe: one object per thread.
class LaneRollout {
 public:
  /// Why lanes do not cover a problem, e.g. "the duration is free"; none where they do. They have
  /// everything that MakeLaneScene has; no cost of a state throughout the motion but, in space, the
  /// motors' work and the slip under load, and no duration that is free.
  static std::optional<std::string> WhyNot(const Problem& problem);

  /// @param kernel  null: the fastest that this processor can run.
  /// @pre  lanes cover the problem.
  LaneRollout(const Problem& problem, double step_s, LanePlan::Scheme scheme,
              const LanePlanKernel<Packet>* kernel = nullptr);
  /// With these steps, by the method of Dormand and Prince, as Rollout::Use.
  LaneRollout(const Problem& problem, const StepGrid& grid,
              const LanePlanKernel<Packet>* kernel = nullptr);
  ~LaneRollout();
  LaneRollout(LaneRollout&&) noexcept;

  /// What of its results a Run computes. The rest, which takes a while, is as before the start.
  enum class Wanted {
    kCost,       ///< The cost, and what it is made of.
    kSimulated,  ///< All but RolloutResult::clearance_excess.
    kAll,
  };

  /// Runs motions with the parameters in `x`, at most Packet::kLanes.
  /// @returns the result of each.
  std::vector<RolloutResult> Run(std::span<const std::vector<double>> x,
                                 Wanted wanted = Wanted::kAll);

  /// Of the last Run: the torques of all lanes at the start of a step [N m].
  [[nodiscard]] const Packet& torque(std::size_t step, std::size_t joint) const;
  /// The lengths of the steps [s].
  [[nodiscard]] std::span<const double> steps() const;
  /// Of the last Run: the part of each lane's cost that is made of squares (GaussNewton::squares).
  [[nodiscard]] double squares(std::size_t lane) const;
  /// The weight of effort in the cost.
  [[nodiscard]] double effort_weight() const;
  /// Evaluations of the dynamics that a motion takes.
  [[nodiscard]] std::int64_t evaluations() const;
  /// The clearance of the robot's own shapes alone, with its gradient (ClearanceConstraint).
  double ClearanceExcess(std::span<const double> x, std::span<double> gradient);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler
