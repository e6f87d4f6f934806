#pragma once

#include "common/core/exit_status.h"

namespace tumbler {

/// The program tumbler bench.
ExitStatus RunBench(int argc, char** argv);

}  // namespace tumbler
