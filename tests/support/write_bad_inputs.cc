// Writes the bad tasks and robots of tests/data/bad_inputs into a folder, as files to try.

#include <cstdio>
#include <exception>
#include <filesystem>

#include "tests/support/bad_inputs.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
    return 2;
  }
  try {
    std::filesystem::create_directories(argv[1]);
    tumbler::testing::WriteBadInputs(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
  }
}
