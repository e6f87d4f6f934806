#pragma once

#include <string>

#include "runtime/record/run_trace.h"

namespace tumbler {

/// Draws setpoints, replies and errors of one run or two, with a column for each joint.
/// @param second  null: one run.
/// @throws FileError  naming the file that cannot be written.
void WriteSvg(const RunTrace& first, const RunTrace* second, const std::string& path);

}  // namespace tumbler
