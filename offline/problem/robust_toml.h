#pragma once

#include <optional>

#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// Reads the table `[robust]` of a task, if there is one.
/// @param problem  the task without it.
/// @throws FileError  also when the task has no pitch to end at, or something that lanes do not
///                    have.
std::optional<RobustSettings> ReadRobust(TomlTable& root, const Problem& problem);

/// The same of a task in space.
std::optional<SpaceRobustSettings> ReadSpaceRobust(TomlTable& root, const Problem& problem);

/// The keys of the table, for docs/formats.md; and of that in space, for docs/space.md.
KeyTable RobustKeyTable();
KeyTable SpaceRobustKeyTable();
KeyTable RobustFeedbackKeyTable();

}  // namespace tumbler
