#include "offline/problem/space_task.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/functions.h"
#include "common/files/file_keys.h"
#include "offline/model/contact_intent.h"
#include "offline/problem/contact_toml.h"
#include "offline/problem/free_start.h"
#include "offline/problem/motor_toml.h"
#include "offline/problem/robust_toml.h"
#include "offline/problem/self_contact_toml.h"
#include "offline/problem/task_keys.h"
#include "offline/problem/task_parts.h"
#include "offline/problem/task_toml.h"
#include "offline/problem/tied_toml.h"
#include "offline/scene/buried_shape.h"
#include "offline/scene/quaternion.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {
namespace in_space {
namespace {

using Triple = std::array<double, 3>;

constexpr Range kPlace{-1e3, 1e3};
/// Times that are nearer than this are the same [s].
constexpr double kSameTime_s = 1e-9;
constexpr Range kSize{0, 1e3, true};
constexpr Quaternion kUpright{1, 0, 0, 0};

SpaceVector ToVector(const Triple& v) { return {v[0], v[1], v[2]}; }

// Obstacles: for each kind, its keys and the shape that they describe.

struct HalfSpaceEntry {
  Triple point{}, normal{};
};
constexpr auto kHalfSpaceKeys = AllRequired(std::array{
    KeyOf<&HalfSpaceEntry::point>("point_m", kPlace, "x, y, z of a point of its surface"),
    KeyOf<&HalfSpaceEntry::normal>("normal", kPlace, "out of it; made a unit vector"),
});
Shape<Spatial> ToShape(TomlTable& table, const HalfSpaceEntry& entry) {
  if (ToVector(entry.normal).norm() < 1e-6)
    table.Fail("normal", "has no direction; allowed: any but [0, 0, 0]");
  return Shape<Spatial>::HalfSpace(ToVector(entry.point), ToVector(entry.normal));
}

struct BallEntry {
  Triple centre{};
  double radius_m = 0;
};
constexpr auto kBallKeys = AllRequired(std::array{
    KeyOf<&BallEntry::centre>("centre_m", kPlace, "x, y, z"),
    KeyOf<&BallEntry::radius_m>("radius_m", kSize, ""),
});
Shape<Spatial> ToShape(TomlTable& /*table*/, const BallEntry& entry) {
  return Shape<Spatial>::Sphere(ToVector(entry.centre), entry.radius_m);
}

struct CapsuleEntry {
  Triple from{}, to{};
  double radius_m = 0;
};
constexpr auto kCapsuleKeys = AllRequired(std::array{
    KeyOf<&CapsuleEntry::from>("from_m", kPlace, "x, y, z of the centre of a round end"),
    KeyOf<&CapsuleEntry::to>("to_m", kPlace, "of the other"),
    KeyOf<&CapsuleEntry::radius_m>("radius_m", kSize, ""),
});
Shape<Spatial> ToShape(TomlTable& table, const CapsuleEntry& entry) {
  const SpaceVector from = ToVector(entry.from), to = ToVector(entry.to);
  const double length = (to - from).norm();
  if (length < 1e-6) table.Fail("to_m", "is the same point as from_m; use a sphere");
  const SpaceVector x = (to - from) / length;
  // Any axes will do whose first is along it.
  const SpaceVector other = std::abs(x.z()) < 0.9 ? SpaceVector::UnitZ() : SpaceVector::UnitX();
  const SpaceVector y = other.cross(x).normalized();
  return Shape<Spatial>::Capsule((from + to) / 2, {SpaceMatrix(x, y, x.cross(y))}, length / 2,
                                 entry.radius_m);
}

struct BoxEntry {
  Triple centre{}, size{};
  Quaternion quaternion = kUpright;
};
constexpr std::array kBoxKeys = {
    KeyOf<&BoxEntry::centre>("centre_m", kPlace, "x, y, z").Required(),
    KeyOf<&BoxEntry::size>("size_m", kSize, "whole sides").Required(),
    KeyOf<&BoxEntry::quaternion>("quaternion", {-1.001, 1.001}, "how it is turned: w, x, y, z")
        .Default("[1, 0, 0, 0]"),
};
Shape<Spatial> ToShape(TomlTable& table, const BoxEntry& entry) {
  const SpaceMatrix turned = ToRotation(UnitQuaternion(table, "quaternion", entry.quaternion));
  return Shape<Spatial>::Box(ToVector(entry.centre), {turned}, ToVector(entry.size) / 2);
}

struct ObstacleEntry {
  std::string name;
  std::size_t kind = 0;
};
constexpr std::array<std::string_view, 4> kKinds = {"half-space", "sphere", "capsule", "box"};
constexpr std::array kObstacleKeys = {
    KeyOf<&ObstacleEntry::name>("name", "").Required().Allowed("unique"),
    KeyOf<&ObstacleEntry::kind>("kind", kKinds, ""),
};

template <class Entry, const auto& kKeys>
Shape<Spatial> ReadShape(TomlTable& table) {
  Entry entry;
  ReadKeys(table, kKeys, entry);
  return ToShape(table, entry);
}

Obstacle<Spatial> ReadOne(TomlTable& table) {
  ObstacleEntry entry;
  ReadKeys(table, kObstacleKeys, entry);
  constexpr std::array kRead = {
      ReadShape<HalfSpaceEntry, kHalfSpaceKeys>, ReadShape<BallEntry, kBallKeys>,
      ReadShape<CapsuleEntry, kCapsuleKeys>, ReadShape<BoxEntry, kBoxKeys>};
  return {entry.name, kRead[entry.kind](table)};
}

// Costs.

struct SpaceCostEntry : CostTerm {
  SpaceQuantity::Of of = SpaceQuantity::Of::kPosition;
  std::optional<double> at_s;
  double latest_s = 0;  ///< That `at_s` may be.
  std::string link;
  Triple point_m{}, axis{}, along{};
};

constexpr std::array<std::string_view, 5> kQuantities = {"position", "velocity", "angular_velocity",
                                                         "misalignment", "heading"};
constexpr std::array<std::string_view, 2> kWhen = {"end", "settled"};

constexpr std::array kTermKeys = {
    KeyOf<&CostTerm::kind, SpaceCostEntry>(
        "term", CostTerm::kKindNames,
        "weight (value - target)^2; weight value; weight integral of \\|tau\\|^2; weight times "
        "the work of the motors [J], which between rests of one height is what turns into heat, as "
        "where feet slide; weight times the [slip](#slip) of contacts that carry weight [m]")
        .Required(),
    KeyOf<&CostTerm::weight, SpaceCostEntry>("weight", {-1e9, 1e9},
                                             "0: nothing is asked for, nor in the purpose")
        .Required()
        .Allowed("-1e9 to 1e9; negative for `terminal-linear` alone"),
};

bool HasPoint(const SpaceCostEntry& term) {
  return term.of == SpaceQuantity::Of::kPosition || term.of == SpaceQuantity::Of::kVelocity;
}
bool HasAxis(const SpaceCostEntry& term) {
  return term.of == SpaceQuantity::Of::kMisalignment || term.of == SpaceQuantity::Of::kHeading;
}
bool IsSquare(const SpaceCostEntry& term) { return term.kind == CostTerm::Kind::kSquare; }

void SetTolerance(SpaceCostEntry& term) {
  switch (term.of) {
    case SpaceQuantity::Of::kPosition:
      term.tolerance = CostTerm::kLengthTolerance_m;
      break;
    case SpaceQuantity::Of::kMisalignment:
    case SpaceQuantity::Of::kHeading:
      term.tolerance = CostTerm::kAngleTolerance_rad;
      break;
    default:
      term.tolerance = CostTerm::kRateTolerance;
  }
}

constexpr std::array kQuantityKeys = {
    KeyOf<&SpaceCostEntry::of>("of", kQuantities,
                               "of a link: where a point of it is, how fast, how fast it turns, "
                               "how far an axis of it is from a direction, 2 sin(angle / 2), or "
                               "the [heading](#headings) of an axis of it")
        .Required()
        .Default("required for terminal terms"),
    KeyOf<&SpaceCostEntry::link>("link", "of the robot's file").Default("the root's link"),
    KeyOf<&SpaceCostEntry::point_m>("point_m", kPlace, "x, y, z in the link's frame")
        .Default("[0, 0, 0]")
        .Where(HasPoint),
    KeyOf<&SpaceCostEntry::axis>("axis", kPlace, "in the link's frame; made a unit vector")
        .Required()
        .Default("required for `misalignment` and `heading`")
        .Where(HasAxis),
    KeyOf<&SpaceCostEntry::along>("along", kPlace,
                                  "direction of the world along which the value is taken, with "
                                  "which the axis is to be aligned, or about which a heading is, "
                                  "by the right hand; made a unit vector")
        .Required()
        .Default("required for terminal terms"),
    KeyOf<&CostTerm::when, SpaceCostEntry>("when", kWhen, "of the motion, or of the settle phase"),
    KeyOf<&SpaceCostEntry::at_s>("time_s",
                                 "instead of `when`: at this time since the start of the motion")
        .Allowed("above 0, up to `duration_s` + `settle_s`",
                 [](const SpaceCostEntry& term) {
                   return Range{0, term.latest_s, true};
                 }),
    KeyOf<&CostTerm::target, SpaceCostEntry>("target", kPlace, "of `terminal`")
        .Allowed("-1000 to 1000; of a heading -3.15 to 3.15")
        .Where(IsSquare),
    KeyOf<&CostTerm::from_start, SpaceCostEntry>(
        "from_start", "of `terminal`: the target is from the value at the start")
        .Where(IsSquare),
    KeyOf<&CostTerm::tolerance, SpaceCostEntry>(
        "tolerance", {0, 1e3, true},
        "of `terminal`: a value farther from the target misses the purpose, and no primitive is "
        "written")
        .Default("0.02 m, 0.05 rad, 0.1 m/s or rad/s", SetTolerance)
        .Where(IsSquare),
};

/// Checks what is asked of a heading, which knows no whole turns.
void CheckHeading(TomlTable& table, SpaceCostEntry& term) {
  constexpr double kHalfTurn = 3.15;  // pi, however it was rounded
  if (std::abs(term.target) > kHalfTurn) {
    table.Fail("target",
               fmt::format("is {} rad of a heading, of which angles that are whole turns apart are "
                           "the same; allowed: -3.15 to 3.15; ask for a heading on the way, at "
                           "a time_s, where the robot is to turn farther",
                           MessageNumber(term.target)));
  }
  if (term.tolerance >= std::numbers::pi) {
    table.Fail("tolerance", fmt::format("is {} rad, which no heading misses; allowed: below pi",
                                        MessageNumber(term.tolerance)));
  }
  // So that it does not jump by a turn before the robot has made half of one.
  if (!IsSquare(term)) term.from_start = true;
}

CostTerm ReadSpaceCost(TomlTable& table, const SpaceRobot& robot, const Problem& problem) {
  SpaceCostEntry term;
  ReadKeys(table, kTermKeys, term);
  if (term.weight < 0 && term.kind != CostTerm::Kind::kLinear) {
    table.Fail("weight",
               fmt::format("is {}; allowed for this term: >= 0", MessageNumber(term.weight)));
  }
  if (!term.of_coordinate()) {
    term.when = CostTerm::When::kThroughout;
    if (term.kind == CostTerm::Kind::kWork) {
      for (const ActuatedJoint& joint : problem.joints)
        term.joint_dofs.push_back(static_cast<std::size_t>(joint.dof));
    }
    if (term.kind == CostTerm::Kind::kSlip)
      term.robot_weight_n = robot.mass_kg() * robot.tree.gravity.norm();
    return term;
  }
  term.latest_s = problem.duration_s + problem.settle_s;
  term.link =
      robot.body_names[robot.first_body() >= 0 ? static_cast<std::size_t>(robot.first_body()) : 0];
  ReadKeys(table, kQuantityKeys, term);
  if (ToVector(term.along).norm() < 1e-6)
    table.Fail("along", "has no direction; allowed: any but [0, 0, 0]");
  const bool misaligned = term.of == SpaceQuantity::Of::kMisalignment;
  if (HasAxis(term) && ToVector(term.axis).norm() < 1e-6)
    table.Fail("axis", "has no direction; allowed: any but [0, 0, 0]");
  if (misaligned && (term.target != 0 || term.from_start))
    table.Fail("target", "is given for a misalignment, which is to be 0; leave it out");
  constexpr double kLargestChord = 2;
  if (misaligned && term.tolerance >= kLargestChord) {
    table.Fail("tolerance", fmt::format("is {}, which no misalignment misses: it is 2 sin(angle / "
                                        "2); allowed: below 2",
                                        MessageNumber(term.tolerance)));
  }
  if (term.of == SpaceQuantity::Of::kHeading) CheckHeading(table, term);
  try {
    term.quantity = QuantityOfLink(robot, term.of, term.link,
                                   HasAxis(term) ? term.axis : term.point_m, term.along);
  } catch (const std::invalid_argument& error) {
    table.Fail("link", fmt::format("is '{}', which {}", term.link, error.what()));
  }
  term.of_velocity = term.quantity.of_velocity();
  term.target_from_start = term.target;
  if (term.at_s) {
    if (table.Has("when")) {
      table.Fail("time_s", fmt::format("is {}, and there is 'when', too; allowed: one of the two",
                                       MessageNumber(*term.at_s)));
    }
    term.when = CostTerm::When::kTime;
    if (std::abs(*term.at_s - problem.duration_s) <= kSameTime_s) {
      term.when = CostTerm::When::kEnd;
    } else if (std::abs(*term.at_s - term.latest_s) <= kSameTime_s) {
      term.when = CostTerm::When::kSettled;
    } else {
      term.time_s = *term.at_s;
    }
  }
  return term;
}

// The start.

struct SpaceStartEntry {
  double x_m = 0, y_m = 0;
  std::optional<double> z_m;
  Quaternion quaternion = kUpright;
};
constexpr std::array kStartKeys = {
    KeyOf<&SpaceStartEntry::x_m>("x_m", kPlace, "of the root link's frame"),
    KeyOf<&SpaceStartEntry::y_m>("y_m", kPlace, "likewise"),
    KeyOf<&SpaceStartEntry::z_m>("z_m", kPlace,
                                 "without it the robot is put on the ground and left to come to "
                                 "rest, its orientation included")
        .Allowed("-1000 to 1000, no shape inside an obstacle"),
    KeyOf<&SpaceStartEntry::quaternion>(
        "quaternion", {-1.001, 1.001},
        "how the root's frame is turned in the world: w, x, y, z of a unit quaternion")
        .Default("[1, 0, 0, 0]"),
};

class Reader {
 public:
  Reader(TomlTable root, const Robot& robot, const std::optional<StartPose>& given)
      : root_(std::move(root)), given_(given), scene_(problem_.space.emplace().scene) {
    scene_.robot = ReduceToSpace(robot);
  }

