#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "common/sequence_toml.h"
#include "offline/report/report.h"

namespace tumbler {

/// Where the links of a motion's robot are: by the joints' and the root's positions, and in the
/// plan of each node. A sequence is played on one ground with one robot.
class RobotPaths {
 public:
  /// @throws FileError when the texts of a primitive cannot be used.
  explicit RobotPaths(const SequenceFile& motion);
  ~RobotPaths();
  RobotPaths(RobotPaths&&) noexcept;

  /// Links, joints, limits and ground; no samples.
  [[nodiscard]] const ReportData& scene() const;

  /// The robot with its root at x, z, pitch and its joints, in the scene's order, at these
  /// positions.
  ReportSample Pose(const std::array<double, 3>& root, std::span<const double> joints_rad);

  /// A node's primitive played alone in the nominal simulation, from its entry, and held for 2 s
  /// after its end; at every step, as the robot plays it (roles exchanged where the node has them).
  /// Time 0 is its start. Computed once.
  const std::vector<ReportSample>& PlanOf(int node);
  /// The same at one time, between the steps; at the ends beyond them.
  ReportSample PlanAt(int node, double time_s);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// The same pose elsewhere: moved along x, and with whole turns of pitch added.
void Place(ReportSample& sample, double dx_m, double turn_rad);

}  // namespace tumbler
