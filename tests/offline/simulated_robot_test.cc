// A simulated robot with its drives and every setting of a twin file, compared with mechanics and
// heat flow.

#include "offline/twin/simulated_robot.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "firmware_interface/devices/mit.h"
#include "firmware_interface/devices/xsens_mti.h"
#include "tests/support/files.h"
#include "tests/support/nominal_gait.h"

namespace tumbler {
namespace {

using testing::Gait;
using testing::kGravity;
using testing::kMass;
using testing::kMs;

DrivesConfig Drives() {
  DrivesConfig drives = LoadDrives(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
  for (DriveEntry& entry : drives.drives) entry.watchdog_s = 0;
  return drives;
}

/// The robot, and a host that speaks the MIT protocol with it.
struct RobotRig {
  explicit RobotRig(const SimulatedRobotConfig& config = {},
                    const DrivesConfig& drives_in = Drives())
      : drives(drives_in), robot(Gait(), drives, config), host(robot.bus().Attach()) {}

  void Send(std::size_t joint, const ImpedanceCommand& command) {
    ASSERT_EQ(host.Send(EncodeMitCommand(Mit(joint), command)), Status::kOk);
  }
  void Magic(MitMagic magic) {
    for (std::size_t j = 0; j < 2; ++j)
      ASSERT_EQ(host.Send(MitMagicFrame(Mit(j), magic)), Status::kOk);
  }
  [[nodiscard]] const MitConfig& Mit(std::size_t joint) const {
    return std::get<MitConfig>(drives.drives[joint].config);
  }
  /// Holds both legs at these angles from now on.
  void HoldAt(float leg1_rad, float leg2_rad) {
    Send(0, {.position_rad = leg1_rad, .kp_nm_per_rad = 200, .kd_nm_s_per_rad = 4});
    Send(1, {.position_rad = leg2_rad, .kp_nm_per_rad = 200, .kd_nm_s_per_rad = 4});
    Magic(MitMagic::kEnter);
  }
  void HoldHome() { HoldAt(-1.5707963F, 1.5707963F); }

  DrivesConfig drives;
  SimulatedRobot robot;
  SimulatedPort& host;
};

/// A robot high above the ground, where only gravity and pushes act.
SimulatedRobotConfig Aloft() {
  SimulatedRobotConfig config;
  PrimitivePose start = StartOf(Gait().file());
  start.root_z_m = 50;
  config.start = start;
  return config;
}

TEST(SimulatedRobot, TheSensorMeasuresAgainstGravityAndNotAgainstAGroundThatRises) {
  const auto measured_pitch_rad = [](double slope_rad) {
    SimulatedRobotConfig config = Aloft();
    config.scene = Gait().scene();
    Tilt(config.scene->robot, slope_rad);
    RobotRig rig(config,
                 LoadDrives(testing::SourcePath("primitives/robots/tumbler_drives_sensor.toml")));
    XsensMti sensor;
    rig.robot.AdvanceTo(20 * kMs);
    ReceivedFrame received;
    while (rig.host.Receive(received) == Status::kOk) sensor.Decode(received.frame);
    const std::array<float, 4>& attitude = sensor.reading().attitude;  // about -y
    return -2 * std::atan2(attitude[2], attitude[0]);
  };
  const double flat = measured_pitch_rad(0);
  EXPECT_NEAR(measured_pitch_rad(0.1) - flat, 0.1, 1e-3);
  EXPECT_NEAR(measured_pitch_rad(-0.2) - flat, -0.2, 1e-3);
}

TEST(SimulatedRobot, IsHeldUntilAllDrivesAreEnabledAndPutBackWhenItIsPickedUp) {
  RobotRig rig(Aloft());
  rig.robot.AdvanceTo(500 * kMs);
  EXPECT_TRUE(rig.robot.state().held);
  EXPECT_EQ(rig.robot.state().root_z_m, 50);
  EXPECT_EQ(rig.host.Send(MitMagicFrame(rig.Mit(0), MitMagic::kEnter)), Status::kOk);
  rig.robot.AdvanceTo(600 * kMs);
  EXPECT_TRUE(rig.robot.state().held) << "one of two";
  rig.HoldHome();
  rig.robot.AdvanceTo(1000 * kMs);
  EXPECT_FALSE(rig.robot.state().held);
  EXPECT_LT(rig.robot.state().root_z_m, 49.5);
  rig.Magic(MitMagic::kExit);
  rig.robot.AdvanceTo(1010 * kMs);
  EXPECT_FALSE(rig.robot.state().held) << "torque off does not hold it again";
  rig.robot.PutBack();
  rig.robot.AdvanceTo(1500 * kMs);
  EXPECT_TRUE(rig.robot.state().held);
  EXPECT_EQ(rig.robot.state().root_z_m, 50);
  EXPECT_EQ(rig.robot.state().root_vz_m_s, 0);
}

TEST(SimulatedRobot, ItsMotorsAreAsTheDrivesFileSaysUnlessTheTwinFileSaysOtherwise) {
  const auto joints_of = [](const SimulatedRobotConfig& config, const MotorFacts& stated) {
    DrivesConfig drives = Drives();
    for (DriveEntry& drive : drives.drives) drive.motor = stated;
    RobotRig rig(config, drives);
    rig.HoldAt(-1.2F, 1.2F);
    rig.robot.AdvanceTo(50 * kMs);
    return rig.robot.state().joint_positions_rad;
  };
  const auto twin_of = [](const MotorFacts& motor) {
    SimulatedRobotConfig config = Aloft();
    config.motors.resize(2);
    for (JointMotor& of : config.motors) {
      of.torque_factor = motor.torque_factor;
      of.torque_time_constant_s = motor.torque_time_constant_s;
      of.velocity_filter_s = motor.velocity_filter_s;
    }
    return config;
  };
  const MotorFacts usual;
  for (const MotorFacts& stated :
       {MotorFacts{1.1, 0, 0}, MotorFacts{1, 1e-3, 0}, MotorFacts{1, 0, 3e-3}}) {
    EXPECT_EQ(joints_of(Aloft(), stated), joints_of(twin_of(stated), usual));
    EXPECT_EQ(joints_of(twin_of(usual), stated), joints_of(Aloft(), usual));
    EXPECT_NE(joints_of(Aloft(), stated), joints_of(Aloft(), usual));
  }
}

TEST(SimulatedRobot, APushGivesTheMomentumOfItsForceTimesItsDuration) {
  SimulatedRobotConfig config = Aloft();
  // The push acts at the robot's mass centre, where the legs (0.8 of 1.8 kg, 0.1 m below the
  // hinges) pull it. So the robot, whose legs are held stiffly, hardly turns.
  Push push{.link = "middle",
            .start_s = 0.1,
            .duration_s = 0.05,
            .since_enabled = true,
            .force_n = {36, 0, 0},
            .point_m = {0, 0, -0.1 * 0.8 / 1.8}};
  config.twin.pushes.push_back(push);
  RobotRig rig(config);
  rig.robot.AdvanceTo(200 * kMs);
  rig.HoldHome();
  rig.robot.AdvanceTo(299 * kMs);
  EXPECT_NEAR(rig.robot.state().root_vx_m_s, 0, 1e-4) << "the legs take hold";
  rig.robot.AdvanceTo(320 * kMs);
  EXPECT_EQ(rig.robot.state().push_n[0], 36);
  rig.robot.AdvanceTo(450 * kMs);
  EXPECT_EQ(rig.robot.state().push_n[0], 0);
  EXPECT_NEAR(rig.robot.state().root_vx_m_s, 36 * 0.05 / kMass, 0.02);
}

TEST(SimulatedRobot, APushOffTheMassCentreTurnsIt) {
  for (const double side : {1.0, -1.0}) {
    SimulatedRobotConfig config = Aloft();
    config.twin.pushes.push_back({.link = "middle",
                                  .start_s = 0,
                                  .duration_s = 0.05,
                                  .since_enabled = true,
                                  .force_n = {0, 0, 10},
                                  .point_m = {side * 0.15, 0, 0}});
    RobotRig rig(config);
    rig.HoldHome();
    rig.robot.AdvanceTo(100 * kMs);
    EXPECT_GT(side * rig.robot.state().root_pitch_rate_rad_s, 0.5);
  }
}

/// How far the standing robot slides when it is pushed along the ground.
double Slide(SimulatedRobotConfig config) {
  config.twin.pushes.push_back({.link = "middle",
                                .start_s = 0.2,
                                .duration_s = 0.3,
                                .since_enabled = true,
                                .force_n = {2, 0, 0},
                                .point_m = {0, 0, -0.15}});
  RobotRig rig(config);
  rig.HoldHome();
  rig.robot.AdvanceTo(1000 * kMs);
  return rig.robot.state().root_x_m;
}

TEST(SimulatedRobot, FrictionIsThatOfThePatchUnderTheFeet) {
  const double plain = Slide({});
  SimulatedRobotConfig ice;
  ice.twin.patches.push_back({.obstacle = "ground", .mu = 0.01});
  SimulatedRobotConfig elsewhere;
  elsewhere.twin.patches.push_back({.obstacle = "ground", .mu = 0.01, .from_x_m = 1, .to_x_m = 2});
  SimulatedRobotConfig sanded = ice;
  sanded.twin.patches.push_back({.obstacle = "ground", .mu = 0.3});
  EXPECT_LT(plain, 0.02);
  EXPECT_GT(Slide(ice), 0.1);
  EXPECT_EQ(Slide(elsewhere), plain);
  EXPECT_NEAR(Slide(sanded), plain, 1e-12) << "the last one counts, and the ground has 0.3";
}

TEST(SimulatedRobot, TheContactLawAndFurtherObstaclesAreThoseOfTheConfiguration) {
  SimulatedRobotConfig slippery;
  ContactLaw law;
  law.stiffness_n_per_m = 2.5e4;
  law.damping_n_s_per_m = 100;
  law.d_on_m = 0.01;
  law.d_off_m = 0.0075;
  law.mu = 0.01;
  slippery.twin.contact = law;
  EXPECT_GT(Slide(slippery), 0.1);

  SimulatedRobotConfig wall;
  wall.twin.contact = law;
  // The wall is 0.04 m beyond the feet, and a robot that slides on ice stops there.
  wall.twin.obstacles.push_back(
      {"wall", Shape<Plane>::Box({0.3 + 0.01 + 0.15 - 0.21, 0.05}, {}, {0.02, 0.05})});
  const double stopped = Slide(wall);
  EXPECT_LT(stopped, 0.06);
  EXPECT_LT(stopped, Slide(slippery) - 0.03);
}

TEST(SimulatedRobot, TheGroundCarriesTheWeightOfTheConfiguredMasses) {
  SimulatedRobotConfig heavy;
  heavy.twin.mass_factor = {{"middle", 1.5}, {"leg1_link", 2.0}};
  for (const auto& [config, mass] :
       {std::pair{SimulatedRobotConfig{}, kMass}, std::pair{heavy, 1.5 + 0.8 + 0.4}}) {
    RobotRig rig(config);
    rig.HoldHome();
    rig.robot.AdvanceTo(2000 * kMs);
    EXPECT_NEAR(rig.robot.state().normal_force_n, mass * kGravity, 0.02 * mass * kGravity);
    double sum = 0;
    for (const TwinContact& contact : rig.robot.contacts()) {
      EXPECT_EQ(contact.obstacle, "ground");
      EXPECT_TRUE(contact.link == "leg1_link" || contact.link == "leg2_link");
      sum += contact.normal_force_n;
    }
    EXPECT_NEAR(sum, rig.robot.state().normal_force_n, 1e-9);
  }
}

/// The rate of leg 1 in the air, a while after a kick has ended.
double RateAfterKick(const SimulatedRobotConfig& config) {
  RobotRig rig(config);
  rig.Send(0, {.torque_nm = 1.0F});
  rig.Magic(MitMagic::kEnter);
  rig.robot.AdvanceTo(20 * kMs);
  rig.Magic(MitMagic::kExit);
  rig.robot.AdvanceTo(150 * kMs);
  return rig.robot.state().joint_velocities_rad_s[0];
}

TEST(SimulatedRobot, DryFrictionStopsAFreeLegAndNeverDrivesIt) {
  SimulatedRobotConfig config = Aloft();
  config.twin.joints.assign(
      2, {.viscous_friction_nm_s_per_rad = 0, .dry_friction_nm = 0, .rotor_inertia_kg_m2 = {}});
  const double free = RateAfterKick(config);
  EXPECT_GT(free, 2);
  config.twin.joints.assign(
      2, {.viscous_friction_nm_s_per_rad = 0, .dry_friction_nm = 0.05, .rotor_inertia_kg_m2 = {}});
  const double slowed = RateAfterKick(config);
  EXPECT_LT(slowed, free - 0.5);
  config.twin.joints.assign(
      2, {.viscous_friction_nm_s_per_rad = 0, .dry_friction_nm = 0.5, .rotor_inertia_kg_m2 = {}});
  EXPECT_NEAR(RateAfterKick(config), 0, 0.01);
}

TEST(SimulatedRobot, ARotorOfMoreInertiaIsSlower) {
  SimulatedRobotConfig config = Aloft();
  const double light = RateAfterKick(config);
  config.twin.joints.assign(2, {});
  config.twin.joints[0].rotor_inertia_kg_m2 = 0.02;
  EXPECT_LT(RateAfterKick(config), 0.5 * light);
}

TEST(SimulatedRobot, ALegStopsAtItsLimitAndComesBackNoFasterThanItCame) {
  SimulatedRobotConfig config = Aloft();
  RobotRig rig(config);
  rig.Send(0, {.torque_nm = -3.0F});
  rig.Magic(MitMagic::kEnter);
  double lowest = 0, incoming = 0, outgoing = 0;
  for (int ms = 1; ms <= 300; ++ms) {
    rig.robot.AdvanceTo(ms * kMs);
    const TwinState state = rig.robot.state();
    const double rate = state.joint_velocities_rad_s[0];
    lowest = std::min(lowest, state.joint_positions_rad[0]);
    incoming = std::min(incoming, rate);
    outgoing = std::max(outgoing, rate);
  }
  EXPECT_LT(lowest, -2.9) << "it reached the stop";
  EXPECT_GT(lowest, -3.2);
  EXPECT_GT(outgoing, 0.1) << "it bounced";
  EXPECT_LT(outgoing, -incoming);
}

TEST(SimulatedRobot, TorqueIsLimitedToTheMotionsUnlessTheMotorSaysOtherwise) {
  for (const double limit : {0.0, 2.5}) {
    SimulatedRobotConfig config = Aloft();
    config.motors.resize(2);
    if (limit > 0) config.motors[0].torque_max_nm = limit;
    RobotRig rig(config);
    rig.Send(0, {.torque_nm = 17});
    rig.Magic(MitMagic::kEnter);
    rig.robot.AdvanceTo(5 * kMs);
    EXPECT_NEAR(rig.robot.state().joint_torques_nm[0], limit > 0 ? limit : 8, 1e-4);
  }
}

TEST(SimulatedRobot, AGearBetweenDriveAndJointChangesNothingAtTheJoint) {
  SimulatedRobotConfig config = Aloft();
  config.motors.resize(2);
  config.motors[0].heating_k_per_nm2 = 10;
  config.motors[0].thermal_time_constant_s = 1;
  config.motors[0].base_speed_rad_s = 2;
  config.motors[0].no_load_speed_rad_s = 6;
  std::vector<double> rates, temperatures;
  for (const float ratio : {1.0F, -6.0F}) {
    DrivesConfig drives = Drives();
    MitConfig& mit = std::get<MitConfig>(drives.drives[0].config);
    mit.joint.direction = ratio < 0 ? -1.0F : 1.0F;
    mit.joint.gear_ratio = std::abs(ratio);
    RobotRig rig(config, drives);
    rig.Send(0, {.torque_nm = 17 / ratio});
    rig.Magic(MitMagic::kEnter);
    rig.robot.AdvanceTo(60 * kMs);
    rates.push_back(rig.robot.state().joint_velocities_rad_s[0]);
    temperatures.push_back(rig.robot.drive(0).temperature_c());
  }
  EXPECT_NEAR(rates[0], rates[1], 0.02);
  EXPECT_LT(rates[0], 6) << "no faster than without load";
  EXPECT_GT(rates[0], 2);
  EXPECT_NEAR(temperatures[0], temperatures[1], 0.1);
  EXPECT_GT(temperatures[0], 26);
}

TEST(SimulatedRobot, NeedsADriveForEachJointAndLinksAndObstaclesThatAreThere) {
  DrivesConfig one = Drives();
  one.drives.pop_back();
  EXPECT_THROW(SimulatedRobot(Gait(), one, {}), std::invalid_argument);
  SimulatedRobotConfig no_link;
  no_link.twin.pushes.push_back({.link = "tail", .start_s = 0, .duration_s = 1});
  EXPECT_THROW(SimulatedRobot(Gait(), Drives(), no_link), std::invalid_argument);
  SimulatedRobotConfig no_obstacle;
  no_obstacle.twin.patches.push_back({.obstacle = "lake", .mu = 0});
  EXPECT_THROW(SimulatedRobot(Gait(), Drives(), no_obstacle), std::invalid_argument);
  DrivesConfig swapped = Drives();
  std::swap(swapped.drives[0], swapped.drives[1]);
  EXPECT_EQ(SimulatedRobot(Gait(), swapped, {}).joints()[0], "leg1") << "found by name";
}

}  // namespace
}  // namespace tumbler
