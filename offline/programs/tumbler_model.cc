// tumbler model: shows the content of a robot file, and evaluates its equations of motion.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "common/files/command_line.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/toml_reader.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/mesh_points.h"
#include "offline/model/mjcf.h"
#include "offline/model/planar_robot.h"
#include "offline/model/robot.h"
#include "offline/model/robot_notes.h"
#include "offline/model/robot_review.h"
#include "offline/model/sdf.h"
#include "offline/model/urdf_source.h"
#include "offline/programs/hybrid_states.h"

namespace tumbler {
namespace {

constexpr const char* kExitCodes =
    R"(Exit codes:
  0  usable
  1  wrong usage, or a file or state that cannot be used
  4  check: no task takes the robot, even with the joints locked that it names)";

using Dynamics = HybridDynamics<Spatial>;

constexpr std::array kRoots = {
    std::pair{"planar-xz", RootKind::kPlanarXz}, std::pair{"fixed", RootKind::kFixed},
    std::pair{"hinge-y", RootKind::kHingeY}, std::pair{"floating", RootKind::kFloating}};

struct Arguments {
  std::string robot;
  std::string root = "planar-xz";
  std::string prescribed;
  std::string locked;
  std::vector<double> gravity;
  double velocity = 0;  ///< 0: not given.
  bool derivatives = false;
  int mesh_points = 0;  ///< 0: meshes touch nothing.
};

RootKind RootOf(const Arguments& arguments) {
  RootKind root = RootKind::kPlanarXz;
  for (const auto& [name, kind] : kRoots) {
    if (arguments.root == name) root = kind;
  }
  return root;
}

/// The joints of `--locked`.
LockedJoints LockedOf(const Arguments& arguments) {
  LockedJoints locked;
  const std::string& list = arguments.locked;
  for (std::size_t begin = 0; begin < list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    const std::string entry = list.substr(begin, end - begin);
    begin = end + 1;
    const std::size_t equals = entry.rfind('=');
    double position = 0;
    const char* const last = entry.data() + entry.size();
    const bool number = equals != std::string::npos &&
                        std::from_chars(entry.data() + equals + 1, last, position).ptr == last &&
                        equals + 1 < entry.size() && std::isfinite(position);
    if (!number) {
      throw UsageError(
          "--locked",
          fmt::format("has '{}'; allowed, separated by commas: JOINT=POSITION, a finite "
                      "number [rad, m]",
                      entry));
    }
    locked[entry.substr(0, equals)] = position;
  }
  return locked;
}

/// Checks that the joints which were to be locked are there, and may be where they are.
void CheckLocked(const Robot& robot, const LockedJoints& asked) {
  for (const auto& [name, position] : asked) {
    const auto found = std::ranges::find(robot.locked, name, &LockedJoint::name);
    if (found == robot.locked.end()) {
      throw UsageError("--locked",
                       fmt::format("'{}' is no joint of {} that moves", name, robot.file));
    }
    if (position != found->position_rad) {
      throw UsageError("--locked",
                       fmt::format("{} is {}, but it follows {}, with which it is at {}; "
                                   "leave it out",
                                   name, position, found->with, found->position_rad));
    }
    if (position < found->limits.lower_rad || position > found->limits.upper_rad) {
      throw UsageError("--locked", fmt::format("{} is {}; allowed: {:g} ... {:g}", name, position,
                                               found->limits.lower_rad, found->limits.upper_rad));
    }
  }
}

Robot LoadRobot(const Arguments& arguments) {
  const std::string text = ReadTextFile(arguments.robot);
  const LockedJoints locked = LockedOf(arguments);
  Robot robot = ParseRobot(text, arguments.robot, RootOf(arguments), locked);
  CheckLocked(robot, locked);
  const UrdfSource source(text, arguments.robot);
  for (const RobotFinding& note : NotesOf(source))
    fmt::print(stderr, "{}:{}: {}: note: {}\n", robot.file, note.line, note.key, note.problem);
  return robot;
}

void FlushOutput() {
  errno = 0;
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    throw std::runtime_error(
        fmt::format("standard output: {}", std::generic_category().message(errno)));
  }
}

