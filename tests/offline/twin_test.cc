// The simulated robot, compared with mechanics: energy, weight, and time.

#include "offline/twin/twin.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "firmware_interface/devices/simulated_mit.h"
#include "offline/model/contact_law.h"
#include "offline/problem/task_toml.h"
#include "tests/support/nominal_gait.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using testing::kGravity;
using testing::kMass;
using testing::kMs;
using testing::LongHandstandTask;
using testing::Replaced;
using testing::ShippedRobot;

std::string StandingTask() { return LongHandstandTask(); }
std::string AloftTask() {
  return Replaced(LongHandstandTask(), "pitch_rad = 0.0", "pitch_rad = 0.0\nz_m = 100.0",
                  "[start]");
}

/// A primitive file with the parts that a twin reads.
PrimitiveFile FileOf(const std::string& task, double shift_x_m = 0) {
  PrimitiveFile file;
  file.provenance.task_toml = task;
  file.provenance.task_file = "task.toml";
  file.provenance.robot_urdf = ShippedRobot();
  file.provenance.robot_file = "robot.urdf";
  const Problem problem = ParseTask(task, "task.toml", ShippedRobot(), "robot.urdf").problem;
  file.entry = {problem.start_q[0] + shift_x_m,
                problem.start_q[1],
                problem.start_q[2],
                {problem.start_q[3], problem.start_q[4]}};
  file.primitive.joint_count = 2;
  file.primitive.joints[0].name = FixedString<32>("leg1");
  file.primitive.joints[1].name = FixedString<32>("leg2");
  return file;
}

/// The settings of a twin that nobody holds.
TwinConfig LetGo(TwinConfig::Steps steps = TwinConfig::Steps::kFixed) {
  TwinConfig config;
  config.held = false;
  config.steps = steps;
  return config;
}

/// A twin with two drives, and their host.
struct Rig {
  /// @param shift_x_m  how far from the task's own start the motion begins.
  explicit Rig(const std::string& task, const TwinConfig& config = LetGo(), double shift_x_m = 0)
      : host(bus.Attach()) {
    std::vector<SimulatedDrive*> pointers;
    for (std::uint16_t i = 0; i < 2; ++i) {
      SimulatedMitConfig drive;
      drive.mit.command_id = static_cast<std::uint16_t>(1 + i);
      drive.mit.reply_id = static_cast<std::uint16_t>(17 + i);
      drive.watchdog_s = 0;
      drive.torque_max_nm = 8;
      drive.encoder_step_rad = 0;
      drives.push_back(std::make_unique<SimulatedMitDrive>(drive));
      bus.Attach(*drives.back(), SimulatedMitDrive::PortConfig());
      pointers.push_back(drives.back().get());
    }
    const PrimitiveFile file = FileOf(task, shift_x_m);
    twin = std::make_unique<Twin>(TaskOf(file).problem.scene, file.entry, config, bus, pointers);
  }
  void Command(std::size_t drive, const ImpedanceCommand& command) {
    ASSERT_EQ(host.Send(EncodeMitCommand(drives[drive]->config().mit, command)), Status::kOk);
  }
  void Magic(MitMagic magic) {
    for (const auto& drive : drives)
      ASSERT_EQ(host.Send(MitMagicFrame(drive->config().mit, magic)), Status::kOk);
  }
  void HoldHome() {
    Command(0, {.position_rad = -1.5707963F, .kp_nm_per_rad = 200, .kd_nm_s_per_rad = 4});
    Command(1, {.position_rad = 1.5707963F, .kp_nm_per_rad = 200, .kd_nm_s_per_rad = 4});
    Magic(MitMagic::kEnter);
  }

  SimulatedBus bus;
  SimulatedBus::Port& host;
  std::vector<std::unique_ptr<SimulatedMitDrive>> drives;
  std::unique_ptr<Twin> twin;
};

/// A rod of the shipped robot, computed from the state independently: its point and angle, and
/// their rates.
struct Rod {
  double x, z, angle, vx, vz, rate;
};

/// A point at distance r from a moving point, in the direction of an angle.
Rod Along(const Rod& from, double angle, double rate, double r) {
  return {from.x + r * std::cos(angle),         from.z + r * std::sin(angle),         angle,
          from.vx - r * rate * std::sin(angle), from.vz + r * rate * std::cos(angle), rate};
}