  Problem Read() {
    RefusePlanarKeys();
    ReadNameAndTimes(root_, problem_);
    if (scene_.robot.joint_count() == 0)
      root_.Fail("robot", "has no joint that moves; allowed: at least one");
    ReadActuatedJoints(root_, problem_);
    ReadMotors(root_, problem_);
    ReadSpline(root_, problem_);
    ReadEndVelocities(root_, problem_);
    ReadTied(root_, problem_);
    const double mass_kg = scene_.robot.mass_kg();
    const double gravity = scene_.robot.tree.gravity.norm();
    if (std::optional<TomlTable> table = root_.OptionalTable("contact"))
      ReadContact(*table, mass_kg, gravity, scene_.contact);
    ReadObstacles();
    std::vector<std::vector<double>> ends(2, std::vector<double>(scene_.robot.tree.dofs.size()));
    for (const ActuatedJoint& joint : problem_.joints) {
      ends[0][static_cast<std::size_t>(joint.dof)] = joint.start_rad;
      ends[1][static_cast<std::size_t>(joint.dof)] = joint.end_rad;
    }
    ReadSelfContact(root_, ends, scene_);
    ReadCosts(
        root_,
        [this](TomlTable& table) {
          const CostTerm term = ReadSpaceCost(table, scene_.robot, problem_);
          if (term.from_start) from_start_.emplace_back(table, term.quantity);
          return term;
        },
        problem_);
    ReadSettings(root_, problem_);
    if (std::optional<TomlTable> table = root_.OptionalTable("drives"))
      ReadKeys(*table, kTaskDrivesKeys, problem_.drives.emplace());
    problem_.space->robust = ReadSpaceRobust(root_, problem_);
    TomlTable start = root_.Table("start");
    ReadStart(start);
    for (const auto& [table, quantity] : from_start_) {
      if (quantity.IsDefined(problem_.start_q, problem_.space->start_orientation)) continue;
      table.Fail("axis",
                 "points along `along` where the robot starts, and has no heading there from which "
                 "another one could be told; give another axis, or a target without from_start");
    }
    SetTargetsFromStart(problem_);
    root_.RejectUnknownKeys();
    for (const std::vector<double>& q : ends) {
      const double effective = SmallestEffectiveMass(scene_.robot.tree, scene_.robot.shapes, q);
      if (scene_.obstacles.empty() || !std::isfinite(effective)) continue;
      problem_.advisable_step_s = std::min(
          problem_.advisable_step_s, AdvisableStep(scene_.contact, effective, mass_kg * gravity));
    }
    SetStepsByAdvice(root_, problem_);
    CheckSteps(root_, problem_);
    return std::move(problem_);
  }

