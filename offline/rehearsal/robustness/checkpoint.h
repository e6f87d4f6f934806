#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "offline/rehearsal/robustness/trial.h"

namespace tumbler {

/// Outcomes by the robot's number. Variations are left out: they follow from study and number.
using Outcomes = std::map<std::uint64_t, TrialOutcome>;

/// A text that is the same for two studies whose outcomes are: a hash of everything that they read
/// and were told. @throws FileError
std::string IdentityOf(const RobustnessStudy& study);

/// The first line of a checkpoint file, and that of a robot. Each is one JSON object with a line
/// feed.
std::string CheckpointHead(const std::string& identity);
std::string CheckpointLine(std::uint64_t index, const TrialOutcome& outcome);

/// Reads lines of robots. @param name, line  of the file, and of its first line there, for
/// messages.
/// @throws FileError  when a line is not one, or contradicts another.
void ReadCheckpointLines(std::string_view text, const std::string& name, std::uint32_t line,
                         Outcomes& outcomes);

/// Outcomes in a file, which grows while they are found, so that a work that was ended goes on
/// where it was. The file's lines have no order.
class Checkpoint {
 public:
  /// Reads a checkpoint. A last line without a line feed was being written when the program ended,
  /// and does not count.
  /// @throws FileError  when the file cannot be used, or is about another study.
  static Outcomes Read(const std::string& path, const std::string& identity);

  /// Opens a file for more lines, and makes it where it is missing; with what `outcomes` gets of
  /// it. A broken last line is taken away. @throws FileError  as Read.
  Checkpoint(const std::string& path, const std::string& identity, Outcomes& outcomes);
  /// Adds lines, which are on disk when this returns. @throws FileError
  void Add(const std::string& lines);

 private:
  std::string path_;
};

}  // namespace tumbler
