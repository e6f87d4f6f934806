#pragma once

#include <array>
#include <initializer_list>
#include <string>
#include <vector>

namespace tumbler {

/// A row of docs/formats.md about one key or several, in Markdown.
struct KeyRow {
  std::string table;  ///< Stands before the key; may be empty.
  std::string key;
  std::string absent;  ///< The default, or that there is none.
  std::string allowed;
  std::string meaning;
  // For schemas of files; empty in rows that are about several keys.
  std::string name = {};    ///< The key itself.
  std::string schema = {};  ///< JSON Schema of its value.
  bool required = false;    ///< Whether it has to be there, whatever else is.
};

/// A table of docs/formats.md.
struct KeyTable {
  std::string source;  ///< The file that describes the keys, relative to the project's folder.
  std::string name;    ///< Name of the table, where a file describes several.
  std::vector<KeyRow> rows;
  /// Heads of the columns; a column without a head is left out.
  std::array<const char*, 4> heads = {"key", "default", "allowed", "meaning"};
};

/// The rows of several lists, one after the other.
std::vector<KeyRow> Joined(std::initializer_list<std::vector<KeyRow>> lists);

}  // namespace tumbler
