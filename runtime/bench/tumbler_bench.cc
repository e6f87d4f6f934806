// tumbler bench: commissions motor drives over CAN.

#include "common/files/program.h"
#include "runtime/bench/bench_program.h"

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler bench", argc, argv, tumbler::RunBench);
}
