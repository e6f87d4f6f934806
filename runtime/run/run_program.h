#pragma once

#include "common/exit_status.h"
#include "runtime/run/simulation.h"

namespace tumbler {

/// The program tumbler-run (docs/runtime.md): reads the command line, runs, and says what became of
/// it. Throws as RunProgram (common/program.h) expects it.
/// @param simulation  what its bus `sim` is; null: there is none in this build.
ExitStatus PlayMotion(int argc, char** argv, const Simulation* simulation);

}  // namespace tumbler
