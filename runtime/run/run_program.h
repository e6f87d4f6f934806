#pragma once

#include "common/exit_status.h"
#include "runtime/run/simulation.h"

namespace tumbler {

/// The program tumbler-run (docs/runtime.md): reads the command line, runs, and reports the
/// outcome. Throws as RunProgram (common/program.h) expects it.
/// @param simulation  makes the bus `sim`; null where the build has none.
ExitStatus PlayMotion(int argc, char** argv, const Simulation* simulation);

}  // namespace tumbler
