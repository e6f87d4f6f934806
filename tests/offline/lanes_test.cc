// Robots in lanes: every lane gets the bits of one robot, whatever the vectors, and the physics are
// those of the scene's own dynamics.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/scene_dynamics.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"

#define TUMBLER_LANES_NAMESPACE lanes_test
#include "offline/scene/lane_dynamics.h"

namespace tumbler {
namespace {

constexpr std::size_t kLanes = Packet::kLanes;

template <class T>
bool SameBits(const T& a, const T& b) {
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): bits are what is compared.
  return std::memcmp(&a, &b, sizeof(T)) == 0;
}

PrimitiveFile HandstandFile() {
  return LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
}

/// The robot of the handstand with everything about it changed at random.
LaneRobot<double> RandomRobot(const LaneScene& scene, std::mt19937_64& random) {
  LaneRobot<double> robot = scene.robot;
  const auto vary = [&](double& value) { value *= Uniform(random, 0.8, 1.2); };
  for (std::size_t b = 0; b <= scene.model.joints; ++b) {
    auto& body = robot.bodies[b];
    for (double* value : {&body.offset_x, &body.mass, &body.centre_x, &body.inertia}) vary(*value);
    body.centre_z = Uniform(random, -0.01, 0.01);
  }
  for (std::size_t j = 0; j < scene.model.joints; ++j) {
    auto& joint = robot.joints[j];
    for (double* value : {&joint.rotor_inertia, &joint.viscous_friction, &joint.torque_max,
                          &joint.kp, &joint.kd, &joint.feed_forward})
      vary(*value);
    joint.dry_friction = Uniform(random, 0, 0.2);
    joint.upper = 2.0;  // so that stops are met
    joint.zero_error = Uniform(random, -0.01, 0.01);
    joint.delay = Uniform(random, 0, 1e-3);
  }
  for (double* value : {&robot.mu, &robot.stiffness, &robot.damping, &robot.v_max}) vary(*value);
  const double slope = Uniform(random, -0.05, 0.05);
  robot.grounds[0].normal_x = -std::sin(slope);
  robot.grounds[0].normal_z = std::cos(slope);
  for (std::size_t k = 0; k < scene.model.stones; ++k) vary(robot.stones[k].half_x);
  return robot;
}

LaneState<double> EntryState(const PrimitiveFile& file) {
  LaneState<double> state{};
  state.q[0] = file.entry.root_x_m;
  state.q[1] = file.entry.root_z_m;
  state.q[2] = file.entry.root_pitch_rad;
  for (std::size_t j = 0; j < file.entry.joint_positions_rad.size(); ++j)
    state.q[3 + j] = file.entry.joint_positions_rad[j];
  return state;
}

std::vector<LaneSetpoint<double>> SetpointsOf(const Primitive<double>& primitive, double more_s) {
  std::vector<LaneSetpoint<double>> setpoints;
  for (int k = 0; k < static_cast<int>((primitive.duration_s + more_s) * 1000); ++k) {
    for (const JointMotion<double>& joint : primitive.motions()) {
      const double t = 1e-3 * k;
      const auto at = joint.position.Evaluate(t);
      setpoints.push_back({at.value, t < primitive.duration_s ? at.first : 0,
                           static_cast<double>(joint.torque.Evaluate(t).value)});
    }
  }
  return setpoints;
}

std::vector<LaneSetpoint<Packet>> InAllLanes(const std::vector<LaneSetpoint<double>>& setpoints) {
  std::vector<LaneSetpoint<Packet>> packets;
  packets.reserve(setpoints.size());
  for (const LaneSetpoint<double>& s : setpoints)
    packets.push_back({Packet::Of(s.position), Packet::Of(s.velocity), Packet::Of(s.third)});
  return packets;
}

TEST(Lanes, EveryLaneOfEveryKernelGetsTheBitsOfOneRobotAlone) {
  const PrimitiveFile file = HandstandFile();
  Scene with_stone = TaskOf(file).problem.scene;  // under the foot that the robot begins on
  with_stone.obstacles.push_back(
      {"stone", Shape<Plane>::Box({-0.2, 0}, {}, Plane::Vector(0.3, 0.004))});
  const LaneScene scene = MakeLaneScene(with_stone, {});
  const auto setpoints = SetpointsOf(file.primitive, 0.5);
  const auto in_lanes = InAllLanes(setpoints);
  std::mt19937_64 random(1);
  std::array<LaneRobot<double>, kLanes> robots;
  std::array<LaneState<double>, kLanes> alone;
  std::array<LaneWatch<double>, kLanes> seen{};
  for (LaneRobot<double>& robot : robots) robot = RandomRobot(scene, random);
  alone.fill(EntryState(file));
  const auto packed_robots = PackLanes<LaneRobot>(robots);
  const auto packed_start = PackLanes<LaneState>(alone);
  bool fell = false, stopped = false;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    HeldSetpoints<double> held{};
    OneRobotKernel().drive(scene.model, robots[lane], {}, setpoints, held, alone[lane], seen[lane]);
    ASSERT_TRUE(std::isfinite(alone[lane].q[2]));
    fell = fell || std::abs(alone[lane].q[2] - 1.57) > 0.5;
    stopped = stopped || seen[lane].torque[1] >= robots[lane].joints[1].torque_max;
  }
  EXPECT_TRUE(fell && stopped) << "the robots ought to meet limits and to differ";
  ASSERT_FALSE(PacketKernels().empty());
  for (const LaneKernel<Packet>* kernel : PacketKernels()) {
    LaneState<Packet> state = packed_start;
    HeldSetpoints<Packet> held{};
    LaneWatch<Packet> watch{};
    kernel->drive(scene.model, packed_robots, {}, in_lanes, held, state, watch);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      EXPECT_TRUE(SameBits(LaneOf<LaneState>(state, lane), alone[lane])) << kernel->name << lane;
      EXPECT_TRUE(SameBits(LaneOf<LaneWatch>(watch, lane), seen[lane])) << kernel->name << lane;
    }
  }
}

