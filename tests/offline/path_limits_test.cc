// Limits are those of the paths: how far motions go is found here by dense samples of their
// splines, and compared with what the solver and the files say of it.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "common/files/primitive_limits.h"
#include "common/files/primitive_toml.h"
#include "offline/certify/certificate.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/constraints.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solve_near.h"
#include "tests/support/docs_tables.h"
#include "tests/support/files.h"
#include "tests/support/primitive_file.h"

namespace tumbler {
namespace {

using ::testing::Contains;
using ::testing::Field;
using testing::Replaced;
using Path = JointMotion<double>::Spline;

/// What a solver that is within 3 % of a path leaves of a limit, and rounding.
constexpr double kLeastWhereItBinds = 0.95;

/// The least and the largest position, velocity or acceleration of a path, by dense samples.
Interval<double> Reached(const Path& path, int derivative) {
  constexpr int kSamples = 20000;
  Interval<double> reached{1e300, -1e300};
  for (int i = 0; i <= kSamples; ++i) {
    const auto at = path.Evaluate(path.end_s() * i / kSamples);
    const double value = derivative == 0 ? at.value : derivative == 1 ? at.first : at.second;
    reached = {std::min(reached.min, value), std::max(reached.max, value)};
  }
  return reached;
}

/// The limits of position, velocity and acceleration.
std::array<Interval<double>, 3> LimitsOf(const JointLimits<double>& limits) {
  return {{{limits.position_min_rad, limits.position_max_rad},
           {-limits.velocity_max_rad_s, limits.velocity_max_rad_s},
           {-limits.acceleration_max_rad_s2, limits.acceleration_max_rad_s2}}};
}

/// How far something goes from the middle of what is allowed, as a part of it.
double PartOf(const Interval<double>& allowed, const Interval<double>& reached) {
  const double middle = 0.5 * (allowed.min + allowed.max);
  return std::max(reached.max - middle, middle - reached.min) / (allowed.max - middle);
}

/// A shipped motion, and the limits that its solver had.
struct Shipped {
  std::string name;
  PrimitiveFile file;
  Problem problem;
  std::vector<double> x;
};

std::vector<Shipped> ShippedMotions() {
  const std::filesystem::path folder = testing::SourcePath("primitives");
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string path = entry.path();
    if (path.ends_with(".toml") &&
        testing::ReadFile(path).find("format = \"tumbler-primitive\"") != std::string::npos)
      paths.push_back(entry.path());
  }
  std::ranges::sort(paths);
  std::vector<Shipped> motions;
  for (const auto& path : paths) {
    Shipped motion{
        std::filesystem::relative(path, folder).replace_extension(), LoadPrimitive(path), {}, {}};
    const Provenance& provenance = motion.file.provenance;
    motion.problem = ParseTask(provenance.task_toml, path, provenance.robot_urdf,
                               provenance.robot_file, TaskSpaces::kPlaneAndSpace)
                         .problem;
    // What was found beside the paths is given now.
    motion.problem.duration_s = motion.file.primitive.duration_s;
    motion.problem.free_duration.reset();
    motion.problem.free_start_rates = {};
    motion.x = testing::FreeControlPoints(motion.file.primitive);
    motions.push_back(std::move(motion));
  }
  return motions;
}

/// The largest value of the rows with each name.
std::map<std::string, double> LargestRows(const Problem& problem, const std::vector<double>& x) {
  std::map<std::string, double> largest;
  for (const LinearRow& row : DerivativeLimitRows(problem)) {
    const auto [entry, is_new] = largest.emplace(row.name, row.Excess(x));
    if (!is_new) entry->second = std::max(entry->second, row.Excess(x));
  }
  return largest;
}

/// Whether a limit holds a motion back: the solver stops at most this far from it.
bool Binds(double row) { return row > -1e-5; }

TEST(PathLimits, OfShippedMotionsAreBoundedForAllTimeAndByHardlyMoreThanTheyReach) {
  const std::vector<Shipped> motions = ShippedMotions();
  ASSERT_GE(motions.size(), 18U);
  for (const Shipped& motion : motions) {
    const std::map<std::string, double> rows = LargestRows(motion.problem, motion.x);
    const auto& primitive = motion.file.primitive;
    for (const JointMotion<double>& joint : primitive.motions()) {
      const auto said = BoundsOf(joint, joint.limits);
      const auto limits = LimitsOf(joint.limits);
      const std::string of = " of " + std::string(joint.name.view());
      for (std::size_t d = 0; d < 3; ++d) {
        SCOPED_TRACE(motion.name + ": " + said[d].name + of);
        const Interval<double> reached = Reached(joint.position, static_cast<int>(d));
        const double size = std::max(std::abs(reached.min), std::abs(reached.max));
        // What loader and certificate say: nothing is beyond, and it is reached.
        EXPECT_LE(said[d].path.min, reached.min + 1e-12 * size);
        EXPECT_GE(said[d].path.max, reached.max - 1e-12 * size);
        EXPECT_NEAR(said[d].path.min, reached.min, 1e-6 * size);
        EXPECT_NEAR(said[d].path.max, reached.max, 1e-6 * size);
        EXPECT_GE(reached.min, limits[d].min);
        EXPECT_LE(reached.max, limits[d].max);
        // What the solver says. It bounds positions by control points.
        if (d == 0) continue;
        const double most = limits[d].max * (1 + rows.at(said[d].name + of));
        EXPECT_GE(most, size * (1 - 1e-9));
        EXPECT_LE(most, 1.03 * size);
      }
    }
  }
}

/// The largest part of a limit that any joint reaches, and whether it binds.
struct Use {
  double part = 0;
  double of_control_points = 0;
  bool binds = false;
};
std::array<Use, 3> UseOf(const Shipped& motion) {
  const std::map<std::string, double> rows = LargestRows(motion.problem, motion.x);
  std::array<Use, 3> uses;
  for (const JointMotion<double>& joint : motion.file.primitive.motions()) {
    const auto limits = LimitsOf(joint.limits);
    for (std::size_t d = 0; d < 3; ++d) {
      const auto points = joint.position.Bounds(static_cast<int>(d));
      Use& use = uses[d];
      const Interval<double> reached = Reached(joint.position, static_cast<int>(d));
      use.part = std::max(use.part, PartOf(limits[d], reached));
      use.of_control_points =
          std::max(use.of_control_points, PartOf(limits[d], {points.min, points.max}));
      if (d == 0) continue;
      const std::string name =
          (d == 1 ? "velocity of " : "acceleration of ") + std::string(joint.name.view());
      if (!Binds(rows.at(name))) continue;
      use.binds = true;
      EXPECT_GE(PartOf(limits[d], reached), kLeastWhereItBinds) << motion.name << ": " << name;
    }
  }
  return uses;
}

TEST(PathLimits, TheTablesOfTheDocumentAreWhatShippedMotionsReach) {
  std::string table = testing::MarkdownHead(
      {"motion", "position", "velocity", "acceleration", "velocity of its control points"});
  for (const Shipped& motion : ShippedMotions()) {
    const auto uses = UseOf(motion);
    std::vector<std::string> cells = {fmt::format("`{}`", motion.name)};
    for (const Use& use : uses)
      cells.push_back(fmt::format("{:.0f} %{}", 100 * use.part, use.binds ? ", binds" : ""));
    cells.push_back(fmt::format("{:.0f} %", 100 * uses[1].of_control_points));
    table += testing::MarkdownRow(cells);
  }
  testing::ExpectTables(
      "docs/method.md",
      std::vector<testing::DocsTable>{{"tests/offline/path_limits_test.cc",
                                       "what shipped motions reach of their limits", table}});
}

const PrimitiveFile& Handstand() {
  static const PrimitiveFile file =
      LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
  return file;
}
/// The task of the nominal handstand with other limits.
Task HandstandTask(const std::string& limits) {
  const Provenance& provenance = Handstand().provenance;
  return ParseTask(Replaced(provenance.task_toml, "[limits]", "[limits]\n" + limits), "task.toml",
                   provenance.robot_urdf, "robot.urdf");
}

/// A limit that is a part of what the handstand reaches.
struct BindingLimit {
  const char* name;
  std::size_t derivative;
  std::size_t joint;
  const char* key;
  double part;
};
class PathLimit : public ::testing::TestWithParam<BindingLimit> {};
INSTANTIATE_TEST_SUITE_P(
    Quantities, PathLimit,
    ::testing::Values(BindingLimit{"velocity of leg1", 1, 0, "leg1.velocity_max_rad_s", 0.9},
                      BindingLimit{"acceleration of leg1", 2, 0, "leg1.acceleration_max_rad_s2",
                                   0.9}),
    [](const auto& limit) { return fmt::format("D{}", limit.param.derivative); });

TEST_P(PathLimit, ThatBindsIsReachedByThePath) {
  const auto [name, derivative, joint, key, part] = GetParam();
  const auto d = static_cast<int>(derivative);
  const Interval<double> before = Reached(Handstand().primitive.joints[joint].position, d);
  const double most = std::max(before.max, -before.min);
  const Problem problem = HandstandTask(fmt::format("{} = {}\n", key, part * most)).problem;
  NearRollouts rollouts(problem);
  const Solution solution = SolveNear(problem, testing::FreeControlPoints(Handstand().primitive),
                                      {100, 0}, rollouts, {}, nullptr);
  EXPECT_TRUE(solution.feasible()) << solution.worst_constraint;
  EXPECT_THAT(solution.kkt.multipliers, Contains(Field(&Multiplier::name, name)));
  const Interval<double> limit = LimitsOf(problem.joints[joint].limits)[derivative];
  const Interval<double> reached = Reached(PositionSpline(problem, solution.x, joint), d);
  EXPECT_LE(reached.max, limit.max);
  EXPECT_GE(reached.min, limit.min);
  EXPECT_GE(PartOf(limit, reached), kLeastWhereItBinds);
}

}  // namespace
}  // namespace tumbler
