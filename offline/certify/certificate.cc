#include "offline/certify/certificate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>
#include <utility>

#include "common/core/index.h"
#include "common/files/primitive_hash.h"
#include "common/files/primitive_limits.h"
#include "common/files/printable.h"
#include "offline/model/least_squares.h"
#include "offline/problem/feed_forward_knots.h"
#include "offline/problem/link_chains.h"
#include "offline/problem/space_task.h"
#include "offline/problem/take_free.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/free_paths.h"
#include "offline/solve/lane_rollout.h"
#include "offline/solve/solve_near.h"
#include "offline/solve/start_state.h"

namespace tumbler {
namespace {

using Spline = JointMotion<double>::Spline;

/// Contact that is lost for less than this [s] counts as one contact: a foot chatters as it lands.
constexpr double kContactGap = 0.01;

/// The root's velocity along x, z and of its pitch; zero where something holds it.
std::array<double, 3> RootRatesOf(std::span<const double> qd, const PlanarRobot& robot) {
  if (robot.root_dofs < 3) return {};
  return {qd[0], qd[1], qd[2]};
}

/// Sets the velocity of the root.
void SetRates(const std::array<double, 3>& rates, PrimitivePose& pose) {
  pose.root_x_m_s = rates[0];
  pose.root_z_m_s = rates[1];
  pose.root_pitch_rad_s = rates[2];
}

/// The steps that the solver ends with for a motion: in space equal ones, elsewhere those that
/// bound the error.
std::optional<StepGrid> SolvedGrid(const Problem& problem, const std::vector<double>& x) {
  if (problem.space) return std::nullopt;
  return StepsFor(problem, x);
}

/// Rollouts with such steps, and with each step halved.
class SolvedSteps {
 public:
  SolvedSteps(const Problem& problem, std::optional<StepGrid> grid)
      : problem_(problem), grid_(std::move(grid)) {}
  [[nodiscard]] Rollout AsSolved() const { return With(problem_.solver.step_s, grid_); }
  /// The costs of motions that take the same steps.
  [[nodiscard]] std::vector<double> Costs(std::span<const std::vector<double>> x) const {
    std::vector<double> costs;
    if (LaneRollout::WhyNot(problem_)) {
      Rollout rollout = AsSolved();
      for (const std::vector<double>& motion : x) costs.push_back(rollout.Run(motion).cost);
      return costs;
    }
    LaneRollout lanes =
        grid_ ? LaneRollout(problem_, *grid_)
              : LaneRollout(problem_, problem_.solver.step_s, LanePlan::Scheme::kRungeKutta);
    for (std::size_t first = 0; first < x.size(); first += Packet::kLanes) {
      const auto packet = x.subspan(first, std::min(Packet::kLanes, x.size() - first));
      for (const RolloutResult& result : lanes.Run(packet, LaneRollout::Wanted::kCost))
        costs.push_back(result.cost);
    }
    return costs;
  }
  [[nodiscard]] Rollout Finer() const {
    return With(problem_.solver.step_s / 2, grid_ ? std::optional(Halved(*grid_)) : std::nullopt);
  }

 private:
  [[nodiscard]] Rollout With(double step_s, const std::optional<StepGrid>& grid) const {
    Rollout rollout(problem_, step_s);
    if (grid) rollout.Use(*grid);
    return rollout;
  }

