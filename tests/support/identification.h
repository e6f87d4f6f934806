#pragma once

#include <gtest/gtest.h>

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
inline const std::vector<std::string>& ExcitationFiles() {
  static const TemporaryFolder folder;
  static const std::vector<std::string> files = [] {
    std::vector<std::string> made;
    for (const std::string task : {"rise", "stand"}) {
      ExcitationSettings settings;
      settings.candidates = 6;
      settings.generations = 0;
      const Excitation found =
          MakeExcitation(SourcePath("primitives/tasks/" + task + ".toml"), settings);
      EXPECT_TRUE(found.file) << found.cause;
      made.push_back(folder / (task + ".toml"));
      PendingFile(made.back(), ToToml(*found.file)).Commit();
    }
    return made;
  }();
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
