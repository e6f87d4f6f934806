#pragma once

#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <string>

namespace tumbler {

/// @throws std::runtime_error  naming the URL that LCM cannot use.
void RequireUsable(lcm::LCM& lcm, const std::string& url);
/// The same for a link that is listened to, also when no server answers there.
void RequireListening(lcm::LCM& lcm, const std::string& url);

/// Waits for a message, and hands it to its subscribers: `lcm::LCM::handleTimeout`, but for links
/// that are broken, such as tcpq without a server, where that one ends the program. May wait
/// longer by what an attempt to mend the link takes.
/// @returns above 0: a message was handled; 0: none came in time; below 0: the link is broken.
int HandleLcm(lcm::LCM& lcm, int timeout_ms);

/// Makes subscriptions so that the sockets that LCM opens for them take whole messages only. Ours
/// are never cut into fragments, and liblcm 1.3 believes what a fragment says of its place: one
/// datagram of anybody would end the program. A socket is without its filter for a moment after it
/// is opened, since LCM shows nobody its sockets.
/// @param subscribe  subscribes; the first of its calls opens the sockets.
void SubscribeToWholeMessages(const std::function<void()>& subscribe);

}  // namespace tumbler
