#include "offline/solve/forward_sensitivity.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/solve/forward_maxima.h"
#include "offline/solve/free_duration.h"
#include "offline/solve/motion_outputs.h"
#include "offline/solve/parametric_motion.h"
#include "offline/solve/paths_with_slopes.h"
#include "offline/solve/start_state.h"

namespace tumbler {
namespace {

using Row = Eigen::Map<Eigen::ArrayXd>;
using ConstRow = Eigen::Map<const Eigen::ArrayXd>;

}  // namespace

struct ForwardSensitivity::Implementation {
  Implementation(const Problem& problem, const StepSettings& settings,
                 std::unique_ptr<ContactForces<Plane>> contact)
      : motion(problem),
        robot(problem.scene, std::move(contact)),
        nf(static_cast<int>(robot.free.size())),
        na(motion.joints()),
        parameters(motion.parameters()),
        rows(2 * nf + 1),
        paths(motion),
        outputs(motion, settings.scheme == StepSettings::Scheme::kAdaptive ? problem.solver.step_s
                                                                           : settings.step_s),
        integrator(settings, Index(rows) * Index(1 + parameters), Index(2 * nf)),
        maxima(motion, outputs, integrator.tableau(), settings.step_s),
        gauss_newton(problem),
        residual_slope(Index(parameters)),
        gradient(Index(outputs.rows().count() * parameters)) {
    steps.adaptive = settings.scheme == StepSettings::Scheme::kAdaptive;
    steps.until.resize(motion.instants().size());
    // Their number does not depend on the duration.
    if (motion.duration().is_free() && !steps.adaptive) {
      steps.grid = EvenGrid(problem, settings.step_s);
      steps.until = StepsUntil(steps.grid, motion.instants());
    }
    // So many steps need no heap.
    constexpr std::size_t kUsualSteps = 1U << 15U;
    if (steps.adaptive)
      steps.grid.motion.reserve(kUsualSteps), steps.grid.settling.reserve(kUsualSteps);
  }

  /// A row of S in a state z. The state holds y, then the rows of S, one after the other.
  double* Sensitivity(std::vector<double>& z, int row) const {
    return z.data() + Index(rows + row * parameters);
  }
  const double* Sensitivity(const std::vector<double>& z, int row) const {
    return z.data() + Index(rows + row * parameters);
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
      const std::size_t dof = Index(motion.joint(j).dof);
      paths.AddSlopes(j, {derivatives.q[i][dof], derivatives.qd[i][dof], derivatives.input[i][dof]},
                      out);
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
    for (int j = 0; j < na; ++j)
      paths.AddSlopes(j, Index(order), by[Index(motion.joint(j).dof)], out);
  }

  /// Writes z' at time t to `slope`. Torques, penetration and their derivatives stay in the record
  /// of the stage.
  void Evaluate(double t, bool moving, const std::vector<double>& z, std::vector<double>& slope) {
    paths.PlaceJoints(t, moving, robot);
    robot.SetFree(z.data());
    robot.TouchAndSolve();
    robot.Differentiate(derivatives);

    StageSensitivities& stage = maxima.stage(integrator.stage());
    for (int j = 0; j < na; ++j) {
      const std::size_t dof = Index(motion.joint(j).dof);
      stage.torque[Index(j)] = robot.tau[dof];
      Differentiate(dof, moving, z, stage.torque_slope.data() + Index(j * parameters));
      if (LimitsTorqueBySpeed(motion.joint(j))) RecordCurve(j, moving, z, stage);
    }
    RecordPenetration(moving, z, stage);
    EvaluateCost({robot.q, robot.qd, stage.torque}, moving, z, stage.torque_slope, slope);
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
    for (const CostTerm& term : motion.problem().cost) {
      if (term.when != CostTerm::When::kThroughout) continue;
      cost += term.weight * term.Accumulate(0, 1, here);
      if (!term.of_state()) {
        term.AddSlopes(term.weight, here, {{}, {}, by_torque});
        continue;
      }
      SceneDynamics::Numbers by_q{}, by_qd{};
      term.AddSlopes(term.weight, here, {by_q, by_qd, by_torque});
      if (const double slip_weight = CostTerm::SlipWeight({&term, 1}); slip_weight != 0) {
        cost += slip_weight * robot.contact->LoadedSlip();
        robot.contact->AddLoadedSlipSlopes(robot.dynamics, slip_weight, {by_q.data(), robot.n},
                                           {by_qd.data(), robot.n});
      }
      AddByState(by_q, 0, moving, z, out);
      AddByState(by_qd, 1, moving, z, out);
    }
    for (int j = 0; j < na; ++j) {
      const double* const own = torque_slope.data() + Index(j * parameters);
      running += by_torque[Index(j)] * ConstRow(own, parameters);
    }
  }

