#include "offline/certify/task_result.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <utility>

#include "offline/certify/driven_motion.h"
#include "offline/certify/progress.h"
#include "offline/certify/space_robust.h"
#include "offline/certify/space_trial.h"
#include "offline/problem/take_free.h"
#include "offline/solve/guess.h"
#include "offline/solve/robot_loss.h"
#include "offline/solve/robust_search.h"
#include "offline/solve/search_in_space.h"

namespace tumbler {
namespace {

/// @param clock  of the process, or of the thread that asks.
double CpuSeconds(clockid_t clock = CLOCK_PROCESS_CPUTIME_ID) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// True when a free robot never touches any obstacle of the task, so that the motion says nothing
/// about contact. One that is held may be there to pass beside them.
bool MissesEveryObstacle(const Problem& problem, const Solution& best) {
  const PlanarRobot& robot = problem.scene.robot;
  const bool free = problem.space || (robot.root_dofs > 0 && !robot.hinged());
  return free && !problem.in_empty_space() && !best.rollout.any_contact;
}

/// Whether gains were asked for, and none were searched because a limit stands in the way.
bool LacksFeedback(const Problem& problem, const Solution& solution) {
  return problem.robust && problem.robust->feedback && solution.end == SolveEnd::kTaken &&
         !solution.feedback.present();
}

/// The reason why nothing was found, and the remedy.
std::string Cause(const Problem& problem, const Solution& best) {
  if (best.evaluations == 0) return "no motion had been found yet";
  if (!best.rollout.finite)
    return "the best motion leaves every plausible range; use a smaller solver.step_s";
  if (MissesEveryObstacle(problem, best)) {
    return "no contact was ever active: the robot touches no obstacle; check start.z_m and the "
           "obstacles (a flight needs none: obstacle = [])";
  }
  const bool exceeds = best.constraint_violation > kNoViolation;
  if (LacksFeedback(problem, best) || (exceeds && best.end == SolveEnd::kTaken)) {
    return fmt::format(
        "the guess, whose path is taken as it is, exceeds a limit here: {} by {:.2g} %; give a "
        "guess that keeps the limits of this task in its duration_s, {:.6g} s (its own may be "
        "another), or let a path be found, without [robust.feedback]",
        best.worst_constraint, 100 * best.constraint_violation, problem.duration_s);
  }
  if (exceeds) {
    return fmt::format(
        "the best motion exceeds a limit: {} by {:.2g} % ({}); give it more duration_s, looser "
        "limits, or {}",
        best.worst_constraint, 100 * best.constraint_violation, ToString(best.end),
        problem.space    ? "another --seed"
        : problem.robust ? "more robust.starts or robust.generations"
                         : "more search.max_samples or solver.max_evaluations");
  }
  if (best.core_reached) {
    return fmt::format(
        "the best motion drives a contact {:.1f} mm deep, through the {:.1f} mm layer to the core; "
        "use a larger contact.stiffness_n_per_m or contact.d_on_m, or {}",
        1e3 * best.rollout.peak_penetration_m, 1e3 * problem.contact().d_on_m,
        problem.space ? "another --seed" : "more search.max_samples");
  }
  return ToString(best.end);
}

/// Makes the duration of a solution that of the problem.
void TakeFree(Problem& problem, Solution& solution) {
  if (solution.duration_s) problem.duration_s = *solution.duration_s;
  TakeFree(problem, solution.x);
}

/// The second looks at the solutions of a problem, each of which is done once. Safe for use from
/// several threads.
class Looks {
 public:
  explicit Looks(const Problem& problem) : problem_(problem) {}
  FineLook At(Solution solution) {
    Problem problem = problem_;
    TakeFree(problem, solution);
    const Motion motion{problem.duration_s, solution.x};
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (const auto known = of_motion_.find(motion); known != of_motion_.end())
        return known->second;
    }
    const double start_s = CpuSeconds(CLOCK_THREAD_CPUTIME_ID);
    FineLook look = LookFinely(problem, solution.x);
    const std::lock_guard<std::mutex> lock(mutex_);
    cpu_s_ += CpuSeconds(CLOCK_THREAD_CPUTIME_ID) - start_s;
    return of_motion_.emplace(motion, std::move(look)).first->second;
  }
  /// The gradient of the cost beside a solution.
  GradientBeside GradientAt(Solution solution) {
    Problem problem = problem_;
    TakeFree(problem, solution);
    const Motion motion{problem.duration_s, solution.x};
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (const auto known = gradients_.find(motion); known != gradients_.end())
        return known->second;
    }
    const double start_s = CpuSeconds(CLOCK_THREAD_CPUTIME_ID);
    GradientBeside beside = DifferentiateBeside(problem, solution.x);
    const std::lock_guard<std::mutex> lock(mutex_);
    cpu_s_ += CpuSeconds(CLOCK_THREAD_CPUTIME_ID) - start_s;
    return gradients_.emplace(motion, std::move(beside)).first->second;
  }
  /// The time that all of them took together.
  [[nodiscard]] double cpu_s() const { return cpu_s_; }

