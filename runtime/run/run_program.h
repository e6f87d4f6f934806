#pragma once

#include "runtime/run/simulation.h"

namespace tumbler {

/// The program tumbler-run (docs/runtime.md): reads the command line, runs, and says what became of
/// it. Errors go to standard error.
/// @param simulation  what its bus `sim` is; null: there is none in this build.
/// @returns the exit status.
int RunProgram(int argc, char** argv, const Simulation* simulation);

}  // namespace tumbler
