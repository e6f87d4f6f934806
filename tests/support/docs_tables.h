#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "common/files/key_table.h"
#include "tests/support/files.h"

namespace tumbler::testing {

/// A table of a document that is made from the code. In the document it is between the lines
/// `<!-- generated from SOURCE: NAME -->` and `<!-- end -->`.
struct DocsTable {
  std::string source;
  std::string name;
  std::string markdown;
};

inline std::string MarkdownRow(const std::vector<std::string>& cells) {
  std::string row = "|";
  for (const std::string& cell : cells) row += cell.empty() ? " |" : " " + cell + " |";
  return row + "\n";
}
inline std::string MarkdownHead(const std::vector<std::string>& cells) {
  std::string rule = "|";
  for (std::size_t i = 0; i < cells.size(); ++i) rule += "---|";
  return MarkdownRow(cells) + rule + "\n";
}

/// The table in Markdown. Neighbouring keys with the same text share a row.
inline std::string Markdown(const KeyTable& table) {
  std::vector<KeyRow> rows;
  for (const KeyRow& row : table.rows) {
    if (!rows.empty() && rows.back().table == row.table && rows.back().meaning == row.meaning &&
        rows.back().absent == row.absent && rows.back().allowed == row.allowed) {
      rows.back().key += ", " + row.key;
    } else {
      rows.push_back(row);
    }
  }
  const auto shown = [&table](const std::vector<std::string>& cells) {
    std::vector<std::string> kept;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (*table.heads[i] != '\0') kept.push_back(cells[i]);
    }
    return kept;
  };
  std::string text = MarkdownHead(shown({table.heads.begin(), table.heads.end()}));
  for (const KeyRow& row : rows) {
    text += MarkdownRow(shown({row.table.empty() ? row.key : row.table + " " + row.key, row.absent,
                               row.allowed, row.meaning}));
  }
  return text;
}

/// Fails unless the file has exactly this text. With TUMBLER_UPDATE_DOCS=1 in the environment it
/// writes the text into the file instead.
/// @param path  relative to the project's folder.
inline void ExpectText(const std::string& path, const std::string& text) {
  const std::string file = SourcePath(path);
  // NOLINTNEXTLINE(concurrency-mt-unsafe): no other thread changes the environment.
  if (std::getenv("TUMBLER_UPDATE_DOCS") != nullptr) {
    WriteFile(file, text);
    return;
  }
  EXPECT_EQ(ReadFile(file), text) << "scripts/docs-tables writes " << path << " as the code has it";
}

/// The same for tables in a document.
inline void ExpectTables(const std::string& path, const std::vector<DocsTable>& tables) {
  const std::string file = SourcePath(path);
  std::string after = ReadFile(file);
  for (const DocsTable& table : tables) {
    const std::string begin = "<!-- generated from " + table.source + ": " + table.name + " -->\n";
    const std::string end = "<!-- end -->\n";
    const std::size_t first = after.find(begin);
    ASSERT_NE(first, std::string::npos) << file << " has no line " << begin;
    const std::size_t last = after.find(end, first);
    ASSERT_NE(last, std::string::npos) << file << " has no line " << end << " after " << begin;
    after.replace(first + begin.size(), last - first - begin.size(), table.markdown);
  }
  ExpectText(path, after);
}

/// The same for tables of keys.
inline void ExpectTables(const std::string& path, const std::vector<KeyTable>& tables) {
  std::vector<DocsTable> documented;
  documented.reserve(tables.size());
  for (const KeyTable& table : tables)
    documented.push_back({table.source, table.name, Markdown(table)});
  ExpectTables(path, documented);
}

}  // namespace tumbler::testing
