#include "offline/programs/robot_of_urdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <string_view>
#include <utility>

#include "common/core/index.h"
#include "common/files/toml_reader.h"
#include "offline/model/mesh_file.h"
#include "offline/model/planar_robot.h"
#include "offline/model/robot_review.h"
#include "offline/problem/motor_toml.h"
#include "offline/problem/task_toml.h"

namespace tumbler {
namespace {

/// How far a joint is bent, at most [rad, m], and the part of its range.
constexpr double kBend_rad = 0.2, kBend_m = 0.02, kPartOfRange = 0.25;
/// How far from its limits a joint starts, at most [rad, m], and the part of its range.
constexpr double kFromLimit = 0.02, kFromLimitPart = 0.1;

/// Of pitches in tasks [rad]: far finer than their tolerances, and a robot that stands flat has 0.
constexpr double kPitchUnit = 1e-3;
/// How far a joint without limits may turn to either side.
constexpr double kEndlessRange_rad = 10;

/// Never a negative zero.
double Rounded(double value, double unit) { return std::round(value / unit) * unit + 0.0; }

/// A joint that the tasks move.
struct MovedJoint {
  std::string name, link;
  RobotJointLimits limits;
  double start = 0, end = 0, dry_friction_nm = 0;
  bool slides = false;
};

MovedJoint Moved(const Robot& robot, std::size_t dof) {
  const Dof<Spatial>& from = robot.tree.dofs[dof];
  const RobotJoint& about = robot.joints[dof];
  MovedJoint joint{from.name,
                   about.link,
                   about.limits,
                   0,
                   0,
                   about.dry_friction_nm,
                   from.kind == JointKind::kPrismatic};
  // A primitive holds no more.
  const double lower = std::max(joint.limits.lower_rad, -100.0);
  const double upper = std::min(joint.limits.upper_rad, 100.0);
  const double range = std::max(0.0, upper - lower);
  const double inside = std::min(kFromLimit, kFromLimitPart * range);
  joint.start = std::clamp(0.0, lower + inside, upper - inside);
  const double most = joint.slides ? kBend_m : kBend_rad;
  const double bend = std::min(most, kPartOfRange * range);
  joint.start = std::round(1e6 * joint.start) / 1e6;
  joint.end = joint.start + (joint.start + bend <= upper - inside ? bend : -bend);
  return joint;
}

class Writer {
 public:
  Writer(const std::string& name, const std::string& urdf, const std::string& urdf_file,
         RootKind root)
      : name_(name), root_(root) {
    RobotReview review = ReviewRobot(urdf, urdf_file, root);
    if (!review.robot) throw RobotFileError(urdf_file, review.mistakes);
    if (!review.left.empty()) throw RobotFileError(urdf_file, review.left);
    if (review.joints_left.empty()) {
      throw FileError(urdf_file, 0, "",
                      "the robot has no joint that moves in the x-z plane (`tumbler model check` "
                      "says which do not, and why)");
    }
    locked_ = review.to_lock;
    if (!locked_.empty())
      notes_.push_back(fmt::format("locked, as no task moves them: {}", NamesOf(locked_)));
    if (review.TooMany() > 0) LockMore(*review.robot, review);
    const Robot robot = ParseRobot(urdf, urdf_file, root, locked_);
    for (std::size_t j = Index(robot.root_dofs); j < robot.tree.dofs.size(); ++j)
      joints_.push_back(Moved(robot, j));
    for (const Dof<Spatial>& dof : robot.tree.dofs) mass_kg_ += dof.mass_kg;
    touches_ = review.touches;
    has_meshes_ = std::ranges::any_of(review.ignored_shapes, &IgnoredShape::mesh);
    for (const auto* const shapes : {&robot.collision_shapes, &robot.visual_shapes}) {
      for (const RobotShape& shape : *shapes) {
        if (!shape.mesh_file.empty()) mesh_files_.insert(shape.mesh_file);
      }
    }
  }

