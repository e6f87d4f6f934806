// The program finds the three motions of [AB04, section V] from nothing, with the costs as printed,
// eleven parameters and the paper's gradient equations.

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "common/files/primitive_toml.h"
#include "common/files/toml_reader.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/forward_sensitivity.h"
#include "tests/support/files.h"
#include "tests/support/primitive_file.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using testing::Program;
using testing::TaskFolder;

/// A solved task, and figures of its file when it is played.
struct Motion {
  Problem problem;
  PrimitiveFile file;
  std::vector<double> start, end;  ///< Positions of all degrees of freedom.
  double effort = 0;               ///< Integral of |tau|^2, by Simpson's rule.
  int contact_changes = 0;         ///< How often the set of touching feet and ends changes.
};

Motion Solved(const std::string& name) {
  const std::string task = testing::SourcePath("primitives/tasks/paper/") + name + ".toml";
  const TaskFolder folder("");
  Program program({testing::ProgramPath("tumbler optimize"), task, "--out", folder / "motion.toml",
                   "--threads", "2"});
  EXPECT_EQ(program.Wait(), 0) << program.text();
  Motion motion{LoadTask(task).problem, LoadPrimitive(folder / "motion.toml"), {}, {}};
  const Problem& problem = motion.problem;
  const std::vector<double> x = testing::FreeControlPoints(motion.file.primitive);
  std::vector<double> power;
  std::set<int> touching;
  Rollout(problem, 0.5e-3).Visit(x, 0, [&](const MotionSample& sample) {
    if (motion.start.empty()) motion.start = sample.q;
    motion.end = sample.q;
    double sum = 0;
    for (const double torque : sample.torque) sum += torque * torque;
    power.push_back(sum);
    std::set<int> now;
    for (const auto& contact : sample.contacts) now.insert(contact.shape);
    if (sample.time_s > 0 && now != touching) ++motion.contact_changes;
    touching = now;
  });
  const double h = problem.duration_s / static_cast<double>(power.size() - 1);
  for (std::size_t i = 0; i + 2 < power.size(); i += 2)
    motion.effort += h / 3 * (power[i] + 4 * power[i + 1] + power[i + 2]);
  return motion;
}

/// The setting that all three tasks have in common.
void ExpectThePapersSetting(const Motion& motion) {
  const Problem& problem = motion.problem;
  EXPECT_EQ(problem.solver.gradient, SolverSettings::Gradient::kForward);
  const ForwardSensitivity forward(problem, {});
  EXPECT_EQ(forward.state_equations(), 7);
  EXPECT_EQ(forward.gradient_equations(), 77);
  EXPECT_EQ(problem.settle_s, 0) << "the paper's motions end with their cost";
  EXPECT_EQ(problem.scene.contact.mu, 0.3);
  EXPECT_EQ(problem.scene.contact.damping_law, ContactDamping::kSigned);
  EXPECT_EQ(problem.scene.contact.smoothing, ContactSmoothing::kCubic);
  EXPECT_LT(motion.file.certificate.gradient_error, 1e-5);
  EXPECT_LT(motion.file.certificate.peak_penetration_m, problem.scene.contact.d_on_m);
}

TEST(PaperTasks, TheHandstandEndsUpright) {
  const Motion motion = Solved("handstand");
  ExpectThePapersSetting(motion);
  EXPECT_NEAR(motion.start[2], 0, 1e-6) << "home";
  EXPECT_NEAR(motion.start[3], -M_PI / 2, 1e-12);
  EXPECT_NEAR(motion.start[4], M_PI / 2, 1e-12);
  const double cost = std::pow(motion.end[2] - M_PI / 2, 2);  // (33)
  EXPECT_LT(cost, 1e-8);
  EXPECT_NEAR(motion.file.provenance.objective, cost, 1e-8) << "of another step";
  EXPECT_NEAR(motion.end[3], 0, 1e-12);
  EXPECT_NEAR(motion.end[4], 0, 1e-12);
}

TEST(PaperTasks, TheRollTurnsOnAndTravelsLeft) {
  const Motion motion = Solved("roll");
  ExpectThePapersSetting(motion);
  EXPECT_NEAR(motion.start[2], M_PI / 2, 1e-3) << "the handstand";
  EXPECT_EQ(motion.file.entry.joint_positions_rad, (std::vector<double>{0, 0}));
  const double cost = 50 * motion.end[0] - motion.end[2];  // (34)
  EXPECT_NEAR(motion.file.provenance.objective, cost, 0.01) << "of another step";
  EXPECT_LT(motion.end[0] - motion.start[0], -0.3);
  EXPECT_GT(motion.end[2] - motion.start[2], M_PI) << "at least a further half turn";
  EXPECT_GT(motion.contact_changes, 4) << "\"changes several times throughout the motion\"";
}

TEST(PaperTasks, TheDownstandEndsOnBothFeetOnTheOtherSide) {
  const Motion motion = Solved("downstand");
  ExpectThePapersSetting(motion);
  EXPECT_NEAR(motion.start[2], M_PI / 2, 1e-3) << "the handstand";
  const double cost = 50 * std::pow(motion.end[2] - M_PI, 2) + 0.5 * motion.effort;  // (35)
  EXPECT_NEAR(motion.file.provenance.objective, cost, 1e-3 * cost);
  EXPECT_NEAR(motion.end[2], M_PI, 0.02);
  EXPECT_NEAR(motion.file.exit.root_pitch_rad, M_PI, 1e-3) << "2 s later";
  EXPECT_NEAR(motion.file.exit.joint_positions_rad[0], M_PI / 2, 1e-12) << "roles exchanged";
  EXPECT_NEAR(motion.file.exit.joint_positions_rad[1], -M_PI / 2, 1e-12);
}

TEST(PaperTasks, ThePrintedDampingDoesNotEvenStandStill) {
  // Eq. (13) with the magnitude of the velocity shows why the tasks have the signed one.
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/tasks/paper/handstand.toml"));
  EXPECT_THROW(ParseTask(testing::Replaced(text, "\"signed\"", "\"printed\""), "task.toml",
                         testing::ShippedRobot(), "robot.urdf"),
               FileError);
}

}  // namespace
}  // namespace tumbler
