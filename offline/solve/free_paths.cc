#include "offline/solve/free_paths.h"

#include <algorithm>
#include <utility>

#include "common/core/index.h"

namespace tumbler {

FreePaths::FreePaths(const Problem& problem) : sources_(Index(problem.parameter_count())) {
  std::vector<const TiedJoint*> tied(problem.joints.size(), nullptr);
  for (const TiedJoint& joint : problem.tied) tied[joint.joint] = &joint;
  const auto tie_of = [&](std::size_t parameter) -> const TiedJoint* {
    const int p = static_cast<int>(parameter);
    return p < problem.first_start_rate() ? tied[problem.joint_of_parameter(p)] : nullptr;
  };
  for (std::size_t p = 0; p < sources_.size(); ++p) {
    if (tie_of(p) != nullptr) continue;
    sources_[p].of = own_.size();
    own_.push_back(p);
    bounds_.push_back(problem.bounds_of_parameter(static_cast<int>(p)));
  }
  for (std::size_t p = 0; p < sources_.size(); ++p) {
    const TiedJoint* tie = tie_of(p);
    if (tie == nullptr) continue;
    const std::size_t point = p - Index(problem.first_parameter(tie->joint));
    sources_[p] = {sources_[Index(problem.first_parameter(tie->to)) + point].of, tie->factor};
    Interval<double> own = problem.bounds_of_parameter(static_cast<int>(p));
    if (tie->factor < 0) own = {-own.max, -own.min};
    Interval<double>& both = bounds_[sources_[p].of];
    both = {std::max(both.min, own.min), std::min(both.max, own.max)};
    // Both begin within their own limits, at the same place but for a rounding.
    both.max = std::max(both.min, both.max);
  }
}

std::vector<double> FreePaths::Inside(std::vector<double> y) const {
  for (std::size_t i = 0; i < y.size(); ++i)
    y[i] = std::clamp(y[i], bounds_[i].min, bounds_[i].max);
  return y;
}

std::vector<double> FreePaths::Expand(std::span<const double> y) const {
  std::vector<double> x;
  x.reserve(sources_.size());
  for (const Source& source : sources_) x.push_back(source.factor * y[source.of]);
  return x;
}

std::vector<double> FreePaths::Reduce(std::span<const double> x) const {
  std::vector<double> y;
  y.reserve(own_.size());
  for (const std::size_t parameter : own_) y.push_back(x[parameter]);
  return y;
}

std::vector<double> FreePaths::Tied(std::vector<double> x) const {
  return any_tied() ? Expand(Inside(Reduce(x))) : x;
}

std::vector<double> FreePaths::ReduceSlopes(std::span<const double> by_x) const {
  std::vector<double> by_y(count(), 0.0);
  for (std::size_t p = 0; p < sources_.size(); ++p)
    by_y[sources_[p].of] += sources_[p].factor * by_x[p];
  return by_y;
}

OutputGradients FreePaths::ReduceSlopes(OutputGradients by_x) const {
  if (!any_tied()) return by_x;
  OutputGradients by_y(by_x.rows(), static_cast<Eigen::Index>(count()));
  for (Eigen::Index row = 0; row < by_x.rows(); ++row) {
    const std::vector<double> slopes =
        ReduceSlopes(std::span(by_x.data() + row * by_x.cols(), sources_.size()));
    std::ranges::copy(slopes, by_y.data() + row * by_y.cols());
  }
  return by_y;
}

GaussNewton FreePaths::Reduce(GaussNewton by_x) const {
  if (!any_tied()) return by_x;
  const auto columns = static_cast<Eigen::Index>(count());
  Eigen::MatrixXd T = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(sources_.size()), columns);
  for (std::size_t p = 0; p < sources_.size(); ++p) {
    T(static_cast<Eigen::Index>(p), static_cast<Eigen::Index>(sources_[p].of)) = sources_[p].factor;
  }
  GaussNewton by_y;
  by_y.matrix = T.transpose() * by_x.matrix * T;
  by_y.residual_slopes = by_x.residual_slopes * T;
  by_y.squares = by_x.squares;
  by_y.linear = T.transpose() * by_x.linear;
  return by_y;
}

std::vector<LinearRow> FreePaths::Reduce(std::span<const LinearRow> rows) const {
  if (!any_tied()) return {rows.begin(), rows.end()};
  std::vector<LinearRow> reduced;
  for (const LinearRow& row : rows) {
    LinearRow by_y = row;
    by_y.a = ReduceSlopes(row.a);
    const bool known = std::ranges::any_of(reduced, [&](const LinearRow& other) {
      return other.a == by_y.a && other.b == by_y.b &&
             (!row.of_free_duration || other.derivative == row.derivative);
    });
    if (!known) reduced.push_back(std::move(by_y));
  }
  return reduced;
}

}  // namespace tumbler
