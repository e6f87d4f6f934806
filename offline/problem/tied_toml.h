#pragma once

#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// Reads which joints follow others, `[tied]`: each moves as the other does, or, with a `-` before
/// its name, the other way round.
/// Ends that agree but for a rounding become the same.
/// @pre the problem's joints are known, and so are their paths' sizes and ends.
/// @throws FileError  where a joint is none that the problem moves, follows one that follows
/// another, or could not follow: its ends, or the number of its control points are not the other's.
void ReadTied(TomlTable& root, Problem& problem);

/// The key, for docs/formats.md and schemas.
KeyTable TiedKeyTable();

}  // namespace tumbler
