#include "firmware_interface/devices/simulated_mit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "firmware_interface/devices/mit.h"
#include "tests/support/allocation_guard.h"

namespace tumbler {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;
constexpr std::int64_t kStepNs = 50'000;

MitConfig ConfigOf(int index) {
  MitConfig config;
  config.command_id = static_cast<std::uint16_t>(1 + index);
  config.reply_id = static_cast<std::uint16_t>(17 + index);
  return config;
}

SimulatedMitConfig Exact(int index) {
  SimulatedMitConfig config;
  config.mit = ConfigOf(index);
  return config;
}

/// A host with two drives on one bus, each moving a joint of 0.05 kg m^2.
class Rig {
 public:
  explicit Rig(SimulatedMitConfig first = Exact(0), SimulatedMitConfig second = Exact(1))
      : hosts{MitDrive(first.mit), MitDrive(second.mit)},
        drives{SimulatedMitDrive(first), SimulatedMitDrive(second)} {
    SimulatedBus::PortConfig logger;
    logger.listen_only = true;
    logger.receive_capacity = 100'000;
    log = &bus.Attach(logger);
    port = &bus.Attach();
    for (auto& drive : drives)
      drive_ports.push_back(&bus.Attach(drive, SimulatedMitDrive::PortConfig()));
  }

  /// One control cycle: the replies to the last one, setpoints, and a millisecond of bus and
  /// physics.
  void Tick(DriveRequest request, bool silent = false) {
    ReceivedFrame received;
    while (port->Receive(received) == Status::kOk) {
      for (auto& host : hosts) host.Decode(received.frame);
    }
    for (std::size_t i = 0; i < 2 && !silent; ++i) {
      FrameBatch batch;
      EXPECT_EQ(hosts[i].Encode(request, setpoints[i], batch), Status::kOk);
      for (const CanFrame& frame : batch.frames()) EXPECT_EQ(port->Send(frame), Status::kOk);
    }
    const std::int64_t end = bus.now_ns() + kTickNs;
    while (bus.now_ns() < end) {
      bus.AdvanceTo(bus.now_ns() + kStepNs);
      for (std::size_t i = 0; i < 2; ++i) {
        torques[i] = drives[i].Step(bus.now_ns(), q[i], w[i]);
        w[i] += torques[i] / 0.05 * 5e-5;
        q[i] += w[i] * 5e-5;
      }
    }
  }

  void Enable() {
    for (int i = 0; i < 10; ++i) Tick(DriveRequest::kEnable);
    EXPECT_EQ(hosts[0].state(), DriveState::kEnabled);
    EXPECT_EQ(hosts[1].state(), DriveState::kEnabled);
  }

  std::vector<ReceivedFrame> Log() {
    std::vector<ReceivedFrame> frames;
    ReceivedFrame received;
    while (log->Receive(received) == Status::kOk) frames.push_back(received);
    return frames;
  }

