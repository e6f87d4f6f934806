#include "offline/solve/stage_maxima.h"

#include <algorithm>
#include <cmath>

#include "common/core/functions.h"

namespace tumbler {

StageMaxima::StageMaxima(const ParametricMotion& motion, const MotionOutputs& outputs,
                         const Timetable& table, const PathTable& paths, const StageValues& values)
    : motion_(motion),
      outputs_(outputs),
      table_(table),
      paths_(paths),
      values_(values),
      by_step_length_(joints() + 1) {}

void StageMaxima::Resize() {
  look_points_ =
      LookPoints(table_.scheme(), *std::max_element(table_.length.begin(), table_.length.end()));
  points_in_.clear();
  for (const double h : table_.length) points_in_.push_back(&look_points_.In(h));
  const std::size_t stages = Index(table_.steps() * table_.stages);
  const std::size_t curved = outputs_.curved().size();
  torque_slope_.resize(stages * joints());
  curve_.resize(stages * curved);
  curve_slope_.resize(stages * curved);
  penetration_slope_.resize(stages);
  highest_in_.resize(Index(table_.steps()));
  added_.reserve(Index(table_.steps()) * (curved == 0 ? 1 : 2));
}

void StageMaxima::Evaluate(ForwardPass pass, RolloutResult& result) {
  if (pass == ForwardPass::kGradient) {
    std::fill(penetration_slope_.begin(), penetration_slope_.end(), 0.0);
    std::fill(torque_slope_.begin(), torque_slope_.end(), 0.0);
    std::fill(curve_slope_.begin(), curve_slope_.end(), 0.0);
  }
  added_.clear();
  stretched_sum_ = 0;
  SmoothMaximum deepest = outputs_.EmptyPenetrationMaximum();
  AddSteps(pass, {values_.penetration.data(), penetration_slope_.data(), 1, 1}, deepest);
  by_step_length_.back() = FinishSlopes(deepest);
  result.penetration_excess = outputs_.PenetrationExcess(deepest);
  for (std::size_t j = 0; j < joints(); ++j) {
    if (!outputs_.IsTorqueLimited(static_cast<int>(j))) continue;
    const double limit = motion_.problem().joints[j].limits.torque_max_nm;
    SmoothMaximum largest = outputs_.EmptyTorqueMaximum();
    AddSteps(pass, {&values_.torque[j], &torque_slope_[j], joints(), limit}, largest);
    const auto curved = outputs_.curved();
    const auto found = std::find(curved.begin(), curved.end(), static_cast<int>(j));
    by_step_length_[j] =
        found == curved.end()
            ? FinishSlopes(largest)
            : AddCurve(pass, static_cast<std::size_t>(found - curved.begin()), largest);
    result.torque_excess[j] = MotionOutputs::TorqueExcess(largest);
  }
}

/// Sets where the motor of a curved joint is on its torque-speed curve at each stage.
void StageMaxima::SetCurve(ForwardPass pass, std::size_t curved) {
  const int stages_used = pass == ForwardPass::kEstimate ? 1 : table_.stages;
  const std::size_t count = outputs_.curved().size();
  const int j = outputs_.curved()[curved];
  for (int step = 0; step < table_.steps(); ++step) {
    for (int s = 0; s < stages_used; ++s) {
      const int point = table_.PointOf(step, s);
      const double velocity = point < table_.held() ? paths_.At(point, j).qd : 0;
      const std::size_t stage = table_.StageOf(step, s);
      curve_[stage * count + curved] =
          OnCurve(motion_.joint(j), values_.torque[stage * joints() + Index(j)], velocity);
    }
  }
}

/// Adds the torque-speed curve of a curved joint to the smooth maximum of its torque, and finishes
/// that.
/// @returns as FinishSlopes.
double StageMaxima::AddCurve(ForwardPass pass, std::size_t curved, SmoothMaximum& largest) {
  SetCurve(pass, curved);
  const std::size_t count = outputs_.curved().size();
  AddSteps(pass, {&curve_[curved], &curve_slope_[curved], count, 1}, largest);
  const double by_duration = FinishSlopes(largest);
  if (pass != ForwardPass::kGradient) return by_duration;
  const int j = outputs_.curved()[curved];
  const double by_torque = motion_.joint(j).motor.curve_by_torque();
  for (std::size_t stage = 0; stage * count < curve_slope_.size(); ++stage)
    torque_slope_[stage * joints() + Index(j)] += by_torque * curve_slope_[stage * count + curved];
  return by_duration;
}

/// Adds all steps to a smooth maximum, except for those that are 0. FinishSlopes makes the slopes
/// those of the maximum, when everything has been added.
void StageMaxima::AddSteps(ForwardPass pass, const Quantity& quantity, SmoothMaximum& maximum) {
  const bool euler = pass == ForwardPass::kEstimate;
  const std::size_t count = euler ? 1 : Index(table_.stages);
  const std::size_t step_stride = Index(table_.stages) * quantity.stride;
  const auto points_of = [&](std::size_t step) -> const StepPoints& {
    return euler ? LookPoints::Start() : *points_in_[step];
  };
  std::array<double, Tableau::kMaxStages> values{}, slopes{};
  const auto set_values = [&](std::size_t step) {
    const double* value = quantity.value + step * step_stride;
    for (std::size_t s = 0; s < count; ++s) values[s] = value[s * quantity.stride] / quantity.unit;
  };
  const std::size_t steps = Index(table_.steps());
  std::size_t highest_step = 0;
  for (std::size_t step = 0; step < steps; ++step) {
    const double* value = quantity.value + step * step_stride;
    double highest = 0;
    for (std::size_t s = 0; s < count; ++s)
      highest = std::max(highest, std::abs(value[s * quantity.stride]));
    highest_in_[step] = highest / quantity.unit;
    if (highest_in_[step] > highest_in_[highest_step]) highest_step = step;
  }
  set_values(highest_step);
  maximum.Expect(points_of(highest_step), {values.data(), count});

  const bool with_slopes = pass == ForwardPass::kGradient;
  for (std::size_t step = 0; step < steps; ++step) {
    if (highest_in_[step] == 0) continue;
    const StepPoints& points = points_of(step);
    if (!maximum.Counts(points, highest_in_[step])) continue;
    set_values(step);
    const double before = maximum.sum();
    const double shrink = maximum.Add(points, table_.length[step], {values.data(), count},
                                      {slopes.data(), with_slopes ? count : 0});
    if (!with_slopes) continue;
    stretched_sum_ *= shrink;
    if (table_.GrowthOf(static_cast<int>(step), motion_.duration()) != 0)
      stretched_sum_ += maximum.sum() - shrink * before;
    for (std::size_t s = 0; s < count; ++s)
      quantity.slope[step * step_stride + s * quantity.stride] = slopes[s];
    added_.push_back({quantity.slope + step * step_stride, quantity.stride, maximum.largest()});
  }
}

/// @returns the derivative of the maximum by the duration as far as steps become longer, if that is
/// free.
double StageMaxima::FinishSlopes(const SmoothMaximum& maximum) {
  const double rho = motion_.problem().solver.sharpness;
  if (maximum.sum() == 0) added_.clear();  // All slopes are 0.
  for (const AddedStep& step : added_) {
    const double since = portable::Exp(rho * (step.largest_so_far - maximum.largest()));
    for (std::size_t s = 0; s < Index(table_.stages); ++s)
      step.slope[s * step.stride] *= since / maximum.sum();
  }
  const double stretched = stretched_sum_;
  added_.clear();
  stretched_sum_ = 0;
  return stretched > 0 ? motion_.duration().growth() * stretched / (rho * maximum.sum()) : 0;
}

}  // namespace tumbler