// ---- check --------------------------------------------------------------------------------------

std::string KindOf(const Robot& robot, std::size_t j) {
  if (robot.joints[j].continuous) return "continuous";
  return robot.tree.dofs[j].kind == JointKind::kRevolute ? "revolute" : "prismatic";
}

/// A number for a table. Numbers that are zero but for the rounding of rotations become 0.
std::string Short(double value) {
  return fmt::format("{:.4g}", std::abs(value) < 1e-12 ? 0 : value);
}

void PrintDegreesOfFreedom(const Robot& robot) {
  fmt::print("degrees of freedom: {}\n", robot.tree.dofs.size());
  fmt::print("  {:<20} {:<10} {:<22} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}  {}\n", "name", "kind",
             "axis at zero", "lower", "upper", "velocity", "effort", "damping", "friction",
             "moves");
  for (const int dof : robot.file_order) {
    const std::size_t j = Index(dof);
    const Dof<Spatial>& d = robot.tree.dofs[j];
    const SpaceVector& axis = d.kind == JointKind::kRevolute ? d.axis : d.direction;
    const RobotJointLimits& limits = robot.joints[j].limits;
    fmt::print("  {:<20} {:<10} {:<22} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}  {}\n", d.name,
               KindOf(robot, j),
               fmt::format("({}, {}, {})", Short(axis.x()), Short(axis.y()), Short(axis.z())),
               Short(limits.lower_rad), Short(limits.upper_rad), Short(limits.velocity_rad_s),
               Short(limits.effort_nm), Short(d.damping_nm_s_per_rad),
               Short(robot.joints[j].dry_friction_nm), robot.joints[j].link);
  }
  fmt::print(
      "  (rad, rad/s, N m, N m s/rad, N m; prismatic: m, m/s, N, N s/m, N; axes in the root's "
      "frame)\n");
  for (const LockedJoint& joint : robot.locked) {
    fmt::print("  {:<20} locked at {}{}\n", joint.name, Short(joint.position_rad),
               joint.with.empty() ? "" : fmt::format(", with {}", joint.with));
  }
  const bool rubs = std::any_of(robot.joints.begin(), robot.joints.end(),
                                [](const RobotJoint& joint) { return joint.dry_friction_nm > 0; });
  if (rubs) {
    fmt::print(
        "  Damping is in plans and in the twin. Dry friction is in the twin, and in plans whose "
        "task "
        "has [motor].\n");
  }
}

void PrintMasses(const Robot& robot) {
  fmt::print("masses [kg]:\n");
  double moving = 0;
  double at_rest = 0;
  for (const RobotLink& link : robot.links) {
    (link.body < 0 ? at_rest : moving) += link.mass_kg;
    fmt::print("  {:<20} {:>12.6g}  {}\n", link.name, link.mass_kg,
               link.body < 0 ? std::string("fixed to the world")
                             : fmt::format("moved by {}", robot.tree.dofs[Index(link.body)].name));
  }
  fmt::print("  {:<20} {:>12.6g}\n", "total, moving", moving);
  if (robot.root == RootKind::kFixed)
    fmt::print("  {:<20} {:>12.6g}\n", "fixed to the world", at_rest);
}

void PrintFinding(const Robot& robot, const RobotFinding& finding, std::string_view kind) {
  fmt::print("{}:{}: {}: {}: {}\n", robot.file, finding.line, finding.key, kind, finding.problem);
}

