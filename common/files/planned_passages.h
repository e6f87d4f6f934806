#pragma once

#include <string>
#include <vector>

#include "common/files/sequence_toml.h"

namespace tumbler {

/// A motion of a sequence that is played to its end.
struct PlannedPassage {
  int node = 0;
  int edge = -1;   ///< That is taken after it; -1: it is the last.
  int cycles = 0;  ///< That are complete when it ends.
};

/// The motions that a sequence plays, one after the other, when nothing but its plan asks for
/// anything: so many cycles, and then its end or a branch (PlannedRequest).
/// @throws std::invalid_argument  when there is no such branch.
/// @throws FileError  about a node on the round when it never ends.
std::vector<PlannedPassage> PlannedPassages(const SequenceFile& file, int cycles,
                                            const std::string& branch);

/// Checks that there is such a branch, and that the plan ends: after any number of cycles, where it
/// does after one. @throws as PlannedPassages.
void RequireEnd(const SequenceFile& file, int cycles, const std::string& branch);

}  // namespace tumbler
