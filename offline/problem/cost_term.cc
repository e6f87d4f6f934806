#include "offline/problem/cost_term.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

namespace tumbler {
namespace {

using Kind = CostTerm::Kind;
using When = CostTerm::When;

/// The names of the kinds in a task, in the order of Kind.
constexpr std::array<std::string_view, 3> kKinds = {"terminal", "terminal-linear", "effort"};

/// Reads the coordinate of the root and the instant that a term is about.
void ReadCoordinate(TomlTable& table, const PlanarRobot& robot, CostTerm& term) {
  constexpr std::array<std::string_view, 2> kWhen = {"end", "settled"};
  term.when = table.Choice("when", kWhen, "end") == "end" ? When::kEnd : When::kSettled;
  if (robot.root_dofs == 0) {
    table.Fail("term", fmt::format("is '{}', about the root's coordinates, and this root is "
                                   "fixed; allowed: effort",
                                   kKinds[static_cast<std::size_t>(term.kind)]));
  }
  constexpr std::array<std::string_view, 6> kOf = {"x",      "z",      "pitch",
                                                   "x_rate", "z_rate", "pitch_rate"};
  const std::string of = table.Choice("of", kOf, "");
  const auto index = static_cast<int>(std::find(kOf.begin(), kOf.end(), of) - kOf.begin());
  term.dof = index % 3;
  term.of_velocity = index >= 3;
}

}  // namespace

CostTerm ReadCostTerm(TomlTable& table, const PlanarRobot& robot) {
  CostTerm term;
  const std::string name = table.Choice("term", kKinds, "");
  term.kind = static_cast<Kind>(std::find(kKinds.begin(), kKinds.end(), name) - kKinds.begin());
  term.weight = table.Number("weight", {-1e9, 1e9});
  const auto require_positive = [&](const char* what) {
    if (term.weight >= 0) return;
    table.Fail("weight",
               fmt::format("is {}; allowed for {}: >= 0", MessageNumber(term.weight), what));
  };
  switch (term.kind) {
    case Kind::kEffort:
      term.when = When::kThroughout;
      require_positive("effort");
      break;
    case Kind::kSquare:
      ReadCoordinate(table, robot, term);
      require_positive("a square");
      term.target = table.Number("target", {-1e3, 1e3}, 0.0);
      break;
    case Kind::kLinear:
      ReadCoordinate(table, robot, term);
      break;
  }
  return term;
}

}  // namespace tumbler
