#include "offline/rollout/rollout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "offline/contact/contact_model.h"
#include "offline/dynamics/hybrid_dynamics.h"
#include "offline/rollout/forward_sensitivity.h"

namespace tumbler {
namespace {

using Spline = JointMotion<double>::Spline;
using Dynamics = HybridDynamics<Plane>;
using Derivatives = Dynamics::Derivatives;
constexpr int kMaxDofs = Dynamics::kMaxDofs;

/// A state beyond this (m, rad, and their rates) is a failed rollout: no tumbler gets near it.
constexpr double kImplausible = 1e4;

// The classical Runge-Kutta scheme.
constexpr int kStages = 4;
constexpr std::array<double, kStages> kA = {0, 0.5, 0.5, 1};  // y_s = y + h a_s k_{s-1}
constexpr std::array<double, kStages> kB = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
constexpr std::array<int, kStages> kHalfSteps = {0, 1, 1, 2};  // c_s in halves of a step

constexpr std::size_t Index(int i) { return static_cast<std::size_t>(i); }

constexpr std::size_t kStates = std::size_t{2} * kMaxDofs;  // positions and velocities
using State = std::array<double, kStates>;

std::vector<double> Knots(const Problem& problem, int control_points) {
  std::vector<double> knots(Index(control_points + problem.degree + 1));
  if (Spline::ClampedUniformKnots(problem.degree, control_points, problem.duration_s, knots) !=
      Status::kOk) {
    throw std::invalid_argument("spline degree, size and duration do not fit together");
  }
  return knots;
}

/// The three weights rows that all splines of one size share at one time.
struct ControlWeights {
  int first = 0;
  std::array<std::array<double, Spline::kMaxDegree + 1>, 3> w{};
};

/// Path of one actuated joint at one time, or the cotangent of it.
struct Control {
  double q = 0, qd = 0, qdd = 0;
};

}  // namespace

std::vector<double> ControlPoints(const Problem& problem, std::span<const double> x,
                                  std::size_t joint) {
  const ActuatedJoint& actuated = problem.joints[joint];
  const auto free = x.subspan(Index(problem.first_parameter(joint)), Index(actuated.free_points()));
  std::vector<double> points(
      3, actuated.start_rad);  // Rest: three equal points fix q, and qd = qdd = 0.
  points.insert(points.end(), free.begin(), free.end());
  points.insert(points.end(), 3, actuated.end_rad);
  return points;
}

Spline PositionSpline(const Problem& problem, std::span<const double> x, std::size_t joint) {
  Spline spline;
  if (spline.Assign(problem.degree, Knots(problem, problem.joints[joint].control_points),
                    ControlPoints(problem, x, joint)) != Status::kOk) {
    throw std::invalid_argument("control points do not make a spline");
  }
  return spline;
}

struct Rollout::Implementation {
  Implementation(const Problem& p, double step_s, std::unique_ptr<ContactForces<Plane>> own_contact)
      : problem(p),
        dynamics(p.robot.tree),
        contact(std::move(own_contact)),
        n(dynamics.size()),
        na(static_cast<int>(p.joints.size())),
        parameters(p.parameter_count()) {
    const bool general = contact == nullptr;
    if (general)
      contact = std::make_unique<ContactModel<Plane>>(p.contact, p.robot.shapes, p.obstacles);
    if (p.solver.gradient == SolverSettings::Gradient::kForward) {
      if (!general)
        throw std::invalid_argument("the forward gradient has the general contact model only");
      forward = std::make_unique<ForwardSensitivity>(
          p, ForwardSettings{ForwardSettings::Scheme::kFixed, step_s});
    }
    for (int j = 0; j < n; ++j) {
      if (!dynamics.prescribed(j)) free.push_back(j);
    }
    nf = static_cast<int>(free.size());
    for (const ActuatedJoint& joint : p.joints) actuated.push_back(joint.dof);
    nd = nf + na;
    motion_steps = std::max(1, static_cast<int>(std::ceil(p.duration_s / step_s - 1e-9)));
    settle_steps = static_cast<int>(std::ceil(p.settle_s / step_s - 1e-9));
    motion_h = p.duration_s / motion_steps;
    settle_h = settle_steps > 0 ? p.settle_s / settle_steps : step_s;
    half_steps = Index(2 * motion_steps + 1);
    for (int j = 0; j < na; ++j) {
      const int size = p.joints[Index(j)].control_points;
      first_parameter.push_back(p.first_parameter(Index(j)));
      int same = 0;
      while (p.joints[Index(same)].control_points != size) ++same;
      weights_of.push_back(same == j ? weights.size() / half_steps : weights_of[Index(same)]);
      if (same == j) AddWeights(size);
    }
    controls.resize(half_steps * Index(na));
    const std::size_t steps = Index(motion_steps + settle_steps);
    order = free;
    order.insert(order.end(), actuated.begin(), actuated.end());
    stage_size = 3 * nd * nd;
    lane_gradient.resize(Index(parameters));
    stage_torque.resize(steps * kStages * Index(na));
    core_slope.resize(steps * Index(nd));
  }

