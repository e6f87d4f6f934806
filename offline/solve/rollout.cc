#include "offline/solve/rollout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/problem/end_points.h"
#include "offline/problem/free_start.h"
#include "offline/scene/even_steps.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/step_grid.h"
#include "offline/scene/stepper.h"
#include "offline/solve/clearance_constraint.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/free_duration.h"
#include "offline/solve/smooth_maximum.h"
#include "offline/solve/start_state.h"
#include "offline/solve/torque_limit.h"

namespace tumbler {
namespace {

using Spline = JointMotion<double>::Spline;
using Derivatives = HybridDynamics<Plane>::Derivatives;
constexpr int kMaxDofs = SceneDynamics::kMaxDofs;

/// The steps of a scheme through motion and settle phase, and the *points* in time of their stages,
/// for which the paths of the joints are computed beforehand. Stages at the same time share a
/// point, also the last stage of a step and the first of the next one.
struct Timetable {
  bool classical = true;  // or Dormand and Prince's
  int stages = 0;         // of a step
  int points_per_step = 0;
  std::array<int, Tableau::kMaxStages> point_of_stage{};  // from the first one of the step
  std::vector<double> length;                             // of the steps [s]
  std::vector<double> time;                               // of the motion's points [s]
  int motion_steps = 0;
  std::vector<int> step_at;  // for each instant of the cost, the step that begins there

  Timetable(const Tableau& scheme, const StepGrid& grid, double duration_s,
            std::span<const CostInstant> instants)
      : classical(&scheme == &kClassical),
        stages(static_cast<int>(scheme.own_stages())),
        length(grid.motion),
        motion_steps(static_cast<int>(grid.motion.size())) {
    length.insert(length.end(), grid.settling.begin(), grid.settling.end());
    std::array<double, Tableau::kMaxStages> fraction{};  // of the step, for each of its points
    for (std::size_t s = 1; s < scheme.own_stages(); ++s) {
      if (scheme.c[s] != scheme.c[s - 1]) fraction[Index(++points_per_step)] = scheme.c[s];
      point_of_stage[s] = points_per_step;
    }
    double begin = 0;
    for (const double h : grid.motion) {
      for (int k = 0; k < points_per_step; ++k) time.push_back(begin + fraction[Index(k)] * h);
      begin += h;
    }
    // The sum of the steps may be beyond the spline's end by rounding.
    for (double& t : time) t = std::min(t, duration_s);
    time.push_back(duration_s);
    FindInstants(instants, duration_s);
  }
  /// Finds the step that begins at each instant.
  /// @throws std::invalid_argument  when there is none.
  void FindInstants(std::span<const CostInstant> instants, double duration_s) {
    int step = 0;
    double begin = 0;  // of the step
    for (const CostInstant& instant : instants) {
      const double rounding = 1e-9 * (1 + instant.time_s);
      const bool ends_phase = instant.when != CostTerm::When::kTime;
      const bool in_motion = !instant.held || instant.when == CostTerm::When::kEnd;
      const int last = in_motion ? motion_steps : steps();
      if (instant.held && step < motion_steps) step = motion_steps, begin = duration_s;
      while (step < last && (ends_phase || begin < instant.time_s - rounding))
        begin += length[Index(step++)];
      if (std::abs(begin - instant.time_s) > rounding)
        throw std::invalid_argument("the steps stride over an instant at which the cost looks");
      step_at.push_back(step);
    }
  }
  [[nodiscard]] int steps() const { return static_cast<int>(length.size()); }
  [[nodiscard]] bool settles() const { return steps() > motion_steps; }
  /// The point of all stages after the motion, in which the joints are held.
  [[nodiscard]] int held() const { return static_cast<int>(time.size()); }
  /// The last stage of the motion's last step still belongs to the motion.
  [[nodiscard]] int PointOf(int step, int s) const {
    return step < motion_steps ? points_per_step * step + point_of_stage[Index(s)] : held();
  }
};

using State = SceneDynamics::State;
constexpr std::size_t kStates = std::tuple_size_v<State>;

std::vector<double> Knots(const Problem& problem, int control_points, double duration_s) {
  std::vector<double> knots(Index(control_points + problem.degree + 1));
  if (Spline::ClampedUniformKnots(problem.degree, control_points, duration_s, knots) !=
      Status::kOk) {
    throw std::invalid_argument("spline degree, size and duration do not fit together");
  }
  return knots;
}

/// The weights of control points in q, qd and qdd at one time. All splines of one size share them.
struct ControlWeights {
  int first = 0;
  std::array<std::array<double, Spline::kMaxDegree + 1>, 3> w{};
};

/// A term of the cost that is an integral. `integral` is its value so far, without its weight.
struct RunningTerm : CostTerm {
  double integral = 0;
};

/// The number of outputs that go back through the steps together, each in its own lane.
constexpr int kLanes = 4;

/// A number for each lane, in pairs with which the processor computes at once.
class Lanes {
  using Pair [[gnu::vector_size(16)]] = double;

 public:
  Lanes() = default;  ///< Its numbers are not set.
  static Lanes Zero() { return {Pair{}, Pair{}}; }
  double operator[](int i) const { return i < 2 ? low_[i] : high_[i - 2]; }
  void Add(int i, double value) {
    if (i < 2) {
      low_[i] += value;
    } else {
      high_[i - 2] += value;
    }
  }

  friend Lanes operator+(const Lanes& a, const Lanes& b) {
    return {a.low_ + b.low_, a.high_ + b.high_};
  }
  friend Lanes operator*(double k, const Lanes& a) { return {k * a.low_, k * a.high_}; }
  Lanes& operator+=(const Lanes& a) { return *this = *this + a; }