  const Problem& problem_;
  std::optional<StepGrid> grid_;
};

/// Where a motion ends: the pitch [rad] of a root in the plane. In space the place [m] and the axes
/// of its frame.
std::vector<double> FinalRoot(const Problem& problem, const std::vector<double>& x,
                              Rollout rollout) {
  std::vector<double> root;
  if (!problem.space) {
    rollout.Visit(x, 0, [&](const MotionSample& sample) {
      root = {RootPitchAt(sample.q, problem.scene.robot)};
    });
    return root;
  }
  rollout.VisitInSpace(x, 0, [&](const SpaceSample& sample) {
    root.assign(sample.q.begin(), sample.q.begin() + 3);
    for (int axis = 0; axis < 3; ++axis) {
      const SpaceVector& e = sample.orientation.col(axis);
      root.insert(root.end(), {e.x(), e.y(), e.z()});
    }
  });
  return root;
}

/// The largest difference of two ends.
double Apart(const std::vector<double>& a, const std::vector<double>& b) {
  double apart = 0;
  for (std::size_t i = 0; i < a.size(); ++i) apart = std::max(apart, std::abs(a[i] - b[i]));
  return apart;
}

/// At the optimum itself the gradient is zero, and a relative error says nothing.
std::vector<double> BesideTheOptimum(std::vector<double> x) {
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += i % 2 == 0 ? 1e-3 : -1e-3;
  return x;
}

std::vector<double> CostGradient(Rollout& rollout, const std::vector<double>& x) {
  std::vector<double> gradient(Index(rollout.output_count()) * x.size());
  rollout.Run(x, gradient);
  gradient.resize(x.size());  // The first row is the cost's.
  return gradient;
}

/// An error or a gradient as a number that a file can hold: what is none becomes 1e9, as does
/// infinity.
double Finite(double error) { return error < 1e9 ? error : 1e9; }

/// The directions along which a gradient of n components is compared: each component alone where
/// there are few, else a few with all components in them, each forwards or backwards at random. A
/// component that is wrong alone is as wrong along each of those.
std::vector<std::vector<double>> DifferenceDirections(std::size_t n) {
  constexpr std::size_t kFew = 4;
  std::vector<std::vector<double>> directions(std::min(n, kFew), std::vector<double>(n));
  std::mt19937 random(1);  // Its numbers are the same everywhere.
  for (std::size_t k = 0; k < directions.size(); ++k) {
    for (std::size_t i = 0; i < n; ++i)
      directions[k][i] = n <= kFew ? (i == k ? 1 : 0) : (random() % 2 == 0 ? 1 : -1);
  }
  return directions;
}

}  // namespace

JointMotion<double>::Spline FeedForward(const Problem& problem, const TorqueSamples& samples,
                                        std::size_t joint) {
  constexpr int kTorqueDegree = kFeedForwardDegree;
  const std::vector<double> knots = FeedForwardKnots(problem.duration_s);
  const int n = static_cast<int>(knots.size()) - kTorqueDegree - 1;
  Spline spline;
  std::vector<double> points(static_cast<std::size_t>(n));
  if (spline.Assign(kTorqueDegree, knots, points) != Status::kOk) {
    throw std::logic_error("a torque spline could not be set up");
  }
  const auto rows = static_cast<Eigen::Index>(samples.time_s.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows, n);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Spline::Weights weights =
        spline.EvaluateWeights(samples.time_s[static_cast<std::size_t>(i)]);
    for (int k = 0; k <= kTorqueDegree; ++k)
      A(i, weights.first + k) = weights.w[0][static_cast<std::size_t>(k)];
  }
  const Eigen::Map<const Eigen::VectorXd> b(samples.torque_nm[joint].data(), rows);
  const Eigen::VectorXd fit = SolveLeastSquares(A, b);
  const double limit = problem.joints[joint].limits.torque_max_nm;
  for (int i = 0; i < n; ++i)
    points[static_cast<std::size_t>(i)] = std::clamp(fit[i], -limit, limit);
  if (problem.held_torque == HeldTorque::kRest)
    points.back() = std::clamp(samples.rest_nm[joint], -limit, limit);
  if (spline.Assign(kTorqueDegree, knots, points) != Status::kOk) {
    throw std::runtime_error("the plan's torques cannot be fitted: a value is not finite");
  }
  return spline;
}

double ExitAfter(const Problem& problem) {
  if (problem.ends_moving()) return 0;
  return problem.scene.robot.hinged() ? problem.settle_s : kExitAfter_s;
}

double SettlingAfter(const Problem& problem) {
  return std::max(0.0, ExitAfter(problem) - problem.settle_s);
}