  /// Appends the weights of splines of one size at all half steps.
  void AddWeights(int control_points) {
    Spline spline;
    if (spline.Assign(problem.degree, Knots(problem, control_points),
                      std::vector<double>(Index(control_points))) != Status::kOk) {
      throw std::invalid_argument("spline degree and size do not fit together");
    }
    for (int k = 0; k <= 2 * motion_steps; ++k) {
      const Spline::Weights w = spline.EvaluateWeights(0.5 * k * motion_h);
      weights.push_back({w.first, w.w});
    }
  }

  [[nodiscard]] const ControlWeights& WeightsOf(int joint, std::size_t half_step) const {
    return weights[weights_of[Index(joint)] * half_steps + half_step];
  }

  void SetControls(std::span<const double> x) {
    for (int j = 0; j < na; ++j) {
      const ActuatedJoint& joint = problem.joints[Index(j)];
      const int free_points = joint.free_points();
      std::array<double, kMaxControlPoints> c{};
      for (int i = 0; i < joint.control_points; ++i) {
        c[Index(i)] = i < 3                 ? joint.start_rad
                      : i < 3 + free_points ? x[Index(first_parameter[Index(j)] + i - 3)]
                                            : joint.end_rad;
      }
      for (std::size_t k = 0; k < half_steps; ++k) {
        const ControlWeights& w = WeightsOf(j, k);
        Control sum;
        for (int i = 0; i <= problem.degree; ++i) {
          const double point = c[Index(w.first + i)];
          sum.q += w.w[0][Index(i)] * point;
          sum.qd += w.w[1][Index(i)] * point;
          sum.qdd += w.w[2][Index(i)] * point;
        }
        controls[k * Index(na) + Index(j)] = sum;
      }
    }
  }

  /// Full state from the free part y = (q_p, qd_p) and the controls at half step k.
  void Expand(const double* y, int half_step) {
    for (int i = 0; i < nf; ++i) {
      q[Index(free[Index(i)])] = y[i];
      qd[Index(free[Index(i)])] = y[nf + i];
    }
    const bool moving = half_step <= 2 * motion_steps;
    const std::size_t k = moving ? Index(half_step) : half_steps - 1;
    for (int j = 0; j < na; ++j) {
      const Control& c = controls[k * Index(na) + Index(j)];
      const std::size_t dof = Index(actuated[Index(j)]);
      q[dof] = c.q;
      qd[dof] = moving ? c.qd : 0;
      qdd[dof] = moving ? c.qdd : 0;
    }
  }

  void Evaluate(const double* y, int half_step) {
    Expand(y, half_step);
    std::fill(tau.begin(), tau.end(), 0.0);
    dynamics.SetState({q.data(), Index(n)}, {qd.data(), Index(n)});
    contact->Apply(dynamics);
    dynamics.Solve({qdd.data(), Index(n)}, {tau.data(), Index(n)});
  }

  /// dg in factored form, as the rows that PullBackStage takes products with, in `order`: R^T for
  /// the free degrees of freedom, input^T for the actuated ones, then D_q^T and D_qd^T.
  void StoreStage(double* out) {
    contact->Differentiate(dynamics);
    dynamics.DifferentiateFactored(derivatives);
    const auto& input = derivatives.input;
    for (const int i : free) {  // R_pp^T = -input_pp, R_ap^T = -input_ap^T = input_pa.
      for (const int k : free) *out++ = -input[Index(i)][Index(k)];
      for (const int k : actuated) *out++ = input[Index(i)][Index(k)];
    }
    for (const int j : actuated) {
      for (const int k : order) *out++ = input[Index(k)][Index(j)];
    }
    for (const auto* block : {&derivatives.q, &derivatives.qd}) {
      for (const int c : order) {
        for (const int i : order) *out++ = (*block)[Index(i)][Index(c)];
      }
    }
  }

