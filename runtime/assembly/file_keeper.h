#pragma once

#include <string>
#include <vector>

#include "common/files/toml_reader.h"

namespace tumbler {

/// A file as it was loaded.
struct LoadedFile {
  std::string path;  ///< The path that the program was given, or found.
  std::string text;
};

/// Reads files for loaders, and keeps their texts for a record.
class FileKeeper {
 public:
  /// A reader for loaders. It refers to this object.
  /// @param source  where texts come from; empty: the file system.
  [[nodiscard]] FileReader reader(const FileReader& source = {});
  /// Every file that was read, once, in the order of the first readings.
  [[nodiscard]] const std::vector<LoadedFile>& files() const { return files_; }

 private:
  std::vector<LoadedFile> files_;
};

}  // namespace tumbler