/// Prints the degrees of freedom that cannot be free, at least where all positions are zero.
void PrintUndetermined(const Robot& robot) {
  const auto print = [&robot](std::size_t j, std::string_view problem) {
    const RobotLink* const link = robot.FindLink(robot.joints[j].link);
    PrintFinding(robot,
                 {link == nullptr ? 0 : link->line, fmt::format("link '{}'", robot.joints[j].link),
                  fmt::format("degree of freedom '{}' {}", robot.tree.dofs[j].name, problem)},
                 "warning");
  };
  bool all_move_mass = true;
  for (std::size_t j = 0; j < robot.tree.dofs.size(); ++j) {
    if (robot.MovesMass(static_cast<int>(j))) continue;
    all_move_mass = false;
    print(j,
          "moves no mass: it can only be prescribed; give the link, or one that it carries, an "
          "<inertial>");
  }
  if (!all_move_mass || robot.tree.dofs.size() > Index(Spatial::kMaxDofs)) return;
  Dynamics dynamics(robot.tree);
  const std::vector<double> zero(robot.tree.dofs.size());
  std::vector<double> qdd = zero, tau = zero;
  dynamics.SetState(zero, zero);
  dynamics.Solve(qdd, tau);
  if (const int j = dynamics.FindUndetermined(kUndetermined); j >= 0) {
    print(Index(j),
          "has no inertia of its own at zero positions with all others free: its acceleration is "
          "not determined there unless it, or one that does the same, is prescribed");
  }
}

void PrintFindings(const Robot& robot, const std::vector<RobotFinding>& findings) {
  for (const RobotFinding& finding : findings)
    fmt::print("    {}:{}: {}: {}\n", robot.file, finding.line, finding.key, finding.problem);
}

/// The shapes with which the robot could touch something.
std::string ShapesThatTouch(const RobotReview& review) {
  const bool meshes = std::ranges::any_of(review.ignored_shapes, &IgnoredShape::mesh);
  return std::string("spheres, cylinders, capsules or boxes") +
         (meshes ? ", or points of its meshes: contact.meshes = \"points\" in the task, "
                   "--mesh-points here"
                 : "");
}

/// Whether a task takes the robot, and what it needs for that.
void PrintUse(const RobotReview& review) {
  const Robot& robot = *review.robot;
  const bool in_space = robot.root == RootKind::kFloating;
  fmt::print("can be looked at: yes\n");
  if (review.obstacles.empty() && review.CanBePlanned()) {
    if (review.touches) {
      fmt::print("can be planned: yes, tumbler optimize takes it\n");
    } else {
      fmt::print(
          "can be planned: only where it touches nothing (obstacle = []); to touch anything it "
          "needs collision shapes: {}\n",
          ShapesThatTouch(review));
    }
    const std::string through =
        in_space ? review.without_contact : LinksWithoutContact(ReduceToPlane(robot));
    if (review.touches && !through.empty())
      fmt::print("note: no collision shape, so passes through the ground: {}\n", through);
    return;
  }
  fmt::print("can be planned: not yet{}\n", review.obstacles.empty() ? "" : "; in the way:");
  PrintFindings(robot, review.obstacles);
  if (!review.to_lock.empty()) {
    fmt::print(
        "  joints that no task moves, for the task (or lock them where you want them):\n    {}\n",
        LockedAsToml(review.to_lock));
    fmt::print("  joints left with these locked: {}\n",
               review.joints_left.empty() ? "none"
                                          : fmt::format("{}", fmt::join(review.joints_left, ", ")));
  }
  if (review.joints_left.empty()) {
    fmt::print("  it needs a joint that moves{}\n", in_space ? "" : " in the x-z plane");
  }
  if (const std::size_t more = review.TooMany(); more > 0) {
    fmt::print(
        "  it needs {} more of these {} joints locked: a task moves up to {}, and has up to {} "
        "coordinates with its root\n    {}\n",
        more, review.joints_left.size(), RobotReview::kMostMoved,
        in_space ? Spatial::kMaxDofs : Plane::kMaxDofs, fmt::join(review.joints_left, ", "));
  }
  if (!review.to_lock.empty() && !review.left.empty()) {
    fmt::print("  with these joints locked it still needs another file:\n");
    PrintFindings(robot, review.left);
  }
  if (!review.touches) {
    fmt::print("  to touch anything it needs collision shapes: {}\n", ShapesThatTouch(review));
  }
  if (review.CanBePlanned()) {
    fmt::print("can be planned with these joints locked: {}\n",
               review.touches ? "yes" : "only where it touches nothing (obstacle = [])");
  }
}

