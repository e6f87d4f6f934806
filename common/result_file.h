#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/toml_reader.h"

namespace tumbler {

/// A file that appears under its name only when it is whole, and only by Commit. So a reader never
/// sees a part of it, and a failure before leaves nothing behind.
class PendingFile {
 public:
  /// An existing file is replaced where it is, also behind a symbolic link.
  /// @throws FileError  when it cannot be written.
  PendingFile(const std::string& path, const std::string& text);
  ~PendingFile() { Discard(); }
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;

  /// Puts the file in place. @throws FileError  when that fails.
  void Commit();

 private:
  void Discard();

  std::filesystem::path path_;
  std::filesystem::path temporary_;
};

/// These check before the work whether its result can be written: a file, or files in a folder. The
/// folder is not made yet. @throws FileError  when they cannot be written.
void CheckWritable(const std::string& path);
void CheckFolderWritable(const std::string& path);

/// Checks that no result would replace one of the inputs, or another result, by whatever names they
/// go. To be called before anything is changed. An empty name and `-`, which is standard output,
/// are no files; devices can be named more than once.
/// @throws FileError  about the first that would.
void CheckDistinct(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

/// A reader for loaders that appends the name of each file to `inputs`, which has to outlive it.
FileReader NotingReader(std::vector<std::string>& inputs);

}  // namespace tumbler
