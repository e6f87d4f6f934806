#include "common/files/held_results.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <system_error>

#include "common/files/primitive_hash.h"
#include "common/files/result_file.h"
#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

/// Takes a name that one program of the machine has at a time. @returns its socket; -1 where there
/// are no such sockets. @throws FileError when another program has it.
int HoldName(const std::string& path) {
  const int held = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (held < 0) return -1;
  // A name whose first byte is 0 is in no folder, and goes with the socket. A path may be longer.
  const std::string name = "tumbler result " + HashOfText(PlaceOf(path).string());
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  name.copy(address.sun_path + 1, sizeof address.sun_path - 1);
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  const bool bound = bind(held, reinterpret_cast<const sockaddr*>(&address), size) == 0;
  const int why = errno;
  if (bound) return held;
  close(held);
  if (why == EADDRINUSE) throw FileError(path, 0, "", kWrittenByAnother);
  return -1;
}

}  // namespace

std::filesystem::path PlaceOf(const std::string& name) {
  std::error_code ignored;
  return std::filesystem::weakly_canonical(std::filesystem::absolute(name, ignored), ignored);
}

HeldResults::HeldResults(const std::vector<std::string>& paths) {
  HeldResults held;  // gives all free where one is not
  for (const std::string& path : paths) {
    if (path.empty() || path == "-" || IsDevice(path)) continue;
    if (const int name = HoldName(path); name >= 0) held.sockets_.push_back(name);
  }
  sockets_.swap(held.sockets_);
}

HeldResults::~HeldResults() {
  for (const int name : sockets_) close(name);
}

}  // namespace tumbler
