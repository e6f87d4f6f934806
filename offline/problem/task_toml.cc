#include "offline/problem/task_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "common/toml_reader.h"
#include "offline/contact/contact_intent.h"
#include "offline/problem/obstacle_toml.h"
#include "offline/scene/rest_pose.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {
namespace {

constexpr int kTaskVersion = 1;
/// A motion with more pairs of shapes would not be found in any time that somebody waits.
constexpr std::size_t kMostPairs = 1000;

/// A start pose from elsewhere than the task.
struct StartPose {
  const PrimitivePose* pose;
  const Primitive<double>* primitive;  // whose joints the pose is of
  std::string from;                    // for messages
  bool own = false;                    // the entry of a primitive made from this very task
};

class TaskReader {
 public:
  TaskReader(TomlTable root, PlanarRobot robot, std::optional<StartPose> given)
      : root_(std::move(root)), given_(std::move(given)) {
    scene_.robot = std::move(robot);
  }

  Problem Read() {
    problem_.name = root_.String("name");
    if (problem_.name.empty() || !FixedString<48>::fits(problem_.name)) {
      root_.Fail("name", fmt::format("is '{}'; allowed: from 1 ... 48 characters", problem_.name));
    }
    problem_.duration_s = root_.Number("duration_s", {0.05, 20});
    problem_.settle_s = root_.Number("settle_s", {0, 5}, 0.0);
    if (static_cast<int>(scene_.robot.tree.dofs.size()) == scene_.robot.root_dofs)
      root_.Fail("robot", "has no joint that moves; allowed: at least one");
    ReadJoints();
    ReadSpline();
    ReadContact();
    ReadObstacles();
    ReadCosts();
    if (std::optional<TomlTable> tolerances = root_.OptionalTable("tolerances")) {
      double& entry = problem_.entry_tolerance_rad;
      double& following = problem_.following_tolerance_rad;
      entry = tolerances->Number("entry_rad", {0, 3, true}, entry);
      following = tolerances->Number("following_rad", {0, 3, true}, following);
    }
    ReadSearch();
    ReadSolver();
    TomlTable start = root_.Table("start");
    ReadStart(start);
    root_.RejectUnknownKeys();
    SetStep();
    return std::move(problem_);
  }

