// tumbler record of a build without the offline side, which reads no robot files: describes the
// content of a flight record, and exports it for other tools.

#include "common/files/program.h"
#include "runtime/record/record_program.h"

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler record", argc, argv, [](int count, char** arguments) {
    return tumbler::DescribeRecord(count, arguments, nullptr);
  });
}