  /// Value of a terminal term and its derivative in the state.
  static double TermValue(const TerminalTerm& term, double value, double* slope) {
    const double e = value - term.target;
    if (term.power == 1) {
      *slope = term.weight;
      return term.weight * e;
    }
    *slope = 2 * term.weight * e;
    return term.weight * e * e;
  }

  void AddTerminal(TerminalTerm::When when, const double* y, RolloutResult& result) const {
    double slope = 0;
    for (const TerminalTerm& term : problem.terminal) {
      if (term.when != when) continue;
      const double value = y[StateIndex(term)];
      result.cost += TermValue(term, value, &slope);
      result.target_error_rad = std::max(result.target_error_rad, term.TargetError(value));
    }
  }
  [[nodiscard]] int StateIndex(const TerminalTerm& term) const {
    const int i = static_cast<int>(std::find(free.begin(), free.end(), term.dof) - free.begin());
    return term.of_velocity ? nf + i : i;
  }

  enum class Scheme { kRungeKutta, kRecordedRungeKutta, kSemiImplicitEuler };

  RolloutResult Forward(std::span<const double> x, Scheme scheme) {
    SetControls(x);
    const int steps = motion_steps + settle_steps;
    const bool record = scheme == Scheme::kRecordedRungeKutta;
    if (record && stages.empty()) {
      stages.resize(Index(steps) * kStages * Index(stage_size));
    }
    RolloutResult result;
    result.peak_torque_nm.assign(Index(na), 0);
    result.torque_excess.assign(Index(na), 0);
    State y{};
    for (int i = 0; i < nf; ++i) y[Index(i)] = problem.start_q[Index(free[Index(i)])];
    effort = 0;
    core_sum = 0;
    for (int step = 0; step < steps; ++step) {
      if (step == motion_steps)
        AddTerminal(TerminalTerm::When::kEnd, y.data(), result), end_state = y;
      if (scheme == Scheme::kSemiImplicitEuler) {
        StepEuler(step, y, result);
      } else {
        StepRungeKutta(step, record, y, result);
      }
      if (!Plausible(y)) {
        result.finite = false;
        result.cost = std::numeric_limits<double>::infinity();
        return result;
      }
    }
    if (settle_steps == 0) AddTerminal(TerminalTerm::When::kEnd, y.data(), result), end_state = y;
    AddTerminal(TerminalTerm::When::kSettled, y.data(), result);
    settled_state = y;
    result.cost += problem.effort_weight * effort;
    SetTorqueExcess(result);
    return result;
  }

  [[nodiscard]] bool Plausible(const State& y) const {
    for (int i = 0; i < 2 * nf; ++i) {
      if (!(std::abs(y[Index(i)]) < kImplausible)) return false;  // Nor is a NaN.
    }
    return true;
  }

  void StepRungeKutta(int step, bool record, State& y, RolloutResult& result) {
    const double h = step < motion_steps ? motion_h : settle_h;
    State ys{}, k{}, sum{};
    for (int s = 0; s < kStages; ++s) {
      for (int i = 0; i < 2 * nf; ++i) ys[Index(i)] = y[Index(i)] + h * kA[Index(s)] * k[Index(i)];
      // The last stage of the motion's last step still belongs to the motion; beyond, legs are
      // held.
      Evaluate(ys.data(),
               step < motion_steps ? 2 * step + kHalfSteps[Index(s)] : 2 * motion_steps + 1);
      for (int i = 0; i < nf; ++i) {
        k[Index(i)] = ys[Index(nf + i)];
        k[Index(nf + i)] = qdd[Index(free[Index(i)])];
      }
      for (int i = 0; i < 2 * nf; ++i) sum[Index(i)] += kB[Index(s)] * k[Index(i)];
      const std::size_t stage = Index(step * kStages + s);
      AddEffort(h * kB[Index(s)], &stage_torque[stage * Index(na)]);
      if (s == 0) Inspect(step, record, result);
      if (record) StoreStage(&stages[stage * Index(stage_size)]);
    }
    for (int i = 0; i < 2 * nf; ++i) y[Index(i)] += h * sum[Index(i)];
  }

