#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "offline/studies/trial.h"
#include "offline/studies/work_file.h"

namespace tumbler {

/// Outcomes by the robot's number. Variations are left out: they follow from study and number.
using Outcomes = std::map<std::uint64_t, TrialOutcome>;

/// A text that is the same for two studies whose outcomes are: a hash of everything that they read
/// and were told. @throws FileError
std::string IdentityOf(const RobustnessStudy& study);

/// The hash of the files that a study is about: the motion with its primitives, drives and twin.
std::string HashOfFiles(const RobustnessStudy& study);

/// The file in which the outcomes of a study are kept as they are found. Its lines have no order.
WorkFile::Work CheckpointOf(const std::string& identity);

/// The line of a robot: one JSON object with a line feed.
std::string CheckpointLine(std::uint64_t index, const TrialOutcome& outcome);

/// Reads lines of robots. @param name, line  of the file, and of its first line there, for
/// messages.
/// @throws FileError  when a line is not one, or contradicts another.
void ReadCheckpointLines(std::string_view text, const std::string& name, std::uint32_t line,
                         Outcomes& outcomes);

}  // namespace tumbler
