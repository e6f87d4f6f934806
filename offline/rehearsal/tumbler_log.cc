// tumbler-log: shows an LCM log of tumbler-run, and writes its ticks for other tools.

#include "common/program.h"
#include "offline/rehearsal/flight_report/run_picture.h"
#include "runtime/mcap/log_program.h"

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler-log", argc, argv, [](int count, char** arguments) {
    const tumbler::PictureSource pictures = tumbler::MakePictureSource();
    return tumbler::ShowLog(count, arguments, &pictures);
  });
}