struct Robot {
  Rod middle, leg1, leg2;  ///< Their points are the mass centres.
  std::array<Rod, 6> spheres;
};

Robot RobotOf(const TwinState& s) {
  const Rod centre{s.root_x_m,    s.root_z_m,    s.root_pitch_rad,
                   s.root_vx_m_s, s.root_vz_m_s, s.root_pitch_rate_rad_s};
  Robot robot;
  robot.middle = centre;
  std::size_t sphere = 0;
  for (int leg = 0; leg < 2; ++leg) {
    const double side = leg == 0 ? 1 : -1;
    const double angle = s.root_pitch_rad + s.joint_positions_rad[static_cast<std::size_t>(leg)];
    const double rate =
        s.root_pitch_rate_rad_s + s.joint_velocities_rad_s[static_cast<std::size_t>(leg)];
    const Rod hinge = Along(centre, s.root_pitch_rad, s.root_pitch_rate_rad_s, side * 0.15);
    (leg == 0 ? robot.leg1 : robot.leg2) = Along(hinge, angle, rate, side * 0.1);
    robot.spheres[sphere++] = hinge;  // These are the ends of the middle link.
    const Rod end = Along(hinge, angle, rate, side * 0.2);
    for (const double across : {0.04, -0.04})
      robot.spheres[sphere++] = Along(end, angle + M_PI / 2, rate, across);
  }
  return robot;
}

double RodEnergy(const Rod& rod, double mass, double inertia) {
  return mass * kGravity * rod.z + 0.5 * mass * (rod.vx * rod.vx + rod.vz * rod.vz) +
         0.5 * inertia * rod.rate * rod.rate;
}

/// Kinetic energy, with that of the rotors, and potential energy in the field of gravity.
double MechanicalEnergy(const TwinState& s) {
  const Robot robot = RobotOf(s);
  double energy = RodEnergy(robot.middle, 1.0, 7.5e-3) +
                  RodEnergy(robot.leg1, 0.4, 1.3333333333333333e-3) +
                  RodEnergy(robot.leg2, 0.4, 1.3333333333333333e-3);
  for (const double rate : s.joint_velocities_rad_s) energy += 0.5 * 0.001 * rate * rate;
  return energy;
}

/// The energy in the springs of the contacts: the integral of the force of slow compression.
double SpringEnergy(const TwinState& s) {
  static const ContactLaw law =
      ParseTask(StandingTask(), "task.toml", ShippedRobot(), "robot.urdf").problem.scene.contact;
  const Robot robot = RobotOf(s);
  double energy = 0;
  for (std::size_t i = 0; i < robot.spheres.size(); ++i) {
    const double radius = i % 3 == 0 ? 0.03 : 0.01;
    const double d = robot.spheres[i].z - radius;
    constexpr int kSteps = 400;
    const double h = std::max(0.0, law.d_on_m - d) / kSteps;
    for (int k = 0; k < kSteps && h > 0; ++k)
      energy += h * EvaluateNormalForce(law, law.d_on_m - (k + 0.5) * h, 0).N;
  }
  return energy;
}

TEST(TwinMechanics, AFreeFallGainsSpeedAsGravitySays) {
  Rig rig(AloftTask());
  for (int ms = 100; ms <= 1000; ms += 100) {
    rig.twin->AdvanceTo(ms * kMs);
    const TwinState s = rig.twin->state();
    const double t = 1e-3 * ms;
    EXPECT_NEAR(s.root_vz_m_s, -kGravity * t, 1e-9);
    EXPECT_NEAR(s.root_z_m, 100 - 0.5 * kGravity * t * t, 1e-9);
    EXPECT_NEAR(s.root_x_m, 0, 1e-12);
    EXPECT_NEAR(s.root_pitch_rad, 0, 1e-12);
    EXPECT_EQ(s.normal_force_n, 0);
    EXPECT_EQ(s.peak_penetration_m, 0);
  }
}