GradientCheck CompareGradient(const CostsOf& costs, const std::vector<double>& at,
                              const std::vector<double>& gradient) {
  double largest = 0;
  for (const double component : gradient) largest = std::max(largest, std::abs(component));
  const std::vector<std::vector<double>> directions = DifferenceDirections(at.size());
  const auto size = [](const std::vector<double>& direction) {
    double sum = 0;
    for (const double component : direction) sum += std::abs(component);
    return sum;
  };
  // The whole displacement has the length of the step.
  const auto distance = [&](double step, const std::vector<double>& direction) {
    return step / std::sqrt(size(direction));
  };
  std::vector<std::vector<double>> points;
  for (const double step : GradientCheck::kSteps) {
    for (const std::vector<double>& direction : directions) {
      for (const double sign : {1.0, -1.0}) {
        std::vector<double>& x = points.emplace_back(at);
        for (std::size_t i = 0; i < at.size(); ++i) {
          if (direction[i] != 0) x[i] += sign * distance(step, direction) * direction[i];
        }
      }
    }
  }
  const std::vector<double> cost = costs(points);
  GradientCheck check;
  std::size_t point = 0;
  for (std::size_t s = 0; s < check.errors.size(); ++s) {
    double worst = 0, scale = largest;
    for (const std::vector<double>& direction : directions) {
      double slope = 0;
      for (std::size_t i = 0; i < at.size(); ++i) slope += direction[i] * gradient[i];
      const double difference =
          (cost[point] - cost[point + 1]) / (2 * distance(GradientCheck::kSteps[s], direction));
      point += 2;
      scale = std::max(scale, std::abs(difference) / size(direction));
      const double wrong = std::abs(difference - slope);
      // std::max would pass over one that is not a number.
      worst =
          std::isfinite(wrong) ? std::max(worst, wrong) : std::numeric_limits<double>::infinity();
    }
    // The gradient of a cost that does not depend on the motion is zero, and cannot be wrong.
    check.errors[s] = scale > 0 ? worst / scale : worst;
  }
  return check;
}

GradientBeside DifferentiateBeside(const Problem& problem, const std::vector<double>& x) {
  GradientBeside beside;
  beside.at = BesideTheOptimum(x);
  beside.grid = SolvedGrid(problem, beside.at);
  const SolvedSteps steps(problem, beside.grid);
  Rollout rollout = steps.AsSolved();
  beside.gradient = CostGradient(rollout, beside.at);
  beside.check = CompareGradient(
      [&steps](std::span<const std::vector<double>> points) { return steps.Costs(points); },
      beside.at, beside.gradient);
  return beside;
}

double GradientStepHalvingChange(const Problem& problem, const GradientBeside& beside) {
  Rollout finer = SolvedSteps(problem, beside.grid).Finer();
  const std::vector<double> reference = CostGradient(finer, beside.at);
  double change = 0, scale = 0;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    change = std::max(change, std::abs(beside.gradient[i] - reference[i]));
    scale = std::max(scale, std::abs(reference[i]));
  }
  return scale > 0 ? change / scale : change;
}

bool IsFarFromMinimum(const Problem& problem, const Solution& solution) {
  constexpr double kFar = 100;
  if (problem.space || problem.robust) return false;
  return solution.kkt.relative.value_or(0) > kFar * problem.solver.kkt_residual;
}

std::optional<KktResidual> FinerKktResidual(const Problem& problem, const std::vector<double>& x) {
  if (problem.space) return std::nullopt;
  if (problem.robust) return std::nullopt;
  StepSettings settings = AdaptiveSteps(problem);
  settings.tolerance = std::max(settings.tolerance / 100, kFinestTolerance);
  ForwardSensitivity rollout(problem, settings);
  OutputGradients outputs(rollout.output_count(), rollout.parameter_count());
  GaussNewton model;
  const RolloutResult result = rollout.Run(x, outputs, &model);
  if (!result.finite) return std::nullopt;
  const FreePaths paths(problem);
  model = paths.Reduce(std::move(model));
  return FindKktResidual(problem, paths, DerivativeLimitRows(problem), x, result,
                         paths.ReduceSlopes(std::move(outputs)), &model);
}

