// tumbler record: describes the content of a flight record, and exports it for other tools.

#include "common/files/program.h"
#include "offline/pages/run_picture.h"
#include "runtime/record/record_program.h"

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler record", argc, argv, [](int count, char** arguments) {
    const tumbler::PictureSource pictures = tumbler::MakePictureSource();
    return tumbler::DescribeRecord(count, arguments, &pictures);
  });
}
