#pragma once

#include <cstddef>
#include <optional>

#include "offline/pages/robot_paths.h"
#include "offline/pages/run_data.h"

namespace tumbler {

/// The planned motion of a run, found from its ticks in their order. In each node it is the nominal
/// simulation of the primitive, which begins at the x where the node before ended; between nodes
/// the robot rests.
class RunPlan {
 public:
  /// @param paths       have to outlive this.
  /// @param start_node  at whose entry the robot rests before the first node begins. Nothing: that
  ///                    is not known, and there is no plan until then.
  RunPlan(RobotPaths& paths, double period_s, std::optional<int> start_node);

  /// The robot as planned at this tick: where a node begins, and every 5 ms.
  [[nodiscard]] std::optional<ReportSample> Take(const RunTick& tick);
  /// The same at the last tick, unless Take gave it.
  [[nodiscard]] std::optional<ReportSample> Last();

 private:
  [[nodiscard]] double PrimitiveTimeAt(const RunTick& tick) const;
  ReportSample SampleAt(int node, const RunTick& tick);

  RobotPaths& paths_;
  std::size_t step_;  // ticks from one sample to the next
  std::optional<int> node_;
  double dx_m_ = 0, turn_rad_ = 0;
  bool began_ = false;           // whether any node has
  std::size_t ticks_ = 0;        // that were taken
  std::optional<RunTick> last_;  // of them
  bool given_ = false;           // whether that one was
  RunTick played_;               // the last one that plays the motion
  std::optional<RunTick> after_played_;
  ReportSample sample_;  // that was given last
};

/// Adds the planned motion of a run whose ticks and bands are there.
/// @param start_node  where the robot rests in a run without a motion.
void AddPlan(RunData& run, RobotPaths& paths, int start_node);

}  // namespace tumbler