MotionSummarizer::MotionSummarizer(const Problem& problem, double refinement)
    : problem_(problem), every_(static_cast<int>(refinement)) {
  summary_.torque_margin_nm = std::numeric_limits<double>::infinity();
  summary_.torques.torque_nm.resize(problem.joints.size());
}

template <class Space>
void MotionSummarizer::TakeRoot(const MotionSampleIn<Space>& sample) {
  const double t = sample.time_s;
  const bool exit = t <= problem_.duration_s + ExitAfter(problem_) + 1e-9;
  if constexpr (std::is_same_v<Space, Plane>) {
    const PlanarRobot& robot = problem_.scene.robot;
    if (count_ == 0) {
      summary_.entry = PoseAt(sample.q, robot);
      SetRates(problem_.start_root_rates, summary_.entry);
    }
    summary_.exit = PoseAt(sample.q, robot);
    const std::array<double, 3> rates = RootRatesOf(sample.qd, robot);
    if (problem_.ends_moving() ||
        std::ranges::any_of(rates, [](double v) { return std::abs(v) > CostTerm::kRateTolerance; }))
      SetRates(rates, summary_.exit);
    if (t <= problem_.duration_s + 1e-9) summary_.final_pitch_rad = RootPitchAt(sample.q, robot);
    if (exit) summary_.settled_pitch_rad = RootPitchAt(sample.q, robot);
  } else {
    summary_.exit = ToPrimitivePose({sample.q, sample.orientation});
    if (count_ == 0) summary_.entry = summary_.exit;
  }
  if (!exit) return;
  summary_.settled_speed = 0;
  for (int i = 0; i < SceneIn<Space>(problem_).robot.root_dofs; ++i)
    summary_.settled_speed = std::max(summary_.settled_speed, std::abs(sample.qd[Index(i)]));
}

template <class Space>
void MotionSummarizer::Take(const MotionSampleIn<Space>& sample, double own_distance_m) {
  const double t = sample.time_s;
  TakeRoot(sample);
  if (t <= problem_.duration_s + 1e-9 && count_ % every_ == 0) TakeTorques(sample);
  ++count_;
  const bool solved = t <= problem_.duration_s + problem_.settle_s + 1e-9;
  if (solved) summary_.torques.rest_nm.assign(sample.torque.begin(), sample.torque.end());
  const SelfContact& own = problem_.self_contact();
  if (solved && std::isfinite(own_distance_m)) {
    summary_.self_clearance_m =
        std::min(summary_.self_clearance_m.value_or(own_distance_m), own_distance_m);
    if (own_distance_m < own.clearance_m - kClearanceTolerance_m) {
      summary_.excess =
          std::max(summary_.excess, (own.clearance_m - own_distance_m) / kClearanceScale_m);
    }
  }
  for (std::size_t j = 0; j < problem_.joints.size(); ++j) {
    const ActuatedJoint& joint = problem_.joints[j];
    const double torque = std::abs(sample.torque[j]);
    const double limit = joint.limits.torque_max_nm;
    const double lack = joint.motor.LackAt(sample.torque[j], sample.qd[Index(joint.dof)]);
    summary_.peak_torque_nm = std::max(summary_.peak_torque_nm, torque);
    summary_.torque_margin_nm = std::min(summary_.torque_margin_nm, limit * (1 - lack) - torque);
    if (solved) summary_.excess = std::max(summary_.excess, torque / limit + lack - 1);
  }
  TakeContacts(sample, solved);
}

template <class Space>
void MotionSummarizer::TakeTorques(const MotionSampleIn<Space>& sample) {
  summary_.torques.time_s.push_back(std::min(sample.time_s, problem_.duration_s));
  for (std::size_t j = 0; j < problem_.joints.size(); ++j)
    summary_.torques.torque_nm[j].push_back(sample.torque[j]);
}

