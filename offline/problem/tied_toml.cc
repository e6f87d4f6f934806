#include "offline/problem/tied_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "common/files/file_keys.h"
#include "offline/problem/joint_units.h"
#include "offline/problem/require_joint.h"

namespace tumbler {
namespace {

/// The problem's joint of a name; the end: it has none.
auto FindJoint(const Problem& problem, const std::string& name) {
  return std::ranges::find_if(
      problem.joints, [&](const ActuatedJoint& joint) { return problem.name_of(joint) == name; });
}

/// Which of the problem's joints has a name.
std::size_t JointNamed(const TomlTable& table, const std::string& name, const Problem& problem) {
  RequireJoint(table, name, problem);
  const auto found = FindJoint(problem, name);
  if (found == problem.joints.end()) {
    table.Fail(name,
               "has no motor ([passive]), which could make it follow another joint; leave it out "
               "here, or out of `passive`");
  }
  return static_cast<std::size_t>(found - problem.joints.begin());
}

/// Says of a joint that others are tied to that it does not move.
void RefuseLocked(const TomlTable& table, const std::string& name, const std::string& to,
                  const Problem& problem) {
  problem.WithScene([&](const auto& scene) {
    if (!std::ranges::any_of(scene.robot.locked,
                             [&to](const LockedJoint& lock) { return lock.name == to; }))
      return;
    table.Fail(name, fmt::format("is tied to '{}', which is locked, so nothing moves it; leave it "
                                 "out here, or '{}' out of `locked`",
                                 to, to));
  });
}

/// Which of the problem's joints another joint is tied to.
/// @param name     of that other joint.
/// @param written  the name that is looked for, perhaps with a '-'.
std::size_t LeaderNamed(const TomlTable& table, const std::string& name, const std::string& written,
                        const Problem& problem) {
  const std::string to = written.starts_with('-') ? written.substr(1) : written;
  RefuseLocked(table, name, to, problem);
  const auto found = FindJoint(problem, to);
  if (found != problem.joints.end() && to != name && !table.Has(to))
    return static_cast<std::size_t>(found - problem.joints.begin());
  const bool is_joint = problem.WithScene(
      [&](const auto& scene) { return scene.robot.FindDof(to) >= scene.robot.root_dofs; });
  if (found == problem.joints.end() && is_joint) {
    table.Fail(name, fmt::format("is tied to '{}', which has no motor ([passive]) that would move "
                                 "it; leave it out here, or '{}' out of `passive`",
                                 to, to));
  }
  std::string names;
  for (const ActuatedJoint& joint : problem.joints)
    names.append(names.empty() ? "" : ", ").append(problem.name_of(joint));
  table.Fail(name,
             fmt::format("is '{}'; allowed: another joint that is tied to none, or '-' and its "
                         "name where it moves the other way round; the joints: {}",
                         written, names));
}

/// Checks that a joint's path can be the other's, times the factor, and makes its ends those of
/// that path where they differ by a rounding.
void MakeFollow(const TomlTable& table, const TiedJoint& tied, Problem& problem) {
  ActuatedJoint& joint = problem.joints[tied.joint];
  const ActuatedJoint& to = problem.joints[tied.to];
  const std::string &name = problem.name_of(joint), &other = problem.name_of(to);
  if (joint.control_points != to.control_points) {
    table.Fail(name, fmt::format("has {} control points, and '{}', which it is tied to, {}; "
                                 "allowed: as many",
                                 joint.control_points, other, to.control_points));
  }
  constexpr double kSame = 1e-9;
  const bool opposite = tied.factor < 0;
  const auto follow = [&](double& value, double of_other, const char* what, const char* unit) {
    const double needed = tied.factor * of_other + 0.0;  // not -0
    if (value == needed) return;
    if (std::abs(value - needed) <= kSame) {
      value = tied.factor * of_other;
      return;
    }
    const auto [is, needs] = DistinctNumbers(value, needed);
    const bool other_way = std::abs(value + needed) <= kSame;
    table.Fail(name, fmt::format("is tied to '{}{}', and {} is {} {} where that needs {}; give "
                                 "both {} ends{}, or leave it out",
                                 opposite ? "-" : "", other, what, is, unit, needs,
                                 opposite ? "opposite" : "the same",
                                 !other_way ? ""
                                 : opposite ? ", or the name no '-'"
                                            : ", or the name a '-'"));
  };
  const JointUnits units = UnitsOf(problem, joint);
  follow(joint.start_rad, to.start_rad, "its start", units.position);
  follow(joint.end_rad, to.end_rad, "its end", units.position);
  follow(joint.start_rad_s, to.start_rad_s, "its velocity at the start", units.velocity);
  follow(joint.end_rad_s, to.end_rad_s, "its velocity at the end", units.velocity);
}

}  // namespace

KeyTable TiedKeyTable() {
  return {"offline/problem/tied_toml.cc",
          "tied",
          {{"", "`tied`", "none",
            "table: some of the joints, and for each the name of another one that is tied to none, "
            "with a `-` before it where it moves the other way round",
            "joints that move as others do: their starts, ends and control points have to agree, "
            "within the limits of both, and the search looks for the paths of the others alone"}}};
}

void ReadTied(TomlTable& root, Problem& problem) {
  std::optional<TomlTable> table = root.OptionalTable("tied");
  if (!table) return;
  for (const std::string& name : table->Keys()) {
    TiedJoint tied;
    tied.joint = JointNamed(*table, name, problem);
    const std::string to = table->String(name);
    if (to.starts_with('-')) tied.factor = -1;
    tied.to = LeaderNamed(*table, name, to, problem);
    MakeFollow(*table, tied, problem);
    problem.tied.push_back(tied);
  }
}

}  // namespace tumbler