std::vector<LaneSetpoint<float>> InSinglePrecision(
    const std::vector<LaneSetpoint<double>>& setpoints) {
  std::vector<LaneSetpoint<float>> single;
  single.reserve(setpoints.size());
  for (const LaneSetpoint<double>& s : setpoints) {
    single.push_back({static_cast<float>(s.position), static_cast<float>(s.velocity),
                      static_cast<float>(s.third)});
  }
  return single;
}

/// Sixteen robots that a motion is ranked by, at the beginning of their motion.
struct Ranked {
  LaneRobot<WidePacket> robots;
  LaneState<WidePacket> state;
  LaneWatch<WidePacket> watch;
};
Ranked RankedOf(const std::array<LaneRobot<double>, 2 * kLanes>& robots,
                const PrimitiveFile& file) {
  std::array<LaneRobot<double>, kLanes> low, high;
  std::array<LaneState<double>, kLanes> states;
  std::copy_n(robots.begin(), kLanes, low.begin());
  std::copy_n(robots.begin() + kLanes, kLanes, high.begin());
  states.fill(EntryState(file));
  const LaneState<Packet> state = PackLanes<LaneState>(states);
  return {WidenLanes<LaneRobot>(PackLanes<LaneRobot>(low), PackLanes<LaneRobot>(high)),
          WidenLanes<LaneState>(state, state), LaneWatch<WidePacket>{}};
}

