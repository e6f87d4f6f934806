#include "offline/problem/cost_term.h"

#include <fmt/format.h>

#include <array>
#include <string_view>

#include "common/file_keys.h"

namespace tumbler {
namespace {

using Kind = CostTerm::Kind;
using When = CostTerm::When;

/// A `[[cost]]` as the file has it.
struct CostEntry : CostTerm {
  int of = 0;  ///< Which of `kCoordinateNames`.
};

constexpr std::array kTermKeys = {
    KeyOf<&CostTerm::kind, CostEntry>(
        "term", CostTerm::kKindNames,
        "weight (value - target)^2; weight value; weight integral of \\|tau\\|^2")
        .Required(),
    KeyOf<&CostTerm::weight, CostEntry>("weight", {-1e9, 1e9}, "")
        .Required()
        .Allowed("-1e9 to 1e9; not negative for `terminal` and `effort`"),
};

/// The default of the tolerance is that of the coordinate's unit.
void SetTolerance(CostEntry& term) {
  constexpr int kPitch = 2;
  term.tolerance = term.of > kPitch    ? CostTerm::kRateTolerance
                   : term.of == kPitch ? CostTerm::kAngleTolerance_rad
                                       : CostTerm::kLengthTolerance_m;
}

constexpr std::array<std::string_view, 2> kWhen = {"end", "settled"};
constexpr std::array kCoordinateKeys = {
    KeyOf<&CostTerm::when, CostEntry>("when", kWhen,
                                      "of terminal terms: of the motion, or of the settle phase"),
    KeyOf<&CostEntry::of>("of", CostTerm::kCoordinateNames, "value of the root")
        .Required()
        .Default("required for terminal terms"),
    KeyOf<&CostTerm::target, CostEntry>("target", {-1e3, 1e3}, "of `terminal`")
        .Where([](const CostEntry& term) { return term.kind == Kind::kSquare; }),
    KeyOf<&CostTerm::tolerance, CostEntry>("tolerance", {0, 1e3, true},
                                           "of `terminal`: a value farther from the target misses "
                                           "the purpose, and no primitive is written")
        .Default("0.05 rad, 0.02 m, 0.1 rad/s or m/s", SetTolerance)
        .Where([](const CostEntry& term) { return term.kind == Kind::kSquare; }),
};

}  // namespace

CostTerm ReadCostTerm(TomlTable& table, const PlanarRobot& robot) {
  CostEntry term;
  ReadKeys(table, kTermKeys, term);
  const std::string_view name = CostTerm::kKindNames[static_cast<std::size_t>(term.kind)];
  const auto require_positive = [&](std::string_view what) {
    if (term.weight >= 0) return;
    table.Fail("weight",
               fmt::format("is {}; allowed for {}: >= 0", MessageNumber(term.weight), what));
  };
  if (!term.of_root()) {
    term.when = When::kThroughout;
    require_positive(name);
    return term;
  }
  if (robot.root_dofs == 0) {
    table.Fail("term", fmt::format("is '{}', about the root's coordinates, and this root is fixed; "
                                   "allowed: a term about joints, such as effort",
                                   name));
  }
  ReadKeys(table, kCoordinateKeys, term);
  term.dof = term.of % 3;
  term.of_velocity = term.of >= 3;
  if (robot.hinged() && term.dof != 2) {
    table.Fail("of", fmt::format("is '{}', which the bar holds; allowed for root = \"hinge-y\": "
                                 "pitch, pitch_rate",
                                 CostTerm::kCoordinateNames[static_cast<std::size_t>(term.of)]));
  }
  if (term.kind == Kind::kSquare) require_positive("a square");
  return term;
}

KeyTable CostKeyTable() {
  return {"offline/problem/cost_term.cc", "cost",
          Joined({RowsOf(kTermKeys), RowsOf(kCoordinateKeys)})};
}

}  // namespace tumbler