  /// Records where a joint's motor is on its torque-speed curve, from its torque.
  void RecordCurve(int j, bool moving, const std::vector<double>& z,
                   StageSensitivities& stage) const {
    const ActuatedJoint& joint = motion.joint(j);
    stage.curve[Index(j)] = OnCurve(joint, stage.torque[Index(j)], robot.qd[Index(joint.dof)]);
    const std::size_t first = Index(j * parameters);
    Row slope(stage.curve_slope.data() + first, parameters);
    slope = joint.motor.curve_by_torque() / joint.limits.torque_max_nm *
            ConstRow(stage.torque_slope.data() + first, parameters);
    SceneDynamics::Numbers by_qd{};
    by_qd[Index(joint.dof)] = joint.motor.curve_by_velocity();
    AddByState(by_qd, 1, moving, z, slope.data());
  }

  /// Records the penetration of the stage that was just evaluated.
  void RecordPenetration(bool moving, const std::vector<double>& z, StageSensitivities& stage) {
    stage.penetration = outputs.Penetration(robot);
    std::fill(stage.penetration_slope.begin(), stage.penetration_slope.end(), 0.0);
    SceneDynamics::Numbers by_q{};
    if (outputs.AddPenetrationSlopes(robot, by_q))
      AddByState(by_q, 0, moving, z, stage.penetration_slope.data());
  }

  /// Takes the step that was just accepted into the sums over the motion.
  void AddStep() {
    const double h = integrator.last_step_s();
    for (int j = 0; gauss_newton.wanted() && j < na; ++j) {
      for (const std::size_t s : {std::size_t{0}, maxima.last_stage()}) {
        const StageSensitivities& stage = maxima.stage(s);
        gauss_newton.AddEffort(h, growth, stage.torque[Index(j)],
                               stage.torque_slope.data() + Index(j * parameters));
      }
    }
    maxima.AddStep(h, growth);
  }

  [[nodiscard]] bool IsPlausible(const std::vector<double>& z) const {
    return std::all_of(z.begin(), z.begin() + 2L * nf,
                       [](double value) { return std::abs(value) < kImplausibleState; });
  }

  /// Whether this run takes the steps of `grid`: those of a free duration are stretched with it.
  [[nodiscard]] bool takes_grid() const {
    return steps.repeats || (motion.duration().is_free() && !steps.adaptive);
  }