TEST(Lanes, RobotsForRankingHaveTheSameBitsWithEveryVectorAndInEveryLane) {
  const PrimitiveFile file = HandstandFile();
  Scene with_stone = TaskOf(file).problem.scene;
  with_stone.obstacles.push_back(
      {"stone", Shape<Plane>::Box({-0.2, 0}, {}, Plane::Vector(0.3, 0.004))});
  const LaneScene scene = MakeLaneScene(with_stone, {});
  const auto setpoints = InSinglePrecision(SetpointsOf(file.primitive, 0.5));
  std::mt19937_64 random(3);
  std::array<LaneRobot<double>, 2 * kLanes> robots;
  for (LaneRobot<double>& robot : robots) robot = RandomRobot(scene, random);
  const auto play = [&](const RankingKernel& kernel) {
    Ranked ranked = RankedOf(robots, file);
    HeldSetpoints<float> held{};
    kernel.drive(scene.model, ranked.robots, {}, setpoints, held, ranked.state, ranked.watch);
    return ranked;
  };
  ASSERT_FALSE(RankingKernels().empty());
  const Ranked first = play(*RankingKernels().back());
  for (const RankingKernel* kernel : RankingKernels()) {
    const Ranked other = play(*kernel);
    EXPECT_TRUE(SameBits(first.state, other.state)) << kernel->name;
    EXPECT_TRUE(SameBits(first.watch, other.watch)) << kernel->name;
  }
  std::rotate(robots.begin(), robots.begin() + 5, robots.end());
  const Ranked turned = play(*RankingKernels().front());
  for (std::size_t lane = 0; lane < robots.size(); ++lane) {
    const std::size_t before = (lane + 5) % robots.size();
    ASSERT_TRUE(std::isfinite(turned.state.q[2].lane(lane)));
    for (std::size_t d = 0; d < scene.model.joints + 3; ++d)
      EXPECT_EQ(turned.state.q[d].lane(lane), first.state.q[d].lane(before)) << lane;
  }
}

TEST(Lanes, RobotsForRankingComeToWhatThoseInDoublePrecisionComeTo) {
  const PrimitiveFile file = LoadPrimitive(testing::SourcePath("primitives/handstand.toml"));
  const LaneScene scene = MakeLaneScene(TaskOf(file).problem.scene, {.kp = 40, .kd = 5});
  const auto setpoints = SetpointsOf(file.primitive, 1.0);
  const auto single = InSinglePrecision(setpoints);
  std::mt19937_64 random(4);
  int stand = 0, fall = 0, differ = 0;
  for (int packet = 0; packet < 30; ++packet) {
    std::array<LaneRobot<double>, 2 * kLanes> robots;
    robots.fill(scene.robot);
    for (LaneRobot<double>& robot : robots) {
      for (std::size_t b = 0; b <= scene.model.joints; ++b)
        robot.bodies[b].mass *= Uniform(random, 0.8, 1.2);
      robot.mu *= Uniform(random, 0.4, 1.6);
      robot.stiffness *= Uniform(random, 0.4, 1.6);
    }
    Ranked ranked = RankedOf(robots, file);
    HeldSetpoints<float> held{};
    RankingKernels().front()->drive(scene.model, ranked.robots, {}, single, held, ranked.state,
                                    ranked.watch);
    for (std::size_t lane = 0; lane < robots.size(); ++lane) {
      LaneState<double> state = EntryState(file);
      LaneWatch<double> watch{};
      HeldSetpoints<double> own{};
      OneRobotKernel().drive(scene.model, robots[lane], {}, setpoints, own, state, watch);
      const auto stands = [](double pitch) { return std::abs(pitch - std::numbers::pi / 2) < 0.2; };
      const bool one = stands(state.q[2]), other = stands(ranked.state.q[2].lane(lane));
      ++(one ? stand : fall);
      if (one != other) {
        ++differ;
        continue;
      }
      if (!one) continue;
      EXPECT_NEAR(ranked.state.q[2].lane(lane), state.q[2], 0.02) << packet << ' ' << lane;
      EXPECT_NEAR(ranked.watch.depth.lane(lane), watch.depth, 0.02 * watch.depth);
    }
  }
  EXPECT_GT(stand, 100);
  EXPECT_GT(fall, 50);
  EXPECT_LE(differ, 1) << "of " << stand + fall;
}