  SimulatedBus bus;
  MitDrive hosts[2];
  SimulatedMitDrive drives[2];
  SimulatedPort* log = nullptr;
  SimulatedPort* port = nullptr;
  std::vector<SimulatedPort*> drive_ports;
  DriveSetpoint setpoints[2];
  double q[2] = {0.3, -0.4};
  double w[2] = {0, 0};
  double torques[2] = {0, 0};
};

TEST(SimulatedDrives, EnableFollowAndReportOverOneBus) {
  Rig rig;
  for (int i = 0; i < 5; ++i) rig.Tick(DriveRequest::kDisable);
  EXPECT_EQ(rig.hosts[0].state(), DriveState::kDisabled);
  EXPECT_NEAR(rig.hosts[0].feedback().position_rad, 0.3F, 1e-3F);
  EXPECT_NEAR(rig.hosts[1].feedback().position_rad, -0.4F, 1e-3F);
  rig.Enable();
  EXPECT_TRUE(rig.drives[0].enabled());
  // Half a step of feed-forward torque, the code nearest to zero, accelerates the free joint a
  // little.
  EXPECT_NEAR(rig.q[0], 0.3, 1e-4) << "enabling moved the joint";
  rig.setpoints[0] = {0.5F, 0, 0, 200, 4};
  rig.setpoints[1] = {-1.0F, 0, 0, 200, 4};
  for (int i = 0; i < 1000; ++i) rig.Tick(DriveRequest::kEnable);
  // The rest position is off by the rounding of position, velocity and torque, divided by kp.
  EXPECT_NEAR(rig.q[0], 0.5, 1e-3);
  EXPECT_NEAR(rig.q[1], -1.0, 1e-3);
  EXPECT_NEAR(rig.hosts[0].feedback().position_rad, rig.q[0], 1e-3);
  EXPECT_NEAR(rig.hosts[1].feedback().position_rad, rig.q[1], 1e-3);
  EXPECT_EQ(rig.hosts[0].feedback().temperature_c, 25);
  for (int i = 0; i < 3; ++i) rig.Tick(DriveRequest::kDisable);
  EXPECT_EQ(rig.hosts[1].state(), DriveState::kDisabled);
  EXPECT_FALSE(rig.drives[1].enabled());
  EXPECT_EQ(rig.torques[1], 0);
}

TEST(SimulatedDrives, BusLoadOfTwoDrivesAtOneKilohertzLiesInThePublishedBounds) {
  Rig rig;
  for (int i = 0; i < 1000; ++i) rig.Tick(DriveRequest::kDisable);
  EXPECT_EQ(rig.bus.statistics().frames, 4000);
  EXPECT_EQ(rig.bus.statistics().collisions, 0);
  RecordProperty("load", std::to_string(rig.bus.load()));
  EXPECT_GE(rig.bus.load(), 0.444);
  EXPECT_LE(rig.bus.load(), 0.54);
  for (const SimulatedPort* port : rig.drive_ports) {
    EXPECT_EQ(port->statistics().sent, 1000);
    EXPECT_EQ(port->statistics().dropped_transmit, 0);
  }
}

TEST(SimulatedDrives, WithOneReplyIdentifierOneShotRepliesAreLostWhenTheyMeet) {
  SimulatedMitConfig first = Exact(0);
  SimulatedMitConfig second = Exact(1);
  first.mit.reply_id = second.mit.reply_id = 0;  // The firmware's default.
  // The second command ends one frame later than the first. With turnarounds that differ by as
  // much, both replies are ready at the same moment.
  SimulatedBus bus;
  first.turnaround_ns = 300'000;
  second.turnaround_ns = 300'000 - FrameBits(MitMagicFrame(second.mit, MitMagic::kExit)) * 1000;
  SimulatedMitDrive slow(first);
  SimulatedMitDrive fast(second);
  auto& host = bus.Attach();
  bus.Attach(slow, SimulatedMitDrive::PortConfig());
  bus.Attach(fast, SimulatedMitDrive::PortConfig());
  ASSERT_EQ(host.Send(MitMagicFrame(first.mit, MitMagic::kExit)), Status::kOk);
  ASSERT_EQ(host.Send(MitMagicFrame(second.mit, MitMagic::kExit)), Status::kOk);
  bus.AdvanceTo(2'000'000);
  EXPECT_EQ(bus.statistics().collisions, 1);
  ReceivedFrame received;
  EXPECT_EQ(host.Receive(received), Status::kWouldBlock) << "both replies are gone";
}

TEST(SimulatedDrives, NothingIsAllocatedOnceBusAndDrivesAreMade) {
  Rig rig;
  {
    // The guard aborts at an allocation. Its own test shows that it does.
    const testing::AllocationGuard guard;
    for (int i = 0; i < 200; ++i) {
      rig.Tick(i < 100 ? DriveRequest::kDisable : DriveRequest::kEnable);
    }
  }
  EXPECT_EQ(rig.hosts[0].state(), DriveState::kEnabled);
}

TEST(SimulatedDrives, SameRunTwiceGivesTheSameFrames) {
  const auto run = [] {
    Rig rig;
    rig.Enable();
    for (int i = 0; i < 300; ++i) {
      for (std::size_t k = 0; k < 2; ++k) {
        rig.setpoints[k] = {static_cast<float>(0.3 * std::sin(0.02 * i)), 0, 0.5F, 150, 3};
      }
      rig.Tick(DriveRequest::kEnable);
    }
    return rig.Log();
  };
  const auto once = run();
  const auto again = run();
  ASSERT_EQ(once.size(), 4U * 310U);
  ASSERT_EQ(once.size(), again.size());
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].frame, again[i].frame);
    EXPECT_EQ(once[i].time_ns, again[i].time_ns);
  }
}

