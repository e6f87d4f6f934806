#pragma once

#include <atomic>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/certify/certificate.h"
#include "offline/certify/second_look.h"
#include "offline/certify/space_trial.h"
#include "offline/problem/contact_steps.h"
#include "offline/problem/damped_motion.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/minima.h"
#include "offline/solve/solver.h"

namespace tumbler {

/// Of a robust motion in space: how many robots of how many are as asked, and were before.
struct RobotsAsAsked {
  int as_asked = 0, before = 0, of = 0;
};

/// The result of the work on one task.
struct TaskResult {
  Task task;
  SolveOutcome outcome;
  Solution best;
  MotionSummary summary;  ///< Figures of `best`, if it has a motion.
  SecondLook look;        ///< At `best`, if it has a motion.
  bool usable = false;    ///< Whether `best` is a motion that can be written.
  std::string cause;      ///< The reason when it is not usable.
  std::vector<LocalMinimum> minima;
  std::vector<MotionSummary> minima_summaries;
  /// What the second look objects to, for each of the minima; empty where it accepts the motion.
  std::vector<std::string> minima_objections;
  std::optional<PrimitiveFile> file;
  DampedMotion damping;  ///< Of the file's motion, with the task's gains.
  ContactSteps steps;    ///< That contact allows on the file's motion, with joints on their paths.
  std::optional<RobotsAsAsked> robust;
  /// What becomes of the model itself in space, played through the task's drives with the setpoints
  /// of SpaceRobustSettings; none of a robust motion, and where there is nothing to judge.
  std::optional<SpaceTrial> through_drives;
  double wall_s = 0;
  double cpu_s = 0;
  double look_cpu_s = 0;  ///< Of it, for second looks and the certificate.

  [[nodiscard]] const Problem& problem() const { return task.problem; }
  /// The distance of the pitch from the task's target, 2 s after the motion [rad]; none where the
  /// task has no such target.
  [[nodiscard]] std::optional<double> settled_error_rad() const {
    if (!problem().target_pitch_rad) return std::nullopt;
    return std::abs(summary.settled_pitch_rad - *problem().target_pitch_rad);
  }
};

struct WorkSettings {
  int threads = 1;
  bool minima = false;     ///< Whether to distinguish the minima.
  bool keep_best = false;  ///< Whether an interrupted search makes a file, too.
  bool quiet = false;      ///< Whether nothing is said on standard error while it works.
  std::atomic<bool>* interrupt = nullptr;
  /// Told of every evaluation, as SolveOptions::progress; empty: standard error is.
  std::function<void(const Evaluation&)> progress;
  /// Gets the file of a motion that passes the second look while the work goes on, and then of each
  /// that costs less; empty: nobody asks, and no such file is made. From any thread but by one at a
  /// time.
  std::function<void(const PrimitiveFile&)> interim;
};

/// Solves the task and makes the primitive's file.
TaskResult WorkOn(Task task, const WorkSettings& settings);

/// The same from one guess after the other: tasks that differ in their guess alone, of motions that
/// robots judge (`[robust]`, in the plane). It ends with the first motion on which all but a few
/// stand.
/// @returns  that, or else, of those with a file where one has it, the one of which robots miss
///           least; with the time that all took.
/// @pre tasks, each with a guess
TaskResult WorkOnGuesses(std::vector<Task> tasks, const WorkSettings& settings);

/// The results, best first: tasks with a motion before those without, then by cost, or by how far
/// they miss. The pointers are into `results`.
std::vector<const TaskResult*> Ranked(const std::vector<TaskResult>& results);

}  // namespace tumbler