TEST(Lanes, ARobotForRankingThatMovesSlowlyMovesInShortStepsToo) {
  const PrimitiveFile file = HandstandFile();
  const LaneScene scene = MakeLaneScene(TaskOf(file).problem.scene, {});
  // It floats at 1 mm/s: in a step of 1 us that is a sixtieth of a unit in the last place of 1 m.
  std::array<LaneRobot<double>, 2 * kLanes> robots;
  robots.fill(scene.robot);
  for (LaneRobot<double>& robot : robots) robot.gravity_x = robot.gravity_z = 0;
  LaneState<double> state = EntryState(file);
  state.q[0] = 1;
  state.q[1] = 5;
  state.v[0] = 1e-3;
  std::vector<LaneSetpoint<float>> setpoints;
  for (int k = 0; k < 500; ++k) {
    for (std::size_t j = 0; j < scene.model.joints; ++j)
      setpoints.push_back({static_cast<float>(state.q[3 + j]), 0, 0});
  }
  Ranked ranked = RankedOf(robots, file);
  std::array<LaneState<double>, kLanes> states;
  states.fill(state);
  const LaneState<Packet> packed = PackLanes<LaneState>(states);
  ranked.state = WidenLanes<LaneState>(packed, packed);
  HeldSetpoints<float> held{};
  for (std::size_t j = 0; j < scene.model.joints; ++j) held[j] = setpoints[j];
  RankingKernels().front()->drive(scene.model, ranked.robots, {.per_tick = 1000}, setpoints, held,
                                  ranked.state, ranked.watch);
  for (std::size_t lane = 0; lane < WidePacket::kLanes; ++lane)
    EXPECT_NEAR(ranked.state.q[0].lane(lane) - 1, 5e-4, 5e-6) << lane;
}

TEST(Lanes, MotionsByTheClassicalMethodHaveTheSameBitsInEveryLaneToo) {
  const PrimitiveFile file = HandstandFile();
  const LaneScene scene = MakeLaneScene(TaskOf(file).problem.scene, {});
  const auto setpoints = SetpointsOf(file.primitive, 0.2);
  std::mt19937_64 random(7);
  std::array<LaneRobot<double>, kLanes> robots;
  std::array<LaneState<double>, kLanes> states;
  for (LaneRobot<double>& robot : robots) robot = RandomRobot(scene, random);
  states.fill(EntryState(file));
  for (const LaneKernel<Packet>* kernel : PacketKernels()) {
    constexpr std::size_t kSome = 3;
    LaneState<Packet> state = PackLanes<LaneState>(states);
    HeldSetpoints<Packet> held{};
    kernel->drive_classically(scene.model, PackLanes<LaneRobot>(robots), {}, InAllLanes(setpoints),
                              held, state, kSome);
    for (std::size_t lane = 0; lane < kSome; ++lane) {
      LaneState<double> alone = states[lane];
      HeldSetpoints<double> own{};
      OneRobotKernel().drive_classically(scene.model, robots[lane], {}, setpoints, own, alone, 1);
      EXPECT_TRUE(SameBits(LaneOf<LaneState>(state, lane), alone)) << kernel->name << lane;
      EXPECT_EQ(held[1].position.lane(lane), own[1].position);
    }
  }
}

TEST(Lanes, PrescribedMotionsHaveTheSameBitsInEveryLaneToo) {
  const PrimitiveFile file = HandstandFile();
  const LaneScene scene = MakeLaneScene(TaskOf(file).problem.scene, {});
  std::vector<LaneSetpoint<double>> setpoints;
  for (int k = 0; k < 4000; ++k) {
    for (const JointMotion<double>& joint : file.primitive.motions()) {
      const auto at = joint.position.Evaluate(2.5e-4 * k);
      setpoints.push_back({at.value, at.first, at.second});
    }
  }
  std::mt19937_64 random(2);
  std::array<LaneRobot<double>, kLanes> robots;
  std::array<LaneState<double>, kLanes> states;
  for (LaneRobot<double>& robot : robots) robot = RandomRobot(scene, random);
  states.fill(EntryState(file));
  for (const LaneKernel<Packet>* kernel : PacketKernels()) {
    LaneState<Packet> state = PackLanes<LaneState>(states);
    LaneWatch<Packet> watch{};
    std::vector<Packet> torques(setpoints.size());
    kernel->prescribe(scene.model, PackLanes<LaneRobot>(robots), 2.5e-4, InAllLanes(setpoints),
                      state, watch, torques);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      LaneState<double> alone = states[lane];
      LaneWatch<double> seen{};
      std::vector<double> own(setpoints.size());
      OneRobotKernel().prescribe(scene.model, robots[lane], 2.5e-4, setpoints, alone, seen, own);
      EXPECT_TRUE(SameBits(LaneOf<LaneState>(state, lane), alone)) << kernel->name << lane;
      for (std::size_t k = 0; k < own.size(); k += 97)
        ASSERT_EQ(torques[k].lane(lane), own[k]) << kernel->name << lane;
    }
  }
}

