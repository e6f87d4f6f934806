#include "offline/problem/task_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

#include "common/files/file_keys.h"
#include "common/files/printable.h"
#include "offline/model/contact_intent.h"
#include "offline/model/robot.h"
#include "offline/problem/bounds_toml.h"
#include "offline/problem/contact_toml.h"
#include "offline/problem/end_points.h"
#include "offline/problem/free_start.h"
#include "offline/problem/locked_toml.h"
#include "offline/problem/motor_toml.h"
#include "offline/problem/obstacle_toml.h"
#include "offline/problem/passive_toml.h"
#include "offline/problem/require_joint.h"
#include "offline/problem/robust_toml.h"
#include "offline/problem/self_contact_toml.h"
#include "offline/problem/start_toml.h"
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
    const std::string& name =
        problem.scene.robot.tree.dofs[static_cast<std::size_t>(joint.dof)].name;
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

/// Reads pairs of joints; those that are not named are their own partners.
void ReadMirror(TomlTable& table, std::string_view key, Problem& problem) {
  std::vector<std::size_t>& partner = problem.guess_mirror;
  std::vector<std::string> names;
  for (const ActuatedJoint& joint : problem.joints)
    names.push_back(problem.scene.robot.tree.dofs[Index(joint.dof)].name);
  partner.resize(problem.joints.size());
  std::iota(partner.begin(), partner.end(), std::size_t{0});
  for (const std::vector<std::string>& pair : table.StringLists(key)) {
    if (pair.size() != 2) {
      table.Fail(key,
                 fmt::format("has an entry of {} names; expected pairs of joints", pair.size()));
    }
    std::array<std::size_t, 2> joints{};
    for (std::size_t i = 0; i < 2; ++i) {
      const auto found = std::ranges::find(names, pair[i]);
      if (found == names.end())
        table.Fail(key, fmt::format("names '{}'; allowed: {}", pair[i], fmt::join(names, ", ")));
      joints[i] = static_cast<std::size_t>(found - names.begin());
    }
    if (joints[0] == joints[1])
      table.Fail(key, fmt::format("exchanges '{}' with itself; allowed: two joints", pair[0]));
    for (std::size_t i = 0; i < 2; ++i) {
      std::size_t& of = partner[joints[i]];
      if (of != joints[i])
        table.Fail(key, fmt::format("names '{}' twice; a joint has one partner", pair[i]));
      of = joints[1 - i];
    }
  }
}

constexpr std::array kMirrorKeys = {
    KeyReadBy<Problem>(
        "joints", ReadMirror,
        "e.g. `[[\"leg1\", \"leg2\"]]`: each moves as the other does in the guess, "
        "the other way round; joints not named keep their role, the other way round, "
        "too")
        .Schema(
            R"({"type": "array", "items": {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2}})")
        .Required()
        .Allowed("pairs of joints, each joint once"),
};

class TaskReader {
 public:
  TaskReader(TomlTable root, PlanarRobot robot, std::optional<StartPose> given)
      : root_(std::move(root)), given_(std::move(given)) {
    scene_.robot = std::move(robot);
  }

