#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "offline/pages/report.h"

namespace tumbler {

/// Checks of a page's data. All throw std::invalid_argument naming the field.
[[noreturn]] void RefuseField(const std::string& field, const std::string& problem);
void CheckFinite(double value, const std::string& field);
void CheckSize(std::size_t size, std::size_t expected, const std::string& field,
               std::string_view what);
/// Checks that (x, z) is a unit vector.
void CheckUnit(double x, double z, const std::string& field);
/// Checks links, joints, limits and obstacles.
void CheckScene(const ReportData& data);
/// Checks one sample of a motion of that scene, by its index.
void CheckSample(const ReportData& data, const std::vector<ReportSample>& samples,
                 std::size_t index);

}  // namespace tumbler