  /// The files of meshes that the URDF names from its own folder: its copy names them likewise.
  /// Those beside that folder, and those that cannot be read, are noted.
  std::vector<NewFile> Meshes(const std::string& urdf_file) {
    std::vector<NewFile> files;
    std::vector<std::string> left;
    for (const std::string& named : mesh_files_) {
      const std::filesystem::path path(named);
      if (path.is_absolute() || named.find("://") != std::string::npos) continue;
      const std::string found = FindMesh(named, urdf_file);
      const std::filesystem::path inside = path.lexically_normal();
      if (found.empty() || *inside.begin() == "..") {
        left.push_back(named);
        continue;
      }
      try {
        files.push_back({inside.string(), BytesOfMesh(found)});
      } catch (const MeshError&) {
        left.push_back(named);
      }
    }
    if (!left.empty()) {
      Note(
          fmt::format("meshes that cannot be read in the folder of {} are not copied, and not "
                      "found from the new one: {}",
                      urdf_file, fmt::join(left, ", ")));
    }
    return files;
  }

  /// Which of the robot's own shapes its tasks keep apart (`self_contact.shapes`).
  void KeepApart(std::string_view shapes) { kept_apart_ = shapes; }

  /// How the root is pitched where the robot rests, straight and bent [rad]; 0 until this is
  /// called.
  void Rest(double straight_rad, double bent_rad) {
    straight_rad_ = straight_rad;
    bent_rad_ = bent_rad;
  }

  [[nodiscard]] bool touches() const { return touches_; }
  /// Whether a collision shape is a mesh.
  [[nodiscard]] bool has_meshes() const { return has_meshes_; }
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }
  [[nodiscard]] std::vector<std::string> JointNames() const {
    std::vector<std::string> names;
    for (const MovedJoint& joint : joints_) names.push_back(joint.name);
    return names;
  }