TEST(Lanes, TheRootIsWatchedWhereJointsArePrescribed) {
  // The legs stay where they are, and the robot falls freely.
  const PrimitiveFile file = HandstandFile();
  const LaneScene scene = MakeLaneScene(TaskOf(file).problem.scene, LaneDrive{});
  LaneState<double> state = EntryState(file);
  state.q[1] += 5;
  std::vector<LaneSetpoint<double>> setpoints;
  for (int k = 0; k < 400; ++k) {
    for (std::size_t j = 0; j < 2; ++j) setpoints.push_back({state.q[j + 3], 0, 0});
  }
  LaneWatch<double> watch{};
  std::vector<double> torques(setpoints.size());
  OneRobotKernel().prescribe(scene.model, scene.robot, 2.5e-4, setpoints, state, watch, torques);
  EXPECT_NEAR(watch.root_speed, 9.81 * 0.1, 1e-3);
}

/// The scene of the handstand with its legs free or prescribed, and what lanes have of it.
struct BothDynamics {
  explicit BothDynamics(bool prescribed) {
    scene = HandstandProblem().scene;
    scene.contact.smoothing = prescribed ? ContactSmoothing::kQuintic : ContactSmoothing::kCubic;
    for (std::size_t j = 0; j < 2; ++j) {
      Dof<Plane>& dof = scene.robot.tree.dofs[3 + j];
      dof.prescribed = prescribed;
      dof.rotor_inertia_kg_m2 = 1e-3;
      dof.damping_nm_s_per_rad = 0.03;
    }
    lanes = MakeLaneScene(scene, {.viscous_friction_nm_s_per_rad = 0});
    one = std::make_unique<SceneDynamics>(scene);
  }
  /// A random state near the ground, in both.
  LaneState<double> Place(std::mt19937_64& random) {
    LaneState<double> state{};
    state.q = {Uniform(random, -3, 3), Uniform(random, 0.15, 0.35), Uniform(random, -4, 4),
               Uniform(random, -2.9, 2.9), Uniform(random, -2.9, 2.9)};
    for (std::size_t i = 0; i < 5; ++i) {
      state.v[i] = Uniform(random, -3, 3);
      one->q[i] = state.q[i];
      one->qd[i] = state.v[i];
    }
    one->Touch();
    return state;
  }
  Scene scene;
  LaneScene lanes;
  std::unique_ptr<SceneDynamics> one;
};

TEST(Lanes, AccelerationsAreThoseOfTheSceneDynamics) {
  BothDynamics both(false);
  LaneDynamics<double> lanes(both.lanes.model, both.lanes.robot);
  std::mt19937_64 random(3);
  int touching = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const LaneState<double> state = both.Place(random);
    LaneDynamics<double>::Numbers tau{}, qdd{};
    both.one->tau.fill(0);
    for (std::size_t i = 3; i < 5; ++i) both.one->tau[i] = tau[i] = Uniform(random, -8, 8);
    both.one->Solve();
    lanes.Accelerate(state, tau, qdd);
    double force = 0;
    for (const auto& contact : both.one->contact->active()) force += contact.normal_force_n;
    touching += force > 0 ? 1 : 0;
    EXPECT_NEAR(lanes.normal_force(), force, 1e-9 * (1 + force));
    for (std::size_t i = 0; i < 5; ++i)
      EXPECT_NEAR(qdd[i], both.one->qdd[i], 1e-9 * (1 + std::abs(both.one->qdd[i]) + force)) << i;
  }
  EXPECT_GT(touching, 100);
}

