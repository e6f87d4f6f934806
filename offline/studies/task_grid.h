#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/problem/task_toml.h"

namespace tumbler {

/// A quantity of a task, and the values that it takes one after the other.
struct GridAxis {
  /// Any number of the task file by its key (`contact.mu`, `cost.0.weight`), `slope_rad` also where
  /// the task has none; or `mass`, `mass.LINK`: a factor of the mass and inertia of all links of
  /// the robot, or of one.
  std::string of;
  std::vector<double> values;
};

/// Reads `OF=V,V,...` or `OF=FROM:TO:COUNT`, evenly spaced with both ends.
/// @throws std::invalid_argument  with what is wrong and what is allowed.
GridAxis ReadAxis(const std::string& text);

/// Tasks that differ from one in some numbers, for all combinations of their values.
///
/// A point is a combination, numbered from 0; the last axis changes fastest. The task of a point
/// has the texts of the first one with those numbers in their places, so that a primitive which is
/// made of it says what it was made for, and is checked like any other.
class TaskGrid {
 public:
  static constexpr int kMostPoints = 10000;

  /// Loads the task and its robot. Checks each value of each axis in a task in which all others
  /// have their first.
  /// @throws FileError  about task, robot, or a value that they do not allow.
  /// @throws std::invalid_argument  about axes: none, the same twice, or too many points.
  TaskGrid(const std::string& task_file, std::vector<GridAxis> axes);

  [[nodiscard]] int size() const { return size_; }
  [[nodiscard]] const std::vector<GridAxis>& axes() const { return axes_; }
  [[nodiscard]] const Task& base() const { return base_; }
  /// The values of a point, one for each axis.
  [[nodiscard]] std::vector<double> At(int point) const;
  /// The task of a point. @throws FileError  when these values do not go together.
  [[nodiscard]] Task TaskAt(int point) const;

 private:
  [[nodiscard]] Task TaskWith(const std::vector<double>& values) const;

  std::vector<GridAxis> axes_;
  Task base_;
  int size_ = 1;
};

}  // namespace tumbler