TEST(SimulatedDrives, GoLimpWhenTheHostFallsSilentAndResumeByThemselves) {
  Rig rig;
  rig.Enable();
  rig.setpoints[0] = rig.setpoints[1] = {1.0F, 0, 2, 20, 1};
  rig.Tick(DriveRequest::kEnable);
  EXPECT_NE(rig.torques[0], 0);
  const std::int64_t heard = rig.drives[0].last_setpoint_ns();
  std::int64_t limp_from = 0;
  for (int i = 0; i < 30; ++i) {
    rig.Tick(DriveRequest::kEnable, true);
    if (rig.drives[0].limp() && limp_from == 0) limp_from = rig.bus.now_ns();
  }
  EXPECT_GT(limp_from - heard, 25'000'000);
  EXPECT_LE(limp_from - heard, 25'000'000 + kTickNs + kStepNs);
  EXPECT_EQ(rig.drives[0].watchdog_expiries(), 1);
  EXPECT_EQ(rig.drives[1].watchdog_expiries(), 1);
  EXPECT_EQ(rig.torques[0], 0);
  EXPECT_TRUE(rig.drives[0].enabled());
  rig.Tick(DriveRequest::kEnable);
  EXPECT_FALSE(rig.drives[0].limp());
  EXPECT_NE(rig.torques[0], 0);
}

/// One drive that is given single frames, on a bus without other load.
class OneDrive {
 public:
  explicit OneDrive(const SimulatedMitConfig& config) : drive(config), host(&bus.Attach()) {
    bus.Attach(drive, SimulatedMitDrive::PortConfig());
  }

  MitReply Exchange(const CanFrame& frame) {
    EXPECT_EQ(host->Send(frame), Status::kOk);
    bus.AdvanceTo(bus.now_ns() + kTickNs);
    ReceivedFrame received;
    MitReply reply;
    answered = host->Receive(received) == Status::kOk;
    if (answered) {
      EXPECT_EQ(DecodeMitReply(drive.config().mit, received.frame, reply), Status::kOk);
    }
    return reply;
  }
  MitReply Magic(MitMagic magic) { return Exchange(MitMagicFrame(drive.config().mit, magic)); }
  MitReply Set(const ImpedanceCommand& command) {
    return Exchange(EncodeMitCommand(drive.config().mit, command));
  }
  double Step(double q, double w) { return drive.Step(bus.now_ns(), q, w); }

  SimulatedBus bus;
  SimulatedMitDrive drive;
  SimulatedPort* host;
  bool answered = false;
};

TEST(SimulatedMitDrive, AppliesTheImpedanceLawOfWhatItHeard) {
  SimulatedMitConfig config;
  config.encoder_step_rad = 0;
  config.torque_max_nm = 100;
  OneDrive one(config);
  one.Magic(MitMagic::kEnter);
  one.Set({0.4F, 2, 60, 1.5F, -3});
  const ImpedanceCommand& c = one.drive.last_setpoint();
  const double expected =
      static_cast<double>(c.kp_nm_per_rad) * (static_cast<double>(c.position_rad) - 0.3) +
      static_cast<double>(c.kd_nm_s_per_rad) * (static_cast<double>(c.velocity_rad_s) - 1.2) +
      static_cast<double>(c.torque_nm);
  EXPECT_DOUBLE_EQ(one.Step(0.3, 1.2), expected);
  EXPECT_NEAR(expected, 60 * 0.1 + 1.5 * 0.8 - 3, 0.1);
}

TEST(SimulatedMitDrive, GivesTheSameTorqueAtTheJointThroughGearAndDirection) {
  SimulatedMitConfig straight;
  straight.encoder_step_rad = 0;
  SimulatedMitConfig geared = straight;
  geared.mit.joint = {-1, 2, 0.25F};
  for (const auto& config : {straight, geared}) {
    OneDrive one(config);
    one.Magic(MitMagic::kEnter);
    const JointMap& map = config.mit.joint;
    one.Set({map.ToDrivePosition(0.7F), map.ToDriveVelocity(0), map.ToDriveGain(100),
             map.ToDriveGain(2), map.ToDriveTorque(1)});
    EXPECT_NEAR(one.Step(0.65, 0.5), 100 * 0.05 - 2 * 0.5 + 1, 0.1);
  }
}