/// Whether a flight keeps its energy and its momentum [kg m/s] so well.
void ExpectKept(TwinConfig config, double energy_share, double momentum_kg_m_s) {
  config.joints.assign(
      2, {.viscous_friction_nm_s_per_rad = 0, .dry_friction_nm = 0, .rotor_inertia_kg_m2 = {}});
  config.stop_stiffness_nm_per_rad = config.stop_damping_nm_s_per_rad = 0;
  Rig rig(AloftTask(), config);
  rig.Command(0, {.torque_nm = 1.0F});
  rig.Command(1, {.torque_nm = -0.4F});
  rig.Magic(MitMagic::kEnter);
  rig.twin->AdvanceTo(100 * kMs);
  rig.Magic(MitMagic::kExit);
  rig.twin->AdvanceTo(110 * kMs);
  const TwinState kicked = rig.twin->state();
  ASSERT_GT(std::abs(kicked.joint_velocities_rad_s[0]), 5);
  ASSERT_EQ(kicked.joint_torques_nm, (std::vector<double>{0, 0}));
  const auto momentum = [](const TwinState& s) {
    const Robot r = RobotOf(s);
    return r.middle.vx + 0.4 * (r.leg1.vx + r.leg2.vx);
  };
  const double energy = MechanicalEnergy(kicked);
  for (int ms = 120; ms <= 1000; ms += 10) {
    rig.twin->AdvanceTo(ms * kMs);
    EXPECT_NEAR(MechanicalEnergy(rig.twin->state()), energy, energy_share * energy) << ms;
    EXPECT_NEAR(momentum(rig.twin->state()), 0, momentum_kg_m_s) << ms;
  }
}

TEST(TwinMechanics, AFlightWithLimpDrivesAndNoFrictionKeepsEnergyAndMomentum) {
  ExpectKept(LetGo(), 1e-5, 1e-6);
  ExpectKept(LetGo(TwinConfig::Steps::kErrorBound), 1e-4, 1e-4);
}

TEST(TwinMechanics, BearingFrictionTakesEnergyAway) {
  Rig rig(AloftTask());
  rig.Command(0, {.torque_nm = 1.0F});
  rig.Magic(MitMagic::kEnter);
  rig.twin->AdvanceTo(100 * kMs);
  rig.Magic(MitMagic::kExit);
  rig.twin->AdvanceTo(110 * kMs);
  double before = MechanicalEnergy(rig.twin->state());
  const double first = before;
  for (int ms = 120; ms <= 400; ms += 10) {
    rig.twin->AdvanceTo(ms * kMs);
    const double now = MechanicalEnergy(rig.twin->state());
    EXPECT_LT(now, before + 1e-9) << ms;
    before = now;
  }
  EXPECT_LT(before, first - 0.01);
}

TEST(TwinMechanics, ACollapseOntoTheGroundNeverGainsEnergy) {
  // The legs are limp from the start. They fold, and the robot lands on its middle link.
  std::string task = Replaced(StandingTask(), "leg1 = -1.5707963267948966", "leg1 = -1.3");
  task = Replaced(task, "leg2 = 1.5707963267948966", "leg2 = 1.2");
  Rig rig(task);
  double before = MechanicalEnergy(rig.twin->state()) + SpringEnergy(rig.twin->state());
  const double first = before;
  for (int ms = 1; ms <= 1500; ++ms) {
    rig.twin->AdvanceTo(ms * kMs);
    const TwinState s = rig.twin->state();
    const double now = MechanicalEnergy(s) + SpringEnergy(s);
    ASSERT_LT(now, before + 1e-5) << ms << " ms";
    before = now;
  }
  EXPECT_LT(before, first - 1) << "it should have fallen";
  EXPECT_GT(rig.twin->state().root_z_m, 0.02) << "it lies on the ground, not in it";
}

