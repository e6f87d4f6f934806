#pragma once

#include <cstdint>
#include <filesystem>
#include <sdf/sdf.hh>
#include <string>
#include <vector>

#include "offline/model/sdf_source.h"

namespace tumbler {

/// A file of SDF, as libsdformat has it.
class SdfFile {
 public:
  /// Reads the file and those that it includes, and finds the model that is taken.
  /// @throws FileError  with line and name: see `ReadSdf`.
  explicit SdfFile(const std::string& path);

  [[nodiscard]] const sdf::Model& model() const { return *model_; }
  [[nodiscard]] const std::filesystem::path& absolute() const { return absolute_; }

  /// @throws FileError  with file and line of the element.
  [[noreturn]] void Fail(const sdf::ElementPtr& at, const std::string& key,
                         const std::string& problem) const;
  static std::uint32_t LineOf(const sdf::ElementPtr& at);

  std::vector<std::string> notes;

 private:
  /// As the caller named it, where it is the same.
  [[nodiscard]] std::string NameOf(const std::string& file) const;
  void CheckSources(const std::filesystem::path& file, const sdf::ParserConfig& config,
                    std::vector<std::filesystem::path> above, SdfTaken taken);
  [[nodiscard]] std::string Find(const std::string& uri) const;
  [[nodiscard]] std::string WithPlaceFirst(const std::string& message) const;
  void Refuse(const sdf::Errors& errors, const std::vector<std::string>& said) const;
  void FindModel();

  std::string path_;
  std::filesystem::path absolute_;
  sdf::Root root_;
  const sdf::Model* model_ = nullptr;
  int includes_ = 0, frames_ = 0;  // of all files
};

}  // namespace tumbler
