#pragma once

#include <string>
#include <string_view>

namespace tumbler {

/// A text as a terminal may show it. Names of files, and those in files and messages, are written
/// by anybody: control characters other than ends of lines and tabs become `\x1b` and the like, so
/// that none of them commands the terminal. Everything else, UTF-8 too, stays.
inline std::string Printable(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    // U+0080 ... U+009F, which are C2 80 ... C2 9F in UTF-8, are control characters as well.
    const bool high = byte == 0xC2 && i + 1 < text.size() &&
                      static_cast<unsigned char>(text[i + 1]) >= 0x80 &&
                      static_cast<unsigned char>(text[i + 1]) < 0xA0;
    if (high || (byte < 0x20 && byte != '\n' && byte != '\t') || byte == 0x7F) {
      const auto shown = high ? static_cast<unsigned char>(text[++i]) : byte;
      out += "\\x";
      out += kDigits[shown >> 4U];
      out += kDigits[shown & 15U];
    } else {
      out += text[i];
    }
  }
  return out;
}

/// A text from a message as part of one line of a terminal: ends of lines and tabs become `\x0a`
/// and `\x09`, too, so that it cannot pass for lines of its own.
inline std::string PrintableInLine(std::string_view text) {
  std::string out;
  for (const char c : Printable(text)) {
    if (c == '\n') {
      out += "\\x0a";
    } else if (c == '\t') {
      out += "\\x09";
    } else {
      out += c;
    }
  }
  return out;
}

/// What is wrong with a name that has a character which is none to be seen: an escape character, or
/// the one of U+009B that stands for the same, would command a terminal that shows it, and others
/// make it look like something else, or two lines. Loaders refuse such names.
/// @returns null for a name that is right.
inline const char* MistakeInName(std::string_view name) {
  if (name.find('\x1b') != std::string_view::npos ||
      name.find("\xC2\x9B") != std::string_view::npos)
    return "has an escape character, which would command the terminal that shows it; take it out";
  if (Printable(name) != name || name.find_first_of("\n\t") != std::string_view::npos)
    return "has a control character, such as the end of a line; take it out";
  return nullptr;
}

}  // namespace tumbler