  void StepEuler(int step, State& y, RolloutResult& result) {
    const double h = step < motion_steps ? motion_h : settle_h;
    Evaluate(y.data(), step < motion_steps ? 2 * step : 2 * motion_steps + 1);
    for (int i = 0; i < nf; ++i) {
      y[Index(nf + i)] += h * qdd[Index(free[Index(i)])];
      y[Index(i)] += h * y[Index(nf + i)];
    }
    AddEffort(h, &stage_torque[Index(step * kStages * na)]);
    Inspect(step, false, result);
  }

  /// Takes the torques of the stage that was just evaluated, of weight dt in the integral.
  void AddEffort(double dt, double* torques) {
    for (int j = 0; j < na; ++j) {
      const double torque = tau[Index(actuated[Index(j)])];
      effort += dt * torque * torque;
      torques[j] = torque;
    }
  }

  /// Takes what counts at the start of a step, just evaluated: peaks of torque and penetration.
  void Inspect(int step, bool record, RolloutResult& result) {
    for (int j = 0; j < na; ++j) {
      double& peak = result.peak_torque_nm[Index(j)];
      peak = std::max(peak, std::abs(tau[Index(actuated[Index(j)])]));
    }
    for (const ActiveContact<Plane>& a : contact->active()) {
      result.any_contact = true;
      result.peak_penetration_m = std::max(result.peak_penetration_m, a.depth_m);
    }
    AddCore(record ? &core_slope[Index(step * nd)] : nullptr);
  }

  /// Adds the active contacts to the sum of [KS79] for the penetration, and its slopes by the
  /// positions.
  void AddCore(double* slopes) {
    if (slopes != nullptr) std::fill_n(slopes, nd, 0.0);
    const double layer = (1 - problem.solver.core_margin) * problem.contact.d_on_m;
    const double rho = problem.solver.sharpness;
    for (const ActiveContact<Plane>& a : contact->active()) {
      const double exponent = rho * (a.depth_m / layer - 1);
      if (exponent < kNegligibleExponent) continue;
      // Beyond 600 nothing is left to compare with.
      const double weight = std::exp(std::min(exponent, 600.0));
      core_sum += weight;
      if (slopes == nullptr || exponent > 600) continue;
      std::array<double, kMaxDofs> J{};
      contact->AddDepthSlopes(dynamics, a, weight / layer, J);
      for (int i = 0; i < nd; ++i) slopes[i] += J[Index(order[Index(i)])];
    }
  }

  /// Smooth maximum over the starts of all steps, [KS79]: never below the true one.
  void SetTorqueExcess(RolloutResult& result) {
    const int steps = motion_steps + settle_steps;
    const double rho = problem.solver.sharpness;
    result.core_excess = core_sum > 0 ? std::max(-1.0, std::log(core_sum) / rho) : -1;
    for (int j = 0; j < na; ++j) {
      const double limit = problem.joints[Index(j)].limits.torque_max_nm;
      if (!std::isfinite(limit)) {
        result.torque_excess[Index(j)] = -1;
        continue;
      }
      const double peak = result.peak_torque_nm[Index(j)] / limit;
      double sum = 0;
      for (int step = 0; step < steps; ++step) {
        const double t = std::abs(stage_torque[Index(step * kStages * na + j)]) / limit;
        sum += std::exp(rho * (t - peak));
      }
      result.torque_excess[Index(j)] = peak - 1 + std::log(sum) / rho;
    }
  }

  /// The discrete adjoint of Forward, kLanes outputs at a time: row 0 is the cost, row 1 + j the
  /// torque excess of joint j.
  template <class Matrix>
  void Backward(const RolloutResult& result, Matrix& gradient) {
    gradient.setZero();
    pullback = {};
    int lanes = 0;
    for (int output = 0; output <= na + 1; ++output) {
      if (output > na && !(result.core_excess > -1)) continue;
      if (output > 0 && output <= na &&
          !SetTorqueLane(result, output - 1, pullback.lanes[Index(lanes)])) {
        continue;
      }
      pullback.lanes[Index(lanes++)].output = output;
      if (lanes == kLanes) {
        PullBack(gradient);
        pullback = {};
        lanes = 0;
      }
    }
    if (lanes > 0) PullBack(gradient);
  }