 private:
  /// Says of what a robot in the plane has that one in space has not.
  void RefusePlanarKeys() {
    for (const char* key : {"passive", "bar", "slope_rad", "mirror"}) {
      if (!root_.Has(key)) continue;
      root_.Fail(
          key,
          "is for robots in the plane so far; leave it out with root = \"floating\" (a slope "
          "is the normal of an [[obstacle]])");
    }
  }

  void ReadObstacles() {
    constexpr const char* kWhatToWrite =
        "say what the robot can touch: for level ground [[obstacle]], and below it name = "
        "\"ground\", point_m = [0, 0, 0] and normal = [0, 0, 1]; for nothing at all obstacle = [], "
        "above the file's first [table]";
    for (TomlTable& table : root_.Tables("obstacle", kWhatToWrite)) {
      const Obstacle<Spatial> obstacle = ReadSpaceObstacle(table);
      const bool twice = std::ranges::any_of(
          scene_.obstacles, [&](const auto& other) { return other.name == obstacle.name; });
      if (twice) {
        table.Fail("name", fmt::format("'{}' is there twice; each obstacle needs a name of its own",
                                       obstacle.name));
      }
      scene_.obstacles.push_back(obstacle);
    }
    CheckObstacles(root_, scene_.obstacles.size(), scene_.robot.shapes.size(),
                   scene_.robot.ignored_shapes);
  }

