#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/files/sequence_toml.h"
#include "runtime/executor/tick_entry.h"
#include "runtime/record/robot_picture.h"

namespace tumbler {

/// Says of a run's ticks, in their order, where the robot is planned to be.
class RunPlanner {
 public:
  RunPlanner() = default;
  RunPlanner(const RunPlanner&) = delete;
  RunPlanner& operator=(const RunPlanner&) = delete;
  virtual ~RunPlanner() = default;

  /// The plan at this tick: where a node begins, and every 5 ms.
  [[nodiscard]] virtual std::optional<PlannedInstant> Take(const TickEntry& entry) = 0;
  /// The plan at the last tick, unless Take gave it.
  [[nodiscard]] virtual std::optional<PlannedInstant> Last() = 0;
};

/// Makes pictures of robots from the texts that motions carry. Robot files are read by what is no
/// part of the runtime, so a program that has it passes this in.
struct PictureSource {
  /// The robot of a motion. Its joints are numbered as in `joints`. Throws FileError.
  std::function<RobotPicture(const SequenceFile& motion, const std::vector<std::string>& joints)>
      robot_of;
  /// The plan of a run of a motion; null for a robot in space, of which no page shows one. All that
  /// can fail does so here: a RunPlanner throws nothing.
  /// @param begin  the node with which the run begins. Nothing: that is not known beforehand, and
  ///               there is no plan until it begins.
  /// @throws FileError or std::invalid_argument  when a node's plan cannot be simulated.
  std::function<std::unique_ptr<RunPlanner>(const SequenceFile& motion, std::int64_t period_ns,
                                            std::optional<int> begin)>
      plan_of;
};

}  // namespace tumbler