  /// Several outputs on their way back through the steps: each number has a lane for each.
  static constexpr int kLanes = 4;
  using Lanes = Eigen::Array<double, kLanes, 1>;
  struct Lane {
    int output = -1;  // none
    double limit = 0, peak = 0, sum = 1;
  };
  struct Pullback {
    Pullback() {
      for (auto* block : {&adjoint, &y_bar}) block->fill(Lanes::Zero());
      for (auto& control : controls) control.fill(Lanes::Zero());
    }
    std::array<Lane, kLanes> lanes;
    std::array<Lanes, kStates> adjoint, y_bar;
    int half_step = 0;  // which `controls` belong to
    std::array<std::array<Lanes, 3>, kMaxDofs> controls;
  };

  /// False for a joint without a limit.
  bool SetTorqueLane(const RolloutResult& result, int joint, Lane& lane) const {
    lane.limit = problem.joints[Index(joint)].limits.torque_max_nm;
    if (!std::isfinite(lane.limit)) return false;
    lane.peak = result.peak_torque_nm[Index(joint)] / lane.limit;
    lane.sum =
        std::exp(problem.solver.sharpness * (result.torque_excess[Index(joint)] + 1 - lane.peak));
    return true;
  }

  template <class Matrix>
  void PullBack(Matrix& gradient) {
    lane_gradient.assign(Index(parameters), Lanes::Zero());
    const int steps = motion_steps + settle_steps;
    AddTerminalSlope(TerminalTerm::When::kSettled, settled_state.data());
    if (settle_steps == 0) AddTerminalSlope(TerminalTerm::When::kEnd, end_state.data());
    std::array<Lanes, kStates> total;
    for (int step = steps - 1; step >= 0; --step) {
      std::copy_n(pullback.adjoint.begin(), 2 * nf, total.begin());
      for (int s = kStages - 1; s >= 0; --s) {
        PullBackStage(step, s);
        for (int i = 0; i < 2 * nf; ++i) total[Index(i)] += pullback.y_bar[Index(i)];
      }
      std::copy_n(total.begin(), 2 * nf, pullback.adjoint.begin());
      if (step == motion_steps) AddTerminalSlope(TerminalTerm::When::kEnd, end_state.data());
    }
    AddToParameters();
    for (int lane = 0; lane < kLanes; ++lane) {
      const int output = pullback.lanes[Index(lane)].output;
      if (output < 0) continue;
      for (int k = 0; k < parameters; ++k) gradient(output, k) = lane_gradient[Index(k)][lane];
    }
  }

  void AddTerminalSlope(TerminalTerm::When when, const double* y) {
    if (pullback.lanes[0].output != 0) return;  // The cost is the first of all lanes.
    for (const TerminalTerm& term : problem.terminal) {
      if (term.when != when) continue;
      double slope = 0;
      TermValue(term, y[StateIndex(term)], &slope);
      pullback.adjoint[Index(StateIndex(term))][0] += slope;
    }
  }

  /// Derivatives of the outputs in the torque of joint j at a stage.
  Lanes TorqueSlopes(int step, int s, int j, double h) const {
    Lanes slopes = Lanes::Zero();
    const double torque = stage_torque[Index((step * kStages + s) * na + j)];
    for (int i = 0; i < kLanes; ++i) {
      const Lane& lane = pullback.lanes[Index(i)];
      if (lane.output == 0) {
        slopes[i] = problem.effort_weight * h * kB[Index(s)] * 2 * torque;
      } else if (lane.output == 1 + j && s == 0) {
        const double weight =
            std::exp(problem.solver.sharpness * (std::abs(torque) / lane.limit - lane.peak));
        slopes[i] = std::copysign(weight / (lane.sum * lane.limit), torque);
      }
    }
    return slopes;
  }

