#include "offline/problem/task_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "common/files/file_keys.h"
#include "common/files/printable.h"
#include "offline/model/robot_notes.h"
#include "offline/problem/bounds_toml.h"
#include "offline/problem/end_points.h"
#include "offline/problem/joint_units.h"
#include "offline/problem/require_joint.h"
#include "offline/problem/task_keys.h"

namespace tumbler {
namespace {

/// The most pairs of obstacle and collision shape. With more, finding a motion would take too long.
constexpr std::size_t kMostPairs = 1000;

/// The most integration steps of a rollout. A gradient keeps about 3 kB of each, in each thread,
/// and the certificate differentiates once more with steps of half the length: 1 GB in all.
constexpr double kMostSteps = 1e5;

/// What is left of a motion of free duration after the last time at which its cost looks, at least.
constexpr double kLeastStretched_s = 0.01;

void ReadName(TomlTable& table, std::string_view key, Problem& problem) {
  problem.name = table.String(key);
  if (const char* mistake = MistakeInName(problem.name)) table.Fail(key, mistake);
  if (problem.name.empty() || !FixedString<48>::fits(problem.name)) {
    table.Fail(key, fmt::format("is '{}'; allowed: from 1 ... 48 characters", problem.name));
  }
}

constexpr std::array kNameKeys = {
    KeyReadBy<Problem>("name", ReadName, "name of the primitive")
        .Schema(R"({"type": "string", "minLength": 1, "maxLength": 48})")
        .Required()
        .Allowed("1 to 48 bytes"),
};

/// Reads one number for all joints, or a table of joints.
void ReadControlPoints(TomlTable& table, std::string_view key, Problem& problem) {
  // There are three fixed points at each end and a free one between them, and enough for the
  // degree.
  const int least = std::max(7, problem.degree + 1);
  if (!table.IsTable(key)) {
    const std::int64_t points = table.Integer(key, least, kMaxControlPoints);
    for (ActuatedJoint& joint : problem.joints) joint.control_points = static_cast<int>(points);
    return;
  }
  TomlTable by_joint = table.Table(key);
  for (const std::string& name : by_joint.Keys()) RequireJoint(by_joint, name, problem);
  for (ActuatedJoint& joint : problem.joints) {
    const std::string& name = problem.name_of(joint);
    joint.control_points = static_cast<int>(by_joint.Integer(name, least, kMaxControlPoints));
  }
}

constexpr std::array kSplineKeys = {
    KeyOf<&Problem::degree>("degree", {3, 7}, ""),
    KeyReadBy<Problem>(
        "control_points", ReadControlPoints,
        "for each joint with a motor; the first and last three are given by the ends. Or a table "
        "with all of them: `{ leg1 = 11, leg2 = 12 }`")
        .Schema(
            R"({"type": ["integer", "object"], "minimum": 7, "maximum": 64, "additionalProperties": {"type": "integer", "minimum": 7, "maximum": 64}})")
        .Default("12")
        .Allowed("7 (and degree + 1) to 64"),
};

/// Checks that the points which an end's velocity moves are within the limits of position.
void CheckPointsBesideEnds(TomlTable& table, const std::string& name, const ActuatedJoint& joint,
                           const Problem& problem) {
  const DurationBounds durations =
      problem.free_duration.value_or(DurationBounds{problem.duration_s, problem.duration_s});
  for (const double duration_s : {durations.min_s, durations.max_s}) {
    const EndPoints ends = EndPointsOf(joint, problem.degree, duration_s);
    for (const auto& points : {ends.first, ends.last}) {
      for (const double point : points) {
        if (point >= joint.limits.position_min_rad && point <= joint.limits.position_max_rad)
          continue;
        table.Fail(name, fmt::format(
                             "puts a control point beside the end at {0} {3}; allowed: {1} to "
                             "{2} {3}; give less velocity, another position or more control points",
                             MessageNumber(point), MessageNumber(joint.limits.position_min_rad),
                             MessageNumber(joint.limits.position_max_rad),
                             UnitsOf(problem, joint).position));
      }
    }
  }
}

/// Checks that no earlier term has a target of the same quantity that is missed wherever this one
/// is met.
void CheckAgainstOthers(TomlTable& table, const CostTerm& term, const Problem& problem) {
  if (!term.draws()) return;
  for (const CostTerm& other : problem.cost) {
    const auto after = [&problem](const CostTerm& of) {
      // Without a settle phase the motion has settled when it ends.
      return of.when == CostTerm::When::kSettled && problem.settle_s == 0 ? CostTerm::When::kEnd
                                                                          : of.when;
    };
    const bool same = other.draws() && other.of() == term.of() && after(other) == after(term) &&
                      other.from_start == term.from_start &&
                      std::abs(other.time_s - term.time_s) <= 1e-9 && other.point == term.point &&
                      other.quantity == term.quantity;
    const double apart = std::abs(term.quantity.Near(other.target, term.target) - other.target);
    if (!same || apart <= term.tolerance + other.tolerance + 1e-9) continue;
    table.Fail("target",
               fmt::format("asks for {} of what another [[cost]] asks to be {} at the same time; "
                           "no motion is within the tolerances of both; leave one out",
                           MessageNumber(term.target), MessageNumber(other.target)));
  }
}

/// Checks that a motion whose duration is free takes longer than until a term looks at it.
void CheckTime(TomlTable& table, const CostTerm& term, const Problem& problem) {
  if (!problem.free_duration || !table.Has("time_s")) return;
  // Nearer to the end there would be no room for the steps that are stretched.
  const double latest = problem.free_duration->min_s - kLeastStretched_s;
  if (term.when == CostTerm::When::kTime && term.time_s <= latest) return;
  table.Fail("time_s", fmt::format("is not within every motion whose duration is free; allowed: "
                                   "up to {} s, which is {} s before duration_min_s, or `when` "
                                   "instead",
                                   MessageNumber(latest), kLeastStretched_s));
}

template <class SceneKind>
void ReadJointsOf(TomlTable& root, SceneKind& scene, Problem& problem) {
  std::optional<TomlTable> limits = root.OptionalTable("limits");
  TomlTable start = root.Table("start").Table("joints_rad");
  TomlTable end = root.Table("end").Table("joints_rad");
  for (const TomlTable* table : {&start, &end}) {
    for (const std::string& name : table->Keys()) RequireJoint(*table, name, problem);
  }
  for (std::size_t j = static_cast<std::size_t>(scene.robot.root_dofs);
       j < scene.robot.tree.dofs.size(); ++j) {
    auto& dof = scene.robot.tree.dofs[j];
    if (scene.robot.IsPassive(static_cast<int>(j))) {
      if (limits && limits->Has(dof.name)) {
        limits->Fail(dof.name,
                     "is in [passive], so it has no motor to limit; leave out one of the two");
      }
      continue;
    }
    if (!start.Has(dof.name)) {
      start.Fail(
          "", fmt::format("lacks the joint '{}': every joint with a motor needs a start and an end",
                          dof.name));
    }
    if (problem.joints.size() == static_cast<std::size_t>(kMaxJoints)) {
      start.Fail(dof.name, fmt::format("a primitive moves at most {} joints", kMaxJoints));
    }
    if (!FixedString<32>::fits(dof.name))
      start.Fail(dof.name, "a joint's name has at most 32 characters");
    dof.prescribed = true;
    ActuatedJoint joint;
    joint.dof = static_cast<int>(j);
    const RobotJointLimits& urdf = scene.robot.limits[j];
    // A joint without limits in the URDF still gets finite ones, because a primitive proves all
    // limits.
    TaskLimits allowed;
    allowed.position_min_rad = std::max(urdf.lower_rad, -100.0);
    allowed.position_max_rad = std::min(urdf.upper_rad, 100.0);
    allowed.velocity_max_rad_s = std::min(urdf.velocity_rad_s, 100.0);
    allowed.torque_max_nm = std::min(urdf.effort_nm, 1000.0);
    if (limits) {
      ReadKeys(*limits, kTaskLimitKeys, allowed);
      if (std::optional<TomlTable> own = limits->OptionalTable(dof.name))
        ReadKeys(*own, kTaskLimitKeys, allowed);
      dof.rotor_inertia_kg_m2 = allowed.rotor_inertia_kg_m2;
    }
    joint.limits = allowed;
    if (allowed.position_min_rad > allowed.position_max_rad) {
      start.Fail(dof.name, fmt::format("its limits in the robot's file, {} to {}, lie outside "
                                       "of what a primitive can hold; allowed: -100 ... 100 {}",
                                       MessageNumber(urdf.lower_rad), MessageNumber(urdf.upper_rad),
                                       UnitsOf(dof.kind).position));
    }
    const Range range{allowed.position_min_rad, allowed.position_max_rad};
    joint.start_rad = start.Number(dof.name, range);
    joint.end_rad = end.Number(dof.name, range);
    problem.joints.push_back(joint);
  }
}

}  // namespace

void ReadNameAndTimes(TomlTable& root, Problem& problem) {
  ReadKeys(root, kNameKeys, problem);
  ReadKeys(root, kTaskTimeKeys, problem);
  TaskDurations durations;
  ReadKeys(root, kTaskDurationKeys, durations);
  if (const auto bounds = CheckedBounds(root, kBoundedDuration, durations.min_s, durations.max_s,
                                        problem.duration_s))
    problem.free_duration = DurationBounds{bounds->min, bounds->max};
}

void ReadActuatedJoints(TomlTable& root, Problem& problem) {
  problem.WithScene([&](auto& scene) { ReadJointsOf(root, scene, problem); });
}

void ReadSpline(TomlTable& root, Problem& problem) {
  if (std::optional<TomlTable> table = root.OptionalTable("spline"))
    ReadKeys(*table, kSplineKeys, problem);
}

void ReadEndVelocities(TomlTable& root, Problem& problem) {
  for (const bool at_end : {false, true}) {
    std::optional<TomlTable> table =
        root.Table(at_end ? "end" : "start").OptionalTable("joints_rad_s");
    if (!table) continue;
    for (const std::string& name : table->Keys()) RequireJoint(*table, name, problem);
    for (ActuatedJoint& joint : problem.joints) {
      const std::string& name = problem.name_of(joint);
      if (!table->Has(name)) continue;
      const double velocity = table->Number(name, kTaskRate);
      // As far within the limit as the solver keeps all velocities.
      const double limit = joint.limits.velocity_max_rad_s;
      if (std::abs(velocity) > kInside * limit) {
        table->Fail(name, fmt::format("is {0} {2}; allowed: less than the joint's limit of {1} "
                                      "{2}, by a millionth of it or more",
                                      MessageNumber(velocity), MessageNumber(limit),
                                      UnitsOf(problem, joint).velocity));
      }
      (at_end ? joint.end_rad_s : joint.start_rad_s) = velocity;
      CheckPointsBesideEnds(*table, name, joint, problem);
    }
  }
  if (problem.joint_ends_moving() && problem.settle_s > 0) {
    root.Fail("settle_s", fmt::format("is {} s, in which the joints are held; but [end] lets "
                                      "them move: allowed: 0, or no end.joints_rad_s",
                                      MessageNumber(problem.settle_s)));
  }
}

void ReadCosts(TomlTable& root, const std::function<CostTerm(TomlTable&)>& read, Problem& problem) {
  std::vector<CostTerm>& cost = problem.cost;
  for (TomlTable& table : root.Tables("cost")) {
    const CostTerm term = read(table);
    CheckTime(table, term, problem);
    CheckAgainstOthers(table, term, problem);
    if (term.targets_pitch() && term.weight > 0) problem.target_pitch_rad = term.target;
    // Integrals that differ only in their weights become one.
    const auto same = std::find_if(cost.begin(), cost.end(), [&term](const CostTerm& other) {
      CostTerm alike = other;
      alike.weight = term.weight;
      return term.when == CostTerm::When::kThroughout && alike == term;
    });
    if (same != cost.end()) {
      same->weight += term.weight;
    } else {
      cost.push_back(term);
    }
  }
  const bool any =
      std::any_of(cost.begin(), cost.end(), [](const CostTerm& term) { return term.weight != 0; });
  if (!any) {
    const bool empty = root.Tables("cost").empty();
    root.Fail("cost", fmt::format("asks for nothing, as it {}; allowed: at least one term with "
                                  "weight > 0",
                                  empty ? "is empty" : "has only weights of 0"));
  }
}

void ReadSettings(TomlTable& root, Problem& problem) {
  if (std::optional<TomlTable> table = root.OptionalTable("tolerances"))
    ReadKeys(*table, kTaskToleranceKeys, problem);
  if (std::optional<TomlTable> table = root.OptionalTable("search"))
    ReadKeys(*table, kSearchKeys, problem.search);
  if (std::optional<TomlTable> table = root.OptionalTable("solver"))
    ReadKeys(*table, kSolverKeys, problem.solver);
}

void CheckObstacles(TomlTable& root, std::size_t obstacles, std::size_t shapes,
                    const std::vector<IgnoredShape>& ignored) {
  if (shapes == 0 && obstacles > 0) {
    std::string why;
    for (const RobotFinding& note : NotesOf(ignored))
      why += fmt::format("; {} (line {})", note.problem, note.line);
    const bool meshes = std::ranges::any_of(ignored, &IgnoredShape::mesh);
    root.Fail(
        "obstacle",
        fmt::format("the robot has no collision shape that could touch it{}; give its links "
                    "spheres, cylinders or boxes, {}or fly: obstacle = []",
                    why, meshes ? "take points of its meshes, contact.meshes = \"points\", " : ""));
  }
  const std::size_t pairs = shapes * obstacles;
  if (pairs <= kMostPairs) return;
  root.Fail("obstacle",
            fmt::format("{} obstacles and {} collision shapes of the robot are {} pairs to look at "
                        "in every step; allowed: up to {}",
                        obstacles, shapes, pairs, kMostPairs));
}

void SetStepsByAdvice(TomlTable& root, Problem& problem) {
  const double advisable = problem.advisable_step_s;
  if (!std::isfinite(advisable)) return;
  const auto given = [&root](const char* table, const char* key) {
    std::optional<TomlTable> found = root.OptionalTable(table);
    return found && found->Has(key);
  };
  const double step = std::max(advisable, 1e-5);
  SolverSettings& solver = problem.solver;
  if (!given("solver", "step_s")) solver.step_s = std::min(solver.step_s, step);
  // These steps may be rough, but must keep the methods of screening and search stable.
  if (!given("solver", "screen_step_s"))
    solver.screen_step_s = std::max(solver.step_s, std::min(solver.screen_step_s, 2 * step));
  if (!given("search", "step_s"))
    problem.search.step_s = std::min(problem.search.step_s, 1.5 * step);
}

void CheckSteps(TomlTable& root, const Problem& problem) {
  const double time = (problem.free_duration ? problem.free_duration->max_s : problem.duration_s) +
                      problem.settle_s;
  const auto check = [&](const char* name, const char* key, double step_s) {
    const double steps = time / step_s;
    if (steps <= kMostSteps) return;
    std::optional<TomlTable> table = root.OptionalTable(name);
    const std::string message = fmt::format(
        "is {} s, which is {:.0f} steps for the {} s of {} and settle_s; allowed: up to "
        "{:.0f} steps, so {} s or more here",
        MessageNumber(step_s), steps, MessageNumber(time),
        problem.free_duration ? "duration_max_s" : "duration_s", kMostSteps,
        MessageNumber(1.00001 * time / kMostSteps));
    if (table) table->Fail(key, message);
    root.Fail(fmt::format("{}.{}", name, key), message);
  };
  check("solver", "step_s", problem.solver.step_s);
  check("solver", "screen_step_s", problem.solver.screen_step_s);
  check("search", "step_s", problem.search.step_s);
}

std::vector<KeyRow> NameKeyRows() { return RowsOf(kNameKeys); }
std::vector<KeyRow> SplineKeyRows() { return RowsOf(kSplineKeys); }

}  // namespace tumbler
