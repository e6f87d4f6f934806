#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tumbler {

/// Holds the names of results from before the work that makes them until its end: another program
/// that would write one of them meanwhile is refused before its own work, which one of the two
/// would lose. Nothing in the file system says so, neither meanwhile nor after a program that was
/// killed: the system gives the names free. It knows of the programs of this machine (of one
/// network namespace: names are those of sockets that are in no folder).
class HeldResults {
 public:
  HeldResults() = default;
  /// @param paths  of files that are written as a PendingFile, or of folders of results. Empty
  ///               ones, `-` and devices are not held.
  /// @throws FileError  about the first that another program holds.
  explicit HeldResults(const std::vector<std::string>& paths);
  ~HeldResults();
  HeldResults(HeldResults&& other) noexcept { sockets_.swap(other.sockets_); }
  HeldResults& operator=(HeldResults&& other) noexcept {
    sockets_.swap(other.sockets_);
    return *this;
  }

 private:
  std::vector<int> sockets_;
};

/// Where a file is, or would be when it is made. A name is looked up from the working folder, since
/// one of a file that is not there is else taken as it is written.
std::filesystem::path PlaceOf(const std::string& name);

/// What is said of a result that another program holds, or writes.
inline constexpr const char* kWrittenByAnother =
    "is being written by another program; wait for its end, or give this one a file of its own";

}  // namespace tumbler
