#include "runtime/assembly/file_keeper.h"

namespace tumbler {

FileReader FileKeeper::reader(const FileReader& source) {
  return [this, source](const std::string& path) {
    for (const LoadedFile& file : files_) {
      if (file.path == path) return file.text;
    }
    files_.push_back({path, source ? source(path) : ReadTextFile(path)});
    return files_.back().text;
  };
}

}  // namespace tumbler
