#pragma once

#include <string>
#include <string_view>

namespace tumbler {

/// A text as a field of CSV: in quotes where it has commas, quotes or line feeds (RFC 4180).
inline std::string CsvField(std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? "\"\"" : std::string(1, c);
  return field + '"';
}

}  // namespace tumbler
