// tumbler-log of a build without the offline side, which reads no robot files: shows an LCM log of
// tumbler-run, and writes its ticks for other tools.

#include "common/files/program.h"
#include "runtime/record/log_program.h"

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler-log", argc, argv, [](int count, char** arguments) {
    return tumbler::ShowLog(count, arguments, nullptr);
  });
}