 private:
  void ReadJoints() {
    const bool any_limits = root_.Has("limits");
    std::optional<TomlTable> limits = root_.OptionalTable("limits");
    TomlTable start = root_.Table("start").Table("joints_rad");
    TomlTable end = root_.Table("end").Table("joints_rad");
    for (const TomlTable* table : {&start, &end}) {
      for (const std::string& name : table->Keys()) RequireJoint(*table, name);
    }
    for (std::size_t j = static_cast<std::size_t>(scene_.robot.root_dofs);
         j < scene_.robot.tree.dofs.size(); ++j) {
      Dof<Plane>& dof = scene_.robot.tree.dofs[j];
      if (!start.Has(dof.name)) {
        start.Fail(
            "",
            fmt::format("lacks the joint '{}': every joint of the robot needs a start and an end",
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
      JointLimits<double>& allowed = joint.limits;
      // A joint without limits in the URDF still gets finite ones: a primitive is a promise about
      // all of them.
      allowed.position_min_rad = std::max(urdf.lower_rad, -100.0);
      allowed.position_max_rad = std::min(urdf.upper_rad, 100.0);
      allowed.velocity_max_rad_s = std::min(urdf.velocity_rad_s, 100.0);
      allowed.acceleration_max_rad_s2 = 1000;
      allowed.torque_max_nm = std::min(urdf.effort_nm, 1000.0);
      if (any_limits) {
        std::optional<TomlTable> own = limits->OptionalTable(dof.name);
        for (TomlTable* table : {&*limits, own ? &*own : nullptr}) {
          if (table != nullptr) Tighten(*table, allowed);
        }
        dof.rotor_inertia_kg_m2 = limits->Number("rotor_inertia_kg_m2", Range{0, 10}, 0.0);
        if (own) {
          dof.rotor_inertia_kg_m2 =
              own->Number("rotor_inertia_kg_m2", Range{0, 10}, dof.rotor_inertia_kg_m2);
        }
      }
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

  /// Limits of the task can only be tighter than the robot's.
  static void Tighten(TomlTable& table, JointLimits<double>& allowed) {
    allowed.velocity_max_rad_s = table.Number(
        "velocity_max_rad_s", {0, allowed.velocity_max_rad_s, true}, allowed.velocity_max_rad_s);
    allowed.acceleration_max_rad_s2 =
        table.Number("acceleration_max_rad_s2", {0, 1e5, true}, allowed.acceleration_max_rad_s2);
    allowed.torque_max_nm =
        table.Number("torque_max_nm", {0, allowed.torque_max_nm, true}, allowed.torque_max_nm);
    const double low = allowed.position_min_rad;
    const double high = allowed.position_max_rad;
    allowed.position_min_rad = table.Number("position_min_rad", {low, high}, low);
    allowed.position_max_rad =
        table.Number("position_max_rad", {allowed.position_min_rad, high}, high);
  }

  void RequireJoint(const TomlTable& table, const std::string& name) const {
    if (scene_.robot.FindDof(name) >= scene_.robot.root_dofs) return;
    table.Fail(name, fmt::format("is not a joint of the robot; its joints: {}", JointNames()));
  }

  [[nodiscard]] std::string JointNames() const {
    std::string names;
    const auto& dofs = scene_.robot.tree.dofs;
    for (std::size_t j = static_cast<std::size_t>(scene_.robot.root_dofs); j < dofs.size(); ++j) {
      names += (names.empty() ? "" : ", ") + dofs[j].name;
    }
    return names;
  }

  void ReadSpline() {
    std::optional<TomlTable> spline = root_.OptionalTable("spline");
    if (!spline) return;
    constexpr std::string_view kPoints = "control_points";
    problem_.degree = static_cast<int>(spline->Integer("degree", 3, 7, problem_.degree));
    // Three fixed points at each end and one free one between them; and enough points for the
    // degree.
    const int least = std::max(7, problem_.degree + 1);
    if (!spline->Has(kPoints)) return;
    if (!spline->IsTable(kPoints)) {
      const std::int64_t points = spline->Integer(kPoints, least, kMaxControlPoints);
      for (ActuatedJoint& joint : problem_.joints) joint.control_points = static_cast<int>(points);
      return;
    }
    TomlTable by_joint = spline->Table(kPoints);
    for (const std::string& name : by_joint.Keys()) RequireJoint(by_joint, name);
    for (ActuatedJoint& joint : problem_.joints) {
      const std::string& name = scene_.robot.tree.dofs[static_cast<std::size_t>(joint.dof)].name;
      joint.control_points = static_cast<int>(by_joint.Integer(name, least, kMaxControlPoints));
    }
  }

  /// The law from what it is to do, where the task says that; else false.
  bool ReadIntent(TomlTable& contact) {
    constexpr std::array<const char*, 3> kIntent = {"static_penetration_m", "settling_time_s",
                                                    "slip_speed_m_per_s"};
    if (std::none_of(kIntent.begin(), kIntent.end(),
                     [&](const char* key) { return contact.Has(key); })) {
      return false;
    }
    for (const char* const raw : {"stiffness_n_per_m", "damping_n_s_per_m", "v_max_m_per_s"}) {
      if (contact.Has(raw)) {
        contact.Fail(raw,
                     "is given beside static_penetration_m, settling_time_s or "
                     "slip_speed_m_per_s, which it follows from; allowed: either these three, or "
                     "stiffness_n_per_m, damping_n_s_per_m and v_max_m_per_s");
      }
    }
    double mass = 0;
    for (const Dof<Plane>& dof : scene_.robot.tree.dofs) mass += dof.mass_kg;
    const double gravity = scene_.robot.tree.gravity.norm();
    ContactIntent intent;
    intent.static_penetration_m = contact.Number("static_penetration_m", {1e-6, 0.1});
    const double shortest = ShortestSettlingTime(intent.static_penetration_m, gravity);
    intent.settling_time_s = contact.Number("settling_time_s", {shortest, 100});
    intent.slip_speed_m_per_s =
        contact.Number("slip_speed_m_per_s", {1e-6, Range::Positive().max, false});
    scene_.contact = LawFor(intent, mass, gravity, scene_.contact);
    return true;
  }

  /// How long integration steps may be, and how long they are where the task does not say it.
  void SetStep() {
    double mass = 0;
    for (const Dof<Plane>& dof : scene_.robot.tree.dofs) mass += dof.mass_kg;
    std::vector<double> end = problem_.start_q;
    for (const ActuatedJoint& joint : problem_.joints)
      end[static_cast<std::size_t>(joint.dof)] = joint.end_rad;
    double effective = std::numeric_limits<double>::infinity();
    for (const std::vector<double>& q : {problem_.start_q, end}) {
      effective = std::min(effective,
                           SmallestEffectiveMass<Plane>(scene_.robot.tree, scene_.robot.shapes, q));
    }
    if (scene_.obstacles.empty() || !std::isfinite(effective)) return;
    problem_.advisable_step_s =
        AdvisableStep(scene_.contact, effective, mass * scene_.robot.tree.gravity.norm());
    const auto given = [this](const char* table, const char* key) {
      std::optional<TomlTable> found = root_.OptionalTable(table);
      return found && found->Has(key);
    };
    const double step = std::max(problem_.advisable_step_s, 1e-5);
    SolverSettings& solver = problem_.solver;
    if (!given("solver", "step_s")) solver.step_s = std::min(solver.step_s, step);
    // Rough, but not past where the methods of screening and search are stable.
    if (!given("solver", "screen_step_s"))
      solver.screen_step_s = std::max(solver.step_s, std::min(solver.screen_step_s, 2 * step));
    if (!given("search", "step_s"))
      problem_.search.step_s = std::min(problem_.search.step_s, 1.5 * step);
  }

  void ReadContact() {
    std::optional<TomlTable> contact = root_.OptionalTable("contact");
    if (!contact) return;
    ContactLaw& law = scene_.contact;
    constexpr Range kSlipSpeed{1e-6, Range::Positive().max, false};
    double least_layer = 1e-6;
    const bool by_intent = ReadIntent(*contact);
    if (by_intent) {
      least_layer = law.d_on_m / 3;  // Thinner, and the robot would rest on the core.
    } else {
      law.stiffness_n_per_m =
          contact->Number("stiffness_n_per_m", {0, 1e8, true}, law.stiffness_n_per_m);
      law.damping_n_s_per_m = contact->Number("damping_n_s_per_m", {0, 1e6}, law.damping_n_s_per_m);
      law.v_max_m_per_s = contact->Number("v_max_m_per_s", kSlipSpeed, law.v_max_m_per_s);
    }
    law.d_on_m = contact->Number("d_on_m", {least_layer, 1, by_intent}, law.d_on_m);
    law.d_off_m = contact->Number("d_off_m", {0, 1}, std::min(law.d_off_m, 0.75 * law.d_on_m));
    // Zero width would make the force jump in its derivative.
    if (law.d_off_m > law.d_on_m * (1 - 1e-6)) {
      contact->Fail("d_off_m", fmt::format("is {}; allowed: from 0 to below d_on_m, which is {}",
                                           MessageNumber(law.d_off_m), MessageNumber(law.d_on_m)));
    }
    law.mu = contact->Number("mu", {0, 10}, law.mu);
    constexpr std::array<std::string_view, 2> kSmoothing = {"cubic", "quintic"};
    constexpr std::array<std::string_view, 3> kDamping = {"no-pull", "signed", "printed"};
    law.smoothing = contact->Choice("smoothing", kSmoothing, "cubic") == "cubic"
                        ? ContactSmoothing::kCubic
                        : ContactSmoothing::kQuintic;
    const std::string damping = contact->Choice("damping_law", kDamping, "no-pull");
    law.damping_law = damping == "no-pull"  ? ContactDamping::kNoPull
                      : damping == "signed" ? ContactDamping::kSigned
                                            : ContactDamping::kPrinted;
  }

  void ReadObstacles() {
    std::vector<TomlTable> tables = root_.Tables("obstacle");
    for (TomlTable& table : tables) {
      const Obstacle<Plane> obstacle = ReadObstacle(table);
      for (const Obstacle<Plane>& other : scene_.obstacles) {
        if (other.name == obstacle.name)
          table.Fail("name",
                     fmt::format("'{}' is there twice; each obstacle needs a name of its own",
                                 obstacle.name));
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

  void ReadCosts() {
    std::vector<CostTerm>& cost = problem_.cost;
    for (TomlTable& table : root_.Tables("cost")) {
      const CostTerm term = ReadCostTerm(table, scene_.robot);
      if (term.targets_pitch()) problem_.target_pitch_rad = term.target;
      // Integrals that differ in their weights alone are one.
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

  void ReadSearch() {
    std::optional<TomlTable> table = root_.OptionalTable("search");
    if (!table) return;
    SearchSettings& s = problem_.search;
    s.seed = static_cast<std::uint64_t>(
        table->Integer("seed", 0, std::numeric_limits<std::int64_t>::max(), 1));
    s.batch = static_cast<int>(table->Integer("batch", 1, 1'000'000, s.batch));
    s.promising = static_cast<int>(table->Integer("promising", 1, 1000, s.promising));
    s.max_samples = static_cast<int>(table->Integer("max_samples", 1, 1'000'000, s.max_samples));
    s.refine = static_cast<int>(table->Integer("refine", 1, 1000, s.refine));
    s.modes = static_cast<int>(table->Integer("modes", 1, 20, s.modes));
    s.spread_rad = table->Number("spread_rad", {0, 20}, s.spread_rad);
    s.basin_rad = table->Number("basin_rad", {1e-3, 1e3}, s.basin_rad);
    s.torque_penalty = table->Number("torque_penalty", {0, 1e6}, s.torque_penalty);
    s.core_penalty = table->Number("core_penalty", {0, 1e6}, s.core_penalty);
    s.step_s = table->Number("step_s", {1e-5, 1e-2}, s.step_s);
  }

  void ReadSolver() {
    std::optional<TomlTable> table = root_.OptionalTable("solver");
    if (!table) return;
    SolverSettings& s = problem_.solver;
    constexpr std::array<std::string_view, 2> kGradients = {"adjoint", "forward"};
    s.gradient = table->Choice("gradient", kGradients, "adjoint") == "adjoint"
                     ? SolverSettings::Gradient::kAdjoint
                     : SolverSettings::Gradient::kForward;
    s.step_s = table->Number("step_s", {1e-5, 1e-2}, s.step_s);
    s.screen_step_s =
        table->Number("screen_step_s", {1e-5, 1e-2}, std::max(s.step_s, s.screen_step_s));
    s.screen_evaluations =
        static_cast<int>(table->Integer("screen_evaluations", 1, 100'000, s.screen_evaluations));
    s.finalists = static_cast<int>(table->Integer("finalists", 1, 1000, s.finalists));
    s.max_evaluations =
        static_cast<int>(table->Integer("max_evaluations", 1, 100'000, s.max_evaluations));
    s.relative_tolerance = table->Number("relative_tolerance", {0, 1, true}, s.relative_tolerance);
    s.torque_margin = table->Number("torque_margin", {0, 0.5}, s.torque_margin);
    s.core_margin = table->Number("core_margin", {0, 0.9}, s.core_margin);
    s.sharpness = table->Number("sharpness", {1, 1e4}, s.sharpness);
  }

  void ReadStart(TomlTable& start) {
    const std::size_t n = scene_.robot.tree.dofs.size();
    problem_.start_q.assign(n, 0.0);
    for (const ActuatedJoint& joint : problem_.joints) {
      problem_.start_q[static_cast<std::size_t>(joint.dof)] = joint.start_rad;
    }
    if (given_) CheckGivenJoints(start);
    if (scene_.robot.root_dofs == 0) return;
    const double x = start.Number("x_m", {-1e3, 1e3}, 0.0);
    const double pitch = start.Number("pitch_rad", {-1e3, 1e3}, 0.0);
    const bool placed = start.Has("z_m");
    const double z = start.Number("z_m", {-1e3, 1e3}, 0.0);
    root_.RejectUnknownKeys();  // Now: a misspelt one is often why the pose comes to no rest.
    if (given_) {
      const PrimitivePose& pose = *given_->pose;
      if (const double apart = std::abs(pose.root_pitch_rad - pitch);
          !given_->own && !(apart <= kStartPitchTolerance)) {
        start.Fail("pitch_rad", fmt::format("is {} rad, but {} has the root's pitch at {} rad: {} "
                                            "rad apart; allowed: <= {} rad",
                                            MessageNumber(pitch), given_->from,
                                            MessageNumber(pose.root_pitch_rad),
                                            MessageNumber(apart), kStartPitchTolerance));
      }
      problem_.start_q[0] = pose.root_x_m;
      problem_.start_q[1] = pose.root_z_m;
      problem_.start_q[2] = pose.root_pitch_rad;
      return;
    }
    problem_.start_q[0] = x;
    problem_.start_q[1] = z;
    problem_.start_q[2] = pitch;
    if (placed) {
      CheckNotBuried(start, z);
      return;
    }
    try {
      problem_.start_q = RestPose(scene_, problem_.start_q);
    } catch (const std::runtime_error& error) {
      start.Fail("", fmt::format("{}; change the joints or the pitch, or give z_m to start from a "
                                 "pose that is not at rest",
                                 error.what()));
    }
  }

  /// No shape starts deeper in an obstacle than the compliant layer is thick.
  void CheckNotBuried(TomlTable& start, double z_m) {
    SceneDynamics robot(scene_);
    std::copy(problem_.start_q.begin(), problem_.start_q.end(), robot.q.begin());
    robot.Touch();
    const ActiveContact<Plane>* deepest = nullptr;
    for (const ActiveContact<Plane>& active : robot.contact->active()) {
      if (deepest == nullptr || active.depth_m > deepest->depth_m) deepest = &active;
    }
    const double layer = scene_.contact.d_on_m;
    if (deepest == nullptr || deepest->depth_m < layer) return;
    start.Fail("z_m",
               fmt::format("is {}: there collision shape {} is {} m inside '{}'; allowed: "
                           "where none is inside an obstacle; without z_m the robot is put "
                           "on the ground",
                           MessageNumber(z_m),
                           scene_.robot.shapes[static_cast<std::size_t>(deepest->shape)].name,
                           MessageNumber(deepest->depth_m - layer),
                           scene_.obstacles[static_cast<std::size_t>(deepest->obstacle)].name));
  }

  /// The joints of the given pose are those of the task, where the task starts them.
  void CheckGivenJoints(TomlTable& start) {
    TomlTable joints = start.Table("joints_rad");
    const std::span<const JointMotion<double>> motions = given_->primitive->motions();
    for (const ActuatedJoint& joint : problem_.joints) {
      const std::string& name = scene_.robot.tree.dofs[static_cast<std::size_t>(joint.dof)].name;
      const auto motion = std::find_if(motions.begin(), motions.end(),
                                       [&](const auto& m) { return m.name.view() == name; });
      if (motion == motions.end()) {
        joints.Fail(name,
                    fmt::format("is a joint of the task, but {} has none of it", given_->from));
      }
      const double position =
          given_->pose->joint_positions_rad[static_cast<std::size_t>(motion - motions.begin())];
      const double apart = std::abs(position - joint.start_rad);
      if (apart <= kStartJointTolerance) continue;
      joints.Fail(name,
                  fmt::format("is {} rad, but {} has it at {} rad: {} rad apart; allowed: <= "
                              "{} rad",
                              MessageNumber(joint.start_rad), given_->from, MessageNumber(position),
                              MessageNumber(apart), MessageNumber(kStartJointTolerance)));
    }
  }

  TomlTable root_;
  std::optional<StartPose> given_;
  Problem problem_;
  Scene& scene_ = problem_.scene;
};

PlanarRobot RobotOf(TomlTable& root, const std::string& text, const std::string& file) {
  constexpr std::array<std::string_view, 2> kRoots = {"planar-xz", "fixed"};
  const bool planar = root.Choice("root", kRoots, "planar-xz") == "planar-xz";
  return ParsePlanarRobot(text, file, planar ? RootKind::kPlanarXz : RootKind::kFixed);
}

void CheckHeader(TomlTable& root) {
  constexpr std::array<std::string_view, 1> kFormats = {"tumbler-task"};
  root.Choice("format", kFormats, "");
  const std::int64_t version = root.Integer("version", 1, std::numeric_limits<std::int64_t>::max());
  if (version > kTaskVersion) {
    root.Fail("version", fmt::format("is {}; this program reads tasks up to version {}", version,
                                     kTaskVersion));
  }
}

Task Parse(const std::string& task_text, const std::string& task_name,
           const std::string& robot_text, const std::string& robot_name,
           std::optional<StartPose> given) {
  TomlTable root = TomlTable::Parse(task_text, task_name);
  CheckHeader(root);
  root.String("robot");
  PlanarRobot robot = RobotOf(root, robot_text, robot_name);
  return {TaskReader(std::move(root), std::move(robot), std::move(given)).Read(),
          task_name,
          task_text,
          robot_name,
          robot_text,
          "",
          ""};
}

/// The URDF that a task names, beside the task.
std::string RobotPath(const std::string& task_text, const std::string& path) {
  TomlTable root = TomlTable::Parse(task_text, path);
  CheckHeader(root);
  const std::string named = root.String("robot");
  const std::filesystem::path robot_path = std::filesystem::path(path).parent_path() / named;
  std::error_code error;
  if (!std::filesystem::exists(robot_path, error)) {
    root.Fail("robot",
              fmt::format("'{}' does not exist (looked for {})", named, robot_path.string()));
  }
  if (std::filesystem::is_directory(robot_path, error))
    root.Fail("robot", fmt::format("'{}' is a directory; allowed: a URDF file", named));
  return robot_path.string();
}

}  // namespace

Task LoadTask(const std::string& path) {
  const std::string task_text = ReadTextFile(path);
  const std::string robot_path = RobotPath(task_text, path);
  return Parse(task_text, path, ReadTextFile(robot_path), robot_path, std::nullopt);
}

Task LoadTask(const std::string& path, const PrimitiveFile& before,
              const std::string& before_path) {
  const std::string task_text = ReadTextFile(path);
  const std::string robot_path = RobotPath(task_text, path);
  const std::string robot_text = ReadTextFile(robot_path);
  if (robot_text != before.provenance.robot_urdf) {
    throw FileError(before_path, 0, "provenance.robot_urdf",
                    fmt::format("is not the robot of the task {}, {}: an exit of another robot is "
                                "no start; make the primitive again with that robot",
                                path, robot_path));
  }
  Task task = Parse(
      task_text, path, robot_text, robot_path,
      StartPose{&before.exit, &before.primitive,
                fmt::format("the exit of '{}' ({})", before.primitive.name.view(), before_path)});
  if (!SameGround(task.problem.scene, TaskOf(before).problem.scene)) {
    throw FileError(before_path, 0, "provenance.task_toml",
                    fmt::format("has other [contact] or [[obstacle]] than the task {}: the robot "
                                "would not stay where it was left; give both the same",
                                path));
  }
  task.start_file = before_path;
  task.start_hash = before.certificate.coefficients_hash;
  return task;
}

Task ParseTask(const std::string& task_text, const std::string& task_name,
               const std::string& robot_text, const std::string& robot_name) {
  return Parse(task_text, task_name, robot_text, robot_name, std::nullopt);
}

Task TaskOf(const PrimitiveFile& file) {
  const Provenance& from = file.provenance;
  Task task = Parse(from.task_toml, from.task_file, from.robot_urdf, from.robot_file,
                    StartPose{&file.entry, &file.primitive,
                              fmt::format("the entry of '{}'", file.primitive.name.view()), true});
  task.start_file = from.start_file;
  task.start_hash = from.start_hash;
  return task;
}

}  // namespace tumbler