  Problem Read() {
    ReadKeys(root_, kNameKeys, problem_);
    ReadKeys(root_, kTaskTimeKeys, problem_);
    TaskDurations durations;
    ReadKeys(root_, kTaskDurationKeys, durations);
    if (const auto bounds = CheckedBounds(root_, kBoundedDuration, durations.min_s, durations.max_s,
                                          problem_.duration_s))
      problem_.free_duration = DurationBounds{bounds->min, bounds->max};
    if (static_cast<int>(scene_.robot.tree.dofs.size()) == scene_.robot.root_dofs)
      root_.Fail("robot", "has no joint that moves; allowed: at least one");
    ReadPassiveJoints(root_, problem_);
    ReadJoints();
    const std::vector<double> passive_start = ReadPassiveStart(root_, scene_);
    ReadMotors(root_, problem_);
    CheckDryFriction();
    ReadSlope();
    ReadBar();
    if (std::optional<TomlTable> table = root_.OptionalTable("spline"))
      ReadKeys(*table, kSplineKeys, problem_);
    ReadEndVelocities();
    if (std::optional<TomlTable> table = root_.OptionalTable("mirror"))
      ReadKeys(*table, kMirrorKeys, problem_);
    if (std::optional<TomlTable> table = root_.OptionalTable("contact"))
      ReadContact(*table, Mass(), scene_.robot.tree.gravity.norm(), scene_.contact);
    ReadObstacles();
    ReadSelfContacts();
    ReadCosts();
    if (std::optional<TomlTable> table = root_.OptionalTable("tolerances"))
      ReadKeys(*table, kTaskToleranceKeys, problem_);
    if (std::optional<TomlTable> table = root_.OptionalTable("search"))
      ReadKeys(*table, kSearchKeys, problem_.search);
    if (std::optional<TomlTable> table = root_.OptionalTable("solver"))
      ReadKeys(*table, kSolverKeys, problem_.solver);
    problem_.robust = ReadRobust(root_, problem_);
    ReadDrives();
    TomlTable start = root_.Table("start");
    ReadStart(root_, start, given_, passive_start, problem_);
    SetTargetsFromStart(problem_);
    CheckRobust(start);
    CheckHeldTorque();
    root_.RejectUnknownKeys();
    SetStep();
    CheckSteps();
    return std::move(problem_);
  }

 private:
  /// A torque at rest is there only after a settle phase in which the robot comes to rest.
  void CheckHeldTorque() {
    if (problem_.held_torque != HeldTorque::kRest) return;
    std::string_view why;
    if (problem_.settle_s == 0) why = "settle_s is 0, so that no rest is simulated";
    if (scene_.robot.hinged()) why = "nothing rests by itself on a bar";
    if (problem_.robust && problem_.robust->feedback)
      why = "the feedback of [robust.feedback] is found with the torque of the end";
    if (!why.empty())
      root_.Fail("held_torque", fmt::format("is \"rest\", but {}; allowed: \"end\"", why));
  }

  /// Checks that a simulation, which is stiff in what holds a joint, can have the file's friction.
  void CheckDryFriction() {
    const PlanarRobot& robot = scene_.robot;
    for (std::size_t j = 0; j < problem_.joints.size(); ++j) {
      const std::size_t dof = Index(problem_.joints[j].dof);
      const double friction_nm =
          scene_.motors.empty() ? robot.dry_friction_nm[dof] : scene_.motors[j].dry_friction_nm;
      if (friction_nm <= kLargestDryFriction) continue;
      root_.Fail(
          "robot",
          fmt::format("has joint '{0}' with a dry friction of {1} N m, which is more than is "
                      "simulated; allowed: up to {2}, or motor.{0}.dry_friction_nm",
                      robot.tree.dofs[dof].name, MessageNumber(friction_nm), kLargestDryFriction));
    }
  }

  /// Reads the joints' velocities at the ends of the motion.
  void ReadEndVelocities() {
    for (const bool at_end : {false, true}) {
      std::optional<TomlTable> table =
          root_.Table(at_end ? "end" : "start").OptionalTable("joints_rad_s");
      if (!table) continue;
      for (const std::string& name : table->Keys()) RequireJoint(*table, name, problem_);
      for (ActuatedJoint& joint : problem_.joints) {
        const std::string& name = scene_.robot.tree.dofs[static_cast<std::size_t>(joint.dof)].name;
        if (!table->Has(name)) continue;
        const double velocity = table->Number(name, kTaskRate);
        // As far within the limit as the solver keeps all velocities.
        const double limit = joint.limits.velocity_max_rad_s;
        if (std::abs(velocity) > kInside * limit) {
          table->Fail(name, fmt::format("is {} rad/s; allowed: less than the joint's limit of {} "
                                        "rad/s, by a millionth of it or more",
                                        MessageNumber(velocity), MessageNumber(limit)));
        }
        (at_end ? joint.end_rad_s : joint.start_rad_s) = velocity;
        CheckPointsBesideEnds(*table, name, joint);
      }
    }
    if (problem_.joint_ends_moving() && problem_.settle_s > 0) {
      root_.Fail("settle_s", fmt::format("is {} s, in which the joints are held; but [end] lets "
                                         "them move: allowed: 0, or no end.joints_rad_s",
                                         MessageNumber(problem_.settle_s)));
    }
  }

