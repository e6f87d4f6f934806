#pragma once

#include <filesystem>

namespace tumbler {

/// A new folder for files that nobody else is to see. It is removed in the end with all that is in
/// it.
class TemporaryFolder {
 public:
  /// @throws std::runtime_error  with its name, when it cannot be made.
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace tumbler
