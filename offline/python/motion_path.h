#pragma once

#include <pybind11/pybind11.h>

#include <filesystem>
#include <string>

namespace tumbler {

/// A motion's file. A primitive that Python holds is written into a folder that lives as long as
/// this object.
class MotionPath {
 public:
  /// @param motion  a path, or a Primitive.
  explicit MotionPath(const pybind11::object& motion);
  ~MotionPath();
  MotionPath(const MotionPath&) = delete;
  MotionPath& operator=(const MotionPath&) = delete;

  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::filesystem::path folder_;  ///< Empty: none was made.
  std::string path_;
};

/// A new folder for files that nobody else is to see. @throws std::runtime_error
std::filesystem::path MakeTemporaryFolder();

}  // namespace tumbler