  /// Checks that the points which an end's velocity moves are within the limits of position.
  void CheckPointsBesideEnds(TomlTable& table, const std::string& name,
                             const ActuatedJoint& joint) const {
    const DurationBounds durations =
        problem_.free_duration.value_or(DurationBounds{problem_.duration_s, problem_.duration_s});
    for (const double duration_s : {durations.min_s, durations.max_s}) {
      const EndPoints ends = EndPointsOf(joint, problem_.degree, duration_s);
      for (const auto& points : {ends.first, ends.last}) {
        for (const double point : points) {
          if (point >= joint.limits.position_min_rad && point <= joint.limits.position_max_rad)
            continue;
          table.Fail(name,
                     fmt::format("puts a control point beside the end at {} rad; allowed: {} to {} "
                                 "rad; give less velocity, another position or more control points",
                                 MessageNumber(point), MessageNumber(joint.limits.position_min_rad),
                                 MessageNumber(joint.limits.position_max_rad)));
        }
      }
    }
  }

  void ReadJoints() {
    std::optional<TomlTable> limits = root_.OptionalTable("limits");
    TomlTable start = root_.Table("start").Table("joints_rad");
    TomlTable end = root_.Table("end").Table("joints_rad");
    for (const TomlTable* table : {&start, &end}) {
      for (const std::string& name : table->Keys()) RequireJoint(*table, name, problem_);
    }
    for (std::size_t j = static_cast<std::size_t>(scene_.robot.root_dofs);
         j < scene_.robot.tree.dofs.size(); ++j) {
      Dof<Plane>& dof = scene_.robot.tree.dofs[j];
      if (scene_.robot.IsPassive(static_cast<int>(j))) {
        if (limits && limits->Has(dof.name)) {
          limits->Fail(dof.name,
                       "is in [passive], so it has no motor to limit; leave out one of the two");
        }
        continue;
      }
      if (!start.Has(dof.name)) {
        start.Fail(
            "",
            fmt::format("lacks the joint '{}': every joint with a motor needs a start and an end",
                        dof.name));
      }
      if (problem_.joints.size() == static_cast<std::size_t>(kMaxJoints)) {
        start.Fail(dof.name, fmt::format("a primitive moves at most {} joints", kMaxJoints));
      }
      if (!FixedString<32>::fits(dof.name))
        start.Fail(dof.name, "a joint's name has at most 32 characters");
      dof.prescribed = true;
      ActuatedJoint joint;
      joint.dof = static_cast<int>(j);
      const RobotJointLimits& urdf = scene_.robot.limits[j];
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
        start.Fail(dof.name,
                   fmt::format("its limits in the robot's file, {} to {}, lie outside "
                               "of what a primitive can hold; allowed: -100 ... 100 rad",
                               MessageNumber(urdf.lower_rad), MessageNumber(urdf.upper_rad)));
      }
      const Range range{allowed.position_min_rad, allowed.position_max_rad};
      joint.start_rad = start.Number(dof.name, range);
      joint.end_rad = end.Number(dof.name, range);
      problem_.joints.push_back(joint);
    }
  }

  /// Sets the advisable integration step, and the steps that the task leaves out.
  void SetStep() {
    std::vector<double> end = problem_.start_q;
    for (const ActuatedJoint& joint : problem_.joints)
      end[static_cast<std::size_t>(joint.dof)] = joint.end_rad;
    double effective = std::numeric_limits<double>::infinity();
    double& advisable = problem_.advisable_step_s;
    for (const std::vector<double>& q : {problem_.start_q, end}) {
      effective =
          std::min(effective, SmallestEffectiveMass(scene_.robot.tree, scene_.robot.shapes, q));
      advisable = std::min(advisable, SpringStep(scene_.robot, q));
    }
    if (!scene_.obstacles.empty() && std::isfinite(effective)) {
      const double weight_n = Mass() * scene_.robot.tree.gravity.norm();
      advisable = std::min(advisable, AdvisableStep(scene_.contact, effective, weight_n));
    }
    if (!std::isfinite(advisable)) return;
    const auto given = [this](const char* table, const char* key) {
      std::optional<TomlTable> found = root_.OptionalTable(table);
      return found && found->Has(key);
    };
    const double step = std::max(advisable, 1e-5);
    SolverSettings& solver = problem_.solver;
    if (!given("solver", "step_s")) solver.step_s = std::min(solver.step_s, step);
    // These steps may be rough, but must keep the methods of screening and search stable.
    if (!given("solver", "screen_step_s"))
      solver.screen_step_s = std::max(solver.step_s, std::min(solver.screen_step_s, 2 * step));
    if (!given("search", "step_s"))
      problem_.search.step_s = std::min(problem_.search.step_s, 1.5 * step);
  }

  /// Checks that a rollout has no more steps than memory and patience allow: a gradient keeps what
  /// it needs of each.
  void CheckSteps() {
    const double time =
        (problem_.free_duration ? problem_.free_duration->max_s : problem_.duration_s) +
        problem_.settle_s;
    const auto check = [&](const char* name, const char* key, double step_s) {
      const double steps = time / step_s;
      if (steps <= kMostSteps) return;
      std::optional<TomlTable> table = root_.OptionalTable(name);
      const std::string problem = fmt::format(
          "is {} s, which is {:.0f} steps for the {} s of {} and settle_s; allowed: up to "
          "{:.0f} steps, so {} s or more here",
          MessageNumber(step_s), steps, MessageNumber(time),
          problem_.free_duration ? "duration_max_s" : "duration_s", kMostSteps,
          MessageNumber(1.00001 * time / kMostSteps));
      if (table) table->Fail(key, problem);
      root_.Fail(fmt::format("{}.{}", name, key), problem);
    };
    check("solver", "step_s", problem_.solver.step_s);
    check("solver", "screen_step_s", problem_.solver.screen_step_s);
    check("search", "step_s", problem_.search.step_s);
  }

  [[nodiscard]] double Mass() const {
    double mass = 0;
    for (const Dof<Plane>& dof : scene_.robot.tree.dofs) mass += dof.mass_kg;
    return mass;
  }

  void ReadObstacles() {
    // What flies says so; what hangs from a bar need not.
    constexpr const char* kWhatToWrite =
        "say what the robot can touch: for level ground [[obstacle]], and below it name = "
        "\"ground\", point_m = [0, 0] and normal = [0, 1]; for nothing at all obstacle = [], above "
        "the file's first [table]";
    std::vector<TomlTable> tables = scene_.robot.hinged() ? root_.OptionalTables("obstacle")
                                                          : root_.Tables("obstacle", kWhatToWrite);
    for (TomlTable& table : tables) {
      const Obstacle<Plane> obstacle = ReadObstacle(table);
      for (const Obstacle<Plane>& other : scene_.obstacles) {
        if (other.name == obstacle.name) {
          table.Fail("name",
                     fmt::format("'{}' is there twice; each obstacle needs a name of its own",
                                 obstacle.name));
        }
      }
      scene_.obstacles.push_back(obstacle);
    }
    if (scene_.robot.shapes.empty() && !scene_.obstacles.empty()) {
      std::string why;
      for (const IgnoredShape& shape : scene_.robot.ignored_shapes)
        why += fmt::format("; {} (line {})", shape.reason, shape.line);
      root_.Fail(
          "obstacle",
          fmt::format("the robot has no collision shape that could touch it{}; give its links "
                      "spheres, cylinders or boxes, or fly: obstacle = []",
                      why));
    }
    const std::size_t pairs = scene_.robot.shapes.size() * scene_.obstacles.size();
    if (pairs > kMostPairs) {
      root_.Fail(
          "obstacle",
          fmt::format("{} obstacles and {} collision shapes of the robot are {} pairs to "
                      "look at in every step; allowed: up to {}",
                      scene_.obstacles.size(), scene_.robot.shapes.size(), pairs, kMostPairs));
    }
  }

  void ReadSlope() {
    TaskGround ground;
    ReadKeys(root_, kTaskGroundKeys, ground);
    if (ground.slope_rad == 0) return;
    if (scene_.robot.root_dofs == 0 || scene_.robot.hinged()) {
      root_.Fail("slope_rad",
                 "is for robots that stand; allowed: with root = \"planar-xz\", or leave it out");
    }
    Tilt(scene_.robot, ground.slope_rad);
  }

  void ReadBar() {
    std::optional<TomlTable> table = root_.OptionalTable("bar");
    if (!table) return;
    if (!scene_.robot.hinged())
      root_.Fail("bar", "holds nothing here; allowed: with root = \"hinge-y\", or leave it out");
    TaskBar bar;
    ReadKeys(*table, kTaskBarKeys, bar);
    scene_.robot.tree.dofs[kPitchOfRoot].damping_nm_s_per_rad = bar.friction_nm_s_per_rad;
  }

  void ReadSelfContacts() {
    std::vector<std::vector<double>> ends(2, std::vector<double>(scene_.robot.tree.dofs.size()));
    for (const ActuatedJoint& joint : problem_.joints) {
      ends[0][Index(joint.dof)] = joint.start_rad;
      ends[1][Index(joint.dof)] = joint.end_rad;
    }
    ReadSelfContact(root_, ends, scene_);
  }

  void ReadCosts() {
    std::vector<CostTerm>& cost = problem_.cost;
    for (TomlTable& table : root_.Tables("cost")) {
      const CostTerm term =
          ReadCostTerm(table, scene_.robot, problem_.duration_s, problem_.settle_s);
      CheckTime(table, term);
      CheckAgainstOthers(table, term);
      if (term.targets_pitch() && term.weight > 0) problem_.target_pitch_rad = term.target;
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
    const bool any = std::any_of(cost.begin(), cost.end(),
                                 [](const CostTerm& term) { return term.weight != 0; });
    if (!any) {
      const bool empty = root_.Tables("cost").empty();
      root_.Fail("cost", fmt::format("asks for nothing, as it {}; allowed: at least one term with "
                                     "weight > 0",
                                     empty ? "is empty" : "has only weights of 0"));
    }
  }

  /// Checks that no earlier term has a target of the same quantity that is missed wherever this one
  /// is met.
  void CheckAgainstOthers(TomlTable& table, const CostTerm& term) const {
    if (!term.draws()) return;
    for (const CostTerm& other : problem_.cost) {
      const auto after = [this](const CostTerm& of) {
        // Without a settle phase the motion has settled when it ends.
        return of.when == CostTerm::When::kSettled && problem_.settle_s == 0 ? CostTerm::When::kEnd
                                                                             : of.when;
      };
      const bool same = other.draws() && other.of() == term.of() && after(other) == after(term) &&
                        other.from_start == term.from_start &&
                        std::abs(other.time_s - term.time_s) <= 1e-9 && other.point == term.point;
      const double apart = std::abs(term.target - other.target);
      if (!same || apart <= term.tolerance + other.tolerance + 1e-9) continue;
      table.Fail("target",
                 fmt::format("asks for {} of what another [[cost]] asks to be {} at the same time; "
                             "no motion is within the tolerances of both; leave one out",
                             MessageNumber(term.target), MessageNumber(other.target)));
    }
  }

  /// Checks that a motion whose duration is free takes longer than until a term looks at it.
  void CheckTime(TomlTable& table, const CostTerm& term) const {
    if (!problem_.free_duration || !table.Has("time_s")) return;
    // Nearer to the end there would be no room for the steps that are stretched.
    const double latest = problem_.free_duration->min_s - kLeastStretched_s;
    if (term.when == CostTerm::When::kTime && term.time_s <= latest) return;
    table.Fail("time_s", fmt::format("is not within every motion whose duration is free; allowed: "
                                     "up to {} s, which is {} s before duration_min_s, or `when` "
                                     "instead",
                                     MessageNumber(latest), kLeastStretched_s));
  }

  void ReadDrives() {
    std::optional<TomlTable> table = root_.OptionalTable("drives");
    if (!table) return;
    if (problem_.robust) {
      table->Fail("",
                  "does not go with [robust], which has the drives' gains itself; allowed: "
                  "robust.kp_nm_per_rad and robust.kd_nm_s_per_rad");
    }
    ReadKeys(*table, kTaskDrivesKeys, problem_.drives.emplace());
  }

  /// Checks that robots which differ from the model begin at rest.
  void CheckRobust(TomlTable& start) const {
    const bool moves =
        !problem_.free_start_coordinates().empty() ||
        std::ranges::any_of(problem_.start_root_rates, [](double v) { return v != 0; });
    if (!problem_.robust || !moves) return;
    start.Fail(
        "", "lets the root move, and robots of [robust] begin at rest; leave out one of the two");
  }

  TomlTable root_;
  std::optional<StartPose> given_;
  Problem problem_;
  Scene& scene_ = problem_.scene;
};

