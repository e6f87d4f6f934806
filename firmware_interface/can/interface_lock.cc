#include "firmware_interface/can/interface_lock.h"

#include <fmt/format.h>
#include <net/if.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <fstream>
#include <system_error>

namespace tumbler {

namespace {

/// A name that only one socket of a network namespace can have. It is in no file system, so nothing
/// of it is left when its holder is killed.
struct LockName {
  explicit LockName(const std::string& interface) {
    const std::string name = "tumbler/can/" + interface;
    address.sun_family = AF_UNIX;
    // The first character is zero, which makes the name an abstract one.
    const std::size_t length = std::min(name.size(), sizeof(address.sun_path) - 1);
    std::copy_n(name.begin(), length, address.sun_path + 1);
    size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + length);
  }
  sockaddr_un address{};
  socklen_t size = 0;
};

/// The interface's own name, of whatever other names it has (`ip link property add ... altname`).
std::string OwnName(const std::string& interface) {
  std::array<char, IF_NAMESIZE> name{};
  const unsigned index = if_nametoindex(interface.c_str());
  return index != 0 && if_indextoname(index, name.data()) != nullptr ? name.data() : interface;
}

int MakeSocket() { return socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0); }

/// The process that holds the lock, such as `process 1234 (tumbler run)`.
std::string DescribeHolder(const LockName& name) {
  const int asker = MakeSocket();
  ucred holder{};
  socklen_t size = sizeof holder;
  const bool found =
      asker >= 0 &&
      connect(asker, reinterpret_cast<const sockaddr*>(&name.address), name.size) == 0 &&
      getsockopt(asker, SOL_SOCKET, SO_PEERCRED, &holder, &size) == 0 && holder.pid > 0;
  if (asker >= 0) close(asker);
  if (!found) return "another program";
  std::string program;
  std::ifstream file(fmt::format("/proc/{}/comm", holder.pid));
  std::getline(file, program);
  return fmt::format("process {}{}", holder.pid, program.empty() ? "" : " (" + program + ")");
}

}  // namespace

InterfaceLock::~InterfaceLock() {
  if (socket_ >= 0) close(socket_);
}

std::string InterfaceLock::Take(const std::string& interface) {
  const LockName name(OwnName(interface));
  constexpr int kAskersMax = 16;
  socket_ = MakeSocket();
  const bool bound = socket_ >= 0 && bind(socket_, reinterpret_cast<const sockaddr*>(&name.address),
                                          name.size) == 0;
  const int error = bound ? 0 : errno;
  if (bound && listen(socket_, kAskersMax) == 0) return "";
  if (error == EADDRINUSE) {
    return fmt::format("{} drives the motors on {} already: end that program first",
                       DescribeHolder(name), interface);
  }
  return fmt::format("the lock of {} cannot be taken: {}", interface,
                     std::generic_category().message(error));
}

}  // namespace tumbler
