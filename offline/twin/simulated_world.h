#pragma once

#include "runtime/run/simulation.h"

namespace tumbler {

/// The bus `sim` of tumbler run. It has the robot of the motion as a `SimulatedRobot`, with the
/// settings of a twin file where one is given.
Simulation MakeSimulation();

}  // namespace tumbler
