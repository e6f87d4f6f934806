#pragma once

#include <string>
#include <vector>

#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler::testing {

/// Runs the program on the folder's task.
inline Program Optimize(const TaskFolder& folder, std::vector<std::string> more) {
  more.insert(more.begin(), {ProgramPath("tumbler optimize"), folder.task_file()});
  return Program(more);
}

}  // namespace tumbler::testing
