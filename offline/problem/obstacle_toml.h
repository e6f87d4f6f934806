#pragma once

#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "offline/model/obstacle.h"
#include "offline/model/plane.h"

namespace tumbler {

/// Reads an `[[obstacle]]` of a task or of a twin (docs/formats.md). Unknown keys are left to the
/// caller.
/// @throws FileError  with file, line, key, value and allowed range.
Obstacle<Plane> ReadObstacle(TomlTable& table);

/// Its keys, for docs/formats.md.
KeyTable ObstacleKeyTable();

}  // namespace tumbler