Task Parse(const std::string& task_text, const std::string& task_name,
           const std::string& robot_text, const std::string& robot_name,
           std::optional<StartPose> given) {
  TomlTable root = TomlTable::Parse(task_text, task_name);
  ReadHeader(root, kTaskHeader);
  TaskRobot named;
  ReadKeys(root, kTaskRobotKeys, named);
  const LockedJoints locked = ReadLocked(root);
  const Robot in_space = ParseRobot(robot_text, robot_name, named.root, locked);
  CheckLocked(root, locked, in_space);
  PlanarRobot robot = ReduceToPlane(in_space);
  Task task;
  task.problem = TaskReader(std::move(root), std::move(robot), std::move(given)).Read();
  task.task_file = task_name;
  task.task_text = task_text;
  task.robot_file = robot_name;
  task.robot_text = robot_text;
  return task;
}

/// The path of the URDF that a task names, relative to the task's folder.
std::string RobotPath(const std::string& task_text, const std::string& path) {
  TomlTable root = TomlTable::Parse(task_text, path);
  ReadHeader(root, kTaskHeader);
  TaskRobot named;
  ReadKeys(root, kTaskRobotKeys, named);
  const std::filesystem::path robot_path = std::filesystem::path(path).parent_path() / named.robot;
  std::error_code error;
  if (!std::filesystem::exists(robot_path, error)) {
    root.Fail("robot",
              fmt::format("'{}' does not exist (looked for {})", named.robot, robot_path.string()));
  }
  if (std::filesystem::is_directory(robot_path, error))
    root.Fail("robot", fmt::format("'{}' is a directory; allowed: a URDF file", named.robot));
  return robot_path.string();
}

}  // namespace