/// Makes points of the meshes that touch, or says why they cannot be used.
std::vector<MeshInContact> TakeMeshPoints(const Arguments& arguments, const std::string& text,
                                          const LockedJoints& locked, RobotReview& review) {
  if (arguments.mesh_points == 0 || !review.robot) return {};
  try {
    const RobotOfPoints with =
        WithMeshPoints(text, *review.robot, static_cast<std::size_t>(arguments.mesh_points));
    review = ReviewRobot(with.urdf, arguments.robot, RootOf(arguments), locked);
    return with.meshes;
  } catch (const RobotFileError& error) {
    review = {};
    review.mistakes = error.findings();
    return {};
  }
}

ExitStatus Check(const Arguments& arguments) {
  const std::string text = ReadTextFile(arguments.robot);
  const LockedJoints locked = LockedOf(arguments);
  RobotReview review = ReviewRobot(text, arguments.robot, RootOf(arguments), locked);
  const std::vector<MeshInContact> meshes = TakeMeshPoints(arguments, text, locked, review);
  for (const RobotFinding& mistake : review.mistakes) {
    fmt::print(
        stderr, "tumbler model: {}\n",
        Printable(FileError(arguments.robot, mistake.line, mistake.key, mistake.problem).what()));
  }
  if (!review.robot) return ExitStatus::kUnusable;
  const Robot& robot = *review.robot;
  CheckLocked(robot, locked);
  for (const RobotFinding& note : review.notes)
    fmt::print(stderr, "{}:{}: {}: note: {}\n", robot.file, note.line, note.key, note.problem);
  fmt::print("robot '{}', root link '{}' {}\n", robot.name, robot.links.front().name,
             robot.root == RootKind::kFixed      ? "fixed to the world"
             : robot.root == RootKind::kPlanarXz ? "free in the x-z plane"
             : robot.root == RootKind::kHingeY   ? "hung from a bar along y"
                                                 : "free in space");
  PrintDegreesOfFreedom(robot);
  PrintMasses(robot);
  for (const RobotFinding& finding : robot.findings) PrintFinding(robot, finding, "warning");
  PrintUndetermined(robot);
  for (const MeshInContact& mesh : meshes) {
    PrintFinding(robot, {mesh.line, fmt::format("link '{}'", mesh.link), Describe(mesh)}, "note");
  }
  for (const RobotFinding& note : NotesOf(review.ignored_shapes)) PrintFinding(robot, note, "note");
  PrintUse(review);
  FlushOutput();
  return review.CanBePlanned() ? ExitStatus::kDone : ExitStatus::kAmiss;
}

// ---- hybrid -------------------------------------------------------------------------------------

ExitStatus Hybrid(const Arguments& arguments) {
  Robot robot = LoadRobot(arguments);
  if (robot.tree.dofs.size() > Index(Spatial::kMaxDofs)) {
    throw FileError(
        robot.file, 0, "",
        fmt::format("the robot has {} coordinates; its dynamics are evaluated with up to "
                    "{}: lock some joints (--locked)",
                    robot.tree.dofs.size(), Spatial::kMaxDofs));
  }
  Prescribe(robot, arguments.prescribed);
  if (!arguments.gravity.empty()) {
    robot.tree.gravity =
        SpaceVector(arguments.gravity[0], arguments.gravity[1], arguments.gravity[2]);
    if (!robot.tree.gravity.allFinite())
      throw std::invalid_argument("--gravity: allowed: three finite numbers");
  }
  for (const RobotFinding& finding : robot.findings) {
    fmt::print(stderr, "{}:{}: {}: warning: {}\n", robot.file, finding.line, finding.key,
               finding.problem);
  }
  HybridStates states(std::move(robot), arguments.derivatives);
  std::string line;
  for (std::size_t number = 1; std::getline(std::cin, line); ++number) {
    const std::vector<std::string_view> parts = PartsOfState(line);
    if (parts.empty()) continue;
    std::string result;
    try {
      result = states.Evaluate(parts);
    } catch (const StateError& error) {
      throw FileError("standard input", static_cast<std::uint32_t>(number), "", error.what());
    }
    std::fputs(result.c_str(), stdout);
    FlushOutput();  // A program that asks line by line waits for the answer.
  }
  if (std::cin.bad() || std::ferror(stdin) != 0)
    throw std::runtime_error("standard input: cannot be read");
  return ExitStatus::kDone;
}