  /// From the adjoint of a step and y_bar of the stage after this one to y_bar of this one.
  void PullBackStage(int step, int s) {
    const double h = step < motion_steps ? motion_h : settle_h;
    // k_bar = h b_s lambda + h a_{s+1} y_bar_{s+1}
    std::array<Lanes, kStates> k_bar;
    const double b = h * kB[Index(s)];
    const double a = s + 1 < kStages ? h * kA[Index(s + 1)] : 0;
    for (int i = 0; i < 2 * nf; ++i)
      k_bar[Index(i)] = b * pullback.adjoint[Index(i)] + a * pullback.y_bar[Index(i)];
    // The stage's record is a matrix with rows of one length: see StoreStage.
    const double* record = &stages[Index(step * kStages + s) * Index(stage_size)];
    const auto row_times = [&](int row, const std::array<Lanes, kMaxDofs>& v) {
      const double* entry = record + Index(row * nd);
      Lanes sum = entry[0] * v[0];
      for (int i = 1; i < nd; ++i) sum += entry[i] * v[Index(i)];
      return sum;
    };
    std::array<Lanes, kMaxDofs> r, w;  // cotangents of g's outputs, and R^T r
    for (int i = 0; i < nf; ++i) r[Index(i)] = k_bar[Index(nf + i)];
    for (int j = 0; j < na; ++j) r[Index(nf + j)] = TorqueSlopes(step, s, j, h);
    for (int i = 0; i < nf; ++i) w[Index(i)] = row_times(i, r);
    for (int j = 0; j < na; ++j) w[Index(nf + j)] = r[Index(nf + j)];
    for (int i = 0; i < nf; ++i) {
      pullback.y_bar[Index(i)] = row_times(nd + i, w);
      pullback.y_bar[Index(nf + i)] = k_bar[Index(i)] + row_times(2 * nd + i, w);
    }
    const double* core = nullptr;
    int core_lane = 0;
    if (s == 0) {
      while (core_lane < kLanes && pullback.lanes[Index(core_lane)].output != na + 1) ++core_lane;
      if (core_lane < kLanes) core = &core_slope[Index(step * nd)];
    }
    const double core_scale = core != nullptr ? 1 / core_sum : 0;
    for (int i = 0; core != nullptr && i < nf; ++i)
      pullback.y_bar[Index(i)][core_lane] += core_scale * core[i];
    if (step >= motion_steps) return;
    // Stages at the same time have the same weights.
    if (const int half_step = 2 * step + kHalfSteps[Index(s)]; half_step != pullback.half_step) {
      AddToParameters();
      pullback.half_step = half_step;
    }
    for (int j = 0; j < na; ++j) {
      auto& control = pullback.controls[Index(j)];
      control[0] += row_times(nd + nf + j, w);
      control[1] += row_times(2 * nd + nf + j, w);
      control[2] += row_times(nf + j, r);
      if (core != nullptr) control[0][core_lane] += core_scale * core[nf + j];
    }
  }

  /// Takes the cotangents of the controls to those of the parameters.
  void AddToParameters() {
    for (int j = 0; j < na; ++j) {
      const ControlWeights& w = WeightsOf(j, Index(pullback.half_step));
      const int begin = std::max(0, 3 - w.first);
      const int end =
          std::min(problem.degree + 1, 3 + problem.joints[Index(j)].free_points() - w.first);
      auto& bar = pullback.controls[Index(j)];
      for (int i = begin; i < end; ++i) {
        lane_gradient[Index(first_parameter[Index(j)] + w.first - 3 + i)] +=
            w.w[0][Index(i)] * bar[0] + w.w[1][Index(i)] * bar[1] + w.w[2][Index(i)] * bar[2];
      }
      bar.fill(Lanes::Zero());
    }
  }

