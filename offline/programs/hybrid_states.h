#pragma once

#include <array>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "offline/model/hybrid_dynamics.h"
#include "offline/model/robot.h"

namespace tumbler {

/// A free degree of freedom counts as undetermined when less than this fraction of its inertia is
/// left once those before it may move. Fewer than three digits of its acceleration would be right.
inline constexpr double kUndetermined = 1e-12;

/// Prescribes degrees of freedom of a robot.
/// @param list  their names, separated by commas.
/// @throws std::invalid_argument  about the list; FileError  where a free one moves no mass.
void Prescribe(Robot& robot, const std::string& list);

/// Thrown when a state of the robot, or its result, cannot be used.
class StateError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The blank-separated parts of a line, without its comment.
[[nodiscard]] std::vector<std::string_view> PartsOfState(std::string_view line);

/// Evaluates hybrid dynamics of a robot, with the coordinates in the order of the file.
class HybridStates {
 public:
  HybridStates(Robot robot, bool derivatives);
  /// The line of results for a line that holds a state. @throws StateError.
  std::string Evaluate(const std::vector<std::string_view>& parts);

 private:
  using Dynamics = HybridDynamics<Spatial>;

  struct Force {
    int body;
    SpaceVector force, point;  // world
  };
  static constexpr std::size_t kForceParts = 7;
  static constexpr std::array kForceNames = {"fx", "fy", "fz", "px", "py", "pz"};

  [[nodiscard]] const std::string& NameOf(int dof) const;
  /// The meaning of the value at a place of the line.
  [[nodiscard]] std::string Meaning(std::size_t place) const;
  [[nodiscard]] double Number(const std::vector<std::string_view>& parts, std::size_t place) const;
  void Read(const std::vector<std::string_view>& parts);
  /// Forces are constant in world axes; their points move with the links.
  void Differentiate();
  [[noreturn]] void FailUndetermined(int j) const;
  void Append(std::string& out, double value) const;

  Robot robot_;
  bool derivatives_wanted_;
  Dynamics dynamics_;
  Dynamics::Derivatives derivatives_;
  std::vector<double> q_, qd_, qdd_, tau_;  // of each degree of freedom
  std::vector<int> prescribed_;             // in the file's order
  std::vector<int> outputs_;                // free ones, then prescribed ones
  std::vector<Force> forces_;
};

}  // namespace tumbler
