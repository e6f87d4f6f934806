#pragma once

#include "common/exit_status.h"
#include "runtime/mcap/picture_source.h"

namespace tumbler {

/// The program tumbler-log: shows an LCM log, and converts it. Throws as RunProgram
/// (common/program.h) expects it.
/// @param pictures  of robots, for MCAP; null where the build has none.
ExitStatus ShowLog(int argc, char** argv, const PictureSource* pictures);

}  // namespace tumbler
