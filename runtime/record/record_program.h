#pragma once

#include "common/core/exit_status.h"
#include "runtime/record/picture_source.h"

namespace tumbler {

/// The program tumbler record: says what a flight record or an LCM log holds, and exports it.
/// Throws as RunProgram (common/files/program.h) expects it.
/// @param pictures  of robots, for MCAP; null where the build has none.
ExitStatus DescribeRecord(int argc, char** argv, const PictureSource* pictures);

}  // namespace tumbler
