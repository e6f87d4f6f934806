#include "runtime/assembly/file_keeper.h"

namespace tumbler {

FileReader FileKeeper::reader() {
  return [this](const std::string& path) {
    for (const LoadedFile& file : files_) {
      if (file.path == path) return file.text;
    }
    files_.push_back({path, ReadTextFile(path)});
    return files_.back().text;
  };
}

}  // namespace tumbler