  void ReadStart(TomlTable& start) {
    SpaceStartEntry entry;
    ReadKeys(start, kStartKeys, entry);
    SpacePose pose;
    pose.q.assign(scene_.robot.tree.dofs.size(), 0.0);
    pose.q[0] = entry.x_m;
    pose.q[1] = entry.y_m;
    pose.q[2] = entry.z_m.value_or(0);
    for (const ActuatedJoint& joint : problem_.joints)
      pose.q[static_cast<std::size_t>(joint.dof)] = joint.start_rad;
    pose.orientation = ToRotation(UnitQuaternion(start, "quaternion", entry.quaternion));
    root_.RejectUnknownKeys();  // A misspelt key is often the reason why the pose does not rest.
    if (given_) {
      CheckGivenJoints(start, *given_, problem_);
      const PrimitivePose& from = *given_->pose;
      const SpaceMatrix orientation = ToRotation(from.root_quaternion);
      if (!given_->own) CheckGivenTurn(start, pose.orientation, orientation);
      pose.q[0] = from.root_x_m;
      pose.q[1] = from.root_y_m;
      pose.q[2] = from.root_z_m;
      pose.orientation = orientation;
    } else if (!entry.z_m) {
      try {
        pose = RestPose(scene_, pose);
      } catch (const std::runtime_error& error) {
        start.Fail("", fmt::format("{}; change the joints or the quaternion, or give z_m to start "
                                   "from a pose that is not at rest",
                                   error.what()));
      }
    }
    problem_.start_q = pose.q;
    problem_.space->start_orientation = pose.orientation;
    CheckNotBuried(start, pose, entry.z_m.has_value());
  }

