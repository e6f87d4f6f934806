#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tumbler {

/// Which models of a file can be part of the robot.
enum class SdfTaken {
  kNone,
  kWithJoints,  ///< Its first, where it has joints or includes something.
  kFirst,       ///< Its first, and others like that.
};

/// What the text of a file of SDF has, which libsdformat does not say or reads until memory or
/// time are at their end.
struct SdfSource {
  struct Include {
    std::uint32_t line = 0;
    std::string uri;
    SdfTaken taken = SdfTaken::kNone;  ///< Of the file that is included.
  };
  std::vector<Include> includes;
  int frames = 0;             ///< Links, joints, frames and models, each of which has a frame.
  std::string newer_version;  ///< Of SDF than the library knows; empty: it is not newer.
};

/// Looks through a file's text. Of XML that is not well-formed, and of other formats, nothing is
/// said: the library says it.
/// @param name   stands for the file in messages.
/// @param taken  which of its models can be part of the robot. In these, texts of numbers are
/// numbers as a whole, sizes are positive, axes have a direction and joints a type, and no
/// inertial is left to Gazebo to find. Others are not looked at.
/// @throws FileError  with line and name, when it is otherwise, or the version cannot be read.
SdfSource ReadSdfSource(const std::string& file, const std::string& name, SdfTaken taken);

}  // namespace tumbler
