#pragma once

#include <span>
#include <string>
#include <vector>

#include "runtime/executor/tick.h"

namespace tumbler {

/// A sentence about a fault or a refusal, with joint, value, limit and tick.
/// @param error_codes  whose error codes the drive of each joint has (`ErrorCodesOf`), so that a
///                     code is named; without them it is a number.
std::string Describe(const FaultDetail& detail, const std::vector<std::string>& joint_names,
                     std::span<const std::string> error_codes = {});
/// The same of a fault whose reaction is not known.
std::string DescribeFault(const FaultDetail& detail, const std::vector<std::string>& joint_names,
                          std::span<const std::string> error_codes = {});
std::string Describe(const RefusalDetail& detail, const std::vector<std::string>& joint_names,
                     std::span<const std::string> error_codes = {});

/// The number of a detail as messages carry it: exact, also of codes of 32 bits; and back. What is
/// no integer of 32 bits where it should be becomes 0.
double ToDouble(DetailNumber number, DetailUnit unit);
DetailNumber FromDouble(double number, DetailUnit unit);

}  // namespace tumbler