std::vector<KeyTable> TaskKeyTables() {
  const char* const source = "offline/problem/task_keys.h";
  const KeyRow joints{
      "", "`joints_rad`", "required",
      "table: every joint with a motor, within its limits; a `[passive]` one may be there", ""};
  const KeyRow locked{
      "", "`locked`", "none",
      "table: some of the joints, and where they are [rad, m], within the URDF's "
      "limits",
      "joints that nothing moves: what they connect is one body, in plans, twin and "
      "pages, and no drive is theirs; with a joint go those that `mimic` it"};
  const KeyRow velocities{"", "`joints_rad_s`", "0 each",
                          "table: some of the joints, within their limits of velocity",
                          "velocities of the joints, whose accelerations are 0 there"};
  return {{source, "task",
           Joined({{RowOf(kTaskHeader)},
                   RowsOf(kNameKeys),
                   RowsOf(kTaskRobotKeys),
                   {locked},
                   RowsOf(kTaskTimeKeys),
                   RowsOf(kTaskDurationKeys),
                   RowsOf(kTaskGroundKeys)})},
          {source, "start",
           Joined({{joints, velocities}, RowsOf(kTaskStartKeys), RowsOf(kTaskStartRateKeys)})},
          {source, "bar", RowsOf(kTaskBarKeys)},
          {source, "spline", RowsOf(kSplineKeys)},
          {source, "limits", RowsOf(kTaskLimitKeys)},
          MotorKeyTable(),
          PassiveKeyTable(),
          CostKeyTable(),
          ContactKeyTable(),
          ObstacleKeyTable(),
          SelfContactKeyTable(),
          {source, "tolerances", RowsOf(kTaskToleranceKeys)},
          {source, "drives", RowsOf(kTaskDrivesKeys)},
          RobustKeyTable(),
          RobustFeedbackKeyTable(),
          {source, "mirror", RowsOf(kMirrorKeys)},
          {source, "search", RowsOf(kSearchKeys)},
          {source, "solver", RowsOf(kSolverKeys)}};
}

