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
  FindEntries();
  stage_size_ = free_ * order_.size() + (keeps_slope_ ? 2 * free_ : 0);
  for (std::size_t i = 0; i < entries_.size(); ++i)
    stage_size_ += Index((i < free_ ? 2 : 3) * entries_[i].count());
  integrates_state_ = std::ranges::any_of(motion.problem().cost, [](const CostTerm& term) {
    return term.when == CostTerm::When::kThroughout && term.of_state();
  });
  integrates_slip_ = CostTerm::SlipWeight(motion.problem().cost) != 0;
}

/// A limb is what hangs on the root by one joint. Inverse dynamics knows nothing between two limbs,
/// and no contact of a robot in space acts between its own bodies.
template <class Space>
void MotionRecord<Space>::FindEntries() {
  const int free = static_cast<int>(free_), all = static_cast<int>(order_.size());
  entries_.assign(order_.size(), {all, 0, 0});
  if (!kSparse) return;
  const auto limb_of = [&](int dof) {
    int first = dof;
    for (int i = dof; i >= 0 && !std::ranges::count(robot_.free, i); i = robot_.dynamics.parent(i))
      first = i;
    return first;
  };
  for (int i = free; i < all; ++i) {
    int begin = i, end = i;
    for (int k = free; k < all; ++k) {
      if (limb_of(order_[Index(k)]) != limb_of(order_[Index(i)])) continue;
      begin = std::min(begin, k);
      end = std::max(end, k + 1);
    }
    entries_[Index(i)] = begin == free ? Entries{end, 0, 0} : Entries{free, begin, end};
  }
}

template <class Space>
void MotionRecord<Space>::Resize(const Timetable& table) {
  const std::size_t stages = Index(table.steps() * table.stages);
  values_.torque.resize(stages * joints_);
  values_.penetration.resize(stages);
  penetration_slope_.resize(stages * order_.size());
  if (integrates_slip_) slip_.resize(stages);
  dynamics_.clear();
}

template <class Space>
void MotionRecord<Space>::PrepareDerivatives() {
  if (!dynamics_.empty()) return;
  dynamics_.resize(values_.penetration.size() * stage_size_);
  if (integrates_state_) states_.resize(values_.penetration.size() * 2 * robot_.n);
  if (integrates_slip_) slip_slopes_.resize(values_.penetration.size() * 2 * robot_.n);
}

template <class Space>
void MotionRecord<Space>::StoreDerivatives(std::size_t stage, const double* slope) {
  robot_.DifferentiateFactored(derivatives_, !kSparse);
  const auto& input = derivatives_.input;
  const std::span<const int> joints = std::span<const int>(order_).subspan(free_);
  double* out = &dynamics_[stage * stage_size_];
  for (const int i : robot_.free) {  // R_pp^T = -input_pp, R_ap^T = -input_ap^T = input_pa
    for (const int k : robot_.free) *out++ = -input[Index(i)][Index(k)];
    for (const int k : joints) *out++ = input[Index(i)][Index(k)];
  }
  const auto& by_acceleration = kSparse ? robot_.dynamics.inertia() : input;
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const std::size_t dof = Index(order_[i]);
    const Entries& entries = entries_[i];
    double *const q = out, *const qd = q + entries.count(), *const qdd = qd + entries.count();
    ForEachEntry(entries, [&](int k, std::size_t other) {
      q[k] = derivatives_.q[other][dof];
      qd[k] = derivatives_.qd[other][dof];
    });
    out = qdd;
    if (i < free_) continue;
    ForEachEntry(entries, [&](int k, std::size_t other) { qdd[k] = by_acceleration[other][dof]; });
    out += entries.count();
  }
  if (keeps_slope_) std::copy_n(slope, 2 * free_, out);
  if (!integrates_state_) return;
  double* const states = &states_[stage * 2 * robot_.n];
  std::copy_n(robot_.q.begin(), robot_.n, states);
  std::copy_n(robot_.qd.begin(), robot_.n, states + robot_.n);
  if (!integrates_slip_) return;
  const std::span<double> slopes(&slip_slopes_[stage * 2 * robot_.n], 2 * robot_.n);
  std::ranges::fill(slopes, 0.0);
  robot_.contact->AddLoadedSlipSlopes(robot_.dynamics, 1, slopes.first(robot_.n),
                                      slopes.last(robot_.n));
}

template class MotionRecord<Plane>;
template class MotionRecord<Spatial>;

}  // namespace tumbler
