#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <vector>

namespace tumbler::testing {

/// Path of a file of the project, such as `primitives/gait.toml`.
[[nodiscard]] std::string SourcePath(const std::string& name);
/// Path of a file of the build under test.
[[nodiscard]] std::string BuildPath(const std::string& name);
/// Path of a program of the build under test, such as `tumbler-run`.
[[nodiscard]] std::string ProgramPath(const std::string& name);

/// All bytes of a file. @throws std::runtime_error  when it cannot be read.
[[nodiscard]] std::string ReadFile(const std::filesystem::path& path);
/// @throws std::runtime_error  when it cannot be written.
void WriteFile(const std::filesystem::path& path, const std::string& text);

/// The text with the first `from` after the first `after` replaced; both must be there.
[[nodiscard]] std::string Replaced(std::string text, const std::string& from, const std::string& to,
                                   const std::string& after = "");
/// The text with every `from` replaced, of which there may be none.
[[nodiscard]] std::string ReplacedAll(std::string text, const std::string& from,
                                      const std::string& to);
/// The number of the line, from 1, in which the first `part` begins; it must be there.
[[nodiscard]] int LineOf(const std::string& text, const std::string& part);

/// What each match of a POSIX extended regular expression consists of: the whole, then its groups,
/// empty where one took no part.
[[nodiscard]] std::vector<std::vector<std::string>> MatchesOf(const std::string& pattern,
                                                              const std::string& text);

/// The same bytes, as readers of binary data take them. They live as long as the text.
[[nodiscard]] std::span<const std::uint8_t> AsBytes(const std::string& text);

/// An empty folder of its own, until the end of the scope.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::string operator/(const std::string& name) const;
  /// Every file and folder in it, relative to it.
  [[nodiscard]] std::set<std::string> Listing() const;

 private:
  std::filesystem::path path_;
};

}  // namespace tumbler::testing
