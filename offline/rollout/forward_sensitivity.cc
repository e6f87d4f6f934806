#include "offline/rollout/forward_sensitivity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "offline/contact/contact_model.h"
#include "offline/dynamics/hybrid_dynamics.h"

namespace tumbler {
namespace {

using Spline = JointMotion<double>::Spline;
using Row = Eigen::Map<Eigen::ArrayXd>;
using ConstRow = Eigen::Map<const Eigen::ArrayXd>;

/// A state beyond this (m, rad, and their rates) is a failed rollout, as in Rollout.
constexpr double kImplausible = 1e4;

constexpr std::size_t Index(int i) { return static_cast<std::size_t>(i); }

/// An explicit Runge-Kutta scheme. Its last stage may be the first of the next step.
constexpr int kMaxStages = 7;
struct Tableau {
  int stages;
  bool first_same_as_last;
  double order;  ///< Of the error estimate, plus one.
  std::array<double, kMaxStages> c;
  std::array<std::array<double, kMaxStages>, kMaxStages> a;
  std::array<double, kMaxStages> b;
  std::array<double, kMaxStages> error;  ///< b less the weights of the embedded scheme.
};

constexpr Tableau kClassical = {4,
                                false,
                                4,
                                {0, 0.5, 0.5, 1},
                                {{{}, {0.5}, {0, 0.5}, {0, 0, 1}}},
                                {1. / 6, 1. / 3, 1. / 3, 1. / 6},
                                {}};

constexpr Tableau kDormandPrince = {
    7,
    true,
    5,
    {0, 1. / 5, 3. / 10, 4. / 5, 8. / 9, 1, 1},
    {{{},
      {1. / 5},
      {3. / 40, 9. / 40},
      {44. / 45, -56. / 15, 32. / 9},
      {19372. / 6561, -25360. / 2187, 64448. / 6561, -212. / 729},
      {9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656},
      {35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84}}},
    {35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84, 0},
    {71. / 57600, 0, -71. / 16695, 71. / 1920, -17253. / 339200, 22. / 525, -1. / 40}};

/// Smooth maximum of one joint's |tau| / limit and its derivative, sample by sample [KS79]:
/// sum and slope are scaled by exp(-rho largest).
struct SmoothMaximum {
  double largest = -std::numeric_limits<double>::infinity();
  double sum = 0;
  std::vector<double> slope;

  void Reset() {
    largest = -std::numeric_limits<double>::infinity();
    sum = 0;
    std::fill(slope.begin(), slope.end(), 0.0);
  }
  void Add(double torque, double limit, double rho, const double* torque_slope) {
    const double value = std::abs(torque) / limit;
    Row total(slope.data(), static_cast<Eigen::Index>(slope.size()));
    if (value > largest) {
      const double shrink = std::exp(rho * (largest - value));  // Zero at first.
      sum *= shrink;
      total *= shrink;
      largest = value;
    }
    const double weight = std::exp(rho * (value - largest));
    sum += weight;
    total += std::copysign(weight / limit, torque) * ConstRow(torque_slope, total.size());
  }
};

}  // namespace

struct ForwardSensitivity::Implementation {
  Implementation(const Problem& p, const ForwardSettings& s)
      : problem(p),
        settings(s),
        tableau(s.scheme == ForwardSettings::Scheme::kFixed ? kClassical : kDormandPrince),
        dynamics(p.robot.tree),
        contact(p.contact, p.robot.shapes, p.obstacles),
        n(dynamics.size()),
        na(static_cast<int>(p.joints.size())),
        parameters(p.parameter_count()),
        splines(Index(na)),
        smooth(Index(na + 1)) {
    for (int j = 0; j < n; ++j) {
      if (!dynamics.prescribed(j)) free.push_back(j);
    }
    nf = static_cast<int>(free.size());
    rows = 2 * nf + 1;
    for (int j = 0; j < na; ++j) first_parameter.push_back(p.first_parameter(Index(j)));
    const std::size_t size = Index(rows) * Index(1 + parameters);
    for (std::vector<double>* z : {&state, &stage_state, &next}) z->resize(size);
    for (int i = 0; i < tableau.stages; ++i) slopes[Index(i)].resize(size);
    torque_slope.resize(Index(na * parameters));
    depth_slope.resize(Index(parameters));
    outputs.resize(Index((2 + na) * parameters));
    for (SmoothMaximum& maximum : smooth) maximum.slope.resize(Index(parameters));
  }