ExitStatus Urdf(const Arguments& arguments) {
  std::optional<double> velocity;
  if (arguments.velocity > 0) velocity = arguments.velocity;
  const TranslatedRobot robot = IsSdf(arguments.robot) ? ReadSdf(arguments.robot, velocity)
                                                       : ReadMjcf(arguments.robot, velocity);
  for (const std::string& note : robot.notes) fmt::print(stderr, "note: {}\n", Printable(note));
  fmt::print("{}", robot.urdf);
  FlushOutput();
  return ExitStatus::kDone;
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line("Shows what a robot file (URDF) holds, and evaluates its equations of motion.",
                   "tumbler model");
  line.SetFooter(kExitCodes);
  line.RequireSubcommand();
  CommandLine check = line.Subcommand("check",
                                      "Degrees of freedom, masses, and everything that stands in "
                                      "the way of a task with it, at once");
  CommandLine hybrid = line.Subcommand(
      "hybrid",
      "Hybrid dynamics (tau_a, qdd_p) = g(q, qd, qdd_a) of states from standard input.\n\n"
      "One state a line; blank lines and what follows # are skipped:\n"
      "  q, qd        positions and velocities of all coordinates: the root's (planar-xz: x z "
      "pitch;\n"
      "               floating: x y z pitch roll yaw), then movable joints in the file's order\n"
      "  qdd_a        accelerations of the prescribed ones, in that order\n"
      "  and any number of forces: fx fy fz px py pz LINK, a force [N] on the named link at a "
      "point [m],\n"
      "               both in world axes\n"
      "One line of results each, 17 digits: accelerations of the free ones, then forces or torques "
      "of the\n"
      "prescribed ones. With --derivatives three matrices follow on the line, row by row: the "
      "partial\n"
      "derivatives of these results (rows) by q, by qd, and by the inputs (columns, all "
      "coordinates in order;\n"
      "the input of a free one is the force or torque on it, that of a prescribed one its "
      "acceleration).\n"
      "Forces stay constant in world axes then, and their points move with the links.\n"
      "Free joints have no force of their own but the damping of the file.");
  CommandLine urdf = line.Subcommand(
      "urdf", "Writes a robot of MuJoCo (MJCF) or Gazebo (SDF) as a URDF to standard output");
  urdf.Option("ROBOT", arguments.robot, "Robot file (MJCF, SDF)").Required();
  urdf.Option("--velocity", arguments.velocity,
              "Limit of joints that have none [rad/s, m/s], as all of MJCF; a task needs one")
      .Within(1e-3, 1e3);
  for (CommandLine command : {check, hybrid}) {
    command.Option("ROBOT", arguments.robot, "Robot file (URDF)").Required();
    command.Option("--root", arguments.root, "How the root link is held")
        .OneOf({"planar-xz", "fixed", "hinge-y", "floating"})
        .ShowDefault();
    command.Option("--locked", arguments.locked,
                   "Joints that are held, and where [rad, m]: JOINT=POSITION, separated by commas");
  }
  check
      .Option("--mesh-points", arguments.mesh_points,
              "Let collision meshes touch with so many corners of their convex hulls, as a task "
              "with contact.meshes = \"points\"")
      .Within(kFewestMeshPoints, kMostMeshPoints);
  hybrid.Option("--prescribed", arguments.prescribed,
                "Joints (or coordinates of the root) whose acceleration is given, separated "
                "by commas; the others are free");
  hybrid.Flag("--derivatives", arguments.derivatives, "Print the partial derivatives as well");
  hybrid.Option("--gravity", arguments.gravity, "World axes [m/s^2], default 0 0 -9.81")
      .TakesValues(3, "X Y Z");
  line.Parse(argc, argv);
  if (urdf.given()) return Urdf(arguments);
  return check.given() ? Check(arguments) : Hybrid(arguments);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler model", argc, argv, tumbler::Main);
}
