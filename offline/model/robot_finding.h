#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/files/toml_reader.h"

namespace tumbler {

/// Something in a robot file that stands in the way of a use of it: the place, and what is wrong.
struct RobotFinding {
  std::uint32_t line = 0;
  std::string key;  ///< Of the link or joint, such as `joint 'leg1'`.
  std::string problem;
};

/// A robot file that cannot be used, with everything that is known to be wrong with it. The message
/// is that of the first finding, and says how many there are besides.
class RobotFileError : public FileError {
 public:
  /// @pre findings is not empty.
  RobotFileError(const std::string& file, std::vector<RobotFinding> findings);

  [[nodiscard]] const std::vector<RobotFinding>& findings() const { return findings_; }

 private:
  std::vector<RobotFinding> findings_;
};

}  // namespace tumbler
