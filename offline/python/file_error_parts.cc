#include "offline/python/file_error_parts.h"

#include <charconv>
#include <cstddef>
#include <filesystem>
#include <system_error>
#include <utility>

namespace tumbler {
namespace {

constexpr std::string_view kColon = ": ";

/// The text after the file's name, `:LINE: ` or `: `, or nothing where it is neither.
std::optional<std::pair<std::optional<std::uint32_t>, std::string_view>> AfterName(
    std::string_view text) {
  using Parts = std::pair<std::optional<std::uint32_t>, std::string_view>;
  if (text.starts_with(kColon)) return Parts{std::nullopt, text.substr(kColon.size())};
  if (!text.starts_with(':')) return std::nullopt;
  std::uint32_t line = 0;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data() + 1, end, line);
  if (error != std::errc()) return std::nullopt;
  const std::string_view after = text.substr(static_cast<std::size_t>(rest - text.data()));
  if (!after.starts_with(kColon)) return std::nullopt;
  return Parts{line, after.substr(kColon.size())};
}

/// The key with which the text begins: one word, or a quoted name with the word before it.
std::optional<std::string> KeyIn(std::string_view text) {
  std::size_t at = text.find_first_of(" :'");
  for (const std::string_view kind : {"link '", "joint '"}) {
    if (!text.starts_with(kind)) continue;
    const std::size_t close = text.find('\'', kind.size());
    at = close == std::string_view::npos ? close : text.find_first_of(" :", close);
  }
  while (at != std::string_view::npos && text[at] != ' ') {
    if (at > 0 && text.substr(at).starts_with(kColon)) return std::string(text.substr(0, at));
    at = text.find_first_of(" :", at + 1);
  }
  return std::nullopt;
}

}  // namespace

FileErrorParts PartsOf(std::string_view message, std::string_view path) {
  if (!path.empty() && message.starts_with(path)) {
    if (const auto after = AfterName(message.substr(path.size())))
      return {std::string(path), after->first, KeyIn(after->second)};
  }
  FileErrorParts parts;
  bool found = false;
  for (std::size_t at = message.find(':'); at != std::string_view::npos;
       at = message.find(':', at + 1)) {
    const auto after = AfterName(message.substr(at));
    if (!after) continue;
    std::string file(message.substr(0, at));
    std::error_code unknown;
    const bool exists = std::filesystem::exists(file, unknown);
    if (!found || exists) parts = {std::move(file), after->first, KeyIn(after->second)};
    found = true;
    if (exists) break;
  }
  return parts;
}

}  // namespace tumbler