template <class Space>
void MotionSummarizer::TakeContacts(const MotionSampleIn<Space>& sample, bool solved) {
  const SceneOf<Space>& scene = SceneIn<Space>(problem_);
  const double t = sample.time_s;
  for (const ActiveContact<Space>& contact : sample.contacts) {
    summary_.peak_penetration_m = std::max(summary_.peak_penetration_m, contact.depth_m);
    if (solved) {
      summary_.excess = std::max(summary_.excess, contact.depth_m / scene.contact.d_on_m - 1);
    }
    if (t > problem_.duration_s + problem_.settle_s) continue;
    auto& list = intervals_[{contact.shape, contact.obstacle, contact.other_shape}];
    if (list.empty() || t - list.back().end_s > kContactGap) {
      list.push_back(
          {scene.robot.shapes[Index(contact.shape)].name, TouchedName(scene, contact), t, t, 0});
    }
    list.back().end_s = t;
    list.back().peak_normal_force_n =
        std::max(list.back().peak_normal_force_n, contact.normal_force_n);
  }
}

template void MotionSummarizer::Take(const MotionSample&, double);
template void MotionSummarizer::Take(const SpaceSample&, double);

MotionSummary MotionSummarizer::Finish() {
  // The splines start and end exactly where the task says; a sum over basis functions rounds.
  for (std::size_t j = 0; j < problem_.joints.size(); ++j) {
    summary_.entry.joint_positions_rad[j] = problem_.joints[j].start_rad;
    summary_.exit.joint_positions_rad[j] = problem_.joints[j].end_rad;
  }
  summary_.core_reached = summary_.peak_penetration_m >= problem_.contact().d_on_m;
  for (auto& entry : intervals_) {
    summary_.contacts.insert(summary_.contacts.end(), entry.second.begin(), entry.second.end());
  }
  std::stable_sort(summary_.contacts.begin(), summary_.contacts.end(),
                   [](const auto& a, const auto& b) { return a.start_s < b.start_s; });
  return std::move(summary_);
}

MotionSummary Summarize(Problem problem, std::vector<double> x) {
  TakeFree(problem, x);
  const double refinement = RefinementOf(problem);
  MotionSummarizer summarizer(problem, refinement);
  VisitWithOwnDistance(problem, x, problem.solver.step_s / refinement,
                       [&](const auto& sample, const SelfClearance& /*own*/, double least_m) {
                         summarizer.Take(sample, least_m);
                       });
  return summarizer.Finish();
}

namespace {

/// By how much the worst of all limits is exceeded, relative to the limit (positions in rad); 0
/// when none is. It is computed from the primitive's splines and their simulation alone,
/// independently of the solver.
double LargestExcess(const Primitive<double>& primitive, const MotionSummary& summary) {
  double excess = std::max(0.0, summary.excess);
  for (const JointMotion<double>& motion : primitive.motions()) {
    const auto bounds = BoundsOf(motion, motion.limits);
    const auto beyond = [](const Bound& bound) {
      return std::max(bound.path.max - bound.max, bound.min - bound.path.min);
    };
    excess = std::max({excess, beyond(bounds[0]), beyond(bounds[1]) / bounds[1].max,
                       beyond(bounds[2]) / bounds[2].max});
  }
  return excess;
}

}  // namespace

PrimitiveFile MakePrimitiveFile(const Task& task, const SolveOutcome& outcome,
                                const Solution& solution) {
  return MakePrimitiveFile(task, outcome, solution, Summarize(task.problem, solution.x),
                           DifferentiateBeside(task.problem, solution.x));
}