TEST(Lanes, AccelerationsAreThoseOfTheSceneDynamicsUnderEveryContactLaw) {
  std::mt19937_64 random(6);
  for (const auto smoothing : {ContactSmoothing::kCubic, ContactSmoothing::kQuintic}) {
    for (const auto law :
         {ContactDamping::kNoPull, ContactDamping::kSigned, ContactDamping::kPrinted}) {
      BothDynamics both(false);
      both.scene.contact.smoothing = smoothing;
      both.scene.contact.damping_law = law;
      both.lanes = MakeLaneScene(both.scene, {.viscous_friction_nm_s_per_rad = 0});
      both.one = std::make_unique<SceneDynamics>(both.scene);
      LaneDynamics<double> lanes(both.lanes.model, both.lanes.robot);
      int touching = 0, pulling = 0;
      for (int trial = 0; trial < 500; ++trial) {
        const LaneState<double> state = both.Place(random);
        LaneDynamics<double>::Numbers tau{}, qdd{};
        both.one->tau.fill(0);
        both.one->Solve();
        lanes.Accelerate(state, tau, qdd);
        double force = 0, size = 0;
        for (const auto& contact : both.one->contact->active()) {
          force += contact.normal_force_n;
          size += std::abs(contact.normal_force_n);
          pulling += contact.normal_force_n < 0 ? 1 : 0;
        }
        touching += size > 0 ? 1 : 0;
        EXPECT_NEAR(lanes.normal_force(), force, 1e-9 * (1 + size));
        for (std::size_t i = 0; i < 5; ++i)
          EXPECT_NEAR(qdd[i], both.one->qdd[i], 1e-9 * (1 + std::abs(both.one->qdd[i]) + size));
      }
      EXPECT_GT(touching, 100);
      EXPECT_EQ(pulling > 0, law != ContactDamping::kNoPull);
    }
  }
}

TEST(Lanes, AccelerationsOnObstaclesThatEndAreThoseOfTheSceneDynamics) {
  BothDynamics both(false);
  both.scene.obstacles.clear();
  both.scene.obstacles.push_back(
      {"box", Shape<Plane>::Box({0.2, -0.3}, Plane::RotationBy(1, 0.2), Plane::Vector(0.3, 0.4))});
  both.scene.obstacles.push_back({"disc", Shape<Plane>::Sphere({-0.3, 0.2}, 0.2)});
  both.scene.obstacles.push_back(
      {"rail", Shape<Plane>::Capsule({0.1, 0.6}, Plane::RotationBy(1, -0.4), 0.3, 0.05)});
  both.lanes = MakeLaneScene(both.scene, {.viscous_friction_nm_s_per_rad = 0});
  both.one = std::make_unique<SceneDynamics>(both.scene);
  LaneDynamics<double> lanes(both.lanes.model, both.lanes.robot);
  std::mt19937_64 random(5);
  int touching = 0, inside = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    LaneState<double> state = both.Place(random);
    state.q[0] = both.one->q[0] = Uniform(random, -0.5, 0.5);
    both.one->Touch();
    LaneDynamics<double>::Numbers tau{}, qdd{};
    both.one->tau.fill(0);
    both.one->Solve();
    lanes.Accelerate(state, tau, qdd);
    double force = 0;
    for (const auto& contact : both.one->contact->active()) {
      force += contact.normal_force_n;
      inside += contact.depth_m > 0.05 ? 1 : 0;
    }
    touching += force > 0 ? 1 : 0;
    EXPECT_NEAR(lanes.normal_force(), force, 1e-9 * (1 + force));
    for (std::size_t i = 0; i < 5; ++i)
      EXPECT_NEAR(qdd[i], both.one->qdd[i], 1e-9 * (1 + std::abs(both.one->qdd[i]) + force)) << i;
  }
  EXPECT_GT(touching, 200);
  EXPECT_GT(inside, 20);
}

