#include "offline/problem/cost_term.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "common/files/file_keys.h"

namespace tumbler {
namespace {

using Kind = CostTerm::Kind;
using When = CostTerm::When;

/// A `[[cost]]` as the file has it.
struct CostEntry : CostTerm {
  int of = 0;  ///< Which of `kCoordinateNames`.
  std::optional<double> at_s;
  double latest_s = 0;  ///< That `at_s` may be.
  std::string link;
  std::array<double, 2> point_m{};

  /// The first name of a point, and of its rates.
  static constexpr int kPoint = 6, kPointRate = 8;
  [[nodiscard]] bool names_point() const { return of >= kPoint; }
};

/// Times that are nearer than this are the same [s].
constexpr double kSameTime_s = 1e-9;

/// The work of motors is for robots in space so far: lanes and forward gradients do not know it.
constexpr std::array<std::string_view, 3> kPlanarKinds = {
    CostTerm::kKindNames[0], CostTerm::kKindNames[1], CostTerm::kKindNames[2]};

constexpr std::array kTermKeys = {
    KeyOf<&CostTerm::kind, CostEntry>(
        "term", kPlanarKinds,
        "weight (value - target)^2; weight value; weight integral of \\|tau\\|^2")
        .Required(),
    KeyOf<&CostTerm::weight, CostEntry>("weight", {-1e9, 1e9},
                                        "0: nothing is asked for, nor in the purpose")
        .Required()
        .Allowed("-1e9 to 1e9; not negative for `terminal` and `effort`"),
};

/// The default of the tolerance is that of the coordinate's unit.
void SetTolerance(CostEntry& term) {
  constexpr int kPitch = 2;
  const bool rate = term.names_point() ? term.of >= CostEntry::kPointRate : term.of > kPitch;
  term.tolerance = rate                ? CostTerm::kRateTolerance
                   : term.of == kPitch ? CostTerm::kAngleTolerance_rad
                                       : CostTerm::kLengthTolerance_m;
}

constexpr std::array<std::string_view, 2> kWhen = {"end", "settled"};
constexpr std::array kCoordinateKeys = {
    KeyOf<&CostTerm::when, CostEntry>("when", kWhen,
                                      "of terminal terms: of the motion, or of the settle phase"),
    KeyOf<&CostEntry::at_s>("time_s",
                            "instead of `when`: at this time since the start of the motion")
        .Allowed("above 0, up to `duration_s` + `settle_s`",
                 [](const CostEntry& term) {
                   return Range{0, term.latest_s, true};
                 }),
    KeyOf<&CostEntry::of>("of", CostTerm::kCoordinateNames,
                          "value of the root, or (`point_...`) of a point of a link")
        .Required()
        .Default("required for terminal terms"),
    KeyOf<&CostEntry::link>("link", "that has the point; links on fixed joints have a name, too")
        .Required()
        .Default("required for `point_...`")
        .Allowed("a link of the robot's file that moves")
        .Where([](const CostEntry& term) { return term.names_point(); }),
    KeyOf<&CostEntry::point_m>("point_m", {-1e3, 1e3},
                               "the point: x and z in the link's frame of the robot's file")
        .Default("[0, 0]")
        .Where([](const CostEntry& term) { return term.names_point(); }),
    KeyOf<&CostTerm::target, CostEntry>("target", {-1e3, 1e3}, "of `terminal`")
        .Where([](const CostEntry& term) { return term.kind == Kind::kSquare; }),
    KeyOf<&CostTerm::from_start, CostEntry>(
        "from_start",
        "of `terminal`: the target is from the value at the start, so that 0 asks for "
        "the same as there")
        .Where([](const CostEntry& term) { return term.kind == Kind::kSquare; }),
    KeyOf<&CostTerm::tolerance, CostEntry>("tolerance", {0, 1e3, true},
                                           "of `terminal`: a value farther from the target misses "
                                           "the purpose, and no primitive is written")
        .Default("0.05 rad, 0.02 m, 0.1 rad/s or m/s", SetTolerance)
        .Where([](const CostEntry& term) { return term.kind == Kind::kSquare; }),
};

}  // namespace

namespace {

/// Sets the instant of a term that asks for a time.
void SetInstant(TomlTable& table, double duration_s, CostEntry& term) {
  if (!term.at_s) return;
  if (table.Has("when")) {
    table.Fail("time_s", fmt::format("is {}, and there is 'when', too; allowed: one of the two",
                                     MessageNumber(*term.at_s)));
  }
  term.when = When::kTime;
  if (std::abs(*term.at_s - duration_s) <= kSameTime_s) {
    term.when = When::kEnd;
  } else if (std::abs(*term.at_s - term.latest_s) <= kSameTime_s) {
    term.when = When::kSettled;
  } else {
    term.time_s = *term.at_s;
  }
}

/// Sets what a term in a coordinate is about.
void SetCoordinate(TomlTable& table, const PlanarRobot& robot, CostEntry& term) {
  if (term.names_point()) {
    term.dof = (term.of - CostEntry::kPoint) % 2;
    term.of_velocity = term.of >= CostEntry::kPointRate;
    try {
      term.point = PointOfLink(robot, term.link, term.point_m);
    } catch (const std::invalid_argument& error) {
      table.Fail("link", fmt::format("is '{}', which {}", term.link, error.what()));
    }
    return;
  }
  term.dof = term.of % 3;
  term.of_velocity = term.of >= 3;
  if (robot.hinged() && term.dof != 2) {
    table.Fail("of", fmt::format("is '{}', which the bar holds; allowed for root = \"hinge-y\": "
                                 "pitch, pitch_rate, or a point of a link",
                                 CostTerm::kCoordinateNames[static_cast<std::size_t>(term.of)]));
  }
}

}  // namespace

CostTerm ReadCostTerm(TomlTable& table, const PlanarRobot& robot, double duration_s,
                      double settle_s) {
  CostEntry term;
  ReadKeys(table, kTermKeys, term);
  const std::string_view name = CostTerm::kKindNames[static_cast<std::size_t>(term.kind)];
  const auto require_positive = [&](std::string_view what) {
    if (term.weight >= 0) return;
    table.Fail("weight",
               fmt::format("is {}; allowed for {}: >= 0", MessageNumber(term.weight), what));
  };
  if (!term.of_coordinate()) {
    term.when = When::kThroughout;
    require_positive(name);
    return term;
  }
  term.latest_s = duration_s + settle_s;
  ReadKeys(table, kCoordinateKeys, term);
  if (robot.root_dofs == 0 && !term.names_point()) {
    table.Fail("term", fmt::format("is '{}', about the root's coordinates, and this root is fixed; "
                                   "allowed: a term about joints, such as effort, or of a point "
                                   "of a link",
                                   name));
  }
  term.target_from_start = term.target;
  SetInstant(table, duration_s, term);
  SetCoordinate(table, robot, term);
  if (term.kind == Kind::kSquare) require_positive("a square");
  return term;
}

KeyTable CostKeyTable() {
  return {"offline/problem/cost_term.cc", "cost",
          Joined({RowsOf(kTermKeys), RowsOf(kCoordinateKeys)})};
}

}  // namespace tumbler
