#pragma once

#include <string>
#include <vector>

#include "runtime/core/tick.h"

namespace tumbler {

/// A sentence about a fault or a refusal, with joint, value, limit and tick.
std::string Describe(const FaultDetail& detail, const std::vector<std::string>& joint_names);
std::string Describe(const RefusalDetail& detail, const std::vector<std::string>& joint_names);

}  // namespace tumbler
