#include "offline/studies/task_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/core/index.h"
#include "common/files/toml_reader.h"
#include "offline/model/urdf_mass.h"
#include "offline/studies/toml_edit.h"

namespace tumbler {
namespace {

constexpr std::string_view kMass = "mass", kSlope = "slope_rad";

/// The link whose mass an axis is about, `` for all; none when it is about something else.
std::optional<std::string> MassOf(const std::string& of) {
  if (of == kMass) return "";
  if (of.starts_with("mass.")) return of.substr(kMass.size() + 1);
  return std::nullopt;
}

std::optional<double> ToNumber(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

std::vector<std::string_view> Split(std::string_view text, char at) {
  std::vector<std::string_view> parts;
  while (true) {
    const std::size_t end = text.find(at);
    parts.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

/// The text of a task with a key `slope_rad`. It takes the place of an empty line where one ends
/// the keys of the root, so that all lines keep their numbers.
std::string WithSlope(const std::string& text, const std::string& name) {
  if (TomlTable::Parse(text, name).Has(kSlope)) return text;
  const std::string key = std::string(kSlope) + " = 0.0\n";
  const std::size_t gap = text.find("\n\n[");
  return gap == std::string::npos ? key + text
                                  : text.substr(0, gap + 1) + key + text.substr(gap + 2);
}

void CheckAxis(const GridAxis& axis, const Task& base) {
  if (!MassOf(axis.of)) {
    if (axis.of != kSlope) static_cast<void>(NumberAt(base.task_text, base.task_file, axis.of));
    return;
  }
  for (const double value : axis.values) {
    if (value >= 0.01 && value <= 100) continue;
    throw std::invalid_argument(
        fmt::format("{}: is {}; allowed: from 0.01 ... 100, a factor", axis.of, value));
  }
}

}  // namespace

GridAxis ReadAxis(const std::string& text) {
  const auto fail = [&](const std::string& why) {
    throw std::invalid_argument(fmt::format(
        "'{}' {}; allowed: KEY=VALUE,VALUE,... or KEY=FROM:TO:COUNT, such as contact.mu=0.2:0.4:3",
        text, why));
  };
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) fail("names no key with values");
  GridAxis axis;
  axis.of = text.substr(0, equals);
  const std::string_view values = std::string_view(text).substr(equals + 1);
  const std::vector<std::string_view> ends = Split(values, ':');
  if (ends.size() > 1) {
    const std::optional<double> from = ToNumber(ends[0]);
    const std::optional<double> to = ends.size() == 3 ? ToNumber(ends[1]) : std::nullopt;
    const std::optional<double> count = ends.size() == 3 ? ToNumber(ends[2]) : std::nullopt;
    if (!from || !to || !count) fail("has no two ends and a count");
    if (*count != std::floor(*count) || *count < 2 || *count > TaskGrid::kMostPoints)
      fail(fmt::format("has a count that is no whole number of 2 to {}", TaskGrid::kMostPoints));
    // As one would write them: 0.05, not the 0.05000000000000002 of the sum.
    for (int k = 0; k < static_cast<int>(*count); ++k) {
      const double value = *from + (*to - *from) * (k / (*count - 1));
      axis.values.push_back(*ToNumber(fmt::format("{:.12g}", value)));
    }
  } else {
    for (const std::string_view part : Split(values, ',')) {
      const std::optional<double> value = ToNumber(part);
      if (!value) fail(fmt::format("has '{}', which is no number", part));
      axis.values.push_back(*value);
    }
  }
  std::vector<double> sorted = axis.values;
  std::sort(sorted.begin(), sorted.end());
  if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end())
    fail("has the same value twice");
  return axis;
}

TaskGrid::TaskGrid(const std::string& task_file, std::vector<GridAxis> axes)
    : axes_(std::move(axes)), base_(LoadTask(task_file)) {
  if (axes_.empty()) throw std::invalid_argument("no quantity is varied; name one with --over");
  for (const GridAxis& axis : axes_) {
    const auto same = [&](const GridAxis& other) { return other.of == axis.of; };
    if (std::count_if(axes_.begin(), axes_.end(), same) > 1) {
      throw std::invalid_argument(
          fmt::format("{} is varied twice; give all its values at once", axis.of));
    }
    CheckAxis(axis, base_);
    if (static_cast<int>(axis.values.size()) > kMostPoints / size_) {
      throw std::invalid_argument(
          fmt::format("these are more than {} points; give fewer values", kMostPoints));
    }
    size_ *= static_cast<int>(axis.values.size());
  }
  for (std::size_t a = 0; a < axes_.size(); ++a) {
    for (const double value : axes_[a].values) {
      std::vector<double> values = At(0);
      values[a] = value;
      static_cast<void>(TaskWith(values));
    }
  }
}

std::vector<double> TaskGrid::At(int point) const {
  std::vector<double> values(axes_.size());
  for (std::size_t a = axes_.size(); a-- > 0;) {
    const int count = static_cast<int>(axes_[a].values.size());
    values[a] = axes_[a].values[Index(point % count)];
    point /= count;
  }
  return values;
}

Task TaskGrid::TaskAt(int point) const { return TaskWith(At(point)); }

Task TaskGrid::TaskWith(const std::vector<double>& values) const {
  std::string task = base_.task_text, robot = base_.robot_as_given;
  for (std::size_t a = 0; a < axes_.size(); ++a) {
    if (const std::optional<std::string> link = MassOf(axes_[a].of)) {
      robot = WithMassTimes(values[a], *link, robot, base_.robot_file);
      continue;
    }
    if (axes_[a].of == kSlope) task = WithSlope(task, base_.task_file);
    task = WithNumber(task, base_.task_file, axes_[a].of, values[a]);
  }
  return ParseTask(task, base_.task_file, robot, base_.robot_file);
}

}  // namespace tumbler
