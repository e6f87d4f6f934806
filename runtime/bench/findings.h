#pragma once

#include <string>
#include <vector>

#include "common/json.h"

namespace tumbler {

/// Something that is not as the drives file says, or as it should be.
struct BenchFinding {
  /// A name for programs, such as `identifiers-exchanged`; docs/formats.md lists them.
  std::string kind;
  std::string subject;  ///< A joint, a drive, or `bus`.
  std::string text;     ///< The finding with its numbers, and what follows from it.
  bool mended = false;  ///< Whether the drives file that is written has it right.
};

inline Json ToJson(const std::vector<BenchFinding>& findings) {
  Json json = Json::Array();
  for (const BenchFinding& finding : findings) {
    json.Append({{"kind", finding.kind},
                 {"subject", finding.subject},
                 {"text", finding.text},
                 {"mended", finding.mended}});
  }
  return json;
}

}  // namespace tumbler