  [[nodiscard]] std::string Task(bool bend) const {
    std::string text = fmt::format(
        R"(# {0}
#   tumbler optimize {1}
# finds it: no guess of the motion is given. Every key is in docs/formats.md.
format = "tumbler-task"
version = 1
name = "{2}"
robot = "../{3}.urdf"
root = {4}
)",
        bend ? "Every joint bends a little." : "Every joint goes back.",
        bend ? "tasks/bend.toml --out motions/bend.toml"
             : "tasks/unbend.toml --start-from motions/bend.toml --out motions/unbend.toml",
        bend ? "bend" : "unbend", name_,
        planar()
            ? R"("planar-xz"        # the root link is free in the plane of x and z; "fixed" bolts it down)"
            : R"("fixed"            # the root link is bolted down; "planar-xz": free in the plane of x and z)");
    if (!locked_.empty())
      text += fmt::format("{}   # nothing moves these\n", LockedAsToml(locked_));
    text += fmt::format(
        R"(duration_s = {}
settle_s = 0.3            # joints held
{}
[start]{}
joints_rad = {}

[end]
joints_rad = {}

[spline]
degree = 5
control_points = 10       # per joint; the first and last three are fixed by rest at the ends

[limits]                  # position, velocity and torque limits are the URDF's unless tightened here
acceleration_max_rad_s2 = 200.0
# rotor_inertia_kg_m2 = 0.001
{}{}
[[cost]]                  # of all such motions, one that asks little of the motors
term = "effort"
weight = 1.0e-2
)",
        Duration(), planar() ? "" : "obstacle = []             # nothing to touch\n",
        planar()
            ? fmt::format(
                  "                   # at rest on the ground in this shape; with --start-from, "
                  "where that motion ends\npitch_rad = {}",
                  ExactDecimal(bend ? straight_rad_ : bent_rad_))
            : "",
        Pose(bend), Pose(!bend), LimitsOfTurns(), Motors());
    if (planar()) text += Ground((bend ? 1 : -1) * (bent_rad_ - straight_rad_));
    if (!kept_apart_.empty()) {
      text += fmt::format(
          "\n[self_contact]\nshapes = \"{}\"       # of all, some are in each other where the "
          "motion "
          "starts, or there are too many\n",
          kept_apart_);
    }
    return text + R"(
[search]
seed = 1                  # another one finds another motion
spread_rad = 0.5          # how far they go off the straight way
max_samples = 100         # random motions that are tried first
promising = 3
refine = 3                # the best of them are solved ...

[solver]
max_evaluations = 60      # ... with so many evaluations each
)";
  }

  /// Of joints that turn without end, which a drive's range does not.
  [[nodiscard]] std::string LimitsOfTurns() const {
    std::string text;
    for (const MovedJoint& joint : joints_) {
      if (std::isfinite(joint.limits.lower_rad) && std::isfinite(joint.limits.upper_rad)) continue;
      text += fmt::format(
          "\n[limits.{}]   # within the range of its drive\n"
          "position_min_rad = -{:.1f}\nposition_max_rad = {:.1f}\n",
          TomlKey(joint.name), kEndlessRange_rad, kEndlessRange_rad);
    }
    return text;
  }

  [[nodiscard]] std::string Sequence() const {
    return fmt::format(
        R"(# Bending and going back, again and again. `tumbler chain check {0}.toml` says whether the motions fit each other.
format = "tumbler-sequence"
version = 1
name = "{0}"
start = "bend"

[primitives]
bend = "motions/bend.toml"
unbend = "motions/unbend.toml"

[[node]]
name = "bend"
primitive = "bend"

[[node]]
name = "unbend"
primitive = "unbend"
safe = true               # a run ends here, without torque. Nothing has shown that the robot stays: see what the run says
ends_cycle = true         # what --cycles counts

[[edge]]
from = "bend"
to = "unbend"
settle_s = 2.0            # time to come to rest, before the next motion may begin

[[edge]]
from = "unbend"
to = "bend"
settle_s = 2.0
)",
        name_);
  }

  [[nodiscard]] std::string Drives() const {
    const int rate = NewRobotRate(static_cast<int>(joints_.size()));
    std::string text = fmt::format(
        R"(# The motor drives of {0} and their bus: imagined ones, of the MIT mini-cheetah kind, with ranges that hold the limits
# of {0}.urdf. Before you drive real motors, make this file from them: `tumbler bench`, docs/commissioning.md. Other
# protocols: docs/protocols.md.
format = "tumbler-drives"
version = 1

[bus]
bit_rate = 1_000_000      # bit/s
rate_hz = {1}             # of the control loop; the bus carries one frame to and one from each drive in every cycle
)",
        name_, rate);
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const MovedJoint& joint = joints_[j];
      const auto reach = [](double least, double limit) {
        return std::isfinite(limit) ? std::max(least, std::ceil(1.2 * std::abs(limit))) : least;
      };
      const double position =
          std::max(reach(12.5, joint.limits.lower_rad), reach(12.5, joint.limits.upper_rad));
      const double torque = reach(18, std::min(joint.limits.effort_nm, 1000.0));
      // A quarter of a radian off (a slide: 0.1 m) asks for the whole torque, or the usual gain
      // does.
      const double stiff = (joint.slides ? 10 : 4) * std::min(joint.limits.effort_nm, 1000.0);
      const double kp = std::max(100.0, Rounded(stiff, 10));
      text += fmt::format(
          R"(
[[drive]]
joint = {0}
protocol = "mit"
command_id = {1}
reply_id = {2}
direction = 1             # -1 where the drive turns against the joint
gear_ratio = 1.0
zero_offset_rad = 0.0     # the joint's angle when the drive reads zero
kp_nm_per_rad = {3:.1f}
kd_nm_s_per_rad = {4:.1f}
temperature_max_c = 80.0
temperature_encoding = "signed"
watchdog_s = {5}
  [drive.range]           # compiled into the drive's firmware
  position_rad = [-{6:.1f}, {6:.1f}]
  velocity_rad_s = [-{7:.1f}, {7:.1f}]
  kp_nm_per_rad = [0.0, {8:.1f}]
  kd_nm_s_per_rad = [0.0, {9:.1f}]
  torque_nm = [-{10:.1f}, {10:.1f}]
)",
          TomlText(joint.name), j + 1, j + 17, kp, 0.02 * kp, 25.0 / rate, position,
          reach(50, std::min(joint.limits.velocity_rad_s, 100.0)), std::max(500.0, 2 * kp),
          std::max(5.0, 0.04 * kp), torque);
    }
    return text;
  }

  [[nodiscard]] std::string Twin() const {
    const MovedJoint& first = joints_.front();
    return fmt::format(
        R"(# The simulated robot as it is, where it is not as {0}.urdf says. Every key may be left out; docs/formats.md has them all.
format = "tumbler-twin"
version = 1
motion = "{0}.toml"
drives = "drives.toml"

[motor]                          # of every joint; [motor.{1}] is for one. Friction: the tasks', else the URDF's, unless it is here
# viscous_friction_nm_s_per_rad = 0.02
# dry_friction_nm = 0.1

[mass_factor]                    # of mass and inertia: try 1.2
{2} = 1.0

# [[push]]                       # what happens to it
# link = {3}
# start_s = 3.0
# duration_s = 0.1
# force_n = [5.0, 0.0]           # x, z in the world
# point_m = [0.0, 0.0]           # in the link's frame
)",
        name_, TomlKey(first.name), TomlKey(first.link), TomlText(first.link));
  }

  [[nodiscard]] std::string Readme() const {
    std::string text = fmt::format(R"(# {0}

In this folder:

    tumbler optimize tasks/bend.toml --out motions/bend.toml --report report
    tumbler optimize tasks/unbend.toml --start-from motions/bend.toml --out motions/unbend.toml
    tumbler run sim {0}.toml --cycles 2 --twin twin.toml

`report/index.html` shows the motion. `{0}.urdf` is the robot, `tasks/` say what it should do, `{0}.toml` puts motions in
a sequence, `drives.toml` describes its motors, `twin.toml` the simulated robot. docs/own-robot.md says how to go on.
Drives are imagined; names and limits are those of the URDF.
)",
                                   name_);
    if (notes_.empty()) return text;
    text += "\nDecided when these files were made:\n\n";
    for (const std::string& note : notes_) text += fmt::format("- {}\n", note);
    return text;
  }

  void Note(std::string note) { notes_.push_back(std::move(note)); }

 private:
  [[nodiscard]] bool planar() const { return root_ == RootKind::kPlanarXz; }

  static std::string NamesOf(const LockedJoints& joints) {
    std::string names;
    for (const auto& [name, position] : joints) names += (names.empty() ? "" : ", ") + name;
    return names;
  }

  static std::string TomlText(const std::string& text) {
    const std::string key = TomlKey(text);
    return key == text ? '"' + text + '"' : key;
  }

  /// Locks the joints beyond what a task moves, from the end of the file.
  void LockMore(const Robot& robot, const RobotReview& review) {
    const std::size_t kept = review.joints_left.size() - review.TooMany();
    LockedJoints more;
    for (std::size_t i = kept; i < review.joints_left.size(); ++i) {
      const std::string& joint = review.joints_left[i];
      const RobotJointLimits& limits = robot.joints[Index(robot.FindDof(joint))].limits;
      more.emplace(joint, NearestToZero(limits));
    }
    locked_.insert(more.begin(), more.end());
    notes_.push_back(
        fmt::format("locked, as a task moves up to {} joints (choose which in tasks/): {}", kept,
                    NamesOf(more)));
  }

  [[nodiscard]] std::string Pose(bool start) const {
    std::string text = "{";
    for (const MovedJoint& joint : joints_) {
      text += fmt::format("{} {} = {}", text.size() == 1 ? "" : ",", TomlKey(joint.name),
                          ExactDecimal(start ? joint.start : joint.end));
    }
    return text + " }";
  }

  /// So long that no joint needs half of its velocity.
  [[nodiscard]] std::string Duration() const {
    double longest_s = 1;
    for (const MovedJoint& joint : joints_) {
      longest_s =
          std::max(longest_s, 4 * std::abs(joint.end - joint.start) / joint.limits.velocity_rad_s);
    }
    return fmt::format("{:.1f}", std::min(20.0, std::ceil(10 * longest_s) / 10));
  }

  /// Friction that is more than is simulated.
  [[nodiscard]] std::string Motors() const {
    std::string text;
    for (const MovedJoint& joint : joints_) {
      if (joint.dry_friction_nm <= kLargestDryFriction) continue;
      text += fmt::format(
          "\n[motor.{}]\ndry_friction_nm = {:.1f}     # the most that is simulated; the URDF says "
          "{}\n",
          TomlKey(joint.name), kLargestDryFriction, MessageNumber(joint.dry_friction_nm));
    }
    return text;
  }

  /// Ground into which the robot sinks a few millimetres, and by how much it is to tip on it.
  [[nodiscard]] std::string Ground(double tips_rad) const {
    const double stiffness = std::max(1000.0, Rounded(mass_kg_ * 9.81 / 0.006, 1000));
    return fmt::format(R"(
[[cost]]                  # the root link {}
term = "terminal"
of = "pitch"
when = "settled"
target = {}
from_start = true
weight = 10.0

[contact]                 # how shapes and ground push each other apart, and grip
stiffness_n_per_m = {:.1f}
damping_n_s_per_m = {:.1f}
d_on_m = 0.01
d_off_m = 0.0075
mu = 0.5
v_max_m_per_s = 0.2

[[obstacle]]
name = "ground"
kind = "half-space"
point_m = [0.0, 0.0]
normal = [0.0, 1.0]
)",
                       tips_rad == 0 ? "as it stood" : "as it rests in the end's shape",
                       ExactDecimal(Rounded(tips_rad, kPitchUnit)), std::min(stiffness, 1e6),
                       std::min(0.004 * stiffness, 1e4));
  }

  std::string name_;
  RootKind root_;
  LockedJoints locked_;
  std::vector<MovedJoint> joints_;
  std::vector<std::string> notes_;
  std::set<std::string> mesh_files_;  ///< As the URDF names them.
  bool has_meshes_ = false;           ///< In contact, were they asked for.
  double mass_kg_ = 0, straight_rad_ = 0, bent_rad_ = 0;
  bool touches_ = false;
  std::string_view kept_apart_;
};

