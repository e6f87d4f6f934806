// tumbler-run: plays a primitive, or a sequence of them, on motors or on a simulated robot.

#include "offline/rehearsal/sim/simulated_world.h"
#include "runtime/run/run_program.h"

int main(int argc, char** argv) {
  const tumbler::Simulation simulation = tumbler::MakeSimulation();
  return tumbler::RunProgram(argc, argv, &simulation);
}