TEST(TwinMechanics, TheHardestImpactIsTheSpeedWithWhichARobotMeetsTheGroundUntilItIsForgotten) {
  for (const double height_m : {0.3, 0.5, 1.0}) {
    Rig rig(Replaced(LongHandstandTask(), "pitch_rad = 0.0",
                     "pitch_rad = 0.0\nz_m = " + std::to_string(height_m), "[start]"));
    double fallen_m_s = 0;
    std::int64_t time_ns = 0;
    while (rig.twin->state().normal_force_n == 0 && time_ns < 1000 * kMs) {
      EXPECT_EQ(rig.twin->state().impact_m_s, 0);
      EXPECT_EQ(rig.twin->state().impact_link, "");
      fallen_m_s = -rig.twin->state().root_vz_m_s;
      rig.twin->AdvanceTo(time_ns += kMs / 5);
    }
    ASSERT_GT(fallen_m_s, 1);
    rig.twin->AdvanceTo(time_ns += 2 * kMs);
    // Both feet fall as the root does. One more step makes them faster by 2 mm/s.
    EXPECT_NEAR(rig.twin->state().impact_m_s, fallen_m_s, 0.004);
    EXPECT_EQ(rig.twin->state().impact_link.substr(0, 3), "leg");
    rig.twin->ForgetImpacts();
    EXPECT_EQ(rig.twin->state().impact_m_s, 0);
    EXPECT_EQ(rig.twin->state().impact_link, "");
    // The limp robot comes down with its middle at last.
    rig.twin->AdvanceTo(time_ns += 2000 * kMs);
    EXPECT_GT(rig.twin->state().impact_m_s, 0.5);
  }
}

TEST(TwinMechanics, HeldAtHomeItStandsAndTheGroundCarriesItsWeight) {
  Rig rig(StandingTask());
  const TwinState start = rig.twin->state();
  rig.HoldHome();
  for (int ms = 100; ms <= 3000; ms += 100) {
    rig.twin->AdvanceTo(ms * kMs);
    const TwinState s = rig.twin->state();
    EXPECT_NEAR(s.root_pitch_rad, 0, 0.01);
    EXPECT_NEAR(s.root_z_m, start.root_z_m, 0.002);
    EXPECT_NEAR(s.root_x_m, 0, 0.005);
    if (ms >= 500) {
      EXPECT_NEAR(s.normal_force_n, kMass * kGravity, 0.01 * kMass * kGravity) << ms;
    }
  }
  EXPECT_LT(rig.twin->state().peak_penetration_m, 0.004);
}

TEST(TwinMechanics, TheStartIsThePrimitivesEntry) {
  EXPECT_EQ(Rig(StandingTask(), LetGo(), 0.25).twin->state().root_x_m, 0.25);
  const TwinState s = Rig(StandingTask()).twin->state();
  EXPECT_EQ(s.time_ns, 0);
  EXPECT_NEAR(s.joint_positions_rad[0], -M_PI / 2, 1e-12);
  EXPECT_NEAR(s.joint_positions_rad[1], M_PI / 2, 1e-12);
  // The feet are spheres of 10 mm, 0.2 m below the hinges, in a layer of 10 mm.
  EXPECT_GT(s.root_z_m, 0.21);
  EXPECT_LT(s.root_z_m, 0.22);
  EXPECT_NEAR(s.root_pitch_rad, 0, 1e-6);
}

void ExpectSame(const TwinState& a, const TwinState& b) {
  EXPECT_EQ(a.time_ns, b.time_ns);
  EXPECT_EQ(a.root_x_m, b.root_x_m);
  EXPECT_EQ(a.root_z_m, b.root_z_m);
  EXPECT_EQ(a.root_pitch_rad, b.root_pitch_rad);
  EXPECT_EQ(a.root_vx_m_s, b.root_vx_m_s);
  EXPECT_EQ(a.root_vz_m_s, b.root_vz_m_s);
  EXPECT_EQ(a.root_pitch_rate_rad_s, b.root_pitch_rate_rad_s);
  EXPECT_EQ(a.joint_positions_rad, b.joint_positions_rad);
  EXPECT_EQ(a.joint_velocities_rad_s, b.joint_velocities_rad_s);
  EXPECT_EQ(a.joint_torques_nm, b.joint_torques_nm);
  EXPECT_EQ(a.peak_penetration_m, b.peak_penetration_m);
}

