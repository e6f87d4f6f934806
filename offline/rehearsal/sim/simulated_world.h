#pragma once

#include "runtime/run/simulation.h"

namespace tumbler {

/// The bus `sim` of tumbler-run: the robot of a motion as a `SimulatedRobot`, or as a twin file has
/// it.
Simulation MakeSimulation();

}  // namespace tumbler
