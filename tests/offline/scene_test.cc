#include "offline/scene/scene.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "common/files/toml_reader.h"
#include "offline/problem/simulated_motion.h"
#include "offline/scene/scene_dynamics.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"

namespace tumbler {
namespace {

SequenceFile Gait() { return LoadMotion(testing::SourcePath("primitives/nominal/gait.toml")); }

TEST(Scene, TheSameGroundHasTheSameLawAndObstaclesWhateverTheRobot) {
  const Scene scene = HandstandProblem().scene;
  Scene other = scene;
  other.robot.tree.dofs[3].mass_kg *= 2;
  EXPECT_TRUE(SameGround(scene, other));
  other.contact.mu += 0.1;
  EXPECT_FALSE(SameGround(scene, other));
  other = scene;
  other.obstacles.clear();
  EXPECT_FALSE(SameGround(scene, other));
}

TEST(Scene, APoseAndThePositionsOfAllDegreesOfFreedomAreTheSame) {
  const PlanarRobot robot = HandstandProblem().scene.robot;
  const std::vector<double> q = {1, 2, 3, 4, 5};
  const PrimitivePose pose = PoseAt(q, robot);
  EXPECT_EQ(pose.root_x_m, 1);
  EXPECT_EQ(pose.root_z_m, 2);
  EXPECT_EQ(pose.root_pitch_rad, 3);
  EXPECT_EQ(pose.joint_positions_rad, (std::vector<double>{4, 5}));
  EXPECT_EQ(PositionsIn(pose, robot), q);
  EXPECT_EQ(RootPitchAt(q, robot), 3);
  EXPECT_THROW(PositionsIn(PrimitivePose{}, robot), std::invalid_argument);
}

TEST(Scene, AContactWithAnotherShapeOfTheRobotHasTheNameOfThatShape) {
  const Scene scene = HandstandProblem().scene;
  ActiveContact<Plane> contact;
  contact.shape = 2;
  contact.obstacle = 0;
  EXPECT_EQ(TouchedName(scene, contact), "ground");
  contact.obstacle = -1;
  contact.other_shape = 4;
  EXPECT_EQ(TouchedName(scene, contact), "leg2_link/0");
}

TEST(Scene, ARobotOnAFixedRootHasNoPitch) {
  PlanarRobot robot = HandstandProblem().scene.robot;
  robot.tree.dofs.erase(robot.tree.dofs.begin(), robot.tree.dofs.begin() + 3);
  robot.root_dofs = 0;
  const std::vector<double> q = {4, 5};
  EXPECT_EQ(PositionsIn(PoseAt(q, robot), robot), q);
  EXPECT_EQ(RootPitchAt(q, robot), 0);
}

TEST(SceneDynamics, ARobotInTheAirFallsWithItsJointsHeld) {
  Problem problem = HandstandProblem();
  SceneDynamics robot(problem.scene);
  EXPECT_EQ(robot.free.size(), 3U);
  problem.start_q[1] = 10;
  std::copy(problem.start_q.begin(), problem.start_q.end(), robot.q.begin());
  robot.SetFree(robot.AtRest(problem.start_q));
  robot.TouchAndSolve();
  EXPECT_TRUE(robot.contact->active().empty());
  SceneDynamics::State k{};
  robot.TakeSlope(k.data());
  EXPECT_NEAR(k[3], 0, 1e-12);
  EXPECT_NEAR(k[4], -9.81, 1e-12);
  EXPECT_NEAR(k[5], 0, 1e-12);
}

TEST(SimulatedMotion, ParsesTheTextsOfAPrimitiveOnce) {
  const SimulatedMotion motion(Gait());
  const SimulatedMotion copy = motion.Alone(1);
  const Problem* const first = &motion.ProblemOf(0);
  EXPECT_EQ(&motion.ProblemOf(0), first);
  EXPECT_NE(&motion.ProblemOf(1), first);
  EXPECT_EQ(&motion.Alone(1).ProblemOf(0), first) << "copies share what has been parsed";
  EXPECT_EQ(&motion.scene(), &motion.ProblemAt(motion.file().graph.start).scene);
  EXPECT_EQ(copy.file().graph.start, 1);
  EXPECT_EQ(copy.file().graph.edge_count, 0);
}

TEST(SimulatedMotion, TextsThatCannotBeUsedAreRefusedWhenTheyAreNeeded) {
  SequenceFile file = Gait();
  file.primitives[1].provenance.robot_urdf = "<robot/>";
  const SimulatedMotion motion(file);
  EXPECT_NO_THROW(static_cast<void>(motion.ProblemOf(0)));
  EXPECT_THROW(static_cast<void>(motion.ProblemOf(1)), FileError);
}

}  // namespace
}  // namespace tumbler
