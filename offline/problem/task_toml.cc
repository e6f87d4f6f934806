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
#include "offline/problem/joint_units.h"
#include "offline/problem/locked_toml.h"
#include "offline/problem/motor_toml.h"
#include "offline/problem/obstacle_toml.h"
#include "offline/problem/passive_toml.h"
#include "offline/problem/require_joint.h"
#include "offline/problem/robust_toml.h"
#include "offline/problem/self_contact_toml.h"
#include "offline/problem/space_task.h"
#include "offline/problem/start_toml.h"
#include "offline/problem/task_keys.h"
#include "offline/problem/task_parts.h"
#include "offline/problem/tied_toml.h"

namespace tumbler {
namespace {

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
    ReadNameAndTimes(root_, problem_);
    if (static_cast<int>(scene_.robot.tree.dofs.size()) == scene_.robot.root_dofs)
      root_.Fail("robot", "has no joint that moves; allowed: at least one");
    ReadPassiveJoints(root_, problem_);
    ReadActuatedJoints(root_, problem_);
    const std::vector<double> passive_start = ReadPassiveStart(root_, scene_);
    ReadMotors(root_, problem_);
    CheckDryFriction();
    ReadSlope();
    ReadBar();
    ReadSpline(root_, problem_);
    ReadEndVelocities(root_, problem_);
    ReadTied(root_, problem_);
    if (std::optional<TomlTable> table = root_.OptionalTable("mirror"))
      ReadKeys(*table, kMirrorKeys, problem_);
    if (std::optional<TomlTable> table = root_.OptionalTable("contact"))
      ReadContact(*table, Mass(), scene_.robot.tree.gravity.norm(), scene_.contact);
    ReadObstacles();
    ReadSelfContacts();
    ReadCosts(
        root_,
        [this](TomlTable& table) {
          return ReadCostTerm(table, scene_.robot, problem_.duration_s, problem_.settle_s);
        },
        problem_);
    ReadSettings(root_, problem_);
    problem_.robust = ReadRobust(root_, problem_);
    ReadDrives();
    TomlTable start = root_.Table("start");
    ReadStart(root_, start, given_, passive_start, problem_);
    SetTargetsFromStart(problem_);
    CheckRobust(start);
    CheckHeldTorque();
    root_.RejectUnknownKeys();
    SetAdvisableStep();
    SetStepsByAdvice(root_, problem_);
    CheckSteps(root_, problem_);
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
      why = "the feedback of [robust.feedback] is found for the torque of the end";
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
          fmt::format("has joint '{0}' with a dry friction of {1} {3}, which is more than is "
                      "simulated; allowed: up to {2}, or motor.{0}.dry_friction_nm",
                      robot.tree.dofs[dof].name, MessageNumber(friction_nm), kLargestDryFriction,
                      UnitsOf(robot.tree.dofs[dof].kind).force));
    }
  }

  void SetAdvisableStep() {
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
    CheckObstacles(root_, scene_.obstacles.size(), scene_.robot.shapes.size(),
                   scene_.robot.ignored_shapes);
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

/// The robot of a task.
struct RobotOfTask {
  TaskRobot named;
  Robot robot;
  RobotOfPoints text;
};
/// @param of_primitive  whether the text is a primitive's, which needs no other file.
RobotOfTask ReadRobot(TomlTable& root, const std::string& text, const std::string& name,
                      bool of_primitive) {
  RobotOfTask of;
  ReadHeader(root, kTaskHeader);
  ReadKeys(root, kTaskRobotKeys, of.named);
  const LockedJoints locked = ReadLocked(root);
  const MeshContact meshes = ReadMeshContact(root);
  of.robot = ParseRobot(text, name, of.named.root, locked);
  CheckLocked(root, locked, of.robot);
  of.text.urdf = text;
  if (meshes.as == MeshContact::As::kIgnored) return of;
  for (const RobotShape& shape : of.robot.collision_shapes) {
    if (!of_primitive || shape.kind != RobotShape::Kind::kMesh || shape.body < 0) continue;
    throw FileError(name, shape.line, fmt::format("link '{}'", shape.link),
                    fmt::format("has collision mesh '{}', of which a primitive holds the points; "
                                "make it again with tumbler optimize",
                                shape.mesh_file));
  }
  of.text = WithMeshPoints(text, of.robot, static_cast<std::size_t>(meshes.most_points));
  if (!of.text.meshes.empty()) of.robot = ParseRobot(of.text.urdf, name, of.named.root, locked);
  return of;
}

/// Reads the rest of a task, of which the robot was read.
Task ReadRest(TomlTable root, RobotOfTask of, const std::string& task_text,
              const std::string& task_name, const std::string& robot_text,
              const std::string& robot_name, std::optional<StartPose> given, TaskSpaces takes) {
  Task task;
  if (of.named.root == RootKind::kFloating) {
    if (takes == TaskSpaces::kPlane && given) {
      throw FileError(
          task_name, 0, "root",
          fmt::format("{} is of a robot in space (root = \"floating\"), which this does "
                      "not take; docs/space.md says what does: tumbler run sim, tumbler chain, "
                      "tumbler robustness, tumbler abort, tumbler view --out with it alone",
                      given->from));
    }
    if (takes == TaskSpaces::kPlane) {
      root.Fail(
          "root",
          "is \"floating\": a robot in space, which docs/space.md is about; tumbler optimize finds "
          "its motions, tumbler robustness and tumbler run sim play them, but not this; allowed "
          "here: planar-xz, fixed, hinge-y");
    }
    if (given && !given->pose->is_in_space()) {
      root.Fail("root", fmt::format("is \"floating\", and {} has no root_quaternion, which every "
                                    "motion of a robot in space has: make it again",
                                    given->from));
    }
    task.problem = ReadSpaceTask(std::move(root), of.robot, given);
  } else {
    if (given && given->pose->is_in_space()) {
      root.Fail("root", fmt::format("is of a robot in the plane, and {} has a root_quaternion, as "
                                    "motions of robots in space have: make it again",
                                    given->from));
    }
    task.problem = TaskReader(std::move(root), ReduceToPlane(of.robot), std::move(given)).Read();
  }
  task.task_file = task_name;
  task.task_text = task_text;
  task.robot_file = robot_name;
  task.robot_text = std::move(of.text.urdf);
  task.robot_as_given = robot_text;
  task.meshes = std::move(of.text.meshes);
  return task;
}

Task Parse(const std::string& task_text, const std::string& task_name,
           const std::string& robot_text, const std::string& robot_name,
           std::optional<StartPose> given, TaskSpaces takes) {
  TomlTable root = TomlTable::Parse(task_text, task_name);
  RobotOfTask of = ReadRobot(root, robot_text, robot_name, given && given->own);
  return ReadRest(std::move(root), std::move(of), task_text, task_name, robot_text, robot_name,
                  std::move(given), takes);
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
                   NameKeyRows(),
                   RowsOf(kTaskRobotKeys),
                   {locked},
                   RowsOf(kTaskTimeKeys),
                   RowsOf(kTaskDurationKeys),
                   RowsOf(kTaskGroundKeys)})},
          {source, "start",
           Joined({{joints, velocities}, RowsOf(kTaskStartKeys), RowsOf(kTaskStartRateKeys)})},
          {source, "bar", RowsOf(kTaskBarKeys)},
          {source, "spline", SplineKeyRows()},
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
          TiedKeyTable(),
          {source, "search", RowsOf(kSearchKeys)},
          {source, "solver", RowsOf(kSolverKeys)}};
}