  // A state z holds y, then the rows of S, one after the other.
  double* Sensitivity(std::vector<double>& z, int row) const {
    return z.data() + Index(rows + row * parameters);
  }
  const double* Sensitivity(const std::vector<double>& z, int row) const {
    return z.data() + Index(rows + row * parameters);
  }

  void SetPaths(double t, bool moving) {
    const double key = moving ? t : -1;
    if (key == paths_time) return;
    paths_time = key;
    for (int j = 0; j < na; ++j) {
      const ActuatedJoint& joint = problem.joints[Index(j)];
      const std::size_t dof = Index(joint.dof);
      if (!moving) {
        q[dof] = joint.end_rad;
        qd[dof] = path_qdd[Index(j)] = 0;
        continue;
      }
      const Spline& spline = splines[Index(j)];
      weights[Index(j)] = spline.EvaluateWeights(t);
      const Spline::Weights& w = weights[Index(j)];
      std::array<double, 3> path{};
      for (int i = 0; i <= problem.degree; ++i) {
        const double point = spline.control_points()[Index(w.first + i)];
        for (std::size_t d = 0; d < 3; ++d) path[d] += w.w[d][Index(i)] * point;
      }
      q[dof] = path[0];
      qd[dof] = path[1];
      path_qdd[Index(j)] = path[2];
    }
  }

  /// The row of S' (or of dtau/dp) that belongs to g's output i: A S + B.
  void Differentiate(int i, bool moving, const std::vector<double>& z, double* out) {
    Row row(out, parameters);
    row.setZero();
    for (int k = 0; k < nf; ++k) {
      const std::size_t dof = Index(free[Index(k)]);
      row += derivatives.q[Index(i)][dof] * ConstRow(Sensitivity(z, k), parameters);
      row += derivatives.qd[Index(i)][dof] * ConstRow(Sensitivity(z, nf + k), parameters);
    }
    if (!moving) return;
    for (int j = 0; j < na; ++j) {
      const ActuatedJoint& joint = problem.joints[Index(j)];
      const std::size_t dof = Index(joint.dof);
      const Spline::Weights& w = weights[Index(j)];
      const int begin = std::max(0, 3 - w.first);
      const int end = std::min(problem.degree + 1, 3 + joint.free_points() - w.first);
      const int shift = first_parameter[Index(j)] + w.first - 3;
      for (int k = begin; k < end; ++k) {
        out[shift + k] += derivatives.q[Index(i)][dof] * w.w[0][Index(k)] +
                          derivatives.qd[Index(i)][dof] * w.w[1][Index(k)] +
                          derivatives.input[Index(i)][dof] * w.w[2][Index(k)];
      }
    }
  }

  /// The derivative, by the parameters, of what has these derivatives by the positions.
  void DifferentiatePosition(const std::array<double, HybridDynamics<Plane>::kMaxDofs>& by_q,
                             bool moving, double* out) {
    Row row(out, parameters);
    row.setZero();
    for (int k = 0; k < nf; ++k)
      row += by_q[Index(free[Index(k)])] * ConstRow(Sensitivity(state, k), parameters);
    if (!moving) return;
    for (int j = 0; j < na; ++j) {
      const ActuatedJoint& joint = problem.joints[Index(j)];
      const Spline::Weights& w = weights[Index(j)];
      const int begin = std::max(0, 3 - w.first);
      const int end = std::min(problem.degree + 1, 3 + joint.free_points() - w.first);
      for (int k = begin; k < end; ++k) {
        out[first_parameter[Index(j)] + w.first - 3 + k] +=
            by_q[Index(joint.dof)] * w.w[0][Index(k)];
      }
    }
  }

