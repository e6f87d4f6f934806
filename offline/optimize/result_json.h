#pragma once

#include <string>
#include <vector>

#include "offline/optimize/task_result.h"

namespace tumbler {

/// The figures of a task that has a motion (docs/formats.md).
/// @pre the result has a file.
std::string ToJson(const TaskResult& result);

/// Those of several tasks, in this order; of a task without a motion, why it has none.
std::string ToJson(const std::vector<const TaskResult*>& order);

}  // namespace tumbler
