#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "common/files/temporary_folder.h"

namespace tumbler::testing {

/// Path of a file of the project, such as `primitives/gait.toml`.
[[nodiscard]] std::string SourcePath(const std::string& name);
/// Path of a file of the build under test.
[[nodiscard]] std::string BuildPath(const std::string& name);
/// Path of a program of the build under test, such as `tumbler run`.
[[nodiscard]] std::string ProgramPath(const std::string& name);

/// Reads all bytes of a file. @throws std::runtime_error  when it cannot be read.
[[nodiscard]] std::string ReadFile(const std::filesystem::path& path);
/// Writes a file. @throws std::runtime_error  when it cannot be written.
void WriteFile(const std::filesystem::path& path, const std::string& text);

/// The text with the first `from` after the first `after` replaced. Both must be there.
[[nodiscard]] std::string Replaced(std::string text, const std::string& from, const std::string& to,
                                   const std::string& after = "");
/// The text with every `from` replaced. There may be none.
[[nodiscard]] std::string ReplacedAll(std::string text, const std::string& from,
                                      const std::string& to);
/// The number of the line, from 1 on, in which the first `part` begins. It must be there.
[[nodiscard]] int LineOf(const std::string& text, const std::string& part);

/// All matches of a POSIX extended regular expression. Each is the whole match, then its groups; a
/// group that took no part is empty.
[[nodiscard]] std::vector<std::vector<std::string>> MatchesOf(const std::string& pattern,
                                                              const std::string& text);

/// The bytes of a text, for readers of binary data. They live as long as the text.
[[nodiscard]] std::span<const std::uint8_t> AsBytes(const std::string& text);

/// The product's, with names of what is in it.
class TemporaryFolder : public tumbler::TemporaryFolder {
 public:
  [[nodiscard]] std::string operator/(const std::string& name) const;
  /// Every file and folder in it, as paths relative to it.
  [[nodiscard]] std::set<std::string> Listing() const;
};

}  // namespace tumbler::testing
