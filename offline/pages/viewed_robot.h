#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <tumbler/state_t.hpp>
#include <tumbler/truth_t.hpp>

#include "common/files/json.h"
#include "common/files/sequence_toml.h"
#include "offline/pages/robot_paths.h"

namespace tumbler {

/// Where the robot of a run is drawn. Its joints are as measured. Its root, and its joints without
/// a motor, are where the simulated robot truly is, as long as that is told; otherwise nobody
/// knows, and they are where the plan has them at this time of the primitive.
class ViewedRobot {
 public:
  /// Computes the plans of all nodes, which takes some tenths of a second for each.
  /// @throws FileError when a text of the motion cannot be used.
  explicit ViewedRobot(const SequenceFile& motion);

  /// Links, joints and surroundings as the page's scripts draw them.
  [[nodiscard]] Json Scene() const;
  [[nodiscard]] const std::vector<std::string>& joints() const;

  void Take(const state_t& state);
  void Take(const truth_t& truth);
  /// Forgets where the robot was: another run begins.
  void Forget();

  /// x [m], z [m] and pitch [rad] of each link in the state that was taken last; null where a joint
  /// was never measured, or where the number of joints is not that of the robot.
  Json Poses();
  /// Whether the root is where the simulated robot truly is.
  [[nodiscard]] bool RootIsTrue() const { return truth_.has_value(); }

 private:
  /// What no drive measures.
  struct Unmeasured {
    std::array<double, 3> root{};
    std::vector<double> passive_rad;
  };
  [[nodiscard]] Unmeasured WhereTheRestIs();

  int node_count_ = 0;
  int start_node_ = 0;
  RobotPaths paths_;
  std::optional<state_t> state_;
  std::optional<Unmeasured> truth_;
  std::int64_t states_since_truth_ = 0;
  int node_ = 0;            ///< The node that is played or was played last.
  bool begun_ = false;      ///< Whether a node was played in this run.
  double shift_m_ = 0;      ///< Of the plan along x, which begins where the node before ended.
  double turn_rad_ = 0;     ///< Of the plan, whole turns.
  double played_to_s_ = 0;  ///< Time of the primitive that was seen last.
};

}  // namespace tumbler
