#include "offline/rollout/rollout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace tumbler {
namespace {

using Spline = JointMotion<double>::Spline;
using Dynamics = HybridDynamics<Plane>;

/// A state beyond this (m, rad, and their rates) is a failed rollout: no tumbler gets near it.
constexpr double kImplausible = 1e4;

// The classical Runge-Kutta scheme.
constexpr int kStages = 4;
constexpr std::array<double, kStages> kA = {0, 0.5, 0.5, 1};  // y_s = y + h a_s k_{s-1}
constexpr std::array<double, kStages> kB = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
constexpr std::array<int, kStages> kHalfSteps = {0, 1, 1, 2};  // c_s in halves of a step

constexpr std::size_t Index(int i) { return static_cast<std::size_t>(i); }

std::vector<double> Knots(const Problem& problem) {
  std::vector<double> knots(Index(problem.control_points + problem.degree + 1));
  if (Spline::ClampedUniformKnots(problem.degree, problem.control_points, problem.duration_s,
                                  knots) != Status::kOk) {
    throw std::invalid_argument("spline degree, size and duration do not fit together");
  }
  return knots;
}

/// The three weights rows that the splines of all joints share at one time.
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
  const std::size_t free = Index(problem.free_points_per_joint());
  const ActuatedJoint& actuated = problem.joints[joint];
  std::vector<double> points(
      3, actuated.start_rad);  // Rest: three equal points fix q, and qd = qdd = 0.
  points.insert(points.end(), x.begin() + static_cast<std::ptrdiff_t>(joint * free),
                x.begin() + static_cast<std::ptrdiff_t>((joint + 1) * free));
  points.insert(points.end(), 3, actuated.end_rad);
  return points;
}

Spline PositionSpline(const Problem& problem, std::span<const double> x, std::size_t joint) {
  Spline spline;
  if (spline.Assign(problem.degree, Knots(problem), ControlPoints(problem, x, joint)) !=
      Status::kOk) {
    throw std::invalid_argument("control points do not make a spline");
  }
  return spline;
}

struct Rollout::Implementation {
  Implementation(const Problem& p, double step_s)
      : problem(p),
        dynamics(p.robot.tree),
        contact(p.contact, p.robot.spheres, p.obstacles),
        n(dynamics.size()),
        na(static_cast<int>(p.joints.size())),
        parameters(p.parameter_count()) {
    for (int j = 0; j < n; ++j) {
      if (!dynamics.prescribed(j)) free.push_back(j);
    }
    nf = static_cast<int>(free.size());
    for (const ActuatedJoint& joint : p.joints) actuated.push_back(joint.dof);
    motion_steps = std::max(1, static_cast<int>(std::ceil(p.duration_s / step_s - 1e-9)));
    settle_steps = static_cast<int>(std::ceil(p.settle_s / step_s - 1e-9));
    motion_h = p.duration_s / motion_steps;
    settle_h = settle_steps > 0 ? p.settle_s / settle_steps : step_s;
    Spline spline;
    const std::vector<double> knots = Knots(p);
    if (spline.Assign(p.degree, knots, std::vector<double>(Index(p.control_points))) !=
        Status::kOk) {
      throw std::invalid_argument("spline degree and size do not fit together");
    }
    weights.resize(Index(2 * motion_steps + 1));
    for (int k = 0; k <= 2 * motion_steps; ++k) {
      const Spline::Weights w = spline.EvaluateWeights(0.5 * k * motion_h);
      weights[Index(k)].first = w.first;
      weights[Index(k)].w = w.w;
    }
    controls.resize(weights.size() * Index(na));
    const std::size_t steps = Index(motion_steps + settle_steps);
    stage_size = n * 2 * n + nf * (nf + na) + na * na;
    pullbacks.resize(Index(1 + na));
    stage_torque.resize(steps * kStages * Index(na));
  }

