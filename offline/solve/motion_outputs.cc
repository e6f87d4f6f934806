#include "offline/solve/motion_outputs.h"

#include <algorithm>
#include <limits>

#include "common/core/index.h"

namespace tumbler {

MotionOutputs::MotionOutputs(const ParametricMotion& motion, double step_s)
    : motion_(motion),
      clearance_(motion.problem(), step_s),
      depth_(sharpness(),
             (1 - motion.problem().solver.core_margin) * motion.problem().contact().d_on_m) {
  for (int j = 0; j < motion.joints(); ++j) {
    if (LimitsTorqueBySpeed(motion.joint(j))) curved_.push_back(j);
  }
}

RolloutResult MotionOutputs::Begin() const {
  RolloutResult result;
  result.peak_torque_nm.assign(Index(motion_.joints()), 0);
  result.torque_excess.assign(Index(motion_.joints()), -1);
  return result;
}

RolloutResult MotionOutputs::Failed(RolloutResult result) {
  result.finite = false;
  result.cost = std::numeric_limits<double>::infinity();
  return result;
}

double MotionOutputs::TorqueExcess(const SmoothMaximum& maximum) {
  return maximum.sum() == 0 ? -1 : maximum.value() - 1;
}

double MotionOutputs::PenetrationExcess(const SmoothMaximum& maximum) const {
  return std::max(-1.0, depth_.least() + maximum.value() - 1);
}

template <class Space>
bool MotionOutputs::AddPenetrationSlopes(SceneDynamicsIn<Space>& robot,
                                         typename SceneDynamicsIn<Space>::Numbers& by_q) const {
  const std::span<const double> slopes = depth_.slopes();
  bool any = false;
  for (std::size_t i = 0; i < slopes.size(); ++i) {
    if (slopes[i] == 0) continue;
    any = true;
    robot.contact->AddDepthSlopes(robot.dynamics, robot.contact->active()[i], slopes[i], by_q);
  }
  return any;
}

template <class Space>
void MotionOutputs::RecordPeaks(const SceneDynamicsIn<Space>& robot, RolloutResult& result) const {
  for (int j = 0; j < motion_.joints(); ++j) {
    double& peak = result.peak_torque_nm[Index(j)];
    peak = std::max(peak, std::abs(robot.tau[Index(motion_.joint(j).dof)]));
  }
  for (const ActiveContact<Space>& active : robot.contact->active()) {
    result.any_contact = true;
    result.peak_penetration_m = std::max(result.peak_penetration_m, active.depth_m);
  }
}

void MotionOutputs::RecordTarget(const CostTerm& term, const CostPoint& here,
                                 RolloutResult& result) {
  result.target_error_rad = std::max(result.target_error_rad, term.TargetError(here));
  if (term.draws()) result.residuals.push_back(term.Residual(here));
}

template <class Space>
MotionOutputs::TermSlopesIn<Space> MotionOutputs::SlopesOf(const CostTerm& term,
                                                           const CostPoint& here) {
  TermSlopesIn<Space> slopes;
  term.AddSlopes(term.weight, here, {slopes.by_q, slopes.by_qd, {}});
  if (term.draws()) slopes.by_target = -2 * std::sqrt(term.weight) * term.Residual(here);
  return slopes;
}

template bool MotionOutputs::AddPenetrationSlopes(SceneDynamics&, SceneDynamics::Numbers&) const;
template bool MotionOutputs::AddPenetrationSlopes(SpaceDynamics&, SpaceDynamics::Numbers&) const;
template void MotionOutputs::RecordPeaks(const SceneDynamics&, RolloutResult&) const;
template void MotionOutputs::RecordPeaks(const SpaceDynamics&, RolloutResult&) const;
template MotionOutputs::TermSlopesIn<Plane> MotionOutputs::SlopesOf<Plane>(const CostTerm&,
                                                                           const CostPoint&);
template MotionOutputs::TermSlopesIn<Spatial> MotionOutputs::SlopesOf<Spatial>(const CostTerm&,
                                                                               const CostPoint&);

}  // namespace tumbler
