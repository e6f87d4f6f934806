#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>

#include "common/files/command_line.h"
#include "common/files/program.h"
#include "offline/studies/spread_names.h"

namespace tumbler {

/// Declares the options of all spreads, for the programs that take them. `spreads` has to outlive
/// Parse.
inline void DeclareSpreads(CommandLine& line, Spreads& spreads) {
  for (const SpreadName& name : kSpreadNames) {
    if (const auto* number = std::get_if<double Spreads::*>(&name.member)) {
      line.Option(name.option, spreads.**number, name.help).Within(0.0, name.max).ShowDefault();
      continue;
    }
    GroundSpread& ground = spreads.*std::get<GroundSpread Spreads::*>(name.member);
    line.Option(
        name.option, "SPREAD",
        [&name, &ground](const std::string& text) {
          const std::optional<GroundSpread> read = ParseGroundSpread(text);
          if (!read) {
            throw UsageError(name.option,
                             fmt::format("'{}' is no number, no range such as 0.2..1 and no factor "
                                         "such as x10; allowed: {}",
                                         text, name.limits.Allowed()));
          }
          if (const std::string mistake = MistakeIn(*read, name.limits); !mistake.empty())
            throw UsageError(name.option, mistake);
          ground = *read;
        },
        name.help);
  }
}

}  // namespace tumbler
