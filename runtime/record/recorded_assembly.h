#pragma once

#include "runtime/assembly/assembly.h"
#include "runtime/record/record_configuration.h"

namespace tumbler {

/// Assembles the recorded run from the recorded files. The result is ready for its first tick.
/// @throws FileError or RecordError  about a part that cannot be used.
[[nodiscard]] Assembly Assemble(const RecordConfiguration& configuration);

}  // namespace tumbler
