#pragma once

#include <memory>
#include <span>

#include "common/core/status.h"
#include "firmware_interface/devices/drive_bank.h"
#include "firmware_interface/devices/inertial_sensor.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/executor/executor.h"

namespace tumbler {

/// An executor, together with its motion and the host sides of its drives.
class Assembly {
 public:
  /// @throws Refused naming the joint whose drive cannot be used as configured, or the sensor's
  /// link
  ///         where a primitive with feedback does not know it.
  explicit Assembly(RunParts parts);

  /// Makes the executor ready for its first tick.
  /// @retval kInvalidArgument  as for Executor::Configure.
  Status Configure(const ExecutorConfig& config);

  [[nodiscard]] Executor& executor() { return *executor_; }
  /// The drives, in the order of the joints.
  [[nodiscard]] std::span<Drive* const> drives() const { return bank_->drives(); }
  [[nodiscard]] const RunParts& parts() const { return parts_; }

 private:
  RunParts parts_;
  std::unique_ptr<DriveBank> bank_;
  std::unique_ptr<InertialSensor> sensor_;  ///< Null: the drives file has none.
  std::unique_ptr<PitchEstimate> pitch_;
  std::unique_ptr<Executor> executor_;
};

}  // namespace tumbler
