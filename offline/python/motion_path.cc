#include "offline/python/motion_path.h"

#include <pybind11/stl/filesystem.h>

#include <cerrno>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <system_error>

#include "common/files/result_file.h"
#include "offline/python/loaded_primitive.h"

namespace tumbler {

std::filesystem::path MakeTemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "tumbler-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr)
    throw std::runtime_error(name + ": " + std::generic_category().message(errno));
  return name;
}

MotionPath::MotionPath(const pybind11::object& motion) {
  if (!pybind11::isinstance<LoadedPrimitive>(motion)) {
    path_ = motion.cast<std::filesystem::path>().string();
    return;
  }
  const auto primitive = motion.cast<std::shared_ptr<LoadedPrimitive>>();
  folder_ = MakeTemporaryFolder();
  path_ = (folder_ / "motion.toml").string();
  try {
    WriteResult(path_, ToToml(primitive->file));
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
    throw;
  }
}

MotionPath::~MotionPath() {
  std::error_code ignored;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

}  // namespace tumbler