TEST(Lanes, TorquesOfPrescribedJointsAreThoseOfTheSceneDynamics) {
  BothDynamics both(true);
  LaneDynamics<double> lanes(both.lanes.model, both.lanes.robot);
  std::mt19937_64 random(4);
  for (int trial = 0; trial < 500; ++trial) {
    const LaneState<double> state = both.Place(random);
    LaneDynamics<double>::Numbers tau{}, qdd{};
    both.one->tau.fill(0);
    for (std::size_t i = 3; i < 5; ++i) both.one->qdd[i] = qdd[i] = Uniform(random, -300, 300);
    both.one->Solve();
    lanes.AcceleratePrescribed(state, tau, qdd);
    const double scale = 1 + lanes.normal_force();
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_NEAR(qdd[i], both.one->qdd[i], 1e-8 * (scale + std::abs(qdd[i]))) << i;
    for (std::size_t i = 3; i < 5; ++i) EXPECT_NEAR(tau[i], both.one->tau[i], 1e-8 * scale) << i;
  }
}

TEST(Lanes, ANominalRobotEndsWhereTheShippedPlanEndsAtAFineStep) {
  const PrimitiveFile file = HandstandFile();
  const LaneScene scene =
      MakeLaneScene(TaskOf(file).problem.scene, {.viscous_friction_nm_s_per_rad = 0});
  const double step_s = 2e-5;
  std::vector<LaneSetpoint<double>> setpoints;
  for (int k = 0; k * step_s < file.primitive.duration_s + 2; ++k) {
    for (const JointMotion<double>& joint : file.primitive.motions()) {
      const auto at = joint.position.Evaluate(step_s * k);
      const bool moves = step_s * k < file.primitive.duration_s;
      setpoints.push_back({at.value, moves ? at.first : 0, moves ? at.second : 0});
    }
  }
  LaneState<double> state = EntryState(file);
  LaneWatch<double> watch{};
  std::vector<double> torques(setpoints.size());
  OneRobotKernel().prescribe(scene.model, scene.robot, step_s, setpoints, state, watch, torques);
  EXPECT_NEAR(state.q[0], file.exit.root_x_m, 1e-3);
  EXPECT_NEAR(state.q[1], file.exit.root_z_m, 1e-4);
  EXPECT_NEAR(state.q[2], file.exit.root_pitch_rad, 2e-3);
}

TEST(Lanes, TheClassicalMethodIsOfTheFourthOrder) {
  // In the air, with setpoints that act at once, so that nothing jumps within a step.
  BothDynamics both(false);
  LaneRobot<double> robot = both.lanes.robot;
  for (auto& joint : robot.joints) {
    joint.delay = 0;
    joint.kp = 20;
    joint.kd = 0.5;
    joint.torque_max = 100;
  }
  const std::vector<LaneSetpoint<double>> ticks(40, {0.5, 0, 0});
  const auto pitch_after = [&](int per_tick) {
    LaneState<double> state{};
    state.q[1] = 5;
    state.v = {0, 0, 2, 1, -1};
    HeldSetpoints<double> held{};
    OneRobotKernel().drive_classically(
        both.lanes.model, robot, {.tick_s = 1e-2, .per_tick = per_tick}, ticks, held, state, 1);
    return state.q[2];
  };
  const double fine = pitch_after(128), coarse_error = pitch_after(8) - fine;
  EXPECT_GT(std::abs(coarse_error), 1e-12);
  EXPECT_NEAR(std::abs(coarse_error / (pitch_after(16) - fine)), 16, 3);
}

