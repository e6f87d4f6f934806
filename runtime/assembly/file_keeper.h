#pragma once

#include <string>
#include <vector>

#include "common/toml_reader.h"

namespace tumbler {

/// A file as it was loaded.
struct LoadedFile {
  std::string path;  ///< As the program was given it, or found it.
  std::string text;
};

/// Takes part in loading: hands out the texts of files, and keeps them for a record.
class FileKeeper {
 public:
  /// For loaders; refers to this object.
  [[nodiscard]] FileReader reader();
  /// Each file once, in the order in which they were first read.
  [[nodiscard]] const std::vector<LoadedFile>& files() const { return files_; }

 private:
  std::vector<LoadedFile> files_;
};

}  // namespace tumbler
