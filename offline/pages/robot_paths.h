#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/files/sequence_toml.h"
#include "offline/pages/report.h"

namespace tumbler {

/// Computes where the links of a motion's robot are: for given positions of root and joints, and in
/// the plan of each node. A sequence is played on one ground with one robot.
class RobotPaths {
 public:
  /// @throws FileError when the texts of a primitive cannot be used.
  explicit RobotPaths(const SequenceFile& motion);
  ~RobotPaths();
  RobotPaths(RobotPaths&&) noexcept;

  /// The links, joints, limits and the ground, without samples.
  [[nodiscard]] const ReportData& scene() const;

  /// The joints without a motor.
  [[nodiscard]] const std::vector<std::string>& passive_names() const;

  /// The robot at these positions: x, z and pitch of the root, the joints in the scene's order, and
  /// those without a motor.
  /// @param passive_rad  empty: not known, and drawn as at the start.
  ReportSample Pose(const std::array<double, 3>& root, std::span<const double> joints_rad,
                    std::span<const double> passive_rad);

  /// The plan of a node, at every step. Its primitive is played alone in the nominal simulation,
  /// from its entry at time 0, and held for 2 s after its end. Where the node exchanges the roles
  /// of legs, so does the plan. It is computed once.
  const std::vector<ReportSample>& PlanOf(int node);
  /// The plan of a node at one time, between its steps. Before its start and after its end it
  /// stands still.
  ReportSample PlanAt(int node, double time_s);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// Moves a pose along x, and turns it by `turn_rad`, which is whole turns.
void Place(ReportSample& sample, double dx_m, double turn_rad);

}  // namespace tumbler
