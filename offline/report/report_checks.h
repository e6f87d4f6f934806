#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "offline/report/report.h"

namespace tumbler {

/// What a page's data is checked for. All throw std::invalid_argument naming the field.
[[noreturn]] void RefuseField(const std::string& field, const std::string& problem);
void CheckFinite(double value, const std::string& field);
void CheckSize(std::size_t size, std::size_t expected, const std::string& field,
               std::string_view what);
void CheckUnit(double x, double z, const std::string& field);
/// Links, joints, limits and obstacles.
void CheckScene(const ReportData& data);
/// One instant of a motion of that scene, by its index.
void CheckSample(const ReportData& data, const std::vector<ReportSample>& samples,
                 std::size_t index);

}  // namespace tumbler
