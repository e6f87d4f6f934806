#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "firmware_interface/devices/drives_toml.h"
#include "offline/scene/lane_robot.h"
#include "offline/scene/scene.h"

namespace tumbler {

/// What a joint was told in one tick, and what its drive answered.
struct RecordedJoint {
  LaneSetpoint<double> setpoint;  ///< As encoded on the wire.
  double reading_rad = 0;         ///< NaN: there was no reply to this setpoint in time.
  /// From the tick to the end of the setpoint's frame on the wire, when the drive takes the
  /// setpoint [s]: by the time stamps of the reply, where the drive samples its joint then, or else
  /// by when the host sent it.
  double arrival_s = 0;
  /// From the tick to when the frame came at which the reading was sampled, or to when the drive
  /// reported it by its own clock [s].
  double sampled_s = 0;
};

/// How a joint's readings come about.
struct RecordedDrive {
  double kp = 0, kd = 0, torque_max_nm = 0;
  double arrival_s = 0;  ///< Median of those of the ticks.
  /// The reading less the angle that the drive's law sees, and that less the true one, on the
  /// average: encoders and wires round downwards.
  double wire_bias_rad = 0, encoder_bias_rad = 0;
  double noise_rad = 0;  ///< Standard deviation of what rounding does to a reading.
  MotorFacts motor;      ///< As the drives file says, before anything was fitted.
};

/// What a flight record tells of how a robot moved: the setpoints of its standing hold and of its
/// first motion, with the replies to them.
struct RecordedMotion {
  std::string name;         ///< Of the record's file.
  std::string motion_name;  ///< Of what was played.
  Scene scene;              ///< As the motion's task has it.
  PrimitivePose start;      ///< Where the motion begins.
  /// The texts that the motion was made from, and the names of their files.
  std::string robot_text, robot_file, task_text, task_file;
  DrivesConfig drives;
  std::string drives_text, drives_file;  ///< Empty: DefaultDrives.
  double tick_s = 1e-3;
  /// Whether periods of the drives' loops begin with the tick, as those of drives do that are
  /// simulated in virtual time. Otherwise they may be anywhere.
  bool periods_with_ticks = true;
  std::vector<RecordedDrive> joints;
  /// By tick and joint, from the beginning of the hold on: hold, motion, settling.
  std::vector<std::vector<RecordedJoint>> ticks;
  std::size_t begins = 0;  ///< The first tick of the motion.
  /// What setpoints are late by, besides the time that frames take on the wire, by the time stamps
  /// of replies [s]: of a simulated robot in the median, of one on an interface by those that are
  /// back soonest.
  double late_s = 0;
  /// Whether the hold before the motion is long enough to show that the robot rested.
  bool rested = true;
  std::vector<std::string> remarks;  ///< In words: what of the record was not used, and why.

  [[nodiscard]] std::size_t joint_count() const { return joints.size(); }
  /// Of what the record says of the robot: setpoints and replies of the first 0.2 s of its motion,
  /// in which two runs never are the same bit by bit. So a record under another name, or a part of
  /// one, is known again.
  [[nodiscard]] std::string Fingerprint() const;
};

/// Settings of the reading.
struct ReadingSettings {
  /// Counts for a turn of a drive's shaft; 14 bits are common. 0: encoders are exact.
  int encoder_counts_per_turn = 16384;
  /// What is taken of the hold before the motion, at most: longer than a robot takes to rest on its
  /// own ground.
  double hold_s = 0.6;
  /// A hold that is shorter does not tell how the robot stood.
  double hold_min_s = 0.15;
  /// What is taken of the settling after the motion, at most.
  double settle_s = 0.4;
  /// A joint that moves less in the whole record tells nothing [rad].
  double motion_min_rad = 0.02;
};

/// @throws RecordError, FileError  naming the record and what is wrong with it: no motion in it, no
///         hold before, a joint that did not move, a robot that lanes do not have.
RecordedMotion ReadRecordedMotion(const std::string& path, const ReadingSettings& settings = {});

}  // namespace tumbler
