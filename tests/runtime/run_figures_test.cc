// Compares the schema of a run's JSON and docs/formats.md with the description of its figures.

#include "runtime/run/run_figures.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "tests/support/docs_tables.h"

namespace tumbler {
namespace {

std::string FigureTable() {
  std::string text = testing::MarkdownHead({"key", "meaning"});
  ForEachRow(kRunFigures, [&](const auto& row) {
    text += testing::MarkdownRow({fmt::format("`{}`", row.field.key), row.field.meaning});
  });
  return text;
}

/// The schema that there is, with every figure as it has to be in it.
std::string SchemaWithFigures(const std::string& text) {
  Json schema = Json::Parse(text).value();
  std::set<std::string> required;
  for (const Json& key : schema["required"].elements()) required.insert(key.text());
  ForEachRow(kRunFigures, [&](const auto& row) {
    schema["properties"][row.field.key] = {{"type", "integer"}, {"minimum", 0}};
    if (required.insert(row.field.key).second) schema["required"].Append(row.field.key);
  });
  return schema.Dump(2) + '\n';
}

TEST(RunFigures, TheTablesOfTheDocumentAndTheSchemaHaveEachOfThem) {
  const std::string schema = "docs/schemas/tumbler-run.schema.json";
  testing::ExpectText(schema, SchemaWithFigures(testing::ReadFile(testing::SourcePath(schema))));
  testing::ExpectTables(
      "docs/formats.md",
      std::vector<testing::DocsTable>{{"runtime/run/run_figures.h", "figures", FigureTable()}});
}

}  // namespace
}  // namespace tumbler
