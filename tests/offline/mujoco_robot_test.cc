// Robots in MuJoCo behind our drives, executor and bus: what is known of a robot by records that no
// model of ours made.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "offline/studies/gate.h"
#include "offline/studies/identified_model.h"
#include "offline/studies/robot_fit.h"
#include "tests/support/files.h"
#include "tests/support/hidden_robot.h"
#include "tests/support/identification.h"
#include "tests/support/mujoco_robot.h"
#include "tests/support/tuned_motion.h"

namespace tumbler {
namespace {

const std::string kMujocoDrives = testing::SourcePath("primitives/robots/tumbler_drives.toml");
const std::string kShippedHandstand = testing::SourcePath("primitives/handstand.toml");

/// Motions of the robots in MuJoCo that differ from the first of them.
testing::HiddenRuns InMujoco(const std::string& motion, const Scene* model = nullptr) {
  testing::HiddenRuns runs(motion, kMujocoDrives);
  if (model != nullptr) runs.OfModel(*model);
  constexpr double kGround_s = 5e-3;
  runs.Behind(testing::MujocoEngine(runs.motion(),
                                    {.time_constant_s = kGround_s, .model = runs.scene().contact}));
  return runs;
}

/// A run of the handstand, with the robot high above the ground when the motion begins.
TwinState AfterAFall(const TwinEngine& engine, const testing::HiddenRobot& robot) {
  const testing::HiddenRuns runs(kShippedHandstand, kMujocoDrives);
  SharedRobot shared = runs.shared();
  shared.config.twin.engine = engine;
  VariedRun run({runs.motion(), nullptr, RunSettings{}, nullptr}, shared, robot.variation);
  while (run.Step() && run.record().state != ExecutorState::kRunning) {
  }
  // What the ground did to it until then differs: both begin anew.
  const TwinState begun = run.robot().state();
  run.robot().Displace(
      std::vector<double>{-begun.root_x_m, 10 - begun.root_z_m, -begun.root_pitch_rad,
                          -1.5708 - begun.joint_positions_rad[0],
                          1.5708 - begun.joint_positions_rad[1]},
      std::vector<double>{-begun.root_vx_m_s, -begun.root_vz_m_s, -begun.root_pitch_rate_rad_s,
                          -begun.joint_velocities_rad_s[0], -begun.joint_velocities_rad_s[1]});
  for (int tick = 0; tick < 500; ++tick) run.Step();
  return run.robot().state();
}

TEST(MujocoRobot, MovesInTheAirAsTheTwinDoes) {
  testing::HiddenRobot robot =
      testing::DrawHiddenRobot(testing::HiddenRuns(kShippedHandstand, kMujocoDrives).scene(), 3, 1);
  for (RobotVariation::Joint& joint : robot.variation.joints) joint.dry_friction_nm = 0;
  for (RobotVariation::Link& link : robot.variation.links) link.length = 1.02;
  const testing::HiddenRuns runs(kShippedHandstand, kMujocoDrives);
  const TwinState ours = AfterAFall(nullptr, robot);
  const TwinState theirs =
      AfterAFall(testing::MujocoEngine(runs.motion(), {.model = runs.scene().contact}), robot);
  EXPECT_LT(ours.root_z_m, 9) << "it fell for half a second";
  EXPECT_GT(std::abs(ours.root_pitch_rad), 0.1) << "its legs turned it";
  EXPECT_NEAR(theirs.root_x_m, ours.root_x_m, 1e-3);
  EXPECT_NEAR(theirs.root_z_m, ours.root_z_m, 1e-3);
  EXPECT_NEAR(theirs.root_pitch_rad, ours.root_pitch_rad, 3e-3);
  for (std::size_t j = 0; j < 2; ++j)
    EXPECT_NEAR(theirs.joint_positions_rad[j], ours.joint_positions_rad[j], 1e-3) << j;
}

TEST(MujocoRobot, StandsOnItsHandsWhenItIsTheModel) {
  const testing::HiddenRuns runs = InMujoco(kShippedHandstand);
  EXPECT_TRUE(runs.Play(testing::DrawHiddenRobot(runs.scene(), 1, 1, 0)));
}

/// What records of the two excitations say of a robot.
PosteriorFile KnownOf(const testing::HiddenRobot& robot) {
  static const std::vector<testing::HiddenRuns> runs = [] {
    std::vector<testing::HiddenRuns> made;
    for (const std::string& file : testing::ExcitationFiles()) made.push_back(InMujoco(file));
    return made;
  }();
  const std::vector<RecordedMotion> records = testing::RecordsOf(runs, robot);
  const FitOutcome fit = FitRobot(records, PriorOfRecords(records, false), {});
  PosteriorFile known;
  known.posterior = fit.posterior;
  known.prior_deviations = fit.first_deviations;
  known.effective = fit.effective;
  known.chi = fit.chi;
  return known;
}

TEST(MujocoRobot, IsIdentifiedAsAnEffectiveModelOnly) {
  const Scene model = testing::HiddenRuns(kShippedHandstand, kMujocoDrives).scene();
  const testing::HiddenRobot robot = testing::DrawHiddenRobot(model, 900, 1);
  const PosteriorFile known = KnownOf(robot);
  EXPECT_TRUE(known.effective) << known.chi << ": contacts of MuJoCo are none of ours";
  // But not one that is far from what could have been built.
  const Scene varied = Varied(model, robot.variation);
  for (std::size_t i = 0; i < known.posterior.size(); ++i) {
    const RobotQuantity& quantity = known.posterior.quantities[i];
    if (quantity.kind != RobotQuantity::Kind::kMass) continue;
    EXPECT_NEAR(known.posterior.mean[i], CoordinateIn(varied, quantity), 0.2) << NameOf(quantity);
  }
}

TEST(MujocoRobot, IsIdentifiedAndDoesNotFallWithWhatTheGateLetsPass) {
  const Scene model = testing::HiddenRuns(kShippedHandstand, kMujocoDrives).scene();
  const testing::HiddenRobot robot = testing::DrawHiddenRobot(model, 900, 0);
  ASSERT_FALSE(InMujoco(kShippedHandstand).Play(robot));
  const PosteriorFile known = KnownOf(robot);
  EXPECT_FALSE(PassGate(kShippedHandstand, kMujocoDrives, known, {}).open());
  const testing::TemporaryFolder folder;
  const std::string motion = folder / "tuned.toml";
  const std::string cause =
      testing::FindAnew(testing::SourcePath("primitives/tasks/handstand.toml"), {kShippedHandstand},
                        known, {}, motion);
  // A motion need not be found, nor the gate be open for it; but then it stands.
  const bool open = cause.empty() && PassGate(motion, kMujocoDrives, known, {}).open();
  EXPECT_TRUE(!open || InMujoco(motion, &model).Play(robot));
}

}  // namespace
}  // namespace tumbler
