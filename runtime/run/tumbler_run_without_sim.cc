// tumbler run of a build without the offline side: plays a primitive, or a sequence of them, on
// motors.

#include "common/files/program.h"
#include "runtime/run/run_program.h"

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler run", argc, argv, [](int count, char** arguments) {
    return tumbler::PlayMotion(count, arguments, nullptr, nullptr);
  });
}