 private:
  using Motion = std::pair<double, std::vector<double>>;  // its duration and parameters
  const Problem& problem_;
  std::mutex mutex_;
  std::map<Motion, FineLook> of_motion_;
  std::map<Motion, GradientBeside> gradients_;
  double cpu_s_ = 0;
};

/// Whether the solver's figures speak for a motion.
bool KeepsLimits(const Problem& problem, const Solution& solution) {
  return !solution.x.empty() && solution.feasible() && !MissesEveryObstacle(problem, solution) &&
         !LacksFeedback(problem, solution);
}

/// How a solve ended, given the Kuhn-Tucker residual by finer steps: a motion is not at a minimum
/// when they do not say so.
SolveEnd EndByFinerSteps(const Problem& problem, const Solution& solution,
                         const std::optional<double>& residual) {
  return solution.end == SolveEnd::kConverged && residual.value_or(0) > problem.solver.kkt_residual
             ? SolveEnd::kConvergedCoarsely
             : solution.end;
}

/// What else may help where a target is missed.
const char* WiderBounds(const Problem& problem) {
  if (!problem.free_start_coordinates().empty())
    return "; or wider bounds of the velocities in [start]";
  return problem.free_duration ? "; or wider bounds of the duration" : "";
}

/// What may help a robot that stays with exact joints, and leaves as drives play the motion.
std::string StifferDrives(const Problem& problem, const DriveGains& drives) {
  const char* const table = problem.robust ? "robust" : "drives";
  return fmt::format(
      "use stiffer drives: a larger {0}.kp_nm_per_rad than {1}, and {0}.kd_nm_s_per_rad than {2}, "
      "as far as the robot's drives carry them; or let it end where it stands more firmly, on "
      "wider feet or with its mass lower",
      table, drives.kp_nm_per_rad, drives.kd_nm_s_per_rad);
}