Task LoadTask(const std::string& path) { return ParseTask(ReadTextFile(path), path); }

Task LoadTask(const std::string& path, const PrimitiveFile& before,
              const std::string& before_path) {
  const std::string task_text = ReadTextFile(path);
  const std::string robot_path = RobotPath(task_text, path);
  return ParseTask(task_text, path, ReadTextFile(robot_path), robot_path, before, before_path);
}

Task ParseTask(const std::string& task_text, const std::string& task_name) {
  const std::string robot_path = RobotPath(task_text, task_name);
  return ParseTask(task_text, task_name, ReadTextFile(robot_path), robot_path);
}

Task ParseTask(const std::string& task_text, const std::string& task_name,
               const std::string& robot_text, const std::string& robot_name) {
  return Parse(task_text, task_name, robot_text, robot_name, std::nullopt);
}

Task ParseTask(const std::string& task_text, const std::string& task_name,
               const std::string& robot_text, const std::string& robot_name,
               const PrimitiveFile& before, const std::string& before_path) {
  if (robot_text != before.provenance.robot_urdf) {
    throw FileError(before_path, 0, "provenance.robot_urdf",
                    fmt::format("is not the robot of the task {}, {}: an exit of another robot is "
                                "no start; make the primitive again with that robot",
                                task_name, robot_name));
  }
  Task task = Parse(
      task_text, task_name, robot_text, robot_name,
      StartPose{&before.exit, &before.primitive,
                fmt::format("the exit of '{}' ({})", before.primitive.name.view(), before_path)});
  const Scene scene_before = TaskOf(before).problem.scene;
  if (!SameJoints(task.problem.scene, scene_before)) {
    throw FileError(before_path, 0, "provenance.task_toml",
                    fmt::format("has other [motor] or [passive], or damping of joints, or locked "
                                "joints, than the task {}: what "
                                "one robot does is no start for another; give both the same",
                                task_name));
  }
  if (!SameGround(task.problem.scene, scene_before)) {
    throw FileError(
        before_path, 0, "provenance.task_toml",
        fmt::format("has other [contact], [[obstacle]] or slope than the task {}: the robot "
                    "would not stay where it was left; give both the same",
                    task_name));
  }
  task.start_file = before_path;
  task.start_hash = ContentHash(before);
  return task;
}

Task TaskOf(const PrimitiveFile& file) {
  const Provenance& from = file.provenance;
  Task task = Parse(from.task_toml, from.task_file, from.robot_urdf, from.robot_file,
                    StartPose{&file.entry, &file.primitive,
                              fmt::format("the entry of '{}'", file.primitive.name.view()), true});
  // The task may have left it to the search.
  task.problem.duration_s = file.primitive.duration_s;
  task.start_file = from.start_file;
  task.start_hash = from.start_hash;
  task.guess_file = from.guess_file;
  task.guess_hash = from.guess_hash;
  task.complement_files = from.complement_files;
  task.complement_hashes = from.complement_hashes;
  return task;
}

}  // namespace tumbler
