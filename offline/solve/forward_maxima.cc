#include "offline/solve/forward_maxima.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

namespace tumbler {
namespace {

using Row = Eigen::Map<Eigen::ArrayXd>;
using ConstRow = Eigen::Map<const Eigen::ArrayXd>;

}  // namespace

ForwardMaxima::ForwardMaxima(const ParametricMotion& motion, const MotionOutputs& outputs,
                             const Tableau& scheme, double longest_s)
    : motion_(motion), outputs_(outputs), scheme_(scheme), look_points_(scheme, longest_s) {
  const std::size_t joints = Index(motion.joints()), parameters = Index(motion.parameters());
  for (StageSensitivities& stage : stages_) {
    stage.torque.resize(joints);
    stage.torque_slope.resize(joints * parameters);
    stage.curve.resize(joints);
    stage.curve_slope.resize(joints * parameters);
    stage.penetration_slope.resize(parameters);
  }
  for (std::size_t j = 0; j <= joints; ++j) {
    maxima_.push_back(
        {j < joints ? outputs.EmptyTorqueMaximum() : outputs.EmptyPenetrationMaximum(),
         std::vector<double>(parameters)});
  }
}

void ForwardMaxima::Begin() {
  for (MaximumWithSlope& sum : maxima_) {
    sum.maximum.Reset();
    std::fill(sum.slope.begin(), sum.slope.end(), 0.0);
  }
}

/// Adds a step to a maximum.
/// @param values  the quantity at its stages.
/// @param slopes  gives its derivative in the parameters at a stage.
/// @param unit    what `slopes` are divided by.
template <class Slopes>
void ForwardMaxima::Add(MaximumWithSlope& sum, const StepPoints& points, double step_s,
                        std::span<const double> values, Slopes&& slopes, double unit,
                        double growth) const {
  SmoothMaximum& maximum = sum.maximum;
  double highest = 0;
  for (const double value : values) highest = std::max(highest, std::abs(value));
  if (!maximum.Counts(points, highest)) return;  // Most steps are far from the largest.
  std::array<double, Tableau::kMaxStages> by_value{};
  const double before = maximum.sum();
  const double shrink = maximum.Add(points, step_s, values, {by_value.data(), values.size()});
  Row total(sum.slope.data(), static_cast<Eigen::Index>(sum.slope.size()));
  if (shrink != 1) total *= shrink;
  for (std::size_t s = 0; s < values.size(); ++s) {
    if (by_value[s] != 0) total += (by_value[s] / unit) * ConstRow(slopes(s), total.size());
  }
  if (growth != 0) {
    sum.slope.back() +=
        growth * (maximum.sum() - shrink * before) / motion_.problem().solver.sharpness;
  }
}

void ForwardMaxima::AddStep(double step_s, double growth) {
  const std::size_t stages = scheme_.own_stages();
  const std::size_t parameters = Index(motion_.parameters());
  const StepPoints& points = look_points_.In(step_s);
  std::array<double, Tableau::kMaxStages> values{};
  const std::span<const double> of_stages(values.data(), stages);
  for (int joint = 0; joint < motion_.joints(); ++joint) {
    if (!outputs_.IsTorqueLimited(joint)) continue;
    const std::size_t j = Index(joint);
    const double limit = motion_.joint(joint).limits.torque_max_nm;
    for (std::size_t s = 0; s < stages; ++s) values[s] = stages_[s].torque[j] / limit;
    const auto torque_slope = [&](std::size_t s) {
      return stages_[s].torque_slope.data() + j * parameters;
    };
    Add(maxima_[j], points, step_s, of_stages, torque_slope, limit, growth);
    if (!LimitsTorqueBySpeed(motion_.joint(joint))) continue;
    for (std::size_t s = 0; s < stages; ++s) values[s] = stages_[s].curve[j];
    const auto curve_slope = [&](std::size_t s) {
      return stages_[s].curve_slope.data() + j * parameters;
    };
    Add(maxima_[j], points, step_s, of_stages, curve_slope, 1, growth);
  }
  bool touched = false;
  for (std::size_t s = 0; s < stages; ++s) {
    values[s] = stages_[s].penetration;
    touched = touched || values[s] != 0;
  }
  const auto penetration_slope = [&](std::size_t s) { return stages_[s].penetration_slope.data(); };
  if (touched) Add(maxima_.back(), points, step_s, of_stages, penetration_slope, 1, growth);
  if (scheme_.first_same_as_last) std::swap(stages_.front(), stages_[scheme_.stages - 1]);
}

void ForwardMaxima::Finish(RolloutResult& result, std::span<double> gradient) const {
  const std::size_t parameters = Index(motion_.parameters());
  const auto set_row = [&](int output, const MaximumWithSlope& sum) {
    const auto size = static_cast<Eigen::Index>(parameters);
    Row(gradient.data() + Index(output) * parameters, size) =
        ConstRow(sum.slope.data(), size) / sum.maximum.sum();
  };
  for (int j = 0; j < motion_.joints(); ++j) {
    const MaximumWithSlope& sum = maxima_[Index(j)];
    if (sum.maximum.sum() == 0) continue;
    result.torque_excess[Index(j)] = MotionOutputs::TorqueExcess(sum.maximum);
    set_row(OutputRows::torque(j), sum);
  }
  if (maxima_.back().maximum.sum() == 0) return;
  result.penetration_excess = outputs_.PenetrationExcess(maxima_.back().maximum);
  if (result.penetration_excess > -1) set_row(outputs_.rows().penetration(), maxima_.back());
}

}  // namespace tumbler