  /// Checks that the root is turned nearly as the task says, its heading included: what costs ask
  /// for is along axes of the world.
  void CheckGivenTurn(TomlTable& start, const SpaceMatrix& asked, const SpaceMatrix& is) const {
    const double cosine = ToQuaternion(is * asked.transpose())[0];  // of half the angle
    const double apart = 2 * portable::Atan2(std::sqrt(std::max(0.0, 1 - cosine * cosine)), cosine);
    if (apart <= kStartPitchTolerance) return;
    std::vector<std::string> parts;
    for (const double part : ToQuaternion(is)) parts.push_back(fmt::format("{:.4f}", part));
    start.Fail("quaternion",
               fmt::format("has the root turned {} rad from {}, which has it at [{}]; allowed: <= "
                           "{} rad",
                           MessageNumber(apart), given_->from, fmt::join(parts, ", "),
                           kStartPitchTolerance));
  }

  /// Checks that no shape starts deeper in an obstacle than the compliant layer is thick.
  void CheckNotBuried(TomlTable& start, const SpacePose& pose, bool placed) {
    RootChart<Spatial> chart;
    chart.axes = pose.orientation;
    const std::optional<BuriedShape> buried = FindBuried<Spatial>(scene_, pose.q, chart);
    if (!buried) return;
    start.Fail(placed ? "z_m" : "",
               fmt::format("puts collision shape {} {} m inside '{}'; allowed: where none is "
                           "inside an obstacle{}",
                           buried->shape, MessageNumber(buried->by_m), buried->obstacle,
                           placed ? "; without z_m the robot is put on the ground"
                                  : "; give contact.stiffness_n_per_m a larger value"));
  }

