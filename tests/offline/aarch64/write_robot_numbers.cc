// Writes the numbers of a planar robot for found_motion.cc.

#include <fstream>
#include <iostream>
#include <sstream>

#include "tests/offline/aarch64/robot_numbers.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: write_robot_numbers ROBOT.urdf OUT\n";
    return 1;
  }
  std::ostringstream text;
  text << std::ifstream(argv[1]).rdbuf();
  tumbler::Robot robot = tumbler::ParseRobot(text.str(), argv[1], tumbler::RootKind::kPlanarXz);
  std::ofstream out(argv[2]);
  tumbler::testing::NumberWriter writer(out);
  Visit(writer, robot);
  return out.flush() && robot.findings.empty() && robot.locked.empty() ? 0 : 1;
}
