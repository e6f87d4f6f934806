#include "common/files/toml_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

// Whether the bytes are UTF-8 (RFC 3629). TOML holds no other text.
bool IsUtf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const int extra = lead < 0x80 ? 0 : lead >= 0xf0 ? 3 : lead >= 0xe0 ? 2 : 1;
    if ((lead >= 0x80 && lead < 0xc2) || lead > 0xf4 ||
        text.size() - i <= static_cast<std::size_t>(extra)) {
      return false;
    }
    std::uint32_t code = extra == 0 ? lead : lead & (0x3fU >> extra);
    for (int k = 1; k <= extra; ++k) {
      const auto next = static_cast<unsigned char>(text[i + static_cast<std::size_t>(k)]);
      if ((next & 0xc0U) != 0x80) return false;
      code = code << 6 | (next & 0x3fU);
    }
    const bool overlong = (extra == 2 && code < 0x800) || (extra == 3 && code < 0x10000);
    if (overlong || code > 0x10ffff || (code >= 0xd800 && code <= 0xdfff)) return false;
    i += static_cast<std::size_t>(extra) + 1;
  }
  return true;
}

bool IsControl(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return byte < 0x20 || byte == 0x7f;
}

// The text as it stands between the quotes of a TOML basic string. `multiline` leaves line feeds as
// they are.
std::string Escaped(std::string_view text, bool multiline) {
  std::string result;
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      result += {'\\', c};
    } else if (IsControl(c) && !(multiline && c == '\n')) {
      result += fmt::format("\\u{:04X}", static_cast<unsigned char>(c));
    } else {
      result += c;
    }
  }
  return result;
}

// A TOML multi-line string that reads back exactly. It is a literal string, which people can read,
// unless the text holds something that a literal string cannot: quotes in a row, a quote at its
// end, carriage returns or other control characters.
std::string MultilineText(std::string_view text) {
  const bool literal = text.find("'''") == std::string_view::npos && !text.ends_with('\'') &&
                       std::none_of(text.begin(), text.end(),
                                    [](char c) { return IsControl(c) && c != '\n' && c != '\t'; });
  // The line feed right after the opening quotes is not part of the value.
  return literal ? fmt::format("'''\n{}'''", text)
                 : fmt::format("\"\"\"\n{}\"\"\"", Escaped(text, true));
}

void RequireUtf8(std::string_view key, std::string_view value) {
  if (!IsUtf8(value)) throw std::invalid_argument(fmt::format("{} is not UTF-8 text", key));
}

}  // namespace

void TomlWriter::Number(std::string_view key, double value) {
  if (!std::isfinite(value)) {
    throw std::invalid_argument(
        fmt::format("{} is {}; {} holds finite numbers", key, value, holder_));
  }
  Line(fmt::format("{} = {}", key, ExactDecimal(value)));
}

void TomlWriter::Numbers(std::string_view key, std::span<const double> values) {
  constexpr std::size_t kPerLine = 4;
  std::string line = fmt::format("{} = [", key);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) {
      throw std::invalid_argument(
          fmt::format("{}[{}] is {}; {} holds finite numbers", key, i, values[i], holder_));
    }
    if (values.size() > kPerLine && i % kPerLine == 0) line += "\n  ";
    line += ExactDecimal(values[i]);
    if (i + 1 < values.size()) line += (i + 1) % kPerLine == 0 ? "," : ", ";
  }
  Line(line + (values.size() > kPerLine ? "\n]" : "]"));
}

void TomlWriter::Text(std::string_view key, std::string_view value) {
  RequireUtf8(key, value);
  Line(fmt::format("{} = \"{}\"", key, Escaped(value, false)));
}

void TomlWriter::Texts(std::string_view key, std::span<const std::string> values) {
  std::string list;
  for (const std::string& value : values) {
    RequireUtf8(key, value);
    list += fmt::format("{}\"{}\"", list.empty() ? "" : ", ", Escaped(value, false));
  }
  Line(fmt::format("{} = [{}]", key, list));
}

void TomlWriter::LongText(std::string_view key, std::string_view value) {
  RequireUtf8(key, value);
  Line(fmt::format("{} = {}", key, MultilineText(value)));
}

}  // namespace tumbler
