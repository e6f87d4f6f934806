// Does the work of `tumbler optimize TASK --out OUT`, for a task in the plane, with a robot whose
// numbers are given. So it needs no library beside C++'s own, and is compiled for machines for
// which the others are not at hand.

#include <fstream>
#include <iostream>

#include "offline/certify/task_result.h"
#include "tests/offline/aarch64/robot_numbers.h"

namespace {

std::string numbers_file;

}  // namespace

namespace tumbler {

/// Takes the place of the parser.
Robot ParseRobot(const std::string&, const std::string& file_name, RootKind root,
                 const LockedJoints& locked) {
  std::ifstream in(numbers_file);
  testing::NumberReader reader(in);
  Robot robot;
  Visit(reader, robot);
  robot.file = file_name;
  if (robot.root != root || !locked.empty())
    throw std::runtime_error("the task is for another robot than the numbers are of");
  return robot;
}

}  // namespace tumbler

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: found_motion TASK ROBOT_NUMBERS OUT\n";
    return 1;
  }
  numbers_file = argv[2];
  tumbler::WorkSettings settings;
  settings.quiet = true;
  settings.threads = 2;
  const tumbler::TaskResult result = tumbler::WorkOn(tumbler::LoadTask(argv[1]), settings);
  if (!result.file) {
    std::cerr << result.cause << '\n';
    return 2;
  }
  std::ofstream out(argv[3], std::ios::binary);
  out << tumbler::ToToml(*result.file);
  return out.flush() ? 0 : 1;
}
