#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/files/result_file.h"
#include "offline/studies/excitation.h"
#include "offline/studies/recorded_motion.h"
#include "tests/support/files.h"
#include "tests/support/hidden_robot.h"

namespace tumbler::testing {

/// The files of two excitations of few candidates, lying and standing, made once in a process.
/// @param generations  of the search for better ones.
inline const std::vector<std::string>& ExcitationFiles(int generations = 0) {
  static const TemporaryFolder folder;
  static std::map<int, std::vector<std::string>> known;
  const auto [at, is_new] = known.emplace(generations, std::vector<std::string>());
  std::vector<std::string>& files = at->second;
  for (const std::string task : {"rise", "stand"}) {
    if (!is_new) break;
    ExcitationSettings settings;
    settings.candidates = 6;
    settings.generations = generations;
    const Excitation found =
        MakeExcitation(SourcePath("primitives/tasks/" + task + ".toml"), settings);
    EXPECT_TRUE(found.file) << found.cause;
    files.push_back(folder / (task + std::to_string(generations) + ".toml"));
    PendingFile(files.back(), ToToml(*found.file)).Commit();
  }
  return files;
}

/// The records of a robot that plays one motion after the other.
inline std::vector<RecordedMotion> RecordsOf(const std::vector<HiddenRuns>& motions,
                                             const HiddenRobot& robot) {
  const TemporaryFolder folder;
  std::vector<RecordedMotion> records;
  for (const HiddenRuns& run : motions) {
    const std::string file = folder / (std::to_string(records.size()) + ".rec");
    EXPECT_TRUE(run.Record(robot, file)) << "an excitation ends where it began";
    records.push_back(ReadRecordedMotion(file));
  }
  return records;
}

}  // namespace tumbler::testing
