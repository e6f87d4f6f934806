#include "offline/solve/forward_sensitivity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "offline/problem/free_start.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/solve/clearance_constraint.h"
#include "offline/solve/free_duration.h"
#include "offline/solve/smooth_maximum.h"
#include "offline/solve/start_state.h"
#include "offline/solve/torque_limit.h"

namespace tumbler {
namespace {

using Spline = JointMotion<double>::Spline;
using Row = Eigen::Map<Eigen::ArrayXd>;
using ConstRow = Eigen::Map<const Eigen::ArrayXd>;

/// A smooth maximum, and its derivative in the parameters.
struct MaximumWithSlope {
  MaximumWithSlope(double sharpness, SmoothMaximum::Of of, std::size_t parameters)
      : rho(sharpness), maximum(sharpness, of), slope(parameters) {}

  void Reset() {
    maximum.Reset();
    std::fill(slope.begin(), slope.end(), 0.0);
  }
  /// Adds a step.
  /// @param values   the quantity at its stages.
  /// @param slopes   gives its derivative in the parameters at a stage.
  /// @param unit     what `slopes` are divided by.
  /// @param growth   derivative of the step by the last parameter, divided by the step; 0 where
  ///                 that is not the duration.
  template <class Slopes>
  void Add(const StepPoints& points, double step_s, std::span<const double> values, Slopes&& slopes,
           double unit, double growth) {
    double highest = 0;
    for (const double value : values) highest = std::max(highest, std::abs(value));
    if (!maximum.Counts(points, highest)) return;  // Most steps are far from the largest.
    std::array<double, Tableau::kMaxStages> by_value{};
    const double before = maximum.sum();
    const double shrink = maximum.Add(points, step_s, values, {by_value.data(), values.size()});
    Row total(slope.data(), static_cast<Eigen::Index>(slope.size()));
    if (shrink != 1) total *= shrink;
    for (std::size_t s = 0; s < values.size(); ++s) {
      if (by_value[s] != 0) total += (by_value[s] / unit) * ConstRow(slopes(s), total.size());
    }
    if (growth != 0) slope.back() += growth * (maximum.sum() - shrink * before) / rho;
  }

  double rho;
  SmoothMaximum maximum;
  std::vector<double> slope;  // of the integral, divided as it is
};

/// What a stage leaves behind for the smooth maxima.
struct StageRecord {
  std::vector<double> torque;        // by joint
  std::vector<double> torque_slope;  // by joint, then parameter
  std::vector<double> curve;         // OnCurve, by joint; of those that have a curve
  std::vector<double> curve_slope;   // by joint, then parameter
  double depth = 0;
  std::vector<double> depth_slope;  // by parameter
};

}  // namespace

struct ForwardSensitivity::Implementation {
  Implementation(const Problem& p, const StepSettings& settings,
                 std::unique_ptr<ContactForces<Plane>> contact)
      : problem(p),
        robot(p.scene, std::move(contact)),
        nf(static_cast<int>(robot.free.size())),
        na(static_cast<int>(p.joints.size())),
        parameters(p.parameter_count()),
        rows(2 * nf + 1),
        splines(Index(na)),
        clearance(p, settings.scheme == StepSettings::Scheme::kAdaptive ? p.solver.step_s
                                                                        : settings.step_s),
        adaptive(settings.scheme == StepSettings::Scheme::kAdaptive),
        integrator(settings, Index(rows) * Index(1 + parameters), Index(2 * nf)),
        instants(p.instants()),
        start(p),
        duration(p),
        steps_until(instants.size()),
        look_points(integrator.tableau(), settings.step_s),
        depth(p.solver.sharpness, (1 - p.solver.core_margin) * p.scene.contact.d_on_m) {
    for (int j = 0; j < na; ++j) first_parameter.push_back(p.first_parameter(Index(j)));
    for (StageRecord& record : records) {
      record.torque.resize(Index(na));
      record.torque_slope.resize(Index(na * parameters));
      record.curve.resize(Index(na));
      record.curve_slope.resize(Index(na * parameters));
      record.depth_slope.resize(Index(parameters));
    }
    residual_slope.resize(Index(parameters));
    outputs.resize(Index((3 + na) * parameters));
    for (int j = 0; j <= na; ++j) {
      smooth.emplace_back(p.solver.sharpness,
                          j < na ? SmoothMaximum::Of::kSize : SmoothMaximum::Of::kAboveZero,
                          Index(parameters));
    }
    for (const CostTerm& term : p.cost) {
      if (term.kind == CostTerm::Kind::kEffort) effort_weight += term.weight;
    }
    path_slopes.resize(Index(na));
    // Their number does not depend on the duration.
    if (duration.is_free() && !adaptive) {
      grid = EvenGrid(p, settings.step_s);
      steps_until = StepsUntil(grid, instants);
    }
    // So many steps need no heap.
    constexpr std::size_t kUsualSteps = 1U << 15U;
    if (adaptive) grid.motion.reserve(kUsualSteps), grid.settling.reserve(kUsualSteps);
  }