 private:
  Lanes(Pair low, Pair high) : low_(low), high_(high) {}
  Pair low_, high_;
};

}  // namespace

StepGrid EvenGrid(const Problem& problem, double longest_s) {
  std::vector<double> motion, settling;
  bool held = false;
  const double longest_duration_s =
      problem.free_duration ? problem.free_duration->max_s : problem.duration_s;
  for (const CostInstant& instant : problem.instants(longest_duration_s)) {
    (held ? settling : motion).push_back(instant.since_s);
    held = instant.held;
  }
  StepGrid grid = EvenGrid(motion, settling, longest_s);
  return problem.free_duration ? FreeDuration(problem).Stretched(std::move(grid)) : grid;
}

std::vector<double> ControlPoints(const Problem& problem, std::span<const double> x,
                                  std::size_t joint) {
  const ActuatedJoint& actuated = problem.joints[joint];
  const auto free = x.subspan(Index(problem.first_parameter(joint)), Index(actuated.free_points()));
  const EndPoints ends = EndPointsOf(actuated, problem.degree, problem.duration_of(x));
  std::vector<double> points(ends.first.begin(), ends.first.end());
  points.insert(points.end(), free.begin(), free.end());
  points.insert(points.end(), ends.last.begin(), ends.last.end());
  return points;
}

Spline PositionSpline(const Problem& problem, std::span<const double> x, std::size_t joint) {
  Spline spline;
  if (spline.Assign(problem.degree,
                    Knots(problem, problem.joints[joint].control_points, problem.duration_of(x)),
                    ControlPoints(problem, x, joint)) != Status::kOk) {
    throw std::invalid_argument("control points do not make a spline");
  }
  return spline;
}

struct Rollout::Implementation {
  Implementation(const Problem& p, double step_s, std::unique_ptr<ContactForces<Plane>> own_contact)
      : problem(p),
        forward(MakeForward(p, step_s, own_contact != nullptr)),
        robot(p.scene, std::move(own_contact)),
        nf(static_cast<int>(robot.free.size())),
        na(static_cast<int>(p.joints.size())),
        nd(nf + na),
        parameters(p.parameter_count()),
        clearance(p, step_s),
        clearance_gradient(Index(parameters)),
        longest_step_s(step_s),
        depth(p.solver.sharpness, (1 - p.solver.core_margin) * p.scene.contact.d_on_m),
        instants(p.instants()),
        start(p),
        duration(p),
        grid(EvenGrid(p, step_s)),
        table(kClassical, grid, p.duration_s, instants) {
    for (const ActuatedJoint& joint : p.joints) actuated.push_back(joint.dof);
    for (int j = 0; j < na; ++j) {
      if (LimitsTorqueBySpeed(p.joints[Index(j)])) curved.push_back(j);
    }
    for (int j = 0; j < na; ++j) first_parameter.push_back(p.first_parameter(Index(j)));
    order = robot.free;
    order.insert(order.end(), actuated.begin(), actuated.end());
    stage_size = 3 * nd * nd + (duration.is_free() ? 2 * nf : 0);
    lane_gradient.resize(Index(parameters));
    excess_slopes.resize(Index(na + 1));
    instant_states.resize(instants.size());
    for (const CostTerm& term : p.cost) {
      if (term.when != CostTerm::When::kThroughout) continue;
      running.push_back({term});
      running_of_state = running_of_state || term.of_state();
    }
    Prepare();
  }

  /// Takes the duration of the motion with these parameters.
  /// @returns false when the cost would look at a time that is not within the motion.
  bool SetDuration(std::span<const double> x) {
    if (!duration.is_free()) return true;
    const double before_s = duration.duration_s();
    if (!duration.Set(problem, x)) return false;
    if (duration.duration_s() == before_s) return true;
    instants = problem.instants(duration.duration_s());
    table = Timetable(table.classical ? kClassical : kDormandPrince, duration.Stretched(grid),
                      duration.duration_s(), instants);
    Prepare();
    return true;
  }

  /// Makes everything that depends on the timetable.
  void Prepare() {
    weights.clear();
    weights_of.clear();
    for (int j = 0; j < na; ++j) {
      const int size = problem.joints[Index(j)].control_points;
      int same = 0;
      while (problem.joints[Index(same)].control_points != size) ++same;
      weights_of.push_back(same == j ? weights.size() / table.time.size()
                                     : weights_of[Index(same)]);
      if (same == j) AddWeights(size);
    }
    controls.resize(table.time.size() * Index(na));
    stage_torque.resize(Index(table.steps() * table.stages * na));
    look_points = LookPoints(table.classical ? kClassical : kDormandPrince,
                             *std::max_element(table.length.begin(), table.length.end()));
    points_in.clear();
    for (const double h : table.length) points_in.push_back(&look_points.In(h));
    torque_slope.resize(stage_torque.size());
    stage_curve.resize(Index(table.steps() * table.stages) * curved.size());
    curve_slope.resize(stage_curve.size());
    stage_depth.resize(Index(table.steps() * table.stages));
    depth_slope.resize(stage_depth.size());
    core_slope.resize(stage_depth.size() * Index(nd));
    highest_in.resize(Index(table.steps()));
    added.reserve(Index(table.steps()) * (curved.empty() ? 1 : 2));
    stages.clear();
  }

  static std::unique_ptr<ForwardSensitivity> MakeForward(const Problem& p, double step_s,
                                                         bool own_contact) {
    if (p.solver.gradient == SolverSettings::Gradient::kAdjoint) return nullptr;
    if (own_contact)
      throw std::invalid_argument("the forward gradient has the general contact model only");
    return std::make_unique<ForwardSensitivity>(p,
                                                StepSettings{StepSettings::Scheme::kFixed, step_s});
  }

  /// Appends the weights of splines of one size at all points.
  void AddWeights(int control_points) {
    Spline spline;
    if (spline.Assign(problem.degree, Knots(problem, control_points, duration.duration_s()),
                      std::vector<double>(Index(control_points))) != Status::kOk) {
      throw std::invalid_argument("spline degree and size do not fit together");
    }
    for (const double t : table.time) {
      const Spline::Weights w = spline.EvaluateWeights(t);
      weights.push_back({w.first, w.w});
    }
  }

  [[nodiscard]] const ControlWeights& WeightsOf(int joint, std::size_t point) const {
    return weights[weights_of[Index(joint)] * table.time.size() + point];
  }

