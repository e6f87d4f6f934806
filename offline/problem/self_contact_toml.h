#pragma once

#include <span>

#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// Sets which of the robot's own shapes have to stay apart (docs/formats.md).
/// @param root  the task, whose `[self_contact]` may be missing.
/// @param q     positions of all degrees of freedom in which the motion begins and ends, and in
/// which these shapes have to be apart.
/// @throws FileError  with file, line, key, value and allowed values.
void ReadSelfContact(TomlTable& root, std::span<const std::vector<double>> q, Scene& scene);
/// The same in space.
void ReadSelfContact(TomlTable& root, std::span<const std::vector<double>> q, SpaceScene& scene);

/// The keys, for docs/formats.md.
KeyTable SelfContactKeyTable();

}  // namespace tumbler
