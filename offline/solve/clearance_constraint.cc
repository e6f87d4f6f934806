#include "offline/solve/clearance_constraint.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/problem/end_points.h"
#include "offline/scene/even_steps.h"
#include "offline/scene/self_clearance.h"
#include "offline/solve/joint_paths.h"
#include "offline/solve/smooth_maximum.h"

namespace tumbler {
namespace {

/// The time that counts as one sample of the smooth maximum [s].
constexpr double kSampleTime_s = 1e-3;

using PathSpline = JointMotion<double>::Spline;

}  // namespace

struct ClearanceConstraint::Implementation {
  /// The weights of a joint's control points in its position at one time.
  struct Weights {
    int first = 0;
    std::array<double, PathSpline::kMaxDegree + 1> w{};
  };

  Implementation(const Problem& p, double step_s)
      : problem(p),
        plane(PlaneDistances(p)),
        space(SpaceDistances(p)),
        steps(p.free_duration ? p.free_duration->max_s : p.duration_s, step_s, 1),
        rho(p.solver.sharpness),
        reach_m(p.self_contact().clearance_m - kNegligibleExponent / rho * kClearanceScale_m),
        q(p.dof_count(), 0.0),
        slopes(p.joints.size()),
        ends(p.joints.size()) {}

  /// Makes the weights when they are first needed.
  void Tabulate() {
    const Problem& p = problem;
    if (!weights.empty() || p.self_contact().pairs.empty()) return;
    std::vector<double> longest(Index(p.parameter_count()), 0.0);
    if (p.free_duration) longest.back() = p.free_duration->max_s / p.duration_s;
    for (std::size_t j = 0; j < p.joints.size(); ++j) {
      first_parameter.push_back(p.first_parameter(j));
      // It takes as long as the steps; where the duration is free, its paths are stretched.
      const PathSpline spline = PositionSpline(p, longest, j);
      for (int k = 0; k <= steps.count; ++k) {
        const PathSpline::Weights all = spline.EvaluateWeights(k * steps.step_s);
        weights.push_back({all.first, all.w[0]});
      }
    }
  }

  [[nodiscard]] const Weights& WeightsOf(std::size_t joint, int k) const {
    return weights[joint * Index(steps.count + 1) + Index(k)];
  }

  void SetJoints(int k, std::span<const double> x) {
    for (std::size_t j = 0; j < problem.joints.size(); ++j) {
      const Weights& w = WeightsOf(j, k);
      double position = 0;
      for (int i = 0; i <= problem.degree; ++i) {
        position += w.w[Index(i)] *
                    ControlPointOf(problem.joints[j], ends[j], first_parameter[j], x, w.first + i);
      }
      q[Index(problem.joints[j].dof)] = position;
    }
  }

  double Evaluate(std::span<const double> x, std::span<double> gradient) {
    std::fill(gradient.begin(), gradient.end(), 0.0);
    Tabulate();
    if (weights.empty()) return -1;
    const double duration_s = problem.duration_of(x);
    for (std::size_t j = 0; j < ends.size(); ++j)
      ends[j] = EndPointsOf(problem.joints[j], problem.degree, duration_s);
    // Sum and gradient are scaled by exp(-rho largest).
    double largest = 0, sum = 0;
    const double stretch = problem.free_duration ? duration_s / problem.free_duration->max_s : 1;
    const double step_s = stretch * steps.step_s;
    for (int k = 0; k <= steps.count; ++k) {
      SetJoints(k, x);
      const double time = (k == 0 || k == steps.count ? 0.5 : 1.0) * step_s / kSampleTime_s;
      std::fill(slopes.begin(), slopes.end(), 0.0);
      const auto add = [&](const auto& near) {
        const double value =
            (problem.self_contact().clearance_m - near.distance_m) / kClearanceScale_m;
        if (sum == 0) largest = value;
        if (value > largest) {
          const double shrink = portable::Exp(rho * (largest - value));
          sum *= shrink;
          for (double& slope : gradient) slope *= shrink;
          for (double& slope : slopes) slope *= shrink;
          largest = value;
        }
        const double weight = time * portable::Exp(rho * (value - largest));
        sum += weight;
        for (std::size_t j = 0; j < slopes.size(); ++j)
          slopes[j] -= weight * near.slopes[Index(problem.joints[j].dof)] / kClearanceScale_m;
      };
      if (space) {
        std::ranges::for_each(space->FindNearer(q, reach_m), add);
      } else {
        std::ranges::for_each(plane->FindNearer(q, reach_m), add);
      }
      if (!gradient.empty()) AddToParameters(k, gradient);
    }
    const double excess = sum > 0 ? largest + portable::Log(sum) / rho : -1;
    if (excess <= -1) {
      std::fill(gradient.begin(), gradient.end(), 0.0);
      return -1;
    }
    for (double& slope : gradient) slope /= sum;
    // The sum grows like the steps.
    if (problem.free_duration && !gradient.empty()) gradient.back() += 1 / (rho * x.back());
    return excess;
  }

  void AddToParameters(int k, std::span<double> gradient) const {
    for (std::size_t j = 0; j < slopes.size(); ++j) {
      if (slopes[j] == 0) continue;
      const Weights& w = WeightsOf(j, k);
      const FreeWeights free(problem.joints[j], first_parameter[j], problem.degree, w.first);
      for (int i = free.begin; i < free.end; ++i)
        gradient[Index(free.shift + i)] += slopes[j] * w.w[Index(i)];
      if (problem.free_duration)
        gradient.back() += problem.duration_s * slopes[j] * MovedWithEnds(j, w);
    }
  }

  /// The derivative of a joint's position by the duration, as its ends move with that.
  [[nodiscard]] double MovedWithEnds(std::size_t joint, const Weights& w) const {
    const ActuatedJoint& actuated = problem.joints[joint];
    const EndPoints by_duration = EndPointSlopes(actuated, problem.degree);
    double sum = 0;
    for (int i = 0; i <= problem.degree; ++i) {
      const int point = w.first + i;
      if (point < 3 || point >= 3 + actuated.free_points())
        sum += w.w[Index(i)] * by_duration.At(point, actuated.control_points);
    }
    return sum;
  }

  static std::optional<SelfDistances> PlaneDistances(const Problem& p) {
    if (p.space) return std::nullopt;
    return SelfDistances(p.scene.robot, p.scene.self_contact.pairs);
  }
  static std::optional<SpaceSelfDistances> SpaceDistances(const Problem& p) {
    if (!p.space) return std::nullopt;
    return SpaceSelfDistances(p.space->scene.robot, p.space->scene.self_contact.pairs);
  }

  Problem problem;
  std::optional<SelfDistances> plane;  // one of the two
  std::optional<SpaceSelfDistances> space;
  EvenSteps steps;
  double rho;
  double reach_m;  // pairs farther apart than this have no share
  std::vector<double> q;
  std::vector<double> slopes;   // of the sum, by joint, at one time
  std::vector<EndPoints> ends;  // of the present motion, by joint
  std::vector<int> first_parameter;
  std::vector<Weights> weights;  // by joint, then time
};

ClearanceConstraint::ClearanceConstraint(const Problem& problem, double step_s)
    : implementation_(std::make_unique<Implementation>(problem, step_s)) {}
ClearanceConstraint::~ClearanceConstraint() = default;
ClearanceConstraint::ClearanceConstraint(ClearanceConstraint&&) noexcept = default;

double ClearanceConstraint::Evaluate(std::span<const double> x, std::span<double> gradient) {
  return implementation_->Evaluate(x, gradient);
}

}  // namespace tumbler