/// Makes the file of the best motion, or says why there is none.
void MakeFile(TaskResult& result, Looks& looks) {
  Solution& best = result.best;
  FineLook fine = looks.At(best);
  result.summary = std::move(fine.summary);
  result.look = std::move(fine.look);
  if (!result.look.acceptable() && best.end == SolveEnd::kTaken) {
    result.cause = fmt::format(
        "a simulation of the guess, taken as it is, with a step of {:.3g} ms shows that it is not "
        "what the task asks for: {}; give a guess that more robots survive, or let path and gains "
        "be found: without robust.feedback.from_guess, first the path without [robust.feedback] "
        "(--guess and [mirror] may stay), then the gains with that as the guess",
        1e3 * result.look.step_s, result.look.Objections());
    return;
  }
  if (result.look.leaving && result.look.drives) {
    // It is as the task asks until the drives give way: another motion would not end elsewhere.
    result.cause = fmt::format(
        "a simulation of the best motion shows that the robot does not stay where the task asks "
        "for it: {}; {}",
        result.look.Objections(), StifferDrives(result.problem(), *result.look.drives));
    return;
  }
  if (!result.look.acceptable()) {
    result.cause = fmt::format(
        "a simulation of the best motion with a step of {:.3g} ms shows that it is not what the "
        "task asks for: {}; use another --seed or another duration_s; for a target that is "
        "missed, a larger weight or tolerance of its term; for torque or penetration, a larger "
        "solver.torque_margin or solver.core_margin{}{}",
        1e3 * result.look.step_s, result.look.Objections(),
        result.look.passive_excess > 0 ? "; for a joint without a motor, a stiffer spring, more "
                                         "damping or wider limits"
                                       : "",
        WiderBounds(result.problem()));
    return;
  }
  const GradientBeside beside = looks.GradientAt(best);
  const double start_s = CpuSeconds(CLOCK_THREAD_CPUTIME_ID);
  PrimitiveFile file = MakePrimitiveFile(result.task, result.outcome, best, result.summary, beside);
  result.look_cpu_s = CpuSeconds(CLOCK_THREAD_CPUTIME_ID) - start_s;
  file.purpose = result.look.purpose;
  best.end = EndByFinerSteps(result.problem(), best, file.certificate.kkt_residual);
  // The certificate computes independently of the solver, and decides.
  if (file.certificate.constraint_violation <= kNoViolation) {
    const std::vector<double> kd(result.problem().joints.size(),
                                 result.problem().drive_gains().kd_nm_s_per_rad);
    result.damping = DampingOf(result.problem(), file.primitive, kd);
    result.steps = ContactStepsOf(result.problem(), file.primitive, result.problem().contact(),
                                  JointMoves::kByPath);
    result.file = std::move(file);
    return;
  }
  result.cause = fmt::format(
      "the certificate finds a limit exceeded by {:.1e}, which the solver does not; this is a "
      "mistake of the program, please report it",
      file.certificate.constraint_violation);
}

/// Makes files of motions that pass the second look while the search goes on.
class InterimFiles {
 public:
  InterimFiles(const Task& task, Looks& looks, std::function<void(const PrimitiveFile&)> take)
      : task_(task), looks_(looks), take_(std::move(take)) {}

  /// Makes the file of a motion, unless it costs as much as one before.
  void Take(const Solution& solution) {
    if (!(solution.rollout.cost < least_)) return;
    if (!KeepsLimits(task_.problem, solution)) return;
    const FineLook fine = looks_.At(solution);
    if (!fine.look.acceptable()) return;
    Task task = task_;
    Solution found = solution;
    TakeFree(task.problem, found);
    SolveOutcome so_far;
    so_far.evaluations = solution.evaluations;
    PrimitiveFile file =
        MakePrimitiveFile(task, so_far, found, fine.summary, looks_.GradientAt(solution));
    if (file.certificate.constraint_violation > kNoViolation) return;
    file.purpose = fine.look.purpose;
    least_ = solution.rollout.cost;
    take_(file);
  }

 private:
  const Task& task_;
  Looks& looks_;
  std::function<void(const PrimitiveFile&)> take_;
  double least_ = std::numeric_limits<double>::infinity();
};

void ListMinima(TaskResult& result, Looks& looks) {
  result.minima = DistinctMinima(result.outcome.solutions);
  for (const LocalMinimum& minimum : result.minima) {
    Solution& solution = result.outcome.solutions[minimum.solution];
    if (solution.end == SolveEnd::kConverged) {
      Problem problem = result.problem();
      Solution found = solution;
      TakeFree(problem, found);
      if (const auto kkt = FinerKktResidual(problem, found.x))
        solution.end = EndByFinerSteps(problem, solution, kkt->relative);
    }
    FineLook fine = looks.At(solution);
    result.minima_summaries.push_back(std::move(fine.summary));
    const SecondLook look = solution.feasible() ? std::move(fine.look) : SecondLook{};
    result.minima_objections.push_back(look.acceptable() ? "" : look.Objections());
  }
}