  /// z' at time t; leaves torques and their slopes behind.
  void Evaluate(double t, bool moving, const std::vector<double>& z, std::vector<double>& slope) {
    ++statistics.evaluations;
    SetPaths(t, moving);
    for (int i = 0; i < nf; ++i) {
      q[Index(free[Index(i)])] = z[Index(i)];
      qd[Index(free[Index(i)])] = z[Index(nf + i)];
    }
    for (int j = 0; j < na; ++j) qdd[Index(problem.joints[Index(j)].dof)] = path_qdd[Index(j)];
    std::fill(tau.begin(), tau.end(), 0.0);
    dynamics.SetState({q.data(), Index(n)}, {qd.data(), Index(n)});
    contact.Apply(dynamics);
    dynamics.Solve({qdd.data(), Index(n)}, {tau.data(), Index(n)});
    contact.Differentiate(dynamics);
    dynamics.Differentiate(derivatives);

    Row running(Sensitivity(slope, 2 * nf), parameters);
    running.setZero();
    double effort = 0;
    for (int j = 0; j < na; ++j) {
      const int dof = problem.joints[Index(j)].dof;
      double* const own = torque_slope.data() + Index(j * parameters);
      Differentiate(dof, moving, z, own);
      const double torque = tau[Index(dof)];
      effort += torque * torque;
      running += 2 * problem.effort_weight * torque * ConstRow(own, parameters);
    }
    slope[Index(2 * nf)] = problem.effort_weight * effort;
    for (int i = 0; i < nf; ++i) {
      slope[Index(i)] = z[Index(nf + i)];
      slope[Index(nf + i)] = qdd[Index(free[Index(i)])];
      std::copy_n(Sensitivity(z, nf + i), parameters, Sensitivity(slope, i));
      Differentiate(free[Index(i)], moving, z, Sensitivity(slope, nf + i));
    }
  }

  /// After the first stage of a step: what is looked at where steps start.
  void Observe(bool moving, RolloutResult& result) {
    for (int j = 0; j < na; ++j) {
      const double torque = tau[Index(problem.joints[Index(j)].dof)];
      double& peak = result.peak_torque_nm[Index(j)];
      peak = std::max(peak, std::abs(torque));
      const double limit = problem.joints[Index(j)].limits.torque_max_nm;
      if (!std::isfinite(limit)) continue;
      smooth[Index(j)].Add(torque, limit, problem.solver.sharpness,
                           torque_slope.data() + Index(j * parameters));
    }
    for (const ActiveContact<Plane>& active : contact.active()) {
      result.any_contact = true;
      result.peak_penetration_m = std::max(result.peak_penetration_m, active.depth_m);
      const double usable = (1 - problem.solver.core_margin) * problem.contact.d_on_m;
      if (problem.solver.sharpness * (active.depth_m / usable - 1) < kNegligibleExponent) continue;
      std::array<double, HybridDynamics<Plane>::kMaxDofs> by_q{};
      contact.AddDepthSlopes(dynamics, active, 1, by_q);
      DifferentiatePosition(by_q, moving, depth_slope.data());
      smooth.back().Add(active.depth_m, usable, problem.solver.sharpness, depth_slope.data());
    }
  }

  /// y + h sum_k w_k slopes_k over the first `count` stages.
  void Combine(double h, const std::array<double, kMaxStages>& w, int count,
               std::vector<double>& out) const {
    const auto size = static_cast<Eigen::Index>(state.size());
    Row sum(out.data(), size);
    sum = ConstRow(state.data(), size);
    for (int k = 0; k < count; ++k) {
      if (w[Index(k)] != 0) sum += (h * w[Index(k)]) * ConstRow(slopes[Index(k)].data(), size);
    }
  }

  /// Stages after the first, then `next`.
  void TakeStep(double t, double h, double t_end, bool moving) {
    for (int s = 1; s < tableau.stages; ++s) {
      Combine(h, tableau.a[Index(s)], s, stage_state);
      const double c = tableau.c[Index(s)];
      Evaluate(c == 1 ? t_end : t + c * h, moving, stage_state, slopes[Index(s)]);
    }
    Combine(h, tableau.b, tableau.stages, next);
  }