PrimitiveFile MakePrimitiveFile(const Task& task, const SolveOutcome& outcome,
                                const Solution& solution, const MotionSummary& summary,
                                const GradientBeside& beside) {
  const Problem& problem = task.problem;
  PrimitiveFile file;
  Primitive<double>& primitive = file.primitive;
  primitive.name = FixedString<48>(problem.name);
  primitive.duration_s = problem.duration_s;
  primitive.settle_s = problem.settle_s;
  primitive.entry_tolerance_rad = problem.entry_tolerance_rad;
  primitive.following_tolerance_rad = problem.following_tolerance_rad;
  primitive.joint_count = static_cast<int>(problem.joints.size());
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    JointMotion<double>& motion = primitive.joints[j];
    const ActuatedJoint& joint = problem.joints[j];
    motion.name = FixedString<32>(problem.joint_name(j));
    motion.limits = joint.limits;
    motion.position = PositionSpline(problem, solution.x, j);
    motion.torque = FeedForward(problem, summary.torques, j);
  }
  primitive.feedback = solution.feedback;
  if (primitive.feedback.present()) file.chains = LinkChainsOf(problem.scene.robot);
  file.entry = summary.entry;
  file.exit = summary.exit;
  file.contacts = summary.contacts;

  Certificate& certificate = file.certificate;
  const GradientCheck& check = beside.check;
  certificate.gradient_error = Finite(check.relative_error());
  certificate.gradient_difference_steps_rad = GradientCheck::kSteps;
  std::transform(check.errors.begin(), check.errors.end(), certificate.gradient_errors.begin(),
                 Finite);
  certificate.gradient_step_halving_change = Finite(GradientStepHalvingChange(problem, beside));
  certificate.projected_gradient = Finite(solution.kkt.absolute);
  if (IsFarFromMinimum(problem, solution)) {
    certificate.kkt_residual = solution.kkt.relative;
  } else if (const auto kkt = FinerKktResidual(problem, solution.x)) {
    certificate.kkt_residual = kkt->relative;
  }
  certificate.constraint_violation = LargestExcess(primitive, summary);
  const SolvedSteps steps(problem,
                          solution.steps ? solution.steps : SolvedGrid(problem, solution.x));
  certificate.step_halving_error_rad = Apart(FinalRoot(problem, solution.x, steps.AsSolved()),
                                             FinalRoot(problem, solution.x, steps.Finer()));
  if (problem.target_pitch_rad)
    certificate.settled_pitch_error_rad = summary.settled_pitch_rad - *problem.target_pitch_rad;
  certificate.peak_torque_nm = summary.peak_torque_nm;
  certificate.peak_penetration_m = summary.peak_penetration_m;
  certificate.self_clearance_m = summary.self_clearance_m;
  const LimitMargins margins = MarginsOf(primitive);
  certificate.position_margin_rad = margins.position_rad;
  certificate.velocity_margin_rad_s = margins.velocity_rad_s;
  certificate.acceleration_margin_rad_s2 = margins.acceleration_rad_s2;
  certificate.torque_margin_nm = summary.torque_margin_nm;

  if (problem.robust || problem.drives) file.drives = problem.drive_gains();
  Provenance& provenance = file.provenance;
  provenance.tool = fmt::format("tumbler optimize {}", TUMBLER_VERSION);
  provenance.seed = problem.search.seed;
  provenance.objective = solution.rollout.cost;
  provenance.evaluations = outcome.evaluations;
  provenance.robot_file = PrintableInLine(task.robot_file);
  if (!task.robot_change.empty()) provenance.robot_file += " " + task.robot_change;
  provenance.task_file = PrintableInLine(task.task_file);
  provenance.robot_urdf = task.robot_text;
  provenance.task_toml = task.task_text;
  provenance.robot_hash = HashOfText(task.robot_text);
  provenance.task_hash = HashOfText(task.task_text);
  provenance.start_file = task.start_file;
  provenance.start_hash = task.start_hash;
  provenance.guess_file = PrintableInLine(task.guess_file);
  provenance.guess_hash = task.guess_hash;
  for (const std::string& other : task.complement_files)
    provenance.complement_files.push_back(PrintableInLine(other));
  provenance.complement_hashes = task.complement_hashes;
  return file;
}

}  // namespace tumbler