/// A guess as it is, where it keeps the limits: what serves robots that differ is no minimum for
/// the model, and a robust search goes on from there.
SolveOutcome FromGuessInSpace(const Problem& problem, const std::vector<double>& guess,
                              const SolveOptions& options) {
  SolveOutcome outcome;
  SolveOptions silent;
  Rollout rollout(problem, problem.solver.step_s);
  Solution solution = SolveFrom(problem, guess, 1, rollout, silent, nullptr);
  solution.end = SolveEnd::kTaken;
  solution.finished = true;
  if (!solution.feasible()) return SolveInSpaceFrom(problem, guess, options);
  outcome.solutions.push_back(std::move(solution));
  outcome.evaluations = 1;
  return outcome;
}

/// Changes the best motion in space until it serves robots that differ, and puts what was found
/// before it.
/// @param accept  whether a motion can be written.
void MakeRobustInSpace(const SolveOptions& options, Looks& looks,
                       const std::function<bool(const Solution&)>& accept, TaskResult& result) {
  const Problem& problem = result.problem();
  std::vector<Solution>& solutions = result.outcome.solutions;
  const auto found = std::ranges::find_if(solutions, accept);
  if (found == solutions.end()) return;
  const Solution& model = *found;
  const std::vector<PurposeFigure> purpose = looks.At(model).look.purpose;
  const RobustInSpace robust = FindRobustInSpace(problem, model.x, purpose, options);
  result.outcome.evaluations += robust.played;
  result.outcome.interrupted = options.interrupt != nullptr && *options.interrupt;
  if (result.outcome.interrupted) return;
  const int fresh = problem.space->robust->fresh;
  const auto count = [&](const std::vector<double>& x) {
    return CountAsAskedInSpace(problem, x, purpose, options, fresh);
  };
  RobotsAsAsked& figures = result.robust.emplace();
  figures.of = fresh;
  figures.before = figures.as_asked = count(model.x);
  Rollout rollout(problem, problem.solver.step_s);
  for (const std::vector<double>& x : robust.motions) {
    if (x == model.x) return;  // Nothing serves more robots.
    SolveOptions silent;
    Solution solution = SolveFrom(problem, x, 1, rollout, silent, nullptr);
    solution.end = SolveEnd::kGenerations;
    solution.finished = true;
    solution.start = model.start;
    if (!solution.feasible() || !accept(solution)) continue;
    const int as_asked = count(x);
    if (as_asked < figures.before) continue;
    figures.as_asked = as_asked;
    solutions.insert(solutions.begin(), std::move(solution));
    return;
  }
}

/// Plays the file's motion on the model through its drives.
std::optional<SpaceTrial> PlayModel(const Problem& problem, const PrimitiveFile& file) {
  const std::vector<DueInSpace> targets = DueTargetsInSpace(problem, file.purpose);
  if (targets.empty()) return std::nullopt;
  std::vector<JointMotion<double>::Spline> feed_forward;
  for (const JointMotion<double>& motion : file.primitive.motions())
    feed_forward.push_back(motion.torque);
  PlayedRobot<Spatial> model = NominalInSpace(problem, {});
  model.period_s = SpaceRobustSettings{}.period_s;
  return TryInSpace(problem, ParametersOf(file.primitive), feed_forward, targets, {&model, 1}, 0)
      .front();
}

}  // namespace

