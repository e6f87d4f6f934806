#pragma once

#include <string>
#include <vector>

#include "offline/certify/task_result.h"

namespace tumbler {

/// The JSON of a task that has a motion (docs/formats.md).
/// @pre the result has a file.
std::string ToJson(const TaskResult& result);

/// The JSON of several tasks, in this order. A task without a motion has the cause instead.
std::string ToJson(const std::vector<const TaskResult*>& order);

}  // namespace tumbler