/// Throws as the tasks' reader does. Where the robot rests tilted, its tasks say so: a motion that
/// begins where another one ends has to begin with that pitch.
void CheckTasks(Writer& writer, const std::string& urdf, const std::string& urdf_file) {
  const auto rest_rad = [&](bool bend) {
    const Problem problem =
        ParseTask(writer.Task(bend), bend ? "tasks/bend.toml" : "tasks/unbend.toml", urdf,
                  urdf_file)
            .problem;
    return problem.scene.robot.root_dofs == 0 ? 0.0 : Rounded(problem.start_q[2], kPitchUnit);
  };
  const double straight_rad = rest_rad(true);
  writer.Rest(straight_rad, straight_rad);  // It bends from there, not from upright.
  const double bent_rad = rest_rad(false);
  if (straight_rad == 0 && bent_rad == 0) return;
  writer.Rest(straight_rad, bent_rad);
  static_cast<void>(rest_rad(true));
  static_cast<void>(rest_rad(false));
}

/// The same. Leaves out own shapes that cannot be kept apart.
void MakeTasks(Writer& writer, const std::string& urdf, const std::string& urdf_file) {
  for (const std::string_view shapes : {"", "collision", "none"}) {
    writer.KeepApart(shapes);
    try {
      CheckTasks(writer, urdf, urdf_file);
    } catch (const FileError& error) {
      if (std::string_view(error.what()).find(": self_contact.") == std::string_view::npos) throw;
      continue;
    }
    if (!shapes.empty()) {
      writer.Note(
          fmt::format("self_contact.shapes is \"{}\", as the robot's other shapes cannot be "
                      "kept apart",
                      shapes));
    }
    return;
  }
}

