// tumbler run: plays a primitive, or a sequence of them, on motors or on a simulated robot.

#include "common/files/program.h"
#include "offline/pages/run_picture.h"
#include "offline/twin/simulated_world.h"
#include "runtime/run/run_program.h"

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler run", argc, argv, [](int count, char** arguments) {
    const tumbler::Simulation simulation = tumbler::MakeSimulation();
    const tumbler::PictureSource pictures = tumbler::MakePictureSource();
    return tumbler::PlayMotion(count, arguments, &simulation, &pictures);
  });
}