TEST(SimulatedMitDrive, SaturatesAtItsCurrentLimitAndAtItsVoltageLimit) {
  SimulatedMitConfig config;
  config.torque_max_nm = 10;
  config.base_speed_rad_s = 20;
  config.no_load_speed_rad_s = 40;
  OneDrive one(config);
  one.Magic(MitMagic::kEnter);
  one.Set({0, 0, 0, 0, 18});
  EXPECT_DOUBLE_EQ(one.Step(0, 0), 10);
  EXPECT_DOUBLE_EQ(one.Step(0, 20), 10);
  EXPECT_DOUBLE_EQ(one.Step(0, 30), 5);
  EXPECT_DOUBLE_EQ(one.Step(0, 45), 0);
  EXPECT_DOUBLE_EQ(one.Step(0, -45), 10) << "braking is not limited by the voltage";
}

TEST(SimulatedMitDrive, RepliesWithTheStateBeforeTheCommand) {
  SimulatedMitConfig config;
  OneDrive one(config);
  one.Magic(MitMagic::kEnter);
  one.Step(0.25, 0);
  EXPECT_NEAR(one.Set({0, 0, 0, 0, 6}).torque_nm, 0, 0.01);
  one.Step(0.25, 0);
  EXPECT_NEAR(one.Set({0, 0, 0, 0, 0}).torque_nm, 6, 0.02);
}

TEST(SimulatedMitDrive, ZeroMovesTheEncoderOutsideMotorModeOnly) {
  SimulatedMitConfig config;
  OneDrive one(config);
  one.Step(0.75, 0);
  one.Magic(MitMagic::kZero);
  EXPECT_NEAR(one.Magic(MitMagic::kEnter).position_rad, 0, 1e-3);
  one.Step(1.5, 0);
  one.Magic(MitMagic::kZero);
  EXPECT_NEAR(one.Magic(MitMagic::kExit).position_rad, 0.75, 1e-3);
}

TEST(SimulatedMitDrive, ActsOnAStaleSetpointAsItEntersMotorMode) {
  SimulatedMitConfig config;
  OneDrive one(config);
  one.Set({1, 0, 100, 0, 0});
  EXPECT_EQ(one.Step(0, 0), 0);
  one.Magic(MitMagic::kEnter);
  EXPECT_GT(one.Step(0, 0), 10);
}

TEST(SimulatedMitDrive, MagicFramesDoNotFeedTheWatchdog) {
  SimulatedMitConfig config;
  OneDrive one(config);
  one.Magic(MitMagic::kEnter);
  one.Set({0, 0, 0, 0, 5});
  for (int i = 0; i < 26; ++i) one.Magic(MitMagic::kEnter);
  EXPECT_EQ(one.Step(0, 0), 0);
  EXPECT_EQ(one.drive.watchdog_expiries(), 1);
}