  Problem problem;
  Dynamics dynamics;
  std::unique_ptr<ContactForces<Plane>> contact;
  int n, na, nf = 0, nd = 0;
  int parameters;
  std::vector<int> free;      // degrees of freedom of y's positions
  std::vector<int> actuated;  // degree of freedom of each joint
  std::vector<int> order;     // `free`, then `actuated`
  int motion_steps, settle_steps;
  double motion_h, settle_h;
  std::size_t half_steps = 0;           // of the motion, both ends included
  std::vector<ControlWeights> weights;  // by size of spline, then half step
  std::vector<std::size_t> weights_of;  // which size each joint has
  std::vector<int> first_parameter;     // of each joint
  std::vector<Control> controls;        // by half step, then joint
  std::vector<double> stage_torque;     // by stage, then joint
  std::vector<double> core_slope;       // by step, then in `order`: see AddCore
  double core_sum = 0;
  std::vector<double> stages;  // by stage: see StoreStage
  int stage_size = 0;
  std::unique_ptr<ForwardSensitivity> forward;  // none: the adjoint
  Pullback pullback;
  std::vector<Lanes> lane_gradient;
  Derivatives derivatives;
  std::array<double, kMaxDofs> q{}, qd{}, qdd{}, tau{};
  State end_state{}, settled_state{};
  double effort = 0;  // integral of |tau|^2 so far
};

Rollout::Rollout(const Problem& problem, double step_s,
                 std::unique_ptr<ContactForces<Plane>> contact)
    : implementation_(std::make_unique<Implementation>(problem, step_s, std::move(contact))) {}
Rollout::~Rollout() = default;
Rollout::Rollout(Rollout&&) noexcept = default;

int Rollout::parameter_count() const { return implementation_->parameters; }
int Rollout::output_count() const { return 2 + implementation_->na; }

RolloutResult Rollout::Run(std::span<const double> x) {
  return implementation_->Forward(x, Implementation::Scheme::kRungeKutta);
}

RolloutResult Rollout::Estimate(std::span<const double> x) {
  return implementation_->Forward(x, Implementation::Scheme::kSemiImplicitEuler);
}

RolloutResult Rollout::Run(
    std::span<const double> x,
    Eigen::Ref<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> gradient) {
  if (gradient.rows() != output_count() || gradient.cols() != parameter_count()) {
    throw std::invalid_argument(
        "the gradient has a row for each output, a column for each parameter");
  }
  if (implementation_->forward) return implementation_->forward->Run(x, gradient);
  RolloutResult result = implementation_->Forward(x, Implementation::Scheme::kRecordedRungeKutta);
  if (!result.finite) {
    gradient.setZero();
    return result;
  }
  implementation_->Backward(result, gradient);
  return result;
}

void Rollout::Visit(std::span<const double> x, double extra_s,
                    const std::function<void(const MotionSample&)>& visitor) {
  Implementation& m = *implementation_;
  m.SetControls(x);
  const int extra_steps = static_cast<int>(std::ceil(extra_s / m.settle_h - 1e-9));
  State y{}, ys{}, k{}, sum{};
  for (int i = 0; i < m.nf; ++i) y[Index(i)] = m.problem.start_q[Index(m.free[Index(i)])];
  MotionSample sample;
  sample.dynamics = &m.dynamics;
  const int steps = m.motion_steps + m.settle_steps + extra_steps;
  for (int step = 0; step <= steps; ++step) {
    const bool moving = step < m.motion_steps;
    const double h = moving ? m.motion_h : m.settle_h;
    sum.fill(0);
    for (int s = 0; s < kStages; ++s) {
      for (int i = 0; i < 2 * m.nf; ++i)
        ys[Index(i)] = y[Index(i)] + h * kA[Index(s)] * k[Index(i)];
      m.Evaluate(ys.data(), moving ? 2 * step + kHalfSteps[Index(s)] : 2 * m.motion_steps + 1);
      if (s == 0) {
        sample.time_s = moving ? step * m.motion_h
                               : m.problem.duration_s + (step - m.motion_steps) * m.settle_h;
        sample.q.assign(m.q.begin(), m.q.begin() + m.n);
        sample.qd.assign(m.qd.begin(), m.qd.begin() + m.n);
        sample.torque.clear();
        for (const ActuatedJoint& joint : m.problem.joints)
          sample.torque.push_back(m.tau[Index(joint.dof)]);
        sample.contacts = m.contact->active();
        visitor(sample);
      }
      for (int i = 0; i < m.nf; ++i) {
        k[Index(i)] = ys[Index(m.nf + i)];
        k[Index(m.nf + i)] = m.qdd[Index(m.free[Index(i)])];
      }
      for (int i = 0; i < 2 * m.nf; ++i) sum[Index(i)] += kB[Index(s)] * k[Index(i)];
    }
    for (int i = 0; i < 2 * m.nf; ++i) y[Index(i)] += h * sum[Index(i)];
  }
}

}  // namespace tumbler
