// Does the work of `tumbler optimize TASK --out OUT`, for a task in the plane. It needs no library
// beside C++'s own, and is compiled for machines for which the others are not at hand.

#include <fstream>
#include <iostream>

#include "offline/certify/task_result.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: found_motion TASK OUT\n";
    return 1;
  }
  tumbler::WorkSettings settings;
  settings.quiet = true;
  settings.threads = 2;
  const tumbler::TaskResult result = tumbler::WorkOn(tumbler::LoadTask(argv[1]), settings);
  if (!result.file) {
    std::cerr << result.cause << '\n';
    return 2;
  }
  std::ofstream out(argv[2], std::ios::binary);
  out << tumbler::ToToml(*result.file);
  return out.flush() ? 0 : 1;
}
