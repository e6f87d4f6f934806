#pragma once

#include <atomic>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "common/primitive_toml.h"
#include "offline/certificate/certificate.h"
#include "offline/problem/task_toml.h"
#include "offline/solver/minima.h"
#include "offline/solver/solver.h"

namespace tumbler {

/// A task with all that is known of it when it has been worked on.
struct TaskResult {
  Task task;
  SolveOutcome outcome;
  Solution best;
  MotionSummary summary;  ///< Of `best`, where that has a motion.
  bool usable = false;    ///< `best` is a motion that can be written.
  std::string cause;      ///< Else why it is none.
  std::vector<LocalMinimum> minima;
  std::vector<MotionSummary> minima_summaries;
  std::optional<PrimitiveFile> file;
  double wall_s = 0;
  double cpu_s = 0;

  [[nodiscard]] const Problem& problem() const { return task.problem; }
  /// How far the pitch is from where the task wants it, 2 s after the motion.
  [[nodiscard]] double settled_error_rad() const {
    return std::abs(summary.settled_pitch_rad - problem().target_pitch_rad);
  }
};

struct WorkSettings {
  int threads = 1;
  bool minima = false;     ///< Whether the minima are told apart.
  bool keep_best = false;  ///< Whether an interrupted search has a file too.
  std::atomic<bool>* interrupt = nullptr;
};

/// Solves the task and makes the primitive's file, with progress on standard error.
TaskResult WorkOn(Task task, const WorkSettings& settings);

/// Best first: tasks with a motion before those without, then by cost, or by how far they miss.
/// The pointers are into `results`.
std::vector<const TaskResult*> Ranked(const std::vector<TaskResult>& results);

}  // namespace tumbler