  void SetControls(std::span<const double> x) {
    for (int j = 0; j < na; ++j) {
      const ActuatedJoint& joint = problem.joints[Index(j)];
      const int free_points = joint.free_points();
      std::array<double, kMaxControlPoints> c{};
      const EndPoints ends = EndPointsOf(joint, problem.degree, duration.duration_s());
      for (int i = 0; i < joint.control_points; ++i) {
        c[Index(i)] = i < 3 || i >= 3 + free_points ? ends.At(i, joint.control_points)
                                                    : x[Index(first_parameter[Index(j)] + i - 3)];
      }
      for (std::size_t k = 0; k < table.time.size(); ++k) {
        const ControlWeights& w = WeightsOf(j, k);
        PathPoint sum;
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

  /// The derivatives of the paths at all points by the duration.
  void SetControlSlopes() {
    control_slopes.resize(controls.size());
    for (std::size_t k = 0; k < table.time.size(); ++k) {
      for (int j = 0; j < na; ++j)
        control_slopes[k * Index(na) + Index(j)] = duration.PathSlope(Index(j), table.time[k]);
    }
  }

  /// Puts the actuated joints where they are at a point.
  void SetJoints(int point) {
    const bool moving = point < table.held();
    const std::size_t k = Index(moving ? point : point - 1);
    for (int j = 0; j < na; ++j) {
      const PathPoint& c = controls[k * Index(na) + Index(j)];
      const std::size_t dof = Index(actuated[Index(j)]);
      robot.q[dof] = c.q;
      robot.qd[dof] = moving ? c.qd : problem.joints[Index(j)].end_rad_s;
      robot.qdd[dof] = moving ? c.qdd : 0;
    }
  }

  void Evaluate(const State& y, int point) {
    robot.SetFree(y);
    SetJoints(point);
    robot.TouchAndSolve();
  }

  /// Stores dg in factored form, as the rows that PullBackStage multiplies with, in `order`: R^T
  /// for the free degrees of freedom, input^T for the actuated ones, then D_q^T and D_qd^T; and the
  /// state's slope where the duration is free.
  void StoreStage(double* out, const double* slope) {
    robot.DifferentiateFactored(derivatives);
    const auto& input = derivatives.input;
    for (const int i : robot.free) {  // R_pp^T = -input_pp, R_ap^T = -input_ap^T = input_pa
      for (const int k : robot.free) *out++ = -input[Index(i)][Index(k)];
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
    if (duration.is_free()) std::copy_n(slope, 2 * nf, out);
  }

  /// The point in time of an instant: at the end of the motion, the joints are held already.
  [[nodiscard]] int PointOf(std::size_t instant) const {
    return instants[instant].held ? table.held() : table.PointOf(table.step_at[instant], 0);
  }
  /// The robot at an instant, in its recorded state.
  CostPoint InstantAt(std::size_t instant) {
    robot.SetFree(instant_states[instant]);
    SetJoints(PointOf(instant));
    return {robot.q, robot.qd, {}};
  }

  /// Adds the cost of all instants from `next` on at which this step begins.
  void AddInstants(int step, const State& y, std::size_t& next, RolloutResult& result) {
    for (; next < instants.size() && table.step_at[next] == step; ++next) {
      instant_states[next] = y;
      AddInstant(next, result);
    }
  }
  void AddInstant(std::size_t instant, RolloutResult& result) {
    const CostPoint here = InstantAt(instant);
    for (const CostTerm& term : problem.cost) {
      if (!instants[instant].Has(term)) continue;
      result.cost = term.Accumulate(result.cost, term.weight, here);
      result.target_error_rad = std::max(result.target_error_rad, term.TargetError(here));
      if (term.draws()) result.residuals.push_back(term.Residual(here));
    }
  }

  enum class Scheme { kRungeKutta, kRecordedRungeKutta, kSemiImplicitEuler };

  RolloutResult Forward(std::span<const double> x, Scheme scheme) {
    return table.classical ? Forward<kClassical>(x, scheme) : Forward<kDormandPrince>(x, scheme);
  }

  template <const Tableau& kScheme>
  RolloutResult Forward(std::span<const double> x, Scheme scheme) {
    const bool record = scheme == Scheme::kRecordedRungeKutta;
    RolloutResult result;
    result.peak_torque_nm.assign(Index(na), 0);
    result.torque_excess.assign(Index(na), 0);
    if (!SetDuration(x)) return Failed(std::move(result));
    start.Set(problem, x);
    SetControls(x);
    if (record && duration.is_free()) SetControlSlopes();
    result.clearance_excess =
        clearance.Evaluate(x, record ? std::span<double>(clearance_gradient) : std::span<double>());
    const int steps = table.steps();
    if (record && stages.empty()) {
      stages.resize(Index(steps * table.stages) * Index(stage_size));
      if (running_of_state) running_states.resize(Index(steps * table.stages) * 2 * robot.n);
    }
    State y = StartState(robot, problem);
    for (RunningTerm& term : running) term.integral = 0;
    std::size_t instant = 0;
    for (int step = 0; step < steps; ++step) {
      AddInstants(step, y, instant, result);
      if (scheme == Scheme::kSemiImplicitEuler) {
        StepEuler(step, y, result);
      } else {
        StepRungeKutta<kScheme>(step, record, y, result);
      }
      if (!Plausible(y)) return Failed(std::move(result));
    }
    AddInstants(steps, y, instant, result);
    for (const RunningTerm& term : running) result.cost += term.weight * term.integral;
    SetExcesses(scheme, result);
    return result;
  }

  static RolloutResult Failed(RolloutResult result) {
    result.finite = false;
    result.cost = std::numeric_limits<double>::infinity();
    return result;
  }

  [[nodiscard]] bool Plausible(const State& y) const {
    for (int i = 0; i < 2 * nf; ++i) {
      if (!(std::abs(y[Index(i)]) < kImplausibleState)) return false;  // NaN is implausible, too.
    }
    return true;
  }

  template <const Tableau& kScheme>
  void StepRungeKutta(int step, bool record, State& y, RolloutResult& result) {
    const double h = table.length[Index(step)];
    tumbler::StepRungeKutta<kScheme>(y, Index(2 * nf), h, [&](int s, const State& y_s, double* k) {
      Evaluate(y_s, table.PointOf(step, s));
      robot.TakeSlope(k);
      const std::size_t stage = StageOf(step, s);
      const CostPoint here = TakeTorques(stage);
      AddRunning(h * kScheme.b[Index(s)], here);
      if (s == 0) Inspect(result);
      TakeDepth(stage, record);
      if (record) StoreStage(&stages[stage * Index(stage_size)], k), StoreRunning(stage);
      return true;
    });
  }

  void StepEuler(int step, State& y, RolloutResult& result) {
    const double h = table.length[Index(step)];
    StepSemiImplicitEuler(y, Index(nf), h, [&](int, const State& y_s, double* k) {
      Evaluate(y_s, table.PointOf(step, 0));
      robot.TakeSlope(k);
      AddRunning(h, TakeTorques(StageOf(step, 0)));
      Inspect(result);
      TakeDepth(StageOf(step, 0), false);
      return true;
    });
  }

  [[nodiscard]] std::size_t StageOf(int step, int s) const {
    return Index(step * table.stages + s);
  }

  /// Stores the torques of the stage that was just evaluated.
  /// @returns the stage as the cost sees it.
  CostPoint TakeTorques(std::size_t stage) {
    double* const torques = &stage_torque[stage * Index(na)];
    for (int j = 0; j < na; ++j) torques[j] = robot.tau[Index(actuated[Index(j)])];
    return {robot.q, robot.qd, {torques, Index(na)}};
  }

  /// Adds a stage to the integrals, with weight dt.
  void AddRunning(double dt, const CostPoint& here) {
    for (RunningTerm& term : running) term.integral = term.Accumulate(term.integral, dt, here);
  }

  /// Stores positions and velocities of the stage that was just evaluated, if any integral depends
  /// on them.
  void StoreRunning(std::size_t stage) {
    if (!running_of_state) return;
    double* const out = &running_states[stage * 2 * robot.n];
    std::copy_n(robot.q.begin(), robot.n, out);
    std::copy_n(robot.qd.begin(), robot.n, out + robot.n);
  }
  /// A recorded stage as the cost saw it.
  [[nodiscard]] CostPoint RecordedAt(std::size_t stage) const {
    const std::span<const double> torques(&stage_torque[stage * Index(na)], Index(na));
    if (!running_of_state) return {{}, {}, torques};
    const double* const states = &running_states[stage * 2 * robot.n];
    return {{states, robot.n}, {states + robot.n, robot.n}, torques};
  }

  /// Takes the start of a step, just evaluated, into the peaks of torque and penetration.
  void Inspect(RolloutResult& result) {
    for (int j = 0; j < na; ++j) {
      double& peak = result.peak_torque_nm[Index(j)];
      peak = std::max(peak, std::abs(robot.tau[Index(actuated[Index(j)])]));
    }
    for (const ActiveContact<Plane>& a : robot.contact->active()) {
      result.any_contact = true;
      result.peak_penetration_m = std::max(result.peak_penetration_m, a.depth_m);
    }
  }

  /// Stores the smooth depth of the stage that was just evaluated, and its derivatives in the
  /// positions.
  void TakeDepth(std::size_t stage, bool record) {
    stage_depth[stage] = depth.Evaluate(robot.contact->active());
    if (!record) return;
    double* const slopes = &core_slope[stage * Index(nd)];
    std::fill_n(slopes, nd, 0.0);
    std::array<double, kMaxDofs> by_q{};
    bool any = false;
    for (std::size_t i = 0; i < depth.slopes().size(); ++i) {
      if (depth.slopes()[i] == 0) continue;
      any = true;
      robot.contact->AddDepthSlopes(robot.dynamics, robot.contact->active()[i], depth.slopes()[i],
                                    by_q);
    }
    for (int i = 0; any && i < nd; ++i) slopes[i] = by_q[Index(order[Index(i)])];
  }

  /// A quantity at all stages, and where the derivative of its smooth maximum by it goes.
  struct Quantity {
    const double* value;  // at the first stage
    double* slope;        // likewise
    std::size_t stride;   // to the next stage
    double unit;
  };

  /// Sets the smooth maxima, and with a gradient to come their derivatives by the torques and
  /// depths of the stages.
  void SetExcesses(Scheme scheme, RolloutResult& result) {
    const double rho = problem.solver.sharpness;
    if (scheme == Scheme::kRecordedRungeKutta) {
      std::fill(depth_slope.begin(), depth_slope.end(), 0.0);
      std::fill(torque_slope.begin(), torque_slope.end(), 0.0);
      std::fill(curve_slope.begin(), curve_slope.end(), 0.0);
    }
    added.clear();
    stretched_sum = 0;
    SmoothMaximum deepest(rho, SmoothMaximum::Of::kAboveZero);
    AddSteps(scheme, {stage_depth.data(), depth_slope.data(), 1, 1}, deepest);
    excess_slopes.back() = FinishSlopes(deepest);
    result.core_excess = std::max(-1.0, depth.least() + deepest.value() - 1);
    for (int j = 0; j < na; ++j) {
      const double limit = problem.joints[Index(j)].limits.torque_max_nm;
      result.torque_excess[Index(j)] = -1;
      if (!std::isfinite(limit)) continue;
      SmoothMaximum largest(rho, SmoothMaximum::Of::kSize);
      AddSteps(scheme, {&stage_torque[Index(j)], &torque_slope[Index(j)], Index(na), limit},
               largest);
      const auto found = std::find(curved.begin(), curved.end(), j);
      excess_slopes[Index(j)] =
          found == curved.end()
              ? FinishSlopes(largest)
              : AddCurve(scheme, static_cast<std::size_t>(found - curved.begin()), largest);
      result.torque_excess[Index(j)] = largest.value() - 1;
    }
  }

  /// Sets where the motor of one of `curved` is on its torque-speed curve at each stage.
  void FindCurve(Scheme scheme, std::size_t c) {
    const int stages_used = scheme == Scheme::kSemiImplicitEuler ? 1 : table.stages;
    const std::size_t j = Index(curved[c]);
    for (int step = 0; step < table.steps(); ++step) {
      for (int s = 0; s < stages_used; ++s) {
        const int point = table.PointOf(step, s);
        const bool moving = point < table.held();
        const double velocity = moving ? controls[Index(point) * Index(na) + j].qd : 0;
        const std::size_t stage = StageOf(step, s);
        stage_curve[stage * curved.size() + c] =
            OnCurve(problem.joints[j], stage_torque[stage * Index(na) + j], velocity);
      }
    }
  }

  /// Adds the torque-speed curve of one of `curved` to the smooth maximum of its joint's torque,
  /// and finishes that.
  /// @returns as FinishSlopes.
  double AddCurve(Scheme scheme, std::size_t c, SmoothMaximum& largest) {
    FindCurve(scheme, c);
    AddSteps(scheme, {&stage_curve[c], &curve_slope[c], curved.size(), 1}, largest);
    const double by_duration = FinishSlopes(largest);
    if (scheme != Scheme::kRecordedRungeKutta) return by_duration;
    const int j = curved[c];
    const double by_torque = problem.joints[Index(j)].motor.curve_by_torque();
    for (std::size_t stage = 0; stage * curved.size() < curve_slope.size(); ++stage) {
      torque_slope[stage * Index(na) + Index(j)] +=
          by_torque * curve_slope[stage * curved.size() + c];
    }
    return by_duration;
  }

  /// Adds all steps to a smooth maximum, except for those that are 0. FinishSlopes makes the
  /// slopes those of the maximum, when everything has been added.
  void AddSteps(Scheme scheme, const Quantity& quantity, SmoothMaximum& maximum) {
    const bool euler = scheme == Scheme::kSemiImplicitEuler;
    const std::size_t count = euler ? 1 : Index(table.stages);
    const std::size_t step_stride = Index(table.stages) * quantity.stride;
    const auto points_of = [&](std::size_t step) -> const StepPoints& {
      return euler ? LookPoints::Start() : *points_in[step];
    };
    std::array<double, Tableau::kMaxStages> values{}, slopes{};
    const auto take_values = [&](std::size_t step) {
      const double* value = quantity.value + step * step_stride;
      for (std::size_t s = 0; s < count; ++s)
        values[s] = value[s * quantity.stride] / quantity.unit;
    };
    // Few steps are near the largest, so it is looked for first.
    const std::size_t steps = Index(table.steps());
    std::size_t highest_step = 0;
    for (std::size_t step = 0; step < steps; ++step) {
      const double* value = quantity.value + step * step_stride;
      double highest = 0;
      for (std::size_t s = 0; s < count; ++s)
        highest = std::max(highest, std::abs(value[s * quantity.stride]));
      highest_in[step] = highest / quantity.unit;
      if (highest_in[step] > highest_in[highest_step]) highest_step = step;
    }
    take_values(highest_step);
    maximum.Expect(points_of(highest_step), {values.data(), count});

    const bool record = scheme == Scheme::kRecordedRungeKutta;
    for (std::size_t step = 0; step < steps; ++step) {
      if (highest_in[step] == 0) continue;
      const StepPoints& points = points_of(step);
      if (!maximum.Counts(points, highest_in[step])) continue;
      take_values(step);
      const double before = maximum.sum();
      const double shrink = maximum.Add(points, table.length[step], {values.data(), count},
                                        {slopes.data(), record ? count : 0});
      if (!record) continue;
      stretched_sum *= shrink;
      if (IsStretched(static_cast<int>(step))) stretched_sum += maximum.sum() - shrink * before;
      for (std::size_t s = 0; s < count; ++s)
        quantity.slope[step * step_stride + s * quantity.stride] = slopes[s];
      added.push_back({quantity.slope + step * step_stride, quantity.stride, maximum.largest()});
    }
  }

  /// @returns the derivative of the maximum by the duration as far as steps become longer, if that
  /// is free.
  double FinishSlopes(const SmoothMaximum& maximum) {
    if (maximum.sum() == 0) added.clear();  // All slopes are 0.
    for (const AddedStep& step : added) {
      const double since =
          portable::Exp(problem.solver.sharpness * (step.largest_so_far - maximum.largest()));
      for (std::size_t s = 0; s < Index(table.stages); ++s)
        step.slope[s * step.stride] *= since / maximum.sum();
    }
    const double stretched = stretched_sum;
    added.clear();
    stretched_sum = 0;
    return stretched > 0
               ? duration.growth() * stretched / (problem.solver.sharpness * maximum.sum())
               : 0;
  }

  /// Whether a step becomes longer with the duration.
  [[nodiscard]] bool IsStretched(int step) const {
    return duration.is_free() && step < table.motion_steps &&
           table.time[Index(table.PointOf(step, 0))] > duration.stretched_from_s() - 1e-9;
  }

  /// The discrete adjoint of Forward, kLanes outputs at a time. Row 0 of the gradient is the cost,
  /// row 1 + j the torque excess of joint j, the next row the core excess, and the last row the
  /// clearance excess, whose gradient is known already.
  void Backward(const RolloutResult& result, std::span<double> gradient) {
    if (table.classical) return Backward<kClassical>(result, gradient);
    Backward<kDormandPrince>(result, gradient);
  }

  template <const Tableau& kScheme>
  void Backward(const RolloutResult& result, std::span<double> gradient) {
    std::fill(gradient.begin(), gradient.end(), 0.0);
    std::copy(clearance_gradient.begin(), clearance_gradient.end(),
              gradient.last(Index(parameters)).begin());
    pullback = {};
    int lanes = 0;
    for (int output = 0; output <= na + 1; ++output) {
      if (output > na && !(result.core_excess > -1)) continue;
      if (output > 0 && output <= na && !SetTorqueLane(output - 1, pullback.lanes[Index(lanes)])) {
        continue;
      }
      if (output > na) pullback.core_lane = lanes;
      pullback.lanes[Index(lanes++)].output = output;
      if (lanes == kLanes) {
        PullBack<kScheme>(gradient);
        pullback = {};
        lanes = 0;
      }
    }
    if (lanes > 0) PullBack<kScheme>(gradient);
  }

  struct Lane {
    int output = -1;   // none
    double limit = 0;  // of the joint whose torque it is of
  };
  struct Pullback {
    Pullback() {
      adjoint.fill(Lanes::Zero());
      for (auto& block : y_bar) block.fill(Lanes::Zero());
      for (auto& control : controls) control.fill(Lanes::Zero());
    }
    std::array<Lane, kLanes> lanes;
    int core_lane = -1;  // of the penetration's output; -1: none
    std::array<Lanes, kStates> adjoint;
    std::array<std::array<Lanes, kStates>, Tableau::kMaxStages> y_bar;  // by stage
    int point = 0;                                                      // of `controls`
    std::array<std::array<Lanes, 3>, kMaxDofs> controls;
  };

  /// @returns false for a joint without a limit.
  bool SetTorqueLane(int joint, Lane& lane) const {
    lane.limit = problem.joints[Index(joint)].limits.torque_max_nm;
    return std::isfinite(lane.limit);
  }

  template <const Tableau& kScheme>
  void PullBack(std::span<double> gradient) {
    lane_gradient.assign(Index(parameters), Lanes::Zero());
    std::size_t instant = instants.size();
    AddInstantSlopes(table.steps(), instant);
    std::array<Lanes, kStates> total;
    for (int step = table.steps() - 1; step >= 0; --step) {
      std::copy_n(pullback.adjoint.begin(), 2 * nf, total.begin());
      for (int s = static_cast<int>(kScheme.own_stages()) - 1; s >= 0; --s) {
        PullBackStage<kScheme>(step, s);
        for (int i = 0; i < 2 * nf; ++i) total[Index(i)] += pullback.y_bar[Index(s)][Index(i)];
      }
      std::copy_n(total.begin(), 2 * nf, pullback.adjoint.begin());
      AddInstantSlopes(step, instant);
    }
    AddToParameters();
    for (const FreeStart::Rate& rate : start.rates()) {
      lane_gradient[Index(rate.parameter)] +=
          pullback.adjoint[Index(nf + robot.FreeIndexOf(rate.dof))];
    }
    for (int lane = 0; lane < kLanes; ++lane) {
      const int output = pullback.lanes[Index(lane)].output;
      if (output < 0) continue;
      for (int k = 0; k < parameters; ++k)
        gradient[Index(output * parameters + k)] = lane_gradient[Index(k)][lane];
      if (duration.is_free() && output > 0)
        gradient[Index((output + 1) * parameters - 1)] += excess_slopes[Index(output - 1)];
    }
  }

  /// The cost, when it is among the outputs, has the first lane.
  [[nodiscard]] bool has_cost() const { return pullback.lanes[0].output == 0; }

  /// Adds the derivatives of the cost in the instants before `end` at which this step begins.
  void AddInstantSlopes(int step, std::size_t& end) {
    for (; end > 0 && table.step_at[end - 1] == step; --end) {
      if (has_cost()) AddInstantSlopes(end - 1);
    }
  }
  void AddInstantSlopes(std::size_t instant) {
    const CostPoint here = InstantAt(instant);
    const bool moving = !instants[instant].held;
    if (moving) CollectControlsAt(PointOf(instant));
    for (std::size_t i = 0; i < problem.cost.size(); ++i) {
      const CostTerm& term = problem.cost[i];
      if (!instants[instant].Has(term)) continue;
      SceneDynamics::Numbers by_q{}, by_qd{};
      term.AddSlopes(term.weight, here, {by_q, by_qd, {}});
      AddStateSlopes(by_q, by_qd, moving, pullback.adjoint);
      if (!term.draws()) continue;
      for (std::size_t r = 0; r < start.rates().size(); ++r) {
        const double by_target = -2 * std::sqrt(term.weight) * term.Residual(here);
        lane_gradient[Index(start.rates()[r].parameter)].Add(0,
                                                             by_target * start.TargetSlope(i, r));
      }
    }
  }

  /// Adds the derivatives of the cost's weighted integrals in a recorded stage.
  /// @param dt  weight of the stage in the integrals.
  void AddRunningSlopes(std::size_t stage, double dt, const CostSlopes& slopes) const {
    const CostPoint there = RecordedAt(stage);
    for (const RunningTerm& term : running) term.AddSlopes(term.weight * dt, there, slopes);
  }

  /// The derivatives of the outputs in the torque of joint j at a stage.
  /// @param of_cost  the derivative of the cost, whose lane is the first; 0 where it is not pulled
  /// back.
  Lanes TorqueSlopes(int step, int s, int j, double of_cost) const {
    Lanes slopes = Lanes::Zero();
    slopes.Add(0, of_cost);
    for (int i = 0; i < kLanes; ++i) {
      const Lane& lane = pullback.lanes[Index(i)];
      if (lane.output == 1 + j)
        slopes.Add(i, torque_slope[StageOf(step, s) * Index(na) + Index(j)] / lane.limit);
    }
    return slopes;
  }

  /// Computes y_bar of a stage from the adjoint of its step and y_bar of the stage after it.
  template <const Tableau& kScheme>
  void PullBackStage(int step, int s) {
    constexpr int kStages = static_cast<int>(kScheme.own_stages());
    const double h = table.length[Index(step)];
    // k_bar = h b_s lambda + h sum_r a_rs y_bar_r
    std::array<Lanes, kStates> k_bar;
    const double b = h * kScheme.b[Index(s)];
    for (int i = 0; i < 2 * nf; ++i) k_bar[Index(i)] = b * pullback.adjoint[Index(i)];
    const int last = kScheme.chained() ? std::min(s + 2, kStages) : kStages;
    for (int r = s + 1; r < last; ++r) {
      const double a = h * kScheme.a[Index(r)][Index(s)];
      for (int i = 0; i < 2 * nf; ++i) k_bar[Index(i)] += a * pullback.y_bar[Index(r)][Index(i)];
    }
    if (IsStretched(step)) AddStretch(step, s, b, k_bar);
    std::array<Lanes, kStates>& y_bar = pullback.y_bar[Index(s)];
    // The record of the stage is a matrix with rows of nd numbers (StoreStage).
    const std::size_t stage = StageOf(step, s);
    const double* record = &stages[stage * Index(stage_size)];
    const auto row_times = [&](int row, const std::array<Lanes, kMaxDofs>& v) {
      const double* entry = record + Index(row * nd);
      Lanes sum = entry[0] * v[0];
      for (int i = 1; i < nd; ++i) sum += entry[i] * v[Index(i)];
      return sum;
    };
    std::array<Lanes, kMaxDofs> r, w;  // the cotangents of g's outputs, and R^T r
    for (int i = 0; i < nf; ++i) r[Index(i)] = k_bar[Index(nf + i)];
    // The integrals of the cost also depend on the stage directly.
    std::array<double, kMaxJoints> by_torque{};
    SceneDynamics::Numbers by_q, by_qd;
    const bool by_state = running_of_state && has_cost();
    if (by_state) by_q.fill(0), by_qd.fill(0);
    if (has_cost()) AddRunningSlopes(stage, b, {by_q, by_qd, by_torque});
    for (int j = 0; j < na; ++j) r[Index(nf + j)] = TorqueSlopes(step, s, j, by_torque[Index(j)]);
    for (int i = 0; i < nf; ++i) w[Index(i)] = row_times(i, r);
    for (int j = 0; j < na; ++j) w[Index(nf + j)] = r[Index(nf + j)];
    for (int i = 0; i < nf; ++i) {
      y_bar[Index(i)] = row_times(nd + i, w);
      y_bar[Index(nf + i)] = k_bar[Index(i)] + row_times(2 * nd + i, w);
    }
    const int core_lane = pullback.core_lane;
    const double core_scale = core_lane >= 0 ? depth_slope[stage] : 0;
    const double* const core = core_scale != 0 ? &core_slope[stage * Index(nd)] : nullptr;
    for (int i = 0; core != nullptr && i < nf; ++i)
      y_bar[Index(i)].Add(core_lane, core_scale * core[i]);
    const bool moving = step < table.motion_steps;
    // Stages at the same time have the same weights, so their controls are summed first.
    if (moving) CollectControlsAt(table.PointOf(step, s));
    for (int j = 0; moving && j < na; ++j) {
      auto& control = pullback.controls[Index(j)];
      control[0] += row_times(nd + nf + j, w);
      control[1] += row_times(2 * nd + nf + j, w);
      control[2] += row_times(nf + j, r);
      if (core != nullptr) control[0].Add(core_lane, core_scale * core[nf + j]);
    }
    if (moving && !curved.empty()) AddCurveSlopes(stage);
    if (by_state) AddStateSlopes(by_q, by_qd, moving, y_bar);
  }

  /// Adds what a stage's share in its step has as derivative by the duration, as the step grows.
  /// @param b      weight of the stage in the integrals.
  /// @param k_bar  cotangent of the state's slope.
  void AddStretch(int step, int s, double b, const std::array<Lanes, kStates>& k_bar) {
    const std::size_t stage = StageOf(step, s);
    const double* const slope = &stages[(stage + 1) * Index(stage_size) - Index(2 * nf)];
    Lanes sum = Lanes::Zero();
    for (int i = 0; i < 2 * nf; ++i) sum += slope[i] * k_bar[Index(i)];
    if (has_cost()) {
      const CostPoint there = RecordedAt(stage);
      for (const RunningTerm& term : running)
        sum.Add(0, term.weight * term.Accumulate(0, b, there));
    }
    lane_gradient.back() += duration.growth() * sum;
  }

  /// Adds the derivatives of torque-speed curves in the joints' velocities at a stage.
  void AddCurveSlopes(std::size_t stage) {
    for (std::size_t c = 0; c < curved.size(); ++c) {
      const int j = curved[c];
      const double by_velocity = problem.joints[Index(j)].motor.curve_by_velocity();
      for (int i = 0; i < kLanes; ++i) {
        if (pullback.lanes[Index(i)].output != 1 + j) continue;
        pullback.controls[Index(j)][1].Add(i, by_velocity * curve_slope[stage * curved.size() + c]);
      }
    }
  }

  /// From here on, cotangents of the controls are those at this point.
  void CollectControlsAt(int point) {
    if (point == pullback.point) return;
    AddToParameters();
    pullback.point = point;
  }

  /// Adds derivatives of the cost in positions and velocities of a stage or an instant.
  void AddStateSlopes(const SceneDynamics::Numbers& by_q, const SceneDynamics::Numbers& by_qd,
                      bool moving, std::array<Lanes, kStates>& y_bar) {
    for (int i = 0; i < nf; ++i) {
      const std::size_t dof = Index(robot.free[Index(i)]);
      y_bar[Index(i)].Add(0, by_q[dof]);
      y_bar[Index(nf + i)].Add(0, by_qd[dof]);
    }
    for (int j = 0; moving && j < na; ++j) {
      const std::size_t dof = Index(actuated[Index(j)]);
      pullback.controls[Index(j)][0].Add(0, by_q[dof]);
      pullback.controls[Index(j)][1].Add(0, by_qd[dof]);
    }
  }

  /// Adds the cotangents of the controls to those of the parameters, and clears them.
  void AddToParameters() {
    for (int j = 0; j < na; ++j) {
      const ControlWeights& w = WeightsOf(j, Index(pullback.point));
      const int begin = std::max(0, 3 - w.first);
      const int end =
          std::min(problem.degree + 1, 3 + problem.joints[Index(j)].free_points() - w.first);
      auto& bar = pullback.controls[Index(j)];
      for (int i = begin; i < end; ++i) {
        lane_gradient[Index(first_parameter[Index(j)] + w.first - 3 + i)] +=
            w.w[0][Index(i)] * bar[0] + w.w[1][Index(i)] * bar[1] + w.w[2][Index(i)] * bar[2];
      }
      if (duration.is_free()) {
        const PathPoint& slope = control_slopes[Index(pullback.point * na + j)];
        lane_gradient.back() += slope.q * bar[0] + slope.qd * bar[1] + slope.qdd * bar[2];
      }
      bar.fill(Lanes::Zero());
    }
  }

  Problem problem;
  std::unique_ptr<ForwardSensitivity> forward;  // null: gradients are by the adjoint
  SceneDynamics robot;
  int nf, na, nd;  // numbers of free, actuated and all degrees of freedom
  int parameters;
  std::vector<int> actuated;  // degree of freedom of each joint
  std::vector<int> order;     // the free ones, then `actuated`
  ClearanceConstraint clearance;
  std::vector<double> clearance_gradient;
  double longest_step_s;  // as asked for
  SmoothDepth depth;
  std::vector<CostInstant> instants;
  FreeStart start;
  FreeDuration duration;
  StepGrid grid;  // which a free duration stretches
  Timetable table;
  LookPoints look_points{kClassical, 0};
  std::vector<const StepPoints*> points_in;  // each step
  std::vector<ControlWeights> weights;       // by size of spline, then point
  std::vector<std::size_t> weights_of;       // for each joint, the index of its size in `weights`
  std::vector<int> first_parameter;          // of each joint
  std::vector<PathPoint> controls;           // by point, then joint
  std::vector<PathPoint> control_slopes;     // by the duration if that is free, likewise
  std::vector<double> excess_slopes;         // of AddSteps: by joint, then the depth's
  std::vector<double> stage_torque;          // by stage, then joint
  std::vector<double> torque_slope;          // of its smooth maximum, likewise, times the limit
  std::vector<int> curved;                   // joints whose limit depends on their speed
  std::vector<double> stage_curve;           // OnCurve: by stage, then in `curved`
  std::vector<double> curve_slope;           // of the smooth maximum by it, likewise
  std::vector<double> stage_depth;           // by stage
  std::vector<double> depth_slope;           // of the smooth maximum of the depth: by stage
  std::vector<double> core_slope;            // of the depth: by stage, then in `order`
  std::vector<double> highest_in;            // of AddSteps: the largest value at a stage, by step
  /// Of AddSteps: the steps that count, where their slopes are, and the largest value up to each.
  struct AddedStep {
    double* slope;
    std::size_t stride;
    double largest_so_far;
  };
  std::vector<AddedStep> added;
  /// Of AddSteps: the part of the maximum's sum that is over steps that are stretched.
  double stretched_sum = 0;
  std::vector<double> stages;  // of StoreStage: by stage
  int stage_size = 0;
  Pullback pullback;
  std::vector<Lanes> lane_gradient;
  Derivatives derivatives;
  std::vector<State> instant_states;
  std::vector<RunningTerm> running;
  bool running_of_state = false;       // whether any of `running` depends on more than torques
  std::vector<double> running_states;  // of StoreRunning: by stage
};

Rollout::Rollout(const Problem& problem, double step_s,
                 std::unique_ptr<ContactForces<Plane>> contact)
    : implementation_(std::make_unique<Implementation>(problem, step_s, std::move(contact))) {}
Rollout::~Rollout() = default;
Rollout::Rollout(Rollout&&) noexcept = default;

int Rollout::parameter_count() const { return implementation_->parameters; }
int Rollout::output_count() const { return 3 + implementation_->na; }

RolloutResult Rollout::Run(std::span<const double> x) {
  return implementation_->Forward(x, Implementation::Scheme::kRungeKutta);
}

RolloutResult Rollout::Estimate(std::span<const double> x) {
  return implementation_->Forward(x, Implementation::Scheme::kSemiImplicitEuler);
}

RolloutResult Rollout::Run(std::span<const double> x, std::span<double> gradient) {
  if (gradient.size() != Index(output_count()) * Index(parameter_count())) {
    throw std::invalid_argument(
        "the gradient has a row for each output, a number for each parameter in it");
  }
  if (implementation_->forward) return implementation_->forward->Run(x, gradient);
  RolloutResult result = implementation_->Forward(x, Implementation::Scheme::kRecordedRungeKutta);
  if (!result.finite) {
    std::fill(gradient.begin(), gradient.end(), 0.0);
    return result;
  }
  implementation_->Backward(result, gradient);
  return result;
}

void Rollout::Use(const StepGrid& grid) {
  Implementation& m = *implementation_;
  const double motion_s = std::accumulate(grid.motion.begin(), grid.motion.end(), 0.0);
  const double settling_s = std::accumulate(grid.settling.begin(), grid.settling.end(), 0.0);
  const auto same = [](double sum_s, double span_s) {
    return std::abs(sum_s - span_s) <= 1e-9 * (1 + span_s);
  };
  const bool free = m.duration.is_free();
  if (!(free ? motion_s > m.duration.stretched_from_s() : same(motion_s, m.problem.duration_s)) ||
      !same(settling_s, m.problem.settle_s))
    throw std::invalid_argument("the steps do not add up to motion and settle phase");
  m.forward.reset();  // It takes equal steps.
  m.grid = grid;
  m.table = Timetable(kDormandPrince, free ? m.duration.Stretched(grid) : grid,
                      m.duration.duration_s(), m.instants);
  m.Prepare();
}

void Rollout::Visit(std::span<const double> x, double extra_s,
                    const std::function<void(const MotionSample&)>& visitor) {
  Implementation& m = *implementation_;
  const SceneDynamics& robot = m.robot;
  if (!m.SetDuration(x)) throw std::invalid_argument("the motion ends before its cost looks at it");
  m.start.Set(m.problem, x);
  m.SetControls(x);
  State y = StartState(robot, m.problem);
  MotionSample sample;
  sample.dynamics = &robot.dynamics;
  const auto visit = [&] {
    sample.q.assign(robot.q.begin(), robot.q.begin() + static_cast<std::ptrdiff_t>(robot.n));
    sample.qd.assign(robot.qd.begin(), robot.qd.begin() + static_cast<std::ptrdiff_t>(robot.n));
    sample.torque.clear();
    for (const int dof : m.actuated) sample.torque.push_back(robot.tau[Index(dof)]);
    sample.contacts = robot.contact->active();
    visitor(sample);
  };
  const Timetable& table = m.table;
  const double settle_step_s =
      table.settles()
          ? *std::max_element(table.length.begin() + table.motion_steps, table.length.end())
          : m.longest_step_s;
  const EvenSteps extra(extra_s, settle_step_s);
  const int steps = table.steps() + extra.count;
  const auto step_on = [&]<const Tableau & kScheme>(int step, double h) {
    StepRungeKutta<kScheme>(y, Index(2 * m.nf), h, [&](int s, const State& y_s, double* k) {
      m.Evaluate(y_s, table.PointOf(step, s));
      if (s == 0) visit();
      robot.TakeSlope(k);
      return true;
    });
  };
  double held_s = 0;  // since the end of the motion
  for (int step = 0; step <= steps; ++step) {
    const double h = step < table.steps() ? table.length[Index(step)] : settle_step_s;
    sample.time_s = m.duration.duration_s() + held_s;
    if (step < table.motion_steps) {
      sample.time_s = table.time[Index(table.PointOf(step, 0))];
    } else {
      held_s += h;
    }
    if (table.classical) {
      step_on.template operator()<kClassical>(step, h);
    } else {
      step_on.template operator()<kDormandPrince>(step, h);
    }
  }
}

}  // namespace tumbler