TaskResult WorkOn(Task task, const WorkSettings& settings) {
  const auto wall_start = std::chrono::steady_clock::now();
  const double cpu_start = CpuSeconds();
  TaskResult result;
  result.task = std::move(task);
  const Problem& problem = result.problem();
  Progress progress(problem);
  const bool guessed = !result.task.guess.empty();
  CheckGuess(result.task);
  SolveOptions options;
  options.threads = settings.threads;
  options.interrupt = settings.interrupt;
  // Of the model's, a guess is solved before anybody would look at its progress.
  const bool by_robots = problem.robust || (problem.space && problem.space->robust);
  if ((!guessed || by_robots) && !settings.quiet)
    options.progress = [&progress](const Evaluation& evaluation) { progress(evaluation); };
  if (settings.progress) options.progress = settings.progress;
  Looks looks(problem);
  const auto accept = [&](const Solution& solution) {
    return looks.At(solution).look.acceptable();
  };
  // For the table of minima, every start is one of those that were asked for.
  if (!settings.minima) options.accept = accept;
  InterimFiles interim(result.task, looks, settings.interim);
  if (settings.interim && !settings.minima && !problem.robust && !problem.space)
    options.interim = [&interim](const Solution& solution) { interim.Take(solution); };
  // From a guess, another motion than the one near it would not be an answer.
  if (!settings.minima && !problem.robust && !problem.space && !guessed) {
    options.calm = [&](const Solution& solution) {
      return looks.GradientAt(solution).check.relative_error() <= kDoubtfulGradient;
    };
  }
  result.outcome =
      problem.space ? (guessed ? (problem.space->robust
                                      ? FromGuessInSpace(problem, result.task.guess, options)
                                      : SolveInSpaceFrom(problem, result.task.guess, options))
                               : SolveInSpace(problem, options))
      : problem.robust
          ? SolveRobust(problem, options, result.task.guess,
                        result.task.guess_feedback ? &*result.task.guess_feedback : nullptr,
                        result.task.complement)
      : guessed ? SolveFromGuess(problem, result.task.guess, options)
                : Solve(problem, options);
  if (problem.space && problem.space->robust && !result.outcome.interrupted) {
    MakeRobustInSpace(
        options, looks,
        [&](const Solution& solution) {
          return KeepsLimits(problem, solution) && accept(solution);
        },
        result);
  }
  progress.Finish();

  const std::vector<Solution>& solutions = result.outcome.solutions;
  const bool wanted = !result.outcome.interrupted || settings.keep_best;
  const auto found = std::ranges::find_if(solutions, [&](const Solution& solution) {
    return KeepsLimits(problem, solution) && (!wanted || accept(solution));
  });
  if (found != solutions.end()) {
    result.best = *found;
  } else if (!solutions.empty()) {
    result.best = solutions.front();
  }
  if (settings.minima) ListMinima(result, looks);
  if (!result.best.x.empty()) TakeFree(result.task.problem, result.best);
  result.usable = KeepsLimits(problem, result.best);
  if (!result.usable) {
    result.cause = Cause(problem, result.best);
  } else if (wanted) {
    MakeFile(result, looks);
    result.usable = result.file.has_value();
    if (problem.space && !problem.space->robust && result.file)
      result.through_drives = PlayModel(problem, *result.file);
  }
  result.wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - wall_start).count();
  result.cpu_s = CpuSeconds() - cpu_start;
  result.look_cpu_s += looks.cpu_s();
  return result;
}

TaskResult WorkOnGuesses(std::vector<Task> tasks, const WorkSettings& settings) {
  const auto missed = [](const TaskResult& result) {
    const std::vector<Evaluation>& history = result.outcome.history;
    return history.empty() ? std::numeric_limits<double>::infinity() : history.back().cost;
  };
  std::optional<TaskResult> best;
  double wall_s = 0, cpu_s = 0, look_cpu_s = 0;
  for (Task& task : tasks) {
    TaskResult result = WorkOn(std::move(task), settings);
    wall_s += result.wall_s;
    cpu_s += result.cpu_s;
    look_cpu_s += result.look_cpu_s;
    const bool is_last =
        result.outcome.interrupted || (result.file && missed(result) < RobotLoss::kCarried);
    const bool is_better = !best || (result.file.has_value() != best->file.has_value()
                                         ? result.file.has_value()
                                         : missed(result) < missed(*best));
    if (is_better) best = std::move(result);
    if (is_last) break;
  }
  best->wall_s = wall_s;
  best->cpu_s = cpu_s;
  best->look_cpu_s = look_cpu_s;
  return std::move(*best);
}

std::vector<const TaskResult*> Ranked(const std::vector<TaskResult>& results) {
  std::vector<const TaskResult*> order;
  order.reserve(results.size());
  for (const TaskResult& result : results) order.push_back(&result);
  std::stable_sort(order.begin(), order.end(), [](const TaskResult* a, const TaskResult* b) {
    if (a->usable != b->usable) return a->usable;
    return a->usable ? a->best.rollout.cost < b->best.rollout.cost
                     : a->best.constraint_violation < b->best.constraint_violation;
  });
  return order;
}

}  // namespace tumbler
