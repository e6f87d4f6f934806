#pragma once

#include <string>
#include <utility>
#include <vector>

#include "common/files/result_file.h"
#include "offline/certify/task_result.h"
#include "offline/solve/guess.h"
#include "offline/studies/identified_model.h"

namespace tumbler::testing {

/// Finds a motion anew for a robot that was identified, as tumbler optimize --guess --posterior.
/// @param file  gets the motion.
/// @returns  why there is none; empty: it was found.
inline std::string FindAnew(const std::string& task, const std::vector<std::string>& guesses,
                            const PosteriorFile& known, const TuningSettings& tuning,
                            const std::string& file) {
  std::vector<Task> tasks;
  try {
    for (const std::string& guess : guesses) {
      tasks.push_back(IdentifiedTask(LoadTask(task), known));
      TuneTo(known, tuning, tasks.back());
      TakeGuess(tasks.back(), LoadPrimitive(guess), guess);
    }
  } catch (const FileError& error) {  // such as a ground that is too stiff for the task's steps
    return std::string("the task is refused: ") + error.what();
  }
  WorkSettings settings;
  settings.quiet = true;
  const TaskResult result = WorkOnGuesses(std::move(tasks), settings);
  if (!result.file) return "no motion found: " + result.cause;
  PendingFile(file, ToToml(*result.file)).Commit();
  return "";
}

}  // namespace tumbler::testing
