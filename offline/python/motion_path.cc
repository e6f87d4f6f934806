#include "offline/python/motion_path.h"

#include <pybind11/stl/filesystem.h>

#include <memory>

#include "common/files/result_file.h"
#include "offline/python/loaded_primitive.h"

namespace tumbler {

MotionPath::MotionPath(const pybind11::object& motion) {
  if (!pybind11::isinstance<LoadedPrimitive>(motion)) {
    path_ = motion.cast<std::filesystem::path>().string();
    return;
  }
  const auto primitive = motion.cast<std::shared_ptr<LoadedPrimitive>>();
  path_ = (folder_.emplace().path() / "motion.toml").string();
  WriteResult(path_, ToToml(primitive->file));
}

}  // namespace tumbler