Task LoadTask(const std::string& path, TaskSpaces takes) {
  return ParseTask(ReadTextFile(path), path, takes);
}

Task LoadTask(const std::string& path, const PrimitiveFile& before,
              const std::string& before_path) {
  const std::string task_text = ReadTextFile(path);
  const std::string robot_path = RobotPath(task_text, path);
  return ParseTask(task_text, path, ReadTextFile(robot_path), robot_path, before, before_path);
}

Task ParseTask(const std::string& task_text, const std::string& task_name, TaskSpaces takes) {
  const std::string robot_path = RobotPath(task_text, task_name);
  return ParseTask(task_text, task_name, ReadTextFile(robot_path), robot_path, takes);
}

Task ParseTask(const std::string& task_text, const std::string& task_name,
               const std::string& robot_text, const std::string& robot_name, TaskSpaces takes) {
  return Parse(task_text, task_name, robot_text, robot_name, std::nullopt, takes);
}

Task ParseTask(const std::string& task_text, const std::string& task_name,
               const std::string& robot_text, const std::string& robot_name,
               const PrimitiveFile& before, const std::string& before_path) {
  TomlTable root = TomlTable::Parse(task_text, task_name);
  RobotOfTask of = ReadRobot(root, robot_text, robot_name, false);
  if (of.text.urdf != before.provenance.robot_urdf) {
    throw FileError(before_path, 0, "provenance.robot_urdf",
                    fmt::format("is not the robot of the task {}, {}: an exit of another robot is "
                                "no start; make the primitive again with that robot",
                                task_name, robot_name));
  }
  Task task = ReadRest(
      std::move(root), std::move(of), task_text, task_name, robot_text, robot_name,
      StartPose{&before.exit, &before.primitive,
                fmt::format("the exit of '{}' ({})", before.primitive.name.view(), before_path)},
      TaskSpaces::kPlaneAndSpace);
  const Problem problem_before = TaskOf(before, TaskSpaces::kPlaneAndSpace).problem;
  if (problem_before.space && problem_before.ends_moving()) {
    throw FileError(
        before_path, 0, "exit",
        fmt::format("is in motion, and motions in space begin at rest, that of {}, too; "
                    "allowed: a motion that ends at rest",
                    task_name));
  }
  if (!SameJoints(task.problem, problem_before)) {
    throw FileError(before_path, 0, "provenance.task_toml",
                    fmt::format("has other [motor] or [passive], or damping of joints, or locked "
                                "joints, than the task {}: what "
                                "one robot does is no start for another; give both the same",
                                task_name));
  }
  if (!SameGround(task.problem, problem_before)) {
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

Task TaskOf(const PrimitiveFile& file, TaskSpaces takes) {
  const Provenance& from = file.provenance;
  const std::string_view name = file.primitive.name.view();
  const auto parse = [&] {
    try {
      return Parse(
          from.task_toml, from.task_file, from.robot_urdf, from.robot_file,
          StartPose{&file.entry, &file.primitive, fmt::format("the entry of '{}'", name), true},
          takes);
    } catch (const FileError& error) {
      // Files and lines are those of the texts in the primitive.
      throw FileError(fmt::format("primitive '{}'", name), 0, "provenance",
                      fmt::format("of the texts in it, {}", error.what()));
    }
  };
  Task task = parse();
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
