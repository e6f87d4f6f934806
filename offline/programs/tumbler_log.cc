// tumbler-log: shows an LCM log of tumbler-run, and writes its ticks for other tools.

#include "common/files/program.h"
#include "offline/pages/run_picture.h"
#include "runtime/record/log_program.h"

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler-log", argc, argv, [](int count, char** arguments) {
    const tumbler::PictureSource pictures = tumbler::MakePictureSource();
    return tumbler::ShowLog(count, arguments, &pictures);
  });
}