  /// Largest estimated error of the step just taken, in tolerances.
  [[nodiscard]] double StepError(double h) const {
    double worst = 0;
    for (std::size_t i = 0; i < state.size(); ++i) {
      double error = 0;
      for (int s = 0; s < tableau.stages; ++s)
        error += tableau.error[Index(s)] * slopes[Index(s)][i];
      const double size = 1 + std::max(std::abs(state[i]), std::abs(next[i]));
      const double scaled = std::abs(h * error) / (settings.tolerance * size);
      // std::max would pass over one that is not a number.
      worst = std::isfinite(scaled) ? std::max(worst, scaled) : 1e10;
    }
    return worst;
  }

  [[nodiscard]] bool Plausible() const {
    return std::all_of(state.begin(), state.begin() + (rows - 1),
                       [](double value) { return std::abs(value) < kImplausible; });
  }

  /// One phase, in which the paths are smooth: the motion, or the joints held after it. False when
  /// the state left every plausible range.
  bool Integrate(double begin, double duration, bool moving, RolloutResult& result) {
    if (duration <= 0) return true;
    return settings.scheme == ForwardSettings::Scheme::kFixed
               ? IntegrateFixed(begin, duration, moving, result)
               : IntegrateAdaptively(begin, duration, moving, result);
  }

  bool IntegrateFixed(double begin, double duration, bool moving, RolloutResult& result) {
    const int steps =
        std::max(moving ? 1 : 0, static_cast<int>(std::ceil(duration / settings.step_s - 1e-9)));
    const double h = duration / steps;
    for (int step = 0; step < steps; ++step) {
      const double t = begin + step * h;
      Evaluate(t, moving, state, slopes[0]);
      Observe(moving, result);
      TakeStep(t, h, begin + (step + 1) * h, moving);
      state.swap(next);
      ++statistics.steps;
      if (!Plausible()) return false;
    }
    return true;
  }

  bool IntegrateAdaptively(double begin, double duration, bool moving, RolloutResult& result) {
    const double finish = begin + duration;
    double t = begin;
    double h = std::min(settings.step_s, duration);
    Evaluate(t, moving, state, slopes[0]);
    while (t < finish) {
      Observe(moving, result);
      for (;;) {
        // A last step that leaves a crumb would be followed by one of rounding's length.
        const bool last = t + 1.001 * h >= finish;
        if (last) h = finish - t;
        const double t_end = last ? finish : t + h;
        TakeStep(t, h, t_end, moving);
        const double error = StepError(h);
        const double factor = std::clamp(0.9 * std::pow(error, -1 / tableau.order), 0.2, 5.0);
        const bool shortest = h <= settings.shortest_step_s;
        if (error <= 1 || shortest) {
          if (error > 1) ++statistics.forced;
          t = t_end;
          h = std::clamp(factor * h, settings.shortest_step_s, settings.step_s);
          break;
        }
        ++statistics.rejected;
        h = std::max(factor * h, settings.shortest_step_s);
      }
      state.swap(next);
      slopes[0].swap(slopes[Index(tableau.stages - 1)]);
      ++statistics.steps;
      if (!Plausible()) return false;
    }
    return true;
  }

  void AddTerminal(TerminalTerm::When when, RolloutResult& result) {
    for (const TerminalTerm& term : problem.terminal) {
      if (term.when != when) continue;
      int row = static_cast<int>(std::find(free.begin(), free.end(), term.dof) - free.begin());
      if (term.of_velocity) row += nf;
      const double off = state[Index(row)] - term.target;
      result.target_error_rad =
          std::max(result.target_error_rad, term.TargetError(state[Index(row)]));
      result.cost += term.weight * (term.power == 2 ? off * off : off);
      const double slope = term.weight * (term.power == 2 ? 2 * off : 1);
      Row(outputs.data(), parameters) += slope * ConstRow(Sensitivity(state, row), parameters);
    }
  }