/// The files of the robot on the ground; with `root` none: of a fixed one, where it does not rest
/// there.
Writer WriterOf(const std::string& name, const std::string& urdf, const std::string& urdf_file,
                std::optional<RootKind> root) {
  std::string why;
  if (root != RootKind::kFixed) {
    try {
      Writer planar(name, urdf, urdf_file, RootKind::kPlanarXz);
      if (root || planar.touches()) {
        MakeTasks(planar, urdf, urdf_file);
        return planar;
      }
      why = planar.has_meshes() ? "its collision shapes are meshes, with which it touches nothing "
                                  "unless its tasks say contact.meshes = \"points\""
                                : "it has no collision shape to stand on";
    } catch (const FileError& error) {
      if (root) throw;
      why = error.what();
    }
  }
  Writer fixed(name, urdf, urdf_file, RootKind::kFixed);
  MakeTasks(fixed, urdf, urdf_file);
  if (!root)
    fixed.Note(fmt::format("its root link is fixed, as it does not rest on the ground: {}", why));
  return fixed;
}

}  // namespace

FilesOfUrdf NewRobotOfUrdf(const std::string& name, const std::string& urdf,
                           const std::string& urdf_file, std::optional<RootKind> root) {
  Writer writer = WriterOf(name, urdf, urdf_file, root);
  std::vector<NewFile> files = {{name + ".urdf", urdf},
                                {"tasks/bend.toml", writer.Task(true)},
                                {"tasks/unbend.toml", writer.Task(false)},
                                {name + ".toml", writer.Sequence()},
                                {"drives.toml", writer.Drives()},
                                {"twin.toml", writer.Twin()}};
  for (NewFile& mesh : writer.Meshes(urdf_file)) files.push_back(std::move(mesh));
  files.push_back({"README.md", writer.Readme()});
  return {std::move(files), writer.JointNames(), writer.notes()};
}

}  // namespace tumbler