  /// Integrates up to an instant from the one before it. Between them the paths are smooth: the
  /// motion, or the joints held after it.
  /// @returns false when the state left every plausible range.
  bool IntegrateTo(std::size_t instant, RolloutResult& result) {
    const std::span<const CostInstant> instants = motion.instants();
    const FreeDuration& duration = motion.duration();
    const double begin = instant == 0 ? 0 : instants[instant - 1].time_s;
    const double span_s = instants[instant].since_s;
    const bool moving = instant == 0 || !instants[instant - 1].held;
    std::vector<double>& chosen = moving ? steps.grid.motion : steps.grid.settling;
    growth = moving && duration.is_free() ? duration.GrowthOfStepAt(begin) : 0;
    const bool begins_phase = instant == 0 || instants[instant - 1].when == CostTerm::When::kEnd;
    const std::size_t first = begins_phase ? 0 : steps.until[instant - 1];
    const auto slope_at = [&](double t, const std::vector<double>& z, std::vector<double>& slope) {
      Evaluate(t, moving, z, slope);
    };
    const auto look = [&] { outputs.RecordPeaks(robot, result); };
    const auto goes_on = [&](const auto& z) {
      AddStep();
      if (steps.adaptive && !steps.repeats) chosen.push_back(integrator.last_step_s());
      return IsPlausible(z);
    };
    if (takes_grid()) {
      const std::vector<double>& taken =
          moving && duration.is_free() ? steps.stretched.motion : chosen;
      const std::span<const double> again(taken.data() + first, steps.until[instant] - first);
      return integrator.IntegrateThrough(begin, span_s, again, slope_at, look, goes_on);
    }
    const auto pieces_at = [&](double t, const std::vector<double>& z) {
      paths.PlaceJoints(t, moving, robot);
      robot.SetFree(z.data());
      robot.Touch();
      return robot.contact->Pieces();
    };
    const bool plausible = integrator.Integrate(begin, span_s, slope_at, look, goes_on, pieces_at);
    steps.until[instant] = chosen.size();
    return plausible;
  }

  void AddInstant(const CostInstant& instant, RolloutResult& result) {
    const std::vector<double>& z = integrator.state();
    const bool moving = !instant.held;
    robot.SetFree(z.data());
    paths.PlaceJoints(instant.time_s, moving, robot);
    const CostPoint here{robot.q, robot.qd, {}};
    /// Adds the derivatives of a number in the parameters to `out`.
    const auto add = [&](const SceneDynamics::Numbers& by_q, const SceneDynamics::Numbers& by_qd,
                         double* out) {
      AddByState(by_q, 0, moving, z, out);
      AddByState(by_qd, 1, moving, z, out);
    };
    outputs.ForEachTermAt(instant, [&](std::size_t i, const CostTerm& term) {
      result.cost += term.weight * term.Accumulate(0, 1, here);
      MotionOutputs::RecordTarget(term, here, result);
      const MotionOutputs::TermSlopes slopes = MotionOutputs::SlopesOf(term, here);
      add(slopes.by_q, slopes.by_qd, gradient.data());
      if (term.draws()) AddTarget(i, slopes.by_target, gradient.data());
      if (!gauss_newton.wanted()) return;
      if (!term.draws()) {
        add(slopes.by_q, slopes.by_qd, gauss_newton.linear());
        return;
      }
      SceneDynamics::Numbers of_term{}, of_rate{};
      term.AddValueSlopes(std::sqrt(term.weight), here, {of_term, of_rate, {}});
      std::fill(residual_slope.begin(), residual_slope.end(), 0.0);
      add(of_term, of_rate, residual_slope.data());
      AddTarget(i, -std::sqrt(term.weight), residual_slope.data());
      gauss_newton.AddResidual(result.residuals.back(), residual_slope);
    });
  }

  /// Adds the derivatives in the parameters by a term's target, where that is given from a start
  /// that is free.
  void AddTarget(std::size_t term, double by_target, double* out) const {
    const FreeStart& start = motion.start();
    for (std::size_t r = 0; r < start.rates().size(); ++r)
      out[start.rates()[r].parameter] += by_target * start.TargetSlope(term, r);
  }

