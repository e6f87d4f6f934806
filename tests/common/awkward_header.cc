// Writes the header with which motion_header_test is compiled. usage: awkward_header OUT

#include <fstream>

#include "common/files/motion_header.h"
#include "tests/support/awkward_motion.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  std::ofstream stream(argv[1], std::ios::binary);
  stream << tumbler::ToHeader(tumbler::testing::AwkwardMotion(), "the text of the file",
                              "awkward::motion")
         << std::flush;
  return stream ? 0 : 1;
}
