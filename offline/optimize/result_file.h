#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tumbler {

/// A file that appears under its name only when it is whole, and only when Commit is called: a
/// reader never sees half of one, and what fails before leaves nothing behind.
class PendingFile {
 public:
  /// An existing file is replaced where it is, also behind a symbolic link.
  /// @throws FileError when it cannot be written.
  PendingFile(const std::string& path, const std::string& text);
  ~PendingFile() { Discard(); }
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;

  /// @throws FileError when it cannot be put in place.
  void Commit();

 private:
  void Discard();

  std::filesystem::path path_;
  std::filesystem::path temporary_;
};

/// Find out before the work whether its result can be written: a file, or a folder, which is made
/// when it is needed, not before. @throws FileError when it cannot.
void CheckWritable(const std::string& path);
void CheckFolderWritable(const std::string& path);

/// No result may take the place of what it is made from, or of another result.
/// @throws FileError about the first that would.
void CheckDistinct(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

}  // namespace tumbler