  RolloutResult Run(std::span<const double> x) {
    std::fill(gradient.begin(), gradient.end(), 0.0);
    integrator.ResetStatistics();
    const auto forget_steps = [&] {
      steps.grid.motion.clear();
      steps.grid.settling.clear();
    };
    if (!takes_grid()) forget_steps();
    RolloutResult result = outputs.Begin();
    const auto fail = [&] {
      std::fill(gradient.begin(), gradient.end(), 0.0);
      if (!takes_grid()) forget_steps();
      return MotionOutputs::Failed(std::move(result));
    };
    if (!std::all_of(x.begin(), x.end(), [](double value) { return std::isfinite(value); }))
      return fail();
    if (!motion.Set(x)) return fail();
    if (motion.duration().is_free() && takes_grid())
      steps.stretched = motion.duration().Stretched(steps.grid);
    result.clearance_excess =
        outputs.ClearanceExcess(x, std::span<double>(gradient).last(Index(parameters)));
    paths.Begin(x);
    maxima.Begin();
    SetStart();
    for (std::size_t i = 0; i < motion.instants().size(); ++i) {
      if (!IntegrateTo(i, result)) return fail();
      AddInstant(motion.instants()[i], result);
    }
    result.cost += integrator.state()[Index(2 * nf)];
    if (gauss_newton.wanted()) gauss_newton.AddSquares(integrator.state()[Index(2 * nf)]);
    Row(gradient.data(), parameters) +=
        ConstRow(Sensitivity(integrator.state(), 2 * nf), parameters);
    maxima.Finish(result, gradient);
    return result;
  }

  /// Writes y and S at the start of the motion.
  void SetStart() {
    std::vector<double>& state = integrator.state();
    std::fill(state.begin(), state.end(), 0.0);
    const SceneDynamics::State first = StartState(robot, motion.problem());
    std::copy_n(first.begin(), 2 * nf, state.begin());
    for (const FreeStart::Rate& rate : motion.start().rates())
      Sensitivity(state, nf + robot.FreeIndexOf(rate.dof))[rate.parameter] = 1;
  }

  RolloutResult RunInto(std::span<const double> x, std::span<double> out, GaussNewton* wanted) {
    gauss_newton.Begin(wanted);
    RolloutResult result = Run(x);
    gauss_newton.End();
    std::ranges::copy(gradient, out.begin());
    return result;
  }

  /// The steps of a run, chosen by their error or given.
  struct Steps {
    bool adaptive = false;           // whether runs choose them by their error
    bool repeats = false;            // whether this run takes those of `grid` nevertheless
    StepGrid grid;                   // of the last run that chose them
    StepGrid stretched;              // those of this run, if it takes those of `grid`
    std::vector<std::size_t> until;  // for each instant, how many of its phase are before it
  };

  ParametricMotion motion;
  SceneDynamics robot;
  int nf, na;      // numbers of free and of actuated degrees of freedom
  int parameters;  // how many
  int rows;        // those of y, and of S
  PathsWithSlopes paths;
  MotionOutputs outputs;
  Integrator integrator;
  ForwardMaxima maxima;
  GaussNewtonSum gauss_newton;
  Steps steps;
  double growth = 0;                   // of the present steps with the duration (FreeDuration)
  std::vector<double> residual_slope;  // by parameter
  std::vector<double> gradient;        // of each output, by rows
  HybridDynamics<Plane>::Derivatives derivatives;
};

ForwardSensitivity::ForwardSensitivity(const Problem& problem, const StepSettings& settings,
                                       std::unique_ptr<ContactForces<Plane>> contact)
    : implementation_(std::make_unique<Implementation>(problem, settings, std::move(contact))) {}
ForwardSensitivity::~ForwardSensitivity() = default;
ForwardSensitivity::ForwardSensitivity(ForwardSensitivity&&) noexcept = default;

int ForwardSensitivity::parameter_count() const { return implementation_->parameters; }
int ForwardSensitivity::output_count() const { return implementation_->outputs.rows().count(); }
int ForwardSensitivity::state_equations() const { return implementation_->rows; }
int ForwardSensitivity::gradient_equations() const {
  return static_cast<int>(implementation_->integrator.state().size()) - implementation_->rows;
}
const StepGrid& ForwardSensitivity::grid() const { return implementation_->steps.grid; }
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
  implementation_->steps.repeats = false;
  return implementation_->RunInto(x, gradient, gauss_newton);
}

RolloutResult ForwardSensitivity::RunAgain(std::span<const double> x, std::span<double> gradient,
                                           GaussNewton* gauss_newton) {
  if (implementation_->steps.grid.motion.empty())
    throw std::logic_error("there are no steps to repeat");
  implementation_->steps.repeats = true;
  return implementation_->RunInto(x, gradient, gauss_newton);
}

}  // namespace tumbler
