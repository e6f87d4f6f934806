// tumbler-run of a build without the offline side: plays a primitive, or a sequence of them, on
// motors.

#include "runtime/run/run_program.h"

int main(int argc, char** argv) { return tumbler::RunProgram(argc, argv, nullptr); }
