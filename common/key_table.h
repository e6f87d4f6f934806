#pragma once

#include <array>
#include <initializer_list>
#include <string>
#include <vector>

namespace tumbler {

/// What docs/formats.md says of a key (in Markdown), or of several.
struct KeyRow {
  std::string table;  ///< Said before the key; may be empty.
  std::string key;
  std::string absent;  ///< The default, or that there is none.
  std::string allowed;
  std::string meaning;
};

/// A table of docs/formats.md.
struct KeyTable {
  std::string source;  ///< The file that describes the keys, relative to the project's folder.
  std::string name;    ///< Of the table, for files with several.
  std::vector<KeyRow> rows;
  /// Of the columns; one without a head is left out.
  std::array<const char*, 4> heads = {"key", "default", "allowed", "meaning"};
};

/// The rows of several lists, one after the other.
std::vector<KeyRow> Joined(std::initializer_list<std::vector<KeyRow>> lists);

}  // namespace tumbler