  /// A row of S in a state z. The state holds y, then the rows of S, one after the other.
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
        robot.q[dof] = joint.end_rad;
        robot.qd[dof] = joint.end_rad_s;
        robot.qdd[dof] = 0;
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
      robot.q[dof] = path[0];
      robot.qd[dof] = path[1];
      robot.qdd[dof] = path[2];
      if (duration.is_free()) path_slopes[Index(j)] = duration.PathSlope(Index(j), t);
    }
  }

  /// Writes A S + B for g's output i: a row of S', or of dtau/dp.
  void Differentiate(std::size_t i, bool moving, const std::vector<double>& z, double* out) {
    Row row(out, parameters);
    row.setZero();
    for (int k = 0; k < nf; ++k) {
      const std::size_t dof = Index(robot.free[Index(k)]);
      row += derivatives.q[i][dof] * ConstRow(Sensitivity(z, k), parameters);
      row += derivatives.qd[i][dof] * ConstRow(Sensitivity(z, nf + k), parameters);
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
        out[shift + k] += derivatives.q[i][dof] * w.w[0][Index(k)] +
                          derivatives.qd[i][dof] * w.w[1][Index(k)] +
                          derivatives.input[i][dof] * w.w[2][Index(k)];
      }
      if (!duration.is_free()) continue;
      const PathPoint& slope = path_slopes[Index(j)];
      out[parameters - 1] += derivatives.q[i][dof] * slope.q + derivatives.qd[i][dof] * slope.qd +
                             derivatives.input[i][dof] * slope.qdd;
    }
  }

  /// Adds the derivatives of a quantity in the parameters to `out`.
  /// @param by     its derivatives in the positions (order 0) or the velocities (order 1).
  void AddByState(const SceneDynamics::Numbers& by, int order, bool moving,
                  const std::vector<double>& z, double* out) const {
    Row row(out, parameters);
    for (int k = 0; k < nf; ++k) {
      const double slope = by[Index(robot.free[Index(k)])];
      if (slope != 0) row += slope * ConstRow(Sensitivity(z, order * nf + k), parameters);
    }
    if (!moving) return;
    for (int j = 0; j < na; ++j) {
      const ActuatedJoint& joint = problem.joints[Index(j)];
      const std::size_t dof = Index(joint.dof);
      const Spline::Weights& w = weights[Index(j)];
      const int begin = std::max(0, 3 - w.first);
      const int end = std::min(problem.degree + 1, 3 + joint.free_points() - w.first);
      for (int k = begin; k < end; ++k) {
        out[first_parameter[Index(j)] + w.first - 3 + k] += by[dof] * w.w[Index(order)][Index(k)];
      }
      if (!duration.is_free()) continue;
      const PathPoint& slope = path_slopes[Index(j)];
      out[parameters - 1] += by[dof] * (order == 0 ? slope.q : slope.qd);
    }
  }

  /// Writes z' at time t to `slope`. Torques, depth and their derivatives stay in the record of the
  /// stage.
  void Evaluate(double t, bool moving, const std::vector<double>& z, std::vector<double>& slope) {
    SetPaths(t, moving);
    robot.SetFree(z.data());
    robot.TouchAndSolve();
    robot.Differentiate(derivatives);

    StageRecord& record = records[integrator.stage()];
    for (int j = 0; j < na; ++j) {
      const std::size_t dof = Index(problem.joints[Index(j)].dof);
      record.torque[Index(j)] = robot.tau[dof];
      Differentiate(dof, moving, z, record.torque_slope.data() + Index(j * parameters));
      if (LimitsTorqueBySpeed(problem.joints[Index(j)])) TakeCurve(Index(j), moving, z, record);
    }
    TakeDepth(moving, z, record);
    EvaluateCost({robot.q, robot.qd, record.torque}, moving, z, record.torque_slope, slope);
    for (int i = 0; i < nf; ++i) {
      slope[Index(i)] = z[Index(nf + i)];
      slope[Index(nf + i)] = robot.qdd[Index(robot.free[Index(i)])];
      std::copy_n(Sensitivity(z, nf + i), parameters, Sensitivity(slope, i));
      Differentiate(Index(robot.free[Index(i)]), moving, z, Sensitivity(slope, nf + i));
    }
    // The state also changes by as much more as the step becomes longer.
    if (growth == 0) return;
    for (int i = 0; i < rows; ++i)
      Sensitivity(slope, i)[parameters - 1] += growth * slope[Index(i)];
  }

  /// Writes the rows of y' and S' of the running cost.
  void EvaluateCost(const CostPoint& here, bool moving, const std::vector<double>& z,
                    const std::vector<double>& torque_slope, std::vector<double>& slope) const {
    double* const out = Sensitivity(slope, 2 * nf);
    Row running(out, parameters);
    running.setZero();
    double& cost = slope[Index(2 * nf)];
    cost = 0;
    std::array<double, kMaxJoints> by_torque{};
    for (const CostTerm& term : problem.cost) {
      if (term.when != CostTerm::When::kThroughout) continue;
      cost += term.weight * term.Accumulate(0, 1, here);
      if (!term.of_state()) {
        term.AddSlopes(term.weight, here, {{}, {}, by_torque});
        continue;
      }
      SceneDynamics::Numbers by_q{}, by_qd{};
      term.AddSlopes(term.weight, here, {by_q, by_qd, by_torque});
      AddByState(by_q, 0, moving, z, out);
      AddByState(by_qd, 1, moving, z, out);
    }
    for (int j = 0; j < na; ++j) {
      const double* const own = torque_slope.data() + Index(j * parameters);
      running += by_torque[Index(j)] * ConstRow(own, parameters);
    }
  }

  /// Records where a joint's motor is on its torque-speed curve, from its torque.
  void TakeCurve(std::size_t j, bool moving, const std::vector<double>& z,
                 StageRecord& record) const {
    const ActuatedJoint& joint = problem.joints[j];
    record.curve[j] = OnCurve(joint, record.torque[j], robot.qd[Index(joint.dof)]);
    const std::size_t first = j * Index(parameters);
    Row slope(record.curve_slope.data() + first, parameters);
    slope = joint.motor.curve_by_torque() / joint.limits.torque_max_nm *
            ConstRow(record.torque_slope.data() + first, parameters);
    SceneDynamics::Numbers by_qd{};
    by_qd[Index(joint.dof)] = joint.motor.curve_by_velocity();
    AddByState(by_qd, 1, moving, z, slope.data());
  }

  /// Records the smooth depth of the stage that was just evaluated.
  void TakeDepth(bool moving, const std::vector<double>& z, StageRecord& record) {
    const auto active = robot.contact->active();
    record.depth = depth.Evaluate(active);
    std::fill(record.depth_slope.begin(), record.depth_slope.end(), 0.0);
    if (record.depth == 0) return;
    SceneDynamics::Numbers by_q{};
    for (std::size_t i = 0; i < active.size(); ++i) {
      if (depth.slopes()[i] != 0)
        robot.contact->AddDepthSlopes(robot.dynamics, active[i], depth.slopes()[i], by_q);
    }
    AddByState(by_q, 0, moving, z, record.depth_slope.data());
  }

  /// Takes the start of a step, just evaluated, into the peaks.
  void Inspect(RolloutResult& result) {
    for (int j = 0; j < na; ++j) {
      double& peak = result.peak_torque_nm[Index(j)];
      peak = std::max(peak, std::abs(robot.tau[Index(problem.joints[Index(j)].dof)]));
    }
    for (const ActiveContact<Plane>& active : robot.contact->active()) {
      result.any_contact = true;
      result.peak_penetration_m = std::max(result.peak_penetration_m, active.depth_m);
    }
  }

  /// Takes the step that was just accepted into the smooth maxima.
  void Observe() {
    const Tableau& scheme = integrator.tableau();
    const std::size_t stages = scheme.own_stages();
    const double h = integrator.last_step_s();
    const StepPoints& points = look_points.In(h);
    std::array<double, Tableau::kMaxStages> values{};
    for (int j = 0; j < na; ++j) {
      const auto slope_at = [&](std::size_t s) {
        return records[s].torque_slope.data() + Index(j * parameters);
      };
      for (const std::size_t s : {std::size_t{0}, stages - 1}) {
        if (gauss_newton != nullptr && effort_weight > 0)
          AddEffort(h, records[s].torque[Index(j)], slope_at(s));
      }
      const double limit = problem.joints[Index(j)].limits.torque_max_nm;
      if (!std::isfinite(limit)) continue;
      for (std::size_t s = 0; s < stages; ++s) values[s] = records[s].torque[Index(j)] / limit;
      smooth[Index(j)].Add(points, h, {values.data(), stages}, slope_at, limit, growth);
      if (!LimitsTorqueBySpeed(problem.joints[Index(j)])) continue;
      for (std::size_t s = 0; s < stages; ++s) values[s] = records[s].curve[Index(j)];
      const auto curve_slope_at = [&](std::size_t s) {
        return records[s].curve_slope.data() + Index(j * parameters);
      };
      smooth[Index(j)].Add(points, h, {values.data(), stages}, curve_slope_at, 1, growth);
    }
    bool touched = false;
    for (std::size_t s = 0; s < stages; ++s) {
      values[s] = records[s].depth;
      touched = touched || values[s] != 0;
    }
    const auto slope_at = [&](std::size_t s) { return records[s].depth_slope.data(); };
    if (touched) smooth.back().Add(points, h, {values.data(), stages}, slope_at, 1, growth);
    if (scheme.first_same_as_last) std::swap(records.front(), records[scheme.stages - 1]);
  }

  [[nodiscard]] bool Plausible(const std::vector<double>& z) const {
    return std::all_of(z.begin(), z.begin() + 2L * nf,
                       [](double value) { return std::abs(value) < kImplausibleState; });
  }

  /// Whether this run takes the steps of `grid`: those of a free duration are stretched with it.
  [[nodiscard]] bool takes_grid() const { return repeats || (duration.is_free() && !adaptive); }

  /// Integrates up to an instant from the one before it. Between them the paths are smooth: the
  /// motion, or the joints held after it.
  /// @returns false when the state left every plausible range.
  bool IntegrateTo(std::size_t instant, RolloutResult& result) {
    const double begin = instant == 0 ? 0 : instants[instant - 1].time_s;
    const double span_s = instants[instant].since_s;
    const bool moving = instant == 0 || !instants[instant - 1].held;
    std::vector<double>& steps = moving ? grid.motion : grid.settling;
    growth = moving && duration.is_free() ? duration.GrowthOfStepAt(begin) : 0;
    const bool begins_phase = instant == 0 || instants[instant - 1].when == CostTerm::When::kEnd;
    const std::size_t first = begins_phase ? 0 : steps_until[instant - 1];
    const auto slope_at = [&](double t, const std::vector<double>& z, std::vector<double>& slope) {
      Evaluate(t, moving, z, slope);
    };
    const auto look = [&] { Inspect(result); };
    const auto goes_on = [&](const auto& z) {
      Observe();
      if (adaptive && !repeats) steps.push_back(integrator.last_step_s());
      return Plausible(z);
    };
    if (takes_grid()) {
      const std::vector<double>& taken = moving && duration.is_free() ? stretched.motion : steps;
      const std::span<const double> again(taken.data() + first, steps_until[instant] - first);
      return integrator.IntegrateThrough(begin, span_s, again, slope_at, look, goes_on);
    }
    const auto pieces_at = [&](double t, const std::vector<double>& z) {
      SetPaths(t, moving);
      robot.SetFree(z.data());
      robot.Touch();
      return robot.contact->Pieces();
    };
    const bool plausible = integrator.Integrate(begin, span_s, slope_at, look, goes_on, pieces_at);
    steps_until[instant] = steps.size();
    return plausible;
  }

  void AddInstant(const CostInstant& instant, RolloutResult& result) {
    const std::vector<double>& z = integrator.state();
    const bool moving = !instant.held;
    robot.SetFree(z.data());
    SetPaths(instant.time_s, moving);
    const CostPoint here{robot.q, robot.qd, {}};
    /// Adds the derivatives of a number in the parameters to `out`.
    const auto add = [&](const SceneDynamics::Numbers& by_q, const SceneDynamics::Numbers& by_qd,
                         double* out) {
      AddByState(by_q, 0, moving, z, out);
      AddByState(by_qd, 1, moving, z, out);
    };
    for (std::size_t i = 0; i < problem.cost.size(); ++i) {
      const CostTerm& term = problem.cost[i];
      if (!instant.Has(term)) continue;
      result.cost += term.weight * term.Accumulate(0, 1, here);
      result.target_error_rad = std::max(result.target_error_rad, term.TargetError(here));
      if (term.draws()) result.residuals.push_back(term.Residual(here));
      SceneDynamics::Numbers by_q{}, by_qd{};
      term.AddSlopes(term.weight, here, {by_q, by_qd, {}});
      add(by_q, by_qd, outputs.data());
      if (term.draws())
        AddTarget(i, 2 * std::sqrt(term.weight) * term.Residual(here), outputs.data());
      if (gauss_newton == nullptr) continue;
      if (!term.draws()) {
        add(by_q, by_qd, gauss_newton->linear.data());
        continue;
      }
      gauss_newton->squares += result.residuals.back() * result.residuals.back();
      SceneDynamics::Numbers of_term{}, of_rate{};
      term.AddValueSlopes(std::sqrt(term.weight), here, {of_term, of_rate, {}});
      std::fill(residual_slope.begin(), residual_slope.end(), 0.0);
      add(of_term, of_rate, residual_slope.data());
      AddTarget(i, std::sqrt(term.weight), residual_slope.data());
      AddSquare(2, residual_slope.data());
      Eigen::MatrixXd& slopes = gauss_newton->residual_slopes;
      slopes.conservativeResize(slopes.rows() + 1, parameters);
      slopes.row(slopes.rows() - 1) =
          Eigen::Map<const Eigen::RowVectorXd>(residual_slope.data(), parameters);
    }
  }

  /// Takes what a term's target changes off its derivatives in the parameters, where it is given
  /// from a start that is free.
  void AddTarget(std::size_t term, double scale, double* out) const {
    for (std::size_t r = 0; r < start.rates().size(); ++r)
      out[start.rates()[r].parameter] -= scale * start.TargetSlope(term, r);
  }

  /// Adds weight slope slope^T to the lower triangle of the Gauss-Newton matrix.
  void AddSquare(double weight, const double* slope) const {
    const Eigen::Map<const Eigen::VectorXd> v(slope, parameters);
    for (int k = 0; k < parameters; ++k) {
      gauss_newton->matrix.col(k).tail(parameters - k) += (weight * v[k]) * v.tail(parameters - k);
    }
  }

  /// Adds the squares of a torque at one end of a step, half of their integral.
  void AddEffort(double step_s, double torque, const double* slope) {
    if (growth == 0) return AddSquare(effort_weight * step_s, slope);
    // What is squared is the torque times the root of the step's length.
    residual_slope.assign(slope, slope + parameters);
    residual_slope.back() += 0.5 * growth * torque;
    AddSquare(effort_weight * step_s, residual_slope.data());
  }

  RolloutResult Run(std::span<const double> x) {
    if (gauss_newton != nullptr) {
      gauss_newton->matrix.setZero(parameters, parameters);
      gauss_newton->residual_slopes.resize(0, parameters);
      gauss_newton->squares = 0;
      gauss_newton->linear.setZero(parameters);
    }
    std::fill(outputs.begin(), outputs.end(), 0.0);
    integrator.ResetStatistics();
    const auto forget_steps = [&] {
      grid.motion.clear();
      grid.settling.clear();
    };
    if (!takes_grid()) forget_steps();
    RolloutResult result;
    result.peak_torque_nm.assign(Index(na), 0);
    result.torque_excess.assign(Index(na), -1);
    const auto fail = [&] {
      std::fill(outputs.begin(), outputs.end(), 0.0);
      if (!takes_grid()) forget_steps();
      result.finite = false;
      result.cost = std::numeric_limits<double>::infinity();
      return result;
    };
    if (!std::all_of(x.begin(), x.end(), [](double value) { return std::isfinite(value); }))
      return fail();
    if (duration.is_free()) {
      if (!duration.Set(problem, x)) return fail();
      instants = problem.instants(duration.duration_s());
      if (takes_grid()) stretched = duration.Stretched(grid);
    }
    result.clearance_excess =
        clearance.Evaluate(x, std::span<double>(outputs).last(Index(parameters)));
    for (int j = 0; j < na; ++j) splines[Index(j)] = PositionSpline(problem, x, Index(j));
    for (MaximumWithSlope& maximum : smooth) maximum.Reset();
    paths_time = std::numeric_limits<double>::quiet_NaN();
    start.Set(problem, x);
    std::vector<double>& state = integrator.state();
    std::fill(state.begin(), state.end(), 0.0);
    const SceneDynamics::State first = StartState(robot, problem);
    std::copy_n(first.begin(), 2 * nf, state.begin());
    for (const FreeStart::Rate& rate : start.rates())
      Sensitivity(state, nf + robot.FreeIndexOf(rate.dof))[rate.parameter] = 1;

    for (std::size_t i = 0; i < instants.size(); ++i) {
      if (!IntegrateTo(i, result)) return fail();
      AddInstant(instants[i], result);
    }
    result.cost += integrator.state()[Index(2 * nf)];
    if (gauss_newton != nullptr) gauss_newton->squares += integrator.state()[Index(2 * nf)];
    Row(outputs.data(), parameters) +=
        ConstRow(Sensitivity(integrator.state(), 2 * nf), parameters);
    for (int j = 0; j <= na; ++j) {
      const SmoothMaximum& maximum = smooth[Index(j)].maximum;
      if (maximum.sum() == 0) continue;
      const double excess = maximum.value() + (j == na ? depth.least() : 0) - 1;
      if (j == na && excess < -1) continue;  // It is far from the core. Rollout does the same.
      (j < na ? result.torque_excess[Index(j)] : result.core_excess) = excess;
      Row(outputs.data() + Index((1 + j) * parameters), parameters) =
          ConstRow(smooth[Index(j)].slope.data(), parameters) / maximum.sum();
    }
    return result;
  }

  RolloutResult RunInto(std::span<const double> x, std::span<double> gradient,
                        GaussNewton* wanted) {
    gauss_newton = wanted;
    RolloutResult result = Run(x);
    if (gauss_newton != nullptr) {
      Eigen::MatrixXd& matrix = gauss_newton->matrix;
      for (Eigen::Index k = 1; k < matrix.cols(); ++k)
        matrix.col(k).head(k) = matrix.row(k).head(k).transpose();
    }
    std::ranges::copy(outputs, gradient.begin());
    return result;
  }

  Problem problem;
  SceneDynamics robot;
  int nf, na;
  int parameters;
  int rows;  // those of y, and of S
  std::vector<int> first_parameter;
  std::vector<Spline> splines;
  ClearanceConstraint clearance;
  std::array<Spline::Weights, kMaxJoints> weights;  // at paths_time
  double paths_time = 0;                            // -1: after the motion
  bool adaptive;
  Integrator integrator;
  std::vector<CostInstant> instants;
  FreeStart start;
  FreeDuration duration;
  double growth = 0;                     // of the present steps with the duration (FreeDuration)
  std::vector<PathPoint> path_slopes;    // by joint, of a free duration, at paths_time
  StepGrid stretched;                    // the steps of this run, if it takes those of `grid`
  StepGrid grid;                         // of the last run that chose it, if adaptive
  std::vector<std::size_t> steps_until;  // for each instant, how many of its phase are before it
  bool repeats = false;                  // whether this run takes the steps of `grid`
  LookPoints look_points;
  SmoothDepth depth;
  std::array<StageRecord, Tableau::kMaxStages> records;  // of the present step
  std::vector<double> residual_slope;                    // by parameter
  std::vector<MaximumWithSlope> smooth;  // of the joints' torques, then of the depth
  std::vector<double> outputs;           // gradient of each output, by rows
  double effort_weight = 0;              // of all terms together
  GaussNewton* gauss_newton = nullptr;   // gets that of this run; null: is not asked for
  HybridDynamics<Plane>::Derivatives derivatives;
};