TEST(SimulatedMitDrive, AWatchdogOfZeroIsOff) {
  SimulatedMitConfig config;
  config.watchdog_s = 0;
  OneDrive one(config);
  one.Magic(MitMagic::kEnter);
  one.Set({0, 0, 0, 0, 5});
  one.bus.AdvanceTo(10'000'000'000);
  EXPECT_NEAR(one.Step(0, 0), 5, 0.01);
  EXPECT_EQ(one.drive.watchdog_expiries(), 0);
}

TEST(SimulatedMitDrive, ItsWindingHeatsWithTheSquareOfTorqueAndCoolsToAmbientInTheFirstOrder) {
  SimulatedMitConfig config;
  config.watchdog_s = 0;
  config.ambient_c = 20;
  config.heating_k_per_nm2 = 0.5;
  config.thermal_time_constant_s = 3;
  for (const float torque : {5.0F, -10.0F}) {
    OneDrive one(config);
    one.Magic(MitMagic::kEnter);
    one.Set({0, 0, 0, 0, torque});
    const double applied = one.Step(0, 0);
    EXPECT_NEAR(one.drive.temperature_c(), 20, 0.01);
    const std::int64_t start_ns = one.bus.now_ns();
    for (int ms = 1; ms <= 6000; ++ms) {
      one.drive.Step(start_ns + ms * kTickNs, 0, 0);
      if (ms % 1500 != 0) continue;
      const double rise = 0.5 * applied * applied * (1 - std::exp(-1e-3 * ms / 3));
      EXPECT_NEAR(one.drive.temperature_c(), 20 + rise, 1e-6 * rise) << ms;
    }
    EXPECT_NEAR(one.Set({0, 0, 0, 0, 0}).temperature_c, one.drive.temperature_c(), 0.51)
        << "the reply says it in whole degrees";
    const double hot = one.drive.temperature_c();
    one.drive.Step(start_ns + 6000 * kTickNs, 0, 0);
    one.drive.Step(start_ns + 9000 * kTickNs, 0, 0);
    EXPECT_NEAR(one.drive.temperature_c(), 20 + (hot - 20) * std::exp(-1.0), 0.05);
  }
}

TEST(SimulatedMitDrive, ItsTorqueFollowsInTheFirstOrderWhereTheCurrentLoopHasATimeConstant) {
  SimulatedMitConfig config;
  config.watchdog_s = 0;
  config.torque_time_constant_s = 0.002;
  OneDrive one(config);
  one.Magic(MitMagic::kEnter);
  one.Step(0, 0);
  one.Set({0, 0, 0, 0, 8});
  const std::int64_t start_ns = one.bus.now_ns();
  const double begun = one.drive.Step(start_ns, 0, 0);  // since the last step: a millisecond
  const double end = static_cast<double>(one.drive.last_setpoint().torque_nm);
  EXPECT_NEAR(begun, end * (1 - std::exp(-0.5)), 1e-9);
  double torque = 0;
  for (std::int64_t us = 50; us <= 4000; us += 50)
    torque = one.drive.Step(start_ns + us * 1000, 0, 0);
  EXPECT_NEAR(torque, end + (begun - end) * std::exp(-2.0), 1e-9);
  EXPECT_EQ(one.drive.Step(start_ns + 4'000'000, 0, 0), torque) << "no time, no change";
}

TEST(SimulatedMitDrive, FaultsAreWhatTheySay) {
  SimulatedMitConfig config;
  OneDrive one(config);
  one.Magic(MitMagic::kEnter);
  one.drive.set_temperature(91);
  one.drive.RaiseError(1);
  const MitReply reply = one.Set({0, 0, 0, 0, 5});
  EXPECT_EQ(reply.error, 1);
  EXPECT_EQ(reply.temperature_c, 91);
  EXPECT_EQ(one.Step(0, 0), 0);
  one.drive.RaiseError(0);
  EXPECT_NEAR(one.Step(0, 0), 5, 0.01);
  one.drive.set_silent(true);
  one.Set({0, 0, 0, 0, -5});
  EXPECT_FALSE(one.answered);
  EXPECT_NEAR(one.Step(0, 0), -5, 0.01) << "a silent drive still obeys";
  EXPECT_EQ(one.drive.frames_received(), 3);
  EXPECT_EQ(one.drive.setpoints_received(), 2);
}

TEST(SimulatedMitDrive, EncoderReadsWholeSteps) {
  SimulatedMitConfig config;
  config.encoder_step_rad = 0.125;
  OneDrive one(config);
  one.Step(0.3, 0);
  EXPECT_NEAR(one.Magic(MitMagic::kEnter).position_rad, 0.25, 4e-4);
}

TEST(SimulatedMitDrive, ChecksItsConfiguration) {
  const auto refused = [](auto change) {
    SimulatedMitConfig config;
    change(config);
    try {
      SimulatedMitDrive drive(config);
    } catch (const std::invalid_argument&) {
      return true;
    }
    return false;
  };
  EXPECT_FALSE(refused([](auto&) {}));
  EXPECT_TRUE(refused([](auto& c) { c.mit.command_id = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.reply_size = 5; }));
  EXPECT_TRUE(refused([](auto& c) { c.watchdog_s = -1; }));
  EXPECT_TRUE(refused([](auto& c) { c.torque_max_nm = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.base_speed_rad_s = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.base_speed_rad_s = 5, c.no_load_speed_rad_s = 4; }));
  EXPECT_TRUE(refused([](auto& c) { c.encoder_step_rad = -1; }));
  EXPECT_TRUE(refused([](auto& c) { c.turnaround_ns = -1; }));
}

}  // namespace
}  // namespace tumbler