  RolloutResult Run(std::span<const double> x) {
    std::fill(outputs.begin(), outputs.end(), 0.0);
    statistics = {};
    RolloutResult result;
    result.peak_torque_nm.assign(Index(na), 0);
    result.torque_excess.assign(Index(na), -1);
    const auto fail = [&] {
      std::fill(outputs.begin(), outputs.end(), 0.0);
      result.finite = false;
      result.cost = std::numeric_limits<double>::infinity();
      return result;
    };
    if (!std::all_of(x.begin(), x.end(), [](double value) { return std::isfinite(value); }))
      return fail();
    for (int j = 0; j < na; ++j) splines[Index(j)] = PositionSpline(problem, x, Index(j));
    for (SmoothMaximum& maximum : smooth) maximum.Reset();
    paths_time = std::numeric_limits<double>::quiet_NaN();
    std::fill(state.begin(), state.end(), 0.0);
    for (int i = 0; i < nf; ++i) state[Index(i)] = problem.start_q[Index(free[Index(i)])];

    if (!Integrate(0, problem.duration_s, true, result)) return fail();
    AddTerminal(TerminalTerm::When::kEnd, result);
    if (!Integrate(problem.duration_s, problem.settle_s, false, result)) return fail();
    AddTerminal(TerminalTerm::When::kSettled, result);
    result.cost += state[Index(2 * nf)];
    Row(outputs.data(), parameters) += ConstRow(Sensitivity(state, 2 * nf), parameters);
    for (int j = 0; j <= na; ++j) {
      const SmoothMaximum& maximum = smooth[Index(j)];
      if (maximum.sum == 0) continue;
      const double excess = maximum.largest - 1 + std::log(maximum.sum) / problem.solver.sharpness;
      if (j == na && excess < -1) continue;  // Far from the core; as in Rollout.
      (j < na ? result.torque_excess[Index(j)] : result.core_excess) = excess;
      Row(outputs.data() + Index((1 + j) * parameters), parameters) =
          ConstRow(maximum.slope.data(), parameters) / maximum.sum;
    }
    return result;
  }

  Problem problem;
  ForwardSettings settings;
  const Tableau& tableau;
  HybridDynamics<Plane> dynamics;
  ContactModel<Plane> contact;
  int n, na, nf = 0;
  int parameters;
  int rows = 0;           // of y and S
  std::vector<int> free;  // degrees of freedom of y's positions
  std::vector<int> first_parameter;
  std::vector<Spline> splines;
  std::array<Spline::Weights, kMaxJoints> weights;  // at paths_time
  double paths_time = 0;                            // -1 after the motion
  std::array<double, kMaxJoints> path_qdd{};
  std::vector<double> state, stage_state, next;
  std::array<std::vector<double>, kMaxStages> slopes;
  std::vector<double> torque_slope;  // by joint, then parameter
  std::vector<double> depth_slope;   // by parameter
  std::vector<SmoothMaximum> smooth;
  std::vector<double> outputs;  // gradient of each output, by rows
  HybridDynamics<Plane>::Derivatives derivatives;
  IntegrationStatistics statistics;
  std::array<double, HybridDynamics<Plane>::kMaxDofs> q{}, qd{}, qdd{}, tau{};
};

ForwardSensitivity::ForwardSensitivity(const Problem& problem, const ForwardSettings& settings)
    : implementation_(std::make_unique<Implementation>(problem, settings)) {}
ForwardSensitivity::~ForwardSensitivity() = default;
ForwardSensitivity::ForwardSensitivity(ForwardSensitivity&&) noexcept = default;

int ForwardSensitivity::parameter_count() const { return implementation_->parameters; }
int ForwardSensitivity::output_count() const { return 2 + implementation_->na; }
int ForwardSensitivity::state_equations() const { return implementation_->rows; }
int ForwardSensitivity::gradient_equations() const {
  return static_cast<int>(implementation_->state.size()) - implementation_->rows;
}
const IntegrationStatistics& ForwardSensitivity::statistics() const {
  return implementation_->statistics;
}

RolloutResult ForwardSensitivity::Run(
    std::span<const double> x,
    Eigen::Ref<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> gradient) {
  RolloutResult result = implementation_->Run(x);
  gradient =
      Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
          implementation_->outputs.data(), output_count(), parameter_count());
  return result;
}

}  // namespace tumbler
