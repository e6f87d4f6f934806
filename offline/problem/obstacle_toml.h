#pragma once

#include "common/toml_reader.h"
#include "offline/contact/obstacle.h"
#include "offline/dynamics/plane.h"

namespace tumbler {

/// Reads an `[[obstacle]]` of a task or of a twin (docs/formats.md). Unknown keys are left to the
/// caller.
/// @throws FileError  with file, line, key, value and allowed range.
Obstacle<Plane> ReadObstacle(TomlTable& table);

}  // namespace tumbler
