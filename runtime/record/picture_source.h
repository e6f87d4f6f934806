#pragma once

#include <functional>
#include <string>
#include <vector>

#include "runtime/record/robot_picture.h"

namespace tumbler {

/// What a flight record tells of the robot in it.
struct RecordPicture {
  RobotPicture robot;
  std::vector<PlannedInstant> plan;  ///< In the order of time.
};

/// Makes pictures of robots from the texts that motions carry. Robot files are read by what is no
/// part of the runtime, so a program that has it passes this in.
struct PictureSource {
  /// The robot of a motion file. Its joints are numbered as in `joints`. Throws FileError.
  std::function<RobotPicture(const std::string& motion_file,
                             const std::vector<std::string>& joints)>
      of_motion;
  /// The robot and the plan of a flight record, given by its file. Throws FileError, RecordError or
  /// std::runtime_error naming the file.
  std::function<RecordPicture(const std::string& record_file)> of_record;
};

}  // namespace tumbler
