#pragma once

#include "runtime/assembly/assembly.h"
#include "runtime/record/record_configuration.h"

namespace tumbler {

/// Puts together what was recorded, from the recorded files, ready for its first tick.
/// @throws FileError or RecordError about what cannot be used.
[[nodiscard]] Assembly Assemble(const RecordConfiguration& configuration);

}  // namespace tumbler
