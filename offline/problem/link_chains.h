#pragma once

#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/model/planar_robot.h"

namespace tumbler {

/// How the absolute angles of a robot's links follow from its root's pitch and its joints. Links
/// behind a prismatic joint turn with the one that carries them. Links that a joint without a motor
/// turns are left out: no encoder tells where they are.
std::vector<LinkChain> LinkChainsOf(const PlanarRobot& robot);

}  // namespace tumbler
