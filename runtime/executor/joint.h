#pragma once

#include "common/core/primitive.h"
#include "firmware_interface/devices/drive.h"
#include "runtime/executor/numbers.h"
#include "runtime/executor/reply_watch.h"
#include "runtime/executor/safety.h"

namespace tumbler {

/// One joint in the executor: its drive, what it plays, what it was sent, and what is known of it.
struct Joint {
  using Basis = JointMotion<float>::Spline::Basis;

  Drive* drive = nullptr;
  const JointMotion<float>* motion = nullptr;  ///< In the present node.
  SafetyLimits limits;
  float acceleration_max_rad_s2 = 0;
  bool shares_position_knots = false;  ///< Whether the path has the knots of joint 0's.
  bool shares_torque_knots = false;    ///< Whether the feed-forward has the knots of joint 0's.
  JointSetpoint commanded;             ///< The last limited setpoint.
  DriveFeedback measured;
  float zero_if_finite = 0;  ///< NaN where a number of `measured` is not finite, else zero.
  DriveState drive_state = DriveState::kUnknown;
  bool was_off = false;      ///< Whether the drive was seen not to be enabled since arming began.
  bool was_enabled = false;  ///< Whether the drive has been enabled since arming.
  bool was_left = false;     ///< Whether there is a `left_rad`.
  ReplyWatch replies;
  float move_from_rad = 0;
  float left_rad = 0;    ///< The last setpoint before torque off.
  Basis position_basis;  ///< At the time in the primitive.
  Basis torque_basis;

  void Measure(const DriveFeedback& report) noexcept {
    measured = report;
    zero_if_finite = ZeroIfFinite(measured.position_rad, measured.velocity_rad_s,
                                  measured.torque_nm, measured.temperature_c);
  }
  [[nodiscard]] bool IsMeasuredFinite() const noexcept { return zero_if_finite == 0; }
};

}  // namespace tumbler