TEST(TwinTime, OneAdvanceAndManyOfWholeStepsGiveTheSameState) {
  Rig one(StandingTask());
  Rig many(StandingTask());
  for (Rig* rig : {&one, &many}) {
    rig->Command(0, {.position_rad = -1.2F, .kp_nm_per_rad = 100, .kd_nm_s_per_rad = 2});
    rig->Command(1, {.position_rad = 1.9F, .kp_nm_per_rad = 100, .kd_nm_s_per_rad = 2});
    rig->Magic(MitMagic::kEnter);
  }
  one.twin->AdvanceTo(300 * kMs);
  std::int64_t time = 0;
  for (int i = 0; time < 300 * kMs; ++i) {
    time = std::min<std::int64_t>(time + 50'000LL * (1 + i % 7), 300 * kMs);
    many.twin->AdvanceTo(time);
  }
  EXPECT_GT(std::abs(one.twin->state().joint_positions_rad[0] + M_PI / 2), 0.1) << "it moved";
  ExpectSame(one.twin->state(), many.twin->state());
}

TEST(TwinTime, TheSameCallsGiveTheSameStateAndThePastChangesNothing) {
  Rig a(StandingTask());
  Rig b(StandingTask());
  for (Rig* rig : {&a, &b}) {
    rig->HoldHome();
    for (int ms = 1; ms <= 200; ++ms) rig->twin->AdvanceTo(ms * kMs + 12'345);
  }
  ExpectSame(a.twin->state(), b.twin->state());
  b.twin->AdvanceTo(5 * kMs);
  ExpectSame(a.twin->state(), b.twin->state());
}

TEST(TwinTime, StepsWithinTheErrorBoundAndHalvesOfFixedOnesHardlyChangeTheMotion) {
  TwinConfig fine = LetGo();
  fine.step_ns = 12'500;
  Rig coarse(StandingTask());
  Rig bounded(StandingTask(), LetGo(TwinConfig::Steps::kErrorBound));
  Rig other(StandingTask(), fine);
  for (Rig* rig : {&coarse, &bounded, &other}) {
    rig->Command(0, {.position_rad = -1.2F, .kp_nm_per_rad = 100, .kd_nm_s_per_rad = 2});
    rig->Command(1, {.position_rad = 1.9F, .kp_nm_per_rad = 100, .kd_nm_s_per_rad = 2});
    rig->Magic(MitMagic::kEnter);
    rig->twin->AdvanceTo(300 * kMs);
  }
  for (Rig* rig : {&coarse, &bounded}) {
    EXPECT_NEAR(rig->twin->state().root_pitch_rad, other.twin->state().root_pitch_rad, 1e-3);
    EXPECT_NEAR(rig->twin->state().root_x_m, other.twin->state().root_x_m, 1e-3);
  }
}

TEST(TwinTime, StepsWithinTheErrorBoundLetARobotRestThatItsDrivesDampHard) {
  // In fixed steps of 1 ms kd 5 is unstable: docs/driving.md.
  Rig rig(StandingTask(), LetGo(TwinConfig::Steps::kErrorBound));
  rig.Command(0, {.position_rad = -1.5708F, .kp_nm_per_rad = 100, .kd_nm_s_per_rad = 5});
  rig.Command(1, {.position_rad = 1.5708F, .kp_nm_per_rad = 100, .kd_nm_s_per_rad = 5});
  rig.Magic(MitMagic::kEnter);
  rig.twin->AdvanceTo(1000 * kMs);
  for (int ms = 1000; ms <= 1500; ++ms) {
    rig.twin->AdvanceTo(ms * kMs);
    for (const double rate : rig.twin->state().joint_velocities_rad_s)
      EXPECT_LT(std::abs(rate), 2e-3) << ms;
  }
}

TEST(TwinTime, APushInTheMiddleOfALongStepActsFromItsStartToItsEnd) {
  TwinConfig config = LetGo(TwinConfig::Steps::kErrorBound);
  config.pushes.push_back({.link = "middle",
                           .start_s = 0.0123456,
                           .duration_s = 0.0200001,
                           .since_enabled = false,
                           .force_n = {6, 0, 0},
                           .point_m = {0, 0}});
  Rig rig(AloftTask(), config);
  rig.twin->AdvanceTo(60 * kMs);
  const Robot r = RobotOf(rig.twin->state());
  // Middle and two legs, 1 and 0.4 kg.
  EXPECT_NEAR(r.middle.vx + 0.4 * (r.leg1.vx + r.leg2.vx), 6 * 0.0200001, 1e-6);
}

/// A drive on a bus, enabled, which has got a setpoint.
struct EnabledDrive {
  EnabledDrive(SimulatedMitConfig config, const ImpedanceCommand& setpoint)
      : host(bus.Attach()), drive(Numbered(config)) {
    drive.AttachTo(bus);
    const MitConfig& mit = drive.config().mit;
    EXPECT_EQ(host.Send(MitMagicFrame(mit, MitMagic::kEnter)), Status::kOk);
    EXPECT_EQ(host.Send(EncodeMitCommand(mit, setpoint)), Status::kOk);
    bus.AdvanceTo(1 * kMs);
    EXPECT_TRUE(drive.enabled());
  }
  static SimulatedMitConfig Numbered(SimulatedMitConfig config) {
    config.mit.command_id = 1;
    config.mit.reply_id = 17;
    return config;
  }
  SimulatedBus bus;
  SimulatedPort& host;
  SimulatedMitDrive drive;
};

TEST(TwinDrives, ATorqueWithinAStepIsThatOfTheStepThatWouldBeThere) {
  struct Loop {
    double lag_s, filter_s, factor;
  };
  for (const Loop& loop :
       {Loop{0, 0, 1}, Loop{1e-3, 0, 1}, Loop{0, 3e-3, 1}, Loop{1e-3, 1e-3, 1.1}}) {
    SimulatedMitConfig config;
    config.encoder_step_rad = 0;
    config.torque_max_nm = 5;
    config.base_speed_rad_s = 8;
    config.no_load_speed_rad_s = 20;
    config.torque_time_constant_s = loop.lag_s;
    config.velocity_filter_s = loop.filter_s;
    config.torque_factor = loop.factor;
    EnabledDrive of(config, {1, 2, 30, 1, 0.5F});
    std::mt19937 random(3);
    std::uniform_real_distribution<double> position(-2, 2), velocity(-15, 15);
    double least = 10, most = -10;
    for (std::int64_t t = 1 * kMs; t < 20 * kMs; t += 100'000) {
      of.drive.Step(t, position(random), velocity(random));
      const double q = position(random), v = velocity(random);
      const double told = of.drive.TorqueAt(t + 50'000, q, v);
      EXPECT_NEAR(told, of.drive.Step(t + 50'000, q, v), 1e-12);
      least = std::min(least, told);
      most = std::max(most, told);
    }
    EXPECT_GT(most - least, 0.5) << "it varies";
  }
}

TEST(TwinDrives, WhatAnEncoderDoesNotResolveStaysWithinAStep) {
  SimulatedMitConfig config;
  config.encoder_step_rad = 0.01;
  EnabledDrive of(config, {0, 0, 100, 1, 0});
  const double torque = of.drive.Step(1 * kMs, 0.0175, 0);
  EXPECT_NEAR(torque, -100 * 0.01, 0.05) << "of the angle that the encoder reads";
  EXPECT_EQ(of.drive.TorqueAt(1 * kMs + 50'000, 0.0175, 0), torque);
  EXPECT_NEAR(of.drive.TorqueAt(1 * kMs + 50'000, 0.0225, 0), torque - 100 * 0.005, 0.05);
}

/// Notes when frames come.
class Listener final : public SimulatedNode {
 public:
  void OnFrame(const ReceivedFrame& received, SimulatedPort& /*port*/) noexcept override {
    if (Heeds(received.frame)) heard_ns.push_back(received.time_ns);
  }
  [[nodiscard]] bool Heeds(const CanFrame& frame) const noexcept override {
    return frame.id % 3 == 0;
  }
  std::vector<std::int64_t> heard_ns;
};

TEST(TwinDrives, NoNodeHeedsAFrameBeforeTheTimeThatTheBusForetells) {
  SimulatedBus bus;
  Listener listener;
  bus.Attach(listener);
  SimulatedPort& one = bus.Attach();
  SimulatedPort& other = bus.Attach();
  std::mt19937 random(5);
  int exact = 0;
  for (int i = 0; i < 2000; ++i) {
    for (SimulatedPort* port : {&one, &other}) {
      if (random() % 3 != 0) continue;
      CanFrame frame;
      frame.id = random() % 64;
      frame.size = static_cast<std::uint8_t>(random() % 9);
      for (std::uint8_t& byte : frame.data) byte = static_cast<std::uint8_t>(random());
      static_cast<void>(port->SendAfter(static_cast<std::int64_t>(random() % 200'000), frame));
    }
    const std::int64_t end_ns = bus.now_ns() + static_cast<std::int64_t>(random() % 400'000);
    while (bus.now_ns() < end_ns) {
      const std::int64_t foretold_ns = bus.NextDelivery();
      const std::size_t heard = listener.heard_ns.size();
      ASSERT_GT(foretold_ns, bus.now_ns());
      if (foretold_ns > end_ns) {
        bus.AdvanceTo(end_ns);
        ASSERT_EQ(listener.heard_ns.size(), heard);
        break;
      }
      bus.AdvanceTo(foretold_ns - 1);
      ASSERT_EQ(listener.heard_ns.size(), heard);
      bus.AdvanceTo(foretold_ns);
      if (listener.heard_ns.size() > heard) ++exact;
    }
  }
  EXPECT_EQ(static_cast<std::size_t>(exact), listener.heard_ns.size());
  EXPECT_GT(exact, 200);
}

TEST(TwinSetUp, NeedsADriveForEveryJointAndAPositiveStep) {
  SimulatedBus bus;
  const PrimitiveFile file = FileOf(StandingTask());
  const Scene scene = TaskOf(file).problem.scene;
  EXPECT_THROW(Twin(scene, file.entry, {}, bus, {}), std::invalid_argument);
  SimulatedMitConfig config;
  SimulatedMitDrive drive(config);
  TwinConfig no_step;
  no_step.step_ns = 0;
  EXPECT_THROW(Twin(scene, file.entry, no_step, bus, {&drive, &drive}), std::invalid_argument);
  EXPECT_THROW(Twin(scene, PrimitivePose{}, {}, bus, {&drive, &drive}), std::invalid_argument);
}

TEST(Twin, SaysHowFarTheRobotsOwnShapesOverlap) {
  Rig rig(AloftTask());
  rig.HoldHome();
  rig.twin->AdvanceTo(100 * kMs);
  EXPECT_EQ(rig.twin->state().self_overlap_m, 0);
  EXPECT_EQ(rig.twin->state().overlapping, "");
  // Both legs swing inwards, where they cross.
  rig.Command(0, {.position_rad = -2.8F, .kp_nm_per_rad = 200, .kd_nm_s_per_rad = 4});
  rig.Command(1, {.position_rad = 2.8F, .kp_nm_per_rad = 200, .kd_nm_s_per_rad = 4});
  rig.twin->AdvanceTo(1500 * kMs);
  const TwinState crossed = rig.twin->state();
  EXPECT_LT(crossed.joint_positions_rad[0], -2.7);
  EXPECT_GT(crossed.self_overlap_m, 0.01);
  EXPECT_NE(crossed.overlapping.find("leg1_link/"), std::string::npos);
  EXPECT_NE(crossed.overlapping.find(" and leg2_link/"), std::string::npos);
}

TEST(Twin, InAStandTheRootStaysInTheAirAndALegHangsWhereItsTorqueBalancesItsWeight) {
  TwinConfig config;
  config.stand_m = 0.5;
  Rig rig(StandingTask(), config);
  const TwinState before = rig.twin->state();
  EXPECT_TRUE(before.held);
  rig.Command(0, {.torque_nm = 0.2F});
  rig.Magic(MitMagic::kEnter);
  rig.twin->AdvanceTo(8000 * kMs);
  const TwinState after = rig.twin->state();
  EXPECT_TRUE(after.held);
  EXPECT_EQ(after.root_x_m, before.root_x_m);
  EXPECT_EQ(after.root_z_m, before.root_z_m);
  EXPECT_EQ(after.root_pitch_rad, before.root_pitch_rad);
  EXPECT_EQ(after.normal_force_n, 0);
  // 0.4 kg at 0.1 m from the joint; the drive's torque is rounded on the wire.
  const double torque_nm = rig.drives[0]->torque_nm();
  EXPECT_NEAR(torque_nm, 0.2, 0.005);
  EXPECT_NEAR(after.joint_positions_rad[0],
              -M_PI / 2 + std::asin(torque_nm / (0.4 * 0.1 * kGravity)), 1e-3);
  // The other drive's torque is that of the code nearest to zero.
  EXPECT_NEAR(after.joint_positions_rad[1], M_PI / 2, 0.02);
  EXPECT_NEAR(after.joint_velocities_rad_s[0], 0, 1e-4);
}

}  // namespace
}  // namespace tumbler
