#pragma once

#include <lcm/lcm-cpp.hpp>

namespace tumbler {

/// Waits for a message, and hands it to its subscribers: `lcm::LCM::handleTimeout`, but for links
/// that are broken, such as tcpq without a server, where that one ends the program. May wait
/// longer by what an attempt to mend the link takes.
/// @returns above 0: a message was handled; 0: none came in time; below 0: the link is broken.
int HandleLcm(lcm::LCM& lcm, int timeout_ms);

}  // namespace tumbler