  void SetControls(std::span<const double> x) {
    const int free_points = problem.free_points_per_joint();
    for (int j = 0; j < na; ++j) {
      const ActuatedJoint& joint = problem.joints[Index(j)];
      std::array<double, kMaxControlPoints> c{};
      for (int i = 0; i < problem.control_points; ++i) {
        c[Index(i)] = i < 3                 ? joint.start_rad
                      : i < 3 + free_points ? x[Index(j * free_points + i - 3)]
                                            : joint.end_rad;
      }
      for (std::size_t k = 0; k < weights.size(); ++k) {
        const ControlWeights& w = weights[k];
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
    const std::size_t k = moving ? Index(half_step) : weights.size() - 1;
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
    contact.Apply(dynamics);
    dynamics.Solve({qdd.data(), Index(n)}, {tau.data(), Index(n)});
  }

  /// dg in factored form: rows of D_q and D_qd, then what of input's blocks is not a transpose.
  void StoreStage(double* out) {
    contact.Differentiate(dynamics);
    dynamics.DifferentiateFactored(derivatives);
    for (int i = 0; i < n; ++i) {
      out = std::copy_n(derivatives.q[Index(i)].begin(), n, out);
      out = std::copy_n(derivatives.qd[Index(i)].begin(), n, out);
    }
    for (const int i : free) {
      for (const int k : free) *out++ = derivatives.input[Index(i)][Index(k)];
      for (const int k : actuated) *out++ = derivatives.input[Index(i)][Index(k)];
    }
    for (const int i : actuated) {
      for (const int k : actuated) *out++ = derivatives.input[Index(i)][Index(k)];
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

  double TerminalCost(TerminalTerm::When when, const double* y) const {
    double sum = 0;
    double slope = 0;
    for (const TerminalTerm& term : problem.terminal) {
      if (term.when == when) sum += TermValue(term, y[StateIndex(term)], &slope);
    }
    return sum;
  }
  void AddTerminalSlope(TerminalTerm::When when, const double* y, double* adjoint) const {
    for (const TerminalTerm& term : problem.terminal) {
      if (term.when != when) continue;
      double slope = 0;
      TermValue(term, y[StateIndex(term)], &slope);
      adjoint[StateIndex(term)] += slope;
    }
  }
  [[nodiscard]] int StateIndex(const TerminalTerm& term) const {
    const int i = static_cast<int>(std::find(free.begin(), free.end(), term.dof) - free.begin());
    return term.of_velocity ? nf + i : i;
  }

  RolloutResult Forward(std::span<const double> x, bool record) {
    SetControls(x);
    const int steps = motion_steps + settle_steps;
    if (record && stages.empty()) {
      stages.resize(Index(steps) * kStages * Index(stage_size));
    }
    RolloutResult result;
    result.peak_torque_nm.assign(Index(na), 0);
    result.torque_excess.assign(Index(na), 0);
    std::array<double, 2 * kMaxDofs> y{}, ys{}, k{}, sum{};
    for (int i = 0; i < nf; ++i) y[Index(i)] = problem.start_q[Index(free[Index(i)])];
    double effort = 0;
    double cost = 0;
    for (int step = 0; step < steps; ++step) {
      if (step == motion_steps)
        cost += TerminalCost(TerminalTerm::When::kEnd, y.data()), end_state = y;
      const double h = step < motion_steps ? motion_h : settle_h;
      sum.fill(0);
      for (int s = 0; s < kStages; ++s) {
        for (int i = 0; i < 2 * nf; ++i)
          ys[Index(i)] = y[Index(i)] + h * kA[Index(s)] * k[Index(i)];
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
        for (int j = 0; j < na; ++j) {
          const double torque = tau[Index(actuated[Index(j)])];
          effort += h * kB[Index(s)] * torque * torque;
          stage_torque[stage * Index(na) + Index(j)] = torque;
          if (s == 0)
            result.peak_torque_nm[Index(j)] =
                std::max(result.peak_torque_nm[Index(j)], std::abs(torque));
        }
        if (s == 0) {
          for (const ActiveContact<Plane>& a : contact.active()) {
            result.any_contact = true;
            result.peak_penetration_m = std::max(result.peak_penetration_m, a.depth_m);
          }
        }
        if (record) StoreStage(&stages[stage * Index(stage_size)]);
      }
      bool plausible = true;
      for (int i = 0; i < 2 * nf; ++i) {
        y[Index(i)] += h * sum[Index(i)];
        plausible = plausible && std::abs(y[Index(i)]) < kImplausible;  // A NaN is not.
      }
      if (!plausible) {
        result.finite = false;
        result.cost = std::numeric_limits<double>::infinity();
        return result;
      }
    }
    if (settle_steps == 0) cost += TerminalCost(TerminalTerm::When::kEnd, y.data()), end_state = y;
    cost += TerminalCost(TerminalTerm::When::kSettled, y.data());
    settled_state = y;
    result.cost = cost + problem.effort_weight * effort;
    SetTorqueExcess(result);
    return result;
  }

  /// Smooth maximum over the starts of all steps, [KS79]: never below the true one.
  void SetTorqueExcess(RolloutResult& result) {
    const int steps = motion_steps + settle_steps;
    const double rho = problem.solver.torque_sharpness;
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

  /// The discrete adjoint of Forward for all outputs at once: row 0 is the cost, row 1 + j the
  /// torque excess of joint j.
  template <class Matrix>
  void Backward(const RolloutResult& result, Matrix& gradient) {
    const int steps = motion_steps + settle_steps;
    gradient.setZero();
    int active = 0;
    for (int output = 0; output <= na; ++output) {
      Pullback p;
      p.joint = output - 1;
      p.gradient = gradient.row(output).data();
      if (p.joint < 0) {
        AddTerminalSlope(TerminalTerm::When::kSettled, settled_state.data(), p.adjoint.data());
        if (settle_steps == 0)
          AddTerminalSlope(TerminalTerm::When::kEnd, end_state.data(), p.adjoint.data());
      } else {
        p.limit = problem.joints[Index(p.joint)].limits.torque_max_nm;
        if (!std::isfinite(p.limit)) continue;
        p.peak = result.peak_torque_nm[Index(p.joint)] / p.limit;
        p.sum = std::exp(problem.solver.torque_sharpness *
                         (result.torque_excess[Index(p.joint)] + 1 - p.peak));
      }
      pullbacks[Index(active++)] = p;
    }
    const std::span<Pullback> outputs(pullbacks.data(), Index(active));
    for (int step = steps - 1; step >= 0; --step) {
      for (Pullback& p : outputs) p.total = p.adjoint;
      for (int s = kStages - 1; s >= 0; --s) {
        for (Pullback& p : outputs) PullBackStage(step, s, p);
      }
      for (Pullback& p : outputs) {
        p.adjoint = p.total;
        if (p.joint < 0 && step == motion_steps)
          AddTerminalSlope(TerminalTerm::When::kEnd, end_state.data(), p.adjoint.data());
      }
    }
    for (Pullback& p : outputs) AddToParameters(p);
  }

  /// One output on its way back through the steps.
  struct Pullback {
    int joint = -1;  // whose torque excess it is; -1 for the cost
    double limit = 0, peak = 0, sum = 1;
    double* gradient = nullptr;
    std::array<double, 2 * kMaxDofs> adjoint{}, y_bar{}, total{};
    int half_step = 0;  // which `control` belongs to
    std::array<Control, kMaxDofs> control{};
  };

  /// Derivative of an output in the torque of joint j at a stage.
  double TorqueSlope(const Pullback& p, int step, int s, int j, double h) const {
    if (p.joint >= 0 && (p.joint != j || s != 0)) return 0;
    const double torque = stage_torque[Index((step * kStages + s) * na + j)];
    if (p.joint < 0) return problem.effort_weight * h * kB[Index(s)] * 2 * torque;
    const double weight =
        std::exp(problem.solver.torque_sharpness * (std::abs(torque) / p.limit - p.peak));
    return std::copysign(weight / (p.sum * p.limit), torque);
  }

  void PullBackStage(int step, int s, Pullback& p) {
    const double h = step < motion_steps ? motion_h : settle_h;
    // k_bar = h b_s lambda + h a_{s+1} y_bar_{s+1}
    std::array<double, 2 * kMaxDofs> k_bar;
    const double b = h * kB[Index(s)];
    const double a = s + 1 < kStages ? h * kA[Index(s + 1)] : 0;
    for (int i = 0; i < 2 * nf; ++i)
      k_bar[Index(i)] = b * p.adjoint[Index(i)] + a * p.y_bar[Index(i)];
    // w = R^T r for the cotangents r of the outputs of hybrid dynamics; the cotangents of the given
    // accelerations on the way.
    const double* row = &stages[Index(step * kStages + s) * Index(stage_size)];
    const double* input = row + 2 * n * n;
    std::array<double, kMaxDofs> w{}, w_free{}, r_actuated, qdd_bar{};
    for (int j = 0; j < na; ++j) {
      r_actuated[Index(j)] = TorqueSlope(p, step, s, j, h);
      w[Index(actuated[Index(j)])] = r_actuated[Index(j)];
    }
    for (int i = 0; i < nf; ++i, input += nf + na) {
      const double r = k_bar[Index(nf + i)];
      double sum = 0;
      for (int j = 0; j < na; ++j) {
        qdd_bar[Index(j)] += input[nf + j] * r;
        sum += input[nf + j] * r_actuated[Index(j)];
      }
      w_free[Index(i)] += sum;
      for (int k = 0; k < nf; ++k) w_free[Index(k)] -= input[k] * r;
    }
    for (int i = 0; i < nf; ++i) w[Index(free[Index(i)])] = w_free[Index(i)];
    for (int j = 0; j < na; ++j, input += na) {
      for (int k = 0; k < na; ++k) qdd_bar[Index(k)] += input[k] * r_actuated[Index(j)];
    }
    std::array<double, 2 * kMaxDofs> bar{};  // cotangent of q and qd
    for (int i = 0; i < n; ++i, row += 2 * n) {
      const double factor = w[Index(i)];
      for (int c = 0; c < 2 * n; ++c) bar[Index(c)] += factor * row[c];
    }
    for (int i = 0; i < nf; ++i) {
      p.y_bar[Index(i)] = bar[Index(free[Index(i)])];
      p.y_bar[Index(nf + i)] = k_bar[Index(i)] + bar[Index(n + free[Index(i)])];
    }
    for (int i = 0; i < 2 * nf; ++i) p.total[Index(i)] += p.y_bar[Index(i)];
    if (step >= motion_steps) return;
    // Stages at the same time have the same weights.
    if (const int half_step = 2 * step + kHalfSteps[Index(s)]; half_step != p.half_step) {
      AddToParameters(p);
      p.half_step = half_step;
    }
    for (int j = 0; j < na; ++j) {
      const std::size_t dof = Index(actuated[Index(j)]);
      Control& control = p.control[Index(j)];
      control.q += bar[dof];
      control.qd += bar[Index(n) + dof];
      control.qdd += qdd_bar[Index(j)];
    }
  }

  /// Takes the cotangents of the controls to those of the parameters.
  void AddToParameters(Pullback& p) const {
    const ControlWeights& w = weights[Index(p.half_step)];
    const int free_points = problem.free_points_per_joint();
    const int begin = std::max(0, 3 - w.first);
    const int end = std::min(problem.degree + 1, 3 + free_points - w.first);
    for (int j = 0; j < na; ++j) {
      Control& bar = p.control[Index(j)];
      double* gradient = p.gradient + j * free_points + w.first - 3;
      for (int i = begin; i < end; ++i) {
        gradient[i] +=
            w.w[0][Index(i)] * bar.q + w.w[1][Index(i)] * bar.qd + w.w[2][Index(i)] * bar.qdd;
      }
      bar = {};
    }
  }

  Problem problem;
  Dynamics dynamics;
  ContactModel<Plane> contact;
  int n, na, nf = 0;
  int parameters;
  std::vector<int> free;      // degrees of freedom of y's positions
  std::vector<int> actuated;  // degree of freedom of each joint
  int motion_steps, settle_steps;
  double motion_h, settle_h;
  std::vector<ControlWeights> weights;  // by half step
  std::vector<Control> controls;        // by half step, then joint
  std::vector<double> stage_torque;     // by stage, then joint
  std::vector<double> stages;           // by stage: see StoreStage
  int stage_size = 0;
  std::vector<Pullback> pullbacks;  // room for one of each output
  DynamicsDerivatives derivatives;
  std::array<double, kMaxDofs> q{}, qd{}, qdd{}, tau{};
  std::array<double, 2 * kMaxDofs> end_state{}, settled_state{};
};

Rollout::Rollout(const Problem& problem, double step_s)
    : implementation_(std::make_unique<Implementation>(problem, step_s)) {}
Rollout::~Rollout() = default;
Rollout::Rollout(Rollout&&) noexcept = default;

int Rollout::parameter_count() const { return implementation_->parameters; }
int Rollout::output_count() const { return 1 + implementation_->na; }

RolloutResult Rollout::Run(std::span<const double> x) { return implementation_->Forward(x, false); }

RolloutResult Rollout::Run(
    std::span<const double> x,
    Eigen::Ref<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> gradient) {
  RolloutResult result = implementation_->Forward(x, true);
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
  std::array<double, 2 * kMaxDofs> y{}, ys{}, k{}, sum{};
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
        sample.contacts = m.contact.active();
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