  TomlTable root_;
  const std::optional<StartPose>& given_;
  Problem problem_;
  SpaceScene& scene_;
  std::vector<std::pair<TomlTable, SpaceQuantity>> from_start_;  // of targets from the start
};

std::vector<KeyTable> KeyTables() {
  const char* const source = "offline/problem/space_task.cc";
  std::vector<KeyRow> obstacles = RowsOf(kObstacleKeys);
  const auto add = [&obstacles](const std::vector<KeyRow>& rows) {
    obstacles.insert(obstacles.end(), rows.begin(), rows.end());
  };
  add(RowsOf(kHalfSpaceKeys, kKinds[0]));
  add(RowsOf(kBallKeys, kKinds[1]));
  add(RowsOf(kCapsuleKeys, kKinds[2]));
  add(RowsOf(kBoxKeys, kKinds[3]));
  return {{source, "start", RowsOf(kStartKeys)},
          {source, "cost", Joined({RowsOf(kTermKeys), RowsOf(kQuantityKeys)})},
          {source, "obstacle", obstacles},
          SpaceRobustKeyTable()};
}

}  // namespace
}  // namespace in_space

Quaternion UnitQuaternion(TomlTable& table, std::string_view key, const Quaternion& given) {
  double square = 0;
  for (const double part : given) square += part * part;
  const double length = std::sqrt(square);
  if (!(std::abs(length - 1) <= 1e-3)) {
    table.Fail(key, fmt::format("has the length {}; allowed: a unit quaternion w, x, y, z",
                                MessageNumber(length)));
  }
  Quaternion unit = given;
  for (double& part : unit) part /= length;
  return unit;
}

Obstacle<Spatial> ReadSpaceObstacle(TomlTable& table) { return in_space::ReadOne(table); }

Problem ReadSpaceTask(TomlTable root, const Robot& robot, const std::optional<StartPose>& given) {
  return in_space::Reader(std::move(root), robot, given).Read();
}

PrimitivePose ToPrimitivePose(const SpacePose& pose) {
  constexpr std::ptrdiff_t kRootDofs = 6;
  PrimitivePose out;
  out.root_x_m = pose.q[0];
  out.root_y_m = pose.q[1];
  out.root_z_m = pose.q[2];
  out.root_quaternion = ToQuaternion(pose.orientation);
  out.joint_positions_rad.assign(pose.q.begin() + kRootDofs, pose.q.end());
  return out;
}

SpacePose ToSpacePose(const PrimitivePose& pose) {
  SpacePose out;
  out.q = {pose.root_x_m, pose.root_y_m, pose.root_z_m, 0, 0, 0};
  out.q.insert(out.q.end(), pose.joint_positions_rad.begin(), pose.joint_positions_rad.end());
  out.orientation = ToRotation(pose.root_quaternion);
  return out;
}

std::vector<KeyTable> SpaceTaskKeyTables() { return in_space::KeyTables(); }

}  // namespace tumbler
