// Takes the place of the parser of URDFs: the robot is that of the file of numbers
// (robot_numbers.h) that the environment names, ROBOT_NUMBERS.

#include <cstdlib>
#include <fstream>
#include <span>
#include <stdexcept>
#include <string>

#include "offline/model/urdf_edit.h"
#include "tests/offline/aarch64/robot_numbers.h"

namespace tumbler {

Robot ParseRobot(const std::string& /*text*/, const std::string& file_name, RootKind root,
                 const LockedJoints& locked) {
  const char* const numbers = std::getenv("ROBOT_NUMBERS");
  if (numbers == nullptr) throw std::runtime_error("ROBOT_NUMBERS names no file");
  std::ifstream in(numbers);
  testing::NumberReader reader(in);
  Robot robot;
  Visit(reader, robot);
  robot.file = file_name;
  if (robot.root != root || !locked.empty())
    throw std::runtime_error("the task is for another robot than the numbers are of");
  return robot;
}

/// Meshes are in no such file.
std::string WithPoints(const std::string& /*urdf*/, const std::string& /*file_name*/,
                       std::span<const ShapeAsPoints> /*shapes*/) {
  throw std::logic_error("a robot of numbers has no meshes");
}

}  // namespace tumbler