TEST(Lanes, ASetpointActsFromItsTickAndTheJointsDelayOn) {
  BothDynamics both(false);
  LaneRobot<double> robot = both.lanes.robot;
  robot.gravity_z = 0;
  for (auto& joint : robot.joints) joint.kp = joint.kd = joint.viscous_friction = 0;
  const auto velocity_after_a_tick = [&](double delay_s) {
    for (auto& joint : robot.joints) joint.delay = delay_s;
    LaneState<double> state{};
    state.q[1] = 5;
    HeldSetpoints<double> held{};
    LaneWatch<double> watch{};
    const std::vector<LaneSetpoint<double>> tick = {{0, 0, 1.0}, {0, 0, 0.0}};
    OneRobotKernel().drive(both.lanes.model, robot, {.tick_s = 1e-3, .per_tick = 4}, tick, held,
                           state, watch);
    EXPECT_EQ(held[0].third, 1.0);
    return state.v[3];
  };
  const double at_once = velocity_after_a_tick(0);
  EXPECT_GT(at_once, 0.1);
  EXPECT_NEAR(velocity_after_a_tick(0.5e-3), at_once / 2, 0.01 * at_once);
  EXPECT_EQ(velocity_after_a_tick(1e-3), 0);
}

TEST(Lanes, SinesAndCosinesAreThoseOfTheMathematicalLibraryToRounding) {
  std::mt19937_64 random(5);
  for (int trial = 0; trial < 20000; ++trial) {
    const double angle = Uniform(random, -1, 1) * std::pow(10.0, Uniform(random, -3, 4));
    const SineAndCosine<double> both(angle);
    ASSERT_NEAR(both.sine, std::sin(angle), 3e-16) << angle;
    ASSERT_NEAR(both.cosine, std::cos(angle), 3e-16) << angle;
  }
  for (int quarter = -8; quarter <= 8; ++quarter) {
    const SineAndCosine<double> both(quarter * std::numbers::pi / 2);
    EXPECT_NEAR(both.sine, std::sin(quarter * std::numbers::pi / 2), 1e-15);
    EXPECT_NEAR(both.cosine, std::cos(quarter * std::numbers::pi / 2), 1e-15);
  }
}

TEST(Lanes, SinesAndCosinesForRankingAreRightToSinglePrecision) {
  using Four = Vector<4, float>;
  std::mt19937_64 random(6);
  double worst = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    WidePacket angles;
    for (std::size_t lane = 0; lane < WidePacket::kLanes; ++lane)
      angles.set_lane(lane, Uniform(random, -1, 1) * std::pow(10.0, Uniform(random, -3, 3)));
    const SineAndCosine<Four> both(Four::Of(angles, 4));
    for (std::size_t lane = 0; lane < Four::kLanes; ++lane) {
      const double angle = angles.lane(4 + lane);
      worst = std::max(worst, std::abs(both.sine.numbers[lane] - std::sin(angle)));
      worst = std::max(worst, std::abs(both.cosine.numbers[lane] - std::cos(angle)));
    }
  }
  EXPECT_LT(worst, 1.5e-7);
}

std::string RefusalOf(const Scene& scene) {
  try {
    MakeLaneScene(scene, {});
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(Lanes, AScenePartThatLanesDoNotHaveIsRefusedByName) {
  Scene scene = HandstandProblem().scene;
  EXPECT_EQ(RefusalOf(scene), "");
  scene.obstacles.push_back({"stone", Shape<Plane>::Sphere({0, 0}, 0.1)});
  EXPECT_EQ(RefusalOf(scene), "");
  scene.robot.shapes.front().shape.half_extents[0] = 0.01;
  EXPECT_NE(RefusalOf(scene).find("'stone' is no half-space"), std::string::npos);
  EXPECT_NE(RefusalOf(scene).find("is no sphere"), std::string::npos);
  scene.obstacles.pop_back();
  EXPECT_EQ(RefusalOf(scene), "");
  scene.robot.tree.dofs[4].kind = JointKind::kPrismatic;
  EXPECT_NE(RefusalOf(scene).find("'leg2' is prismatic"), std::string::npos);
}

}  // namespace
}  // namespace tumbler
