#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "offline/studies/processes.h"
#include "offline/studies/task_grid.h"

namespace tumbler {

/// What is solved at every point of a grid, each for itself.
struct SweepStudy {
  TaskGrid grid;
  /// A primitive that every point starts from, if any, and its file's name.
  std::optional<PrimitiveFile> guess;
  std::string guess_file;
  std::optional<std::uint64_t> seed;  ///< Of the search, instead of the task's.
};

/// What became of a point.
struct SweepPoint {
  bool found = false;
  std::string cause;  ///< The reason when it is not.
  std::string file;   ///< Of its primitive, in the library's folder.
  std::string hash;   ///< Of the text of that file.
  double objective = 0;
  double duration_s = 0;
  double peak_torque_nm = 0;  ///< Of the certificate.
  std::int64_t evaluations = 0;
};

struct SweepPlan {
  std::string folder;  ///< Of the library.
  int threads = 1;     ///< Of each process; a point takes one.
  /// Set it from any thread to end as soon as possible; may be null.
  std::atomic<bool>* interrupt = nullptr;
  /// Told how many points are known; may be empty.
  std::function<void(int known)> progress;
};

/// What RunSweep has.
struct SweepDone {
  int known = 0;  ///< Of the points.
  /// In the order of their numbers. Empty until all are known, and in all processes but the first.
  std::vector<SweepPoint> points;
};

/// Solves the points that are not known yet, shared among the processes, and writes what is found
/// into the folder, by the first process: a primitive for every point that has a motion, and
/// `points.jsonl`, a line for every point that is known, from which a work that was ended goes on.
/// When all are known, `library.json` says what is where. None of these files depends on threads,
/// processes and interruptions, except for the order of those lines.
/// @throws FileError  when a file cannot be used, or the folder holds something else.
SweepDone RunSweep(const SweepStudy& study, const SweepPlan& plan, const Processes& processes);

/// The files that RunSweep may write.
std::vector<std::string> FilesOf(const SweepStudy& study, const SweepPlan& plan);

/// A table for people, a line for each point.
std::string ToText(const SweepStudy& study, const std::vector<SweepPoint>& points);
/// The text of `library.json`, without the last line feed.
Json ToJson(const SweepStudy& study, const std::vector<SweepPoint>& points);

}  // namespace tumbler
