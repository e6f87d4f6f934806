#include "offline/studies/toml_edit.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include <toml++/toml.h>

#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

toml::table ParsedToml(const std::string& text, const std::string& name) {
  // The reader refuses what would be dangerous to parse.
  static_cast<void>(TomlTable::Parse(text, name));
  return toml::parse(text, name);
}

/// The entry of a table or an array, or a null pointer.
const toml::node* EntryOf(const toml::node& node, std::string_view part) {
  if (const toml::table* table = node.as_table()) return table->get(part);
  const toml::array* array = node.as_array();
  if (array == nullptr) return nullptr;
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), index);
  if (error != std::errc() || end != part.data() + part.size()) return nullptr;
  return array->get(index);
}

const toml::node& NumberNode(const toml::table& root, const std::string& name,
                             const std::string& path) {
  const toml::node* node = &root;
  std::uint32_t line = 0;
  std::string_view rest = path;
  while (true) {
    const std::size_t dot = rest.find('.');
    const toml::node* entry = EntryOf(*node, rest.substr(0, dot));
    if (entry == nullptr) {
      throw FileError(
          name, line, path,
          "is not there, so no number can take its place; write it into the file first");
    }
    node = entry;
    line = node->source().begin.line;
    if (dot == std::string_view::npos) break;
    rest.remove_prefix(dot + 1);
  }
  if (!node->is_number())
    throw FileError(name, line, path, "is no number; allowed: the key of a number");
  return *node;
}

/// The place of a line and column of the parser, which counts columns in characters of UTF-8.
std::size_t PlaceOf(std::string_view text, toml::source_position at) {
  std::size_t place = 0;
  for (std::uint32_t line = 1; line < at.line; ++line) place = text.find('\n', place) + 1;
  const auto continues = [&](std::size_t i) {
    return (static_cast<unsigned char>(text[i]) & 0xC0U) == 0x80U;
  };
  for (std::uint32_t column = 1; column < at.column; ++column) {
    ++place;
    while (place < text.size() && continues(place)) ++place;
  }
  return place;
}

}  // namespace

double NumberAt(const std::string& text, const std::string& name, const std::string& path) {
  const toml::table root = ParsedToml(text, name);
  return NumberNode(root, name, path).value_or(0.0);
}

std::string WithOnly(const std::string& text, const std::string& name,
                     std::span<const std::string_view> keys) {
  const toml::table given = ParsedToml(text, name);
  toml::table kept;
  for (const std::string_view key : keys) {
    if (const toml::node* node = given.get(key)) kept.insert(key, *node);
  }
  std::ostringstream out;
  out << kept << '\n';
  return out.str();
}

std::string WithNumber(const std::string& text, const std::string& name, const std::string& path,
                       double value) {
  const toml::table root = ParsedToml(text, name);
  const toml::node& node = NumberNode(root, name, path);
  const bool whole = node.is_integer() && value == std::floor(value) && std::abs(value) < 1e15;
  const std::size_t begin = PlaceOf(text, node.source().begin);
  const std::size_t end = std::min(text.find_first_of(" \t\r\n,]}#", begin), text.size());
  std::string edited = text;
  edited.replace(begin, end - begin, whole ? fmt::format("{:.0f}", value) : ExactDecimal(value));
  // Whether the right characters went away is not left to the parser's count of them.
  if (NumberAt(edited, name, path) != value)
    throw std::logic_error(fmt::format("{}: {}: {} could not be put there", name, path, value));
  return edited;
}

}  // namespace tumbler
