#pragma once

#include "common/files/toml_reader.h"
#include "runtime/assembly/assembly.h"
#include "runtime/record/record_configuration.h"

namespace tumbler {

/// Reads the recorded files, and no others. It refers to the configuration.
/// It throws RecordError about a file that was not recorded.
[[nodiscard]] FileReader RecordedFiles(const RecordConfiguration& configuration);

/// Assembles the recorded run from the recorded files. The result is ready for its first tick.
/// @throws FileError or RecordError  about a part that cannot be used.
[[nodiscard]] Assembly Assemble(const RecordConfiguration& configuration);

}  // namespace tumbler
