#include "offline/solve/motion_record.h"

namespace tumbler {

template <class Space>
MotionRecord<Space>::MotionRecord(const ParametricMotion& motion, Dynamics& robot)
    : robot_(robot),
      free_(robot.free.size()),
      joints_(motion.problem().joints.size()),
      order_(robot.free),
      keeps_slope_(motion.duration().is_free()) {
  for (const ActuatedJoint& joint : motion.problem().joints) order_.push_back(joint.dof);
  stage_size_ = 3 * order_.size() * order_.size() + (keeps_slope_ ? 2 * free_ : 0);
  integrates_state_ = std::ranges::any_of(motion.problem().cost, [](const CostTerm& term) {
    return term.when == CostTerm::When::kThroughout && term.of_state();
  });
}

template <class Space>
void MotionRecord<Space>::Resize(const Timetable& table) {
  const std::size_t stages = Index(table.steps() * table.stages);
  values_.torque.resize(stages * joints_);
  values_.penetration.resize(stages);
  penetration_slope_.resize(stages * order_.size());
  dynamics_.clear();
}

template <class Space>
void MotionRecord<Space>::PrepareDerivatives() {
  if (!dynamics_.empty()) return;
  dynamics_.resize(values_.penetration.size() * stage_size_);
  if (integrates_state_) states_.resize(values_.penetration.size() * 2 * robot_.n);
}

template <class Space>
void MotionRecord<Space>::StoreDerivatives(std::size_t stage, const double* slope) {
  robot_.DifferentiateFactored(derivatives_);
  const auto& input = derivatives_.input;
  const std::span<const int> order(order_), joints = order.subspan(free_);
  double* out = &dynamics_[stage * stage_size_];
  for (const int i : robot_.free) {  // R_pp^T = -input_pp, R_ap^T = -input_ap^T = input_pa
    for (const int k : robot_.free) *out++ = -input[Index(i)][Index(k)];
    for (const int k : joints) *out++ = input[Index(i)][Index(k)];
  }
  for (const int j : joints) {
    for (const int k : order) *out++ = input[Index(k)][Index(j)];
  }
  for (const auto* block : {&derivatives_.q, &derivatives_.qd}) {
    for (const int c : order) {
      for (const int i : order) *out++ = (*block)[Index(i)][Index(c)];
    }
  }
  if (keeps_slope_) std::copy_n(slope, 2 * free_, out);
  if (!integrates_state_) return;
  double* const states = &states_[stage * 2 * robot_.n];
  std::copy_n(robot_.q.begin(), robot_.n, states);
  std::copy_n(robot_.qd.begin(), robot_.n, states + robot_.n);
}

template class MotionRecord<Plane>;
template class MotionRecord<Spatial>;

}  // namespace tumbler
