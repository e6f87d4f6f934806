#pragma once

#include "firmware_interface/devices/drive.h"

namespace tumbler {

/// What host sides of drives have in common: a configuration, and what was last said and heard.
/// @tparam Config  that of the protocol, with `Validate()`.
template <typename Config>
class ConfiguredDrive : public Drive {
 public:
  [[nodiscard]] DriveSetpoint encoded_setpoint() const noexcept final { return encoded_; }
  [[nodiscard]] DriveFeedback feedback() const noexcept final { return feedback_; }
  [[nodiscard]] const Config& config() const noexcept { return config_; }

 protected:
  /// @param validity  config.Validate(). If it is not kOk, `valid_` is false, and every Encode has
  ///                  to return kInvalidArgument and send nothing. (A call in this constructor
  ///                  would leave a table with pure functions in the firmware.)
  ConfiguredDrive(const Config& config, Status validity) noexcept
      : config_(config), valid_(validity == Status::kOk) {}

  Config config_;
  bool valid_;
  DriveFeedback feedback_;
  DriveSetpoint encoded_;
};

}  // namespace tumbler