ForwardSensitivity::ForwardSensitivity(const Problem& problem, const StepSettings& settings,
                                       std::unique_ptr<ContactForces<Plane>> contact)
    : implementation_(std::make_unique<Implementation>(problem, settings, std::move(contact))) {}
ForwardSensitivity::~ForwardSensitivity() = default;
ForwardSensitivity::ForwardSensitivity(ForwardSensitivity&&) noexcept = default;

int ForwardSensitivity::parameter_count() const { return implementation_->parameters; }
int ForwardSensitivity::output_count() const { return 3 + implementation_->na; }
int ForwardSensitivity::state_equations() const { return implementation_->rows; }
int ForwardSensitivity::gradient_equations() const {
  return static_cast<int>(implementation_->integrator.state().size()) - implementation_->rows;
}
const StepGrid& ForwardSensitivity::grid() const { return implementation_->grid; }
const IntegrationStatistics& ForwardSensitivity::statistics() const {
  return implementation_->integrator.statistics();
}

StepSettings AdaptiveSteps(const Problem& problem) {
  return {StepSettings::Scheme::kAdaptive, kLongestAdaptiveStep_s, problem.solver.tolerance};
}

StepGrid StepsFor(const Problem& problem, std::span<const double> x) {
  ForwardSensitivity forward(problem, AdaptiveSteps(problem));
  std::vector<double> gradient(Index(forward.output_count() * forward.parameter_count()));
  if (forward.Run(x, gradient).finite) return forward.grid();
  return EvenGrid(problem, problem.solver.step_s);
}

RolloutResult ForwardSensitivity::Run(std::span<const double> x, std::span<double> gradient,
                                      GaussNewton* gauss_newton) {
  implementation_->repeats = false;
  return implementation_->RunInto(x, gradient, gauss_newton);
}

RolloutResult ForwardSensitivity::RunAgain(std::span<const double> x, std::span<double> gradient,
                                           GaussNewton* gauss_newton) {
  if (implementation_->grid.motion.empty()) throw std::logic_error("there are no steps to repeat");
  implementation_->repeats = true;
  return implementation_->RunInto(x, gradient, gauss_newton);
}

}  // namespace tumbler
