#pragma once

#include <string>

namespace tumbler {

/// The right of one program to command the drives on an interface: whoever holds it is the only
/// one of all programs on this machine that ask for it.
///
/// The kernel gives the lock back when its holder ends, however it ends. It belongs to the network
/// namespace, like the interface.
class InterfaceLock {
 public:
  InterfaceLock() = default;
  ~InterfaceLock();
  InterfaceLock(const InterfaceLock&) = delete;
  InterfaceLock& operator=(const InterfaceLock&) = delete;

  /// Takes the lock of an interface, at once or not at all. The interface itself is not touched,
  /// and need not exist. To be called once.
  /// @returns what is wrong, naming the program that holds the lock if it can be found; empty when
  /// it was taken.
  [[nodiscard]] std::string Take(const std::string& interface);

 private:
  int socket_ = -1;
};

}  // namespace tumbler
