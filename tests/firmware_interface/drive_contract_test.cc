// The contract that every drive keeps, whatever its protocol. The same tests run against each
// simulated drive and, with
//
//   drive_contract_test --bus can0 --drives drives.toml --joint leg1 [--arm]
//
// against a real one. Without --arm no test enables the drive. With --arm the joint turns by up to
// 0.2 rad to either side of its position and must be free to move. Tests that have to break
// something (raise an error, turn the joint by hand) run in simulation only.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/can/socketcan_bus.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/rotor_plant.h"
#include "tests/support/files.h"
#include "tests/support/protocol_side.h"

namespace tumbler {
namespace {

struct Options {
  std::string bus;
  std::string drives;
  std::string joint;
  bool arm = false;
  [[nodiscard]] bool real() const { return !bus.empty(); }
};

Options& TheOptions() {
  static Options options;  // static, because the cases of GoogleTest cannot be given arguments
  return options;
}

struct Case {
  std::string name;
  DriveEntry entry;
  testing::ProtocolNature nature;
  testing::WireSteps steps;
  double rate_hz = 1000;

  /// The largest error at the shaft that rounding to the wire makes: half a step and, for a
  /// position, the rounding of a float.
  [[nodiscard]] double position_resolution_rad() const {
    return 0.5001 * steps.position_rad + 1e-6;
  }
  [[nodiscard]] double velocity_resolution_rad_s() const { return 0.5001 * steps.velocity_rad_s; }
  [[nodiscard]] double torque_resolution_nm() const { return 0.5001 * steps.torque_nm; }
};

std::vector<Case> Cases() {
  std::vector<Case> cases;
  const Options& options = TheOptions();
  const auto load = [](const std::string& file, std::size_t drive) {
    const DrivesConfig config = LoadDrives(file);
    const DriveEntry& entry = config.drives.at(drive);
    const testing::ProtocolSide& side = testing::SideOf(entry.config);
    return Case{"", entry, side.nature(), side.StepsOf(entry.config), config.rate_hz};
  };
  if (options.real()) {
    const DrivesConfig config = LoadDrives(options.drives);
    for (std::size_t i = 0; i < config.drives.size(); ++i) {
      if (config.drives[i].joint != options.joint) continue;
      cases.push_back(load(options.drives, i));
      cases.back().name = "On_" + options.bus;
    }
    return cases;
  }
  for (const testing::TestedProtocol& protocol : testing::EveryProtocol()) {
    cases.push_back(load(testing::SourcePath(protocol.drives), 0));
    cases.back().name = protocol.name;
    // This drive is mounted the other way round, behind a gear, with its zero elsewhere.
    Case geared = cases.back();
    geared.name += "_geared";
    std::visit(
        [](auto& config) {
          config.joint.direction = -1;
          config.joint.gear_ratio = 2.5F;
          config.joint.zero_offset_rad = 0.4F;
        },
        geared.entry.config);
    cases.push_back(geared);
  }
  return cases;
}

/// A drive, its host, and the bus between them.
class World {
 public:
  World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  virtual ~World() = default;
  virtual CanBus& bus() = 0;
  virtual void Advance(double time_s) = 0;
};

class SimulatedWorld final : public World {
 public:
  explicit SimulatedWorld(const Case& c) : host_(bus_.Attach()) {
    SimulatedMotorConfig motor;
    motor.encoder_step_rad = 2 * M_PI / 65536;
    drive = MakeSimulatedDrive(c.entry, motor);
    drive->AttachTo(bus_);
    RotorPlant::Rotor rotor;
    rotor.drive = drive.get();
    rotor.position_rad = 0.3;
    plant = std::make_unique<RotorPlant>(bus_, std::vector<RotorPlant::Rotor>{rotor});
  }
  CanBus& bus() override { return host_; }
  void Advance(double time_s) override {
    now_ns_ += static_cast<std::int64_t>(std::llround(time_s * 1e9));
    plant->AdvanceTo(now_ns_);
  }
  [[nodiscard]] RotorPlant::Rotor& rotor() { return plant->rotors()[0]; }

  std::unique_ptr<SimulatedDrive> drive;
  std::unique_ptr<RotorPlant> plant;

 private:
  SimulatedBus bus_;
  SimulatedPort& host_;
  std::int64_t now_ns_ = 0;
};

class RealWorld final : public World {
 public:
  explicit RealWorld(const std::string& interface) {
    const auto opened = bus_.Open(interface);
    if (opened.status != Status::kOk) throw std::runtime_error(opened.message);
  }
  CanBus& bus() override { return bus_; }
  void Advance(double time_s) override { usleep(static_cast<useconds_t>(time_s * 1e6)); }

 private:
  SocketCanBus bus_;
};

class DriveContract : public ::testing::TestWithParam<Case> {
 protected:
  DriveContract() {
    EXPECT_EQ(bank_.Add(GetParam().entry.config), Status::kOk);
    if (TheOptions().real()) {
      world_ = std::make_unique<RealWorld>(TheOptions().bus);
    } else {
      auto simulated = std::make_unique<SimulatedWorld>(GetParam());
      simulated_ = simulated.get();
      world_ = std::move(simulated);
    }
    period_s_ = 1 / GetParam().rate_hz;
  }
  ~DriveContract() override {
    if (TheOptions().real()) Ticks(0.1, DriveRequest::kDisable);
  }

  [[nodiscard]] Drive& host() const { return *bank_.drives()[0]; }
  [[nodiscard]] const JointMap& joint() const { return JointOf(GetParam().entry.config); }
  [[nodiscard]] const testing::ProtocolNature& nature() const { return GetParam().nature; }

  void Listen() {
    ReceivedFrame received;
    while (world_->bus().Receive(received) == Status::kOk) host().Decode(received.frame);
  }
  /// Makes one tick of a control loop. @returns how the drive took the setpoint.
  Status TryTick(DriveRequest request, const DriveSetpoint& setpoint) {
    Listen();
    FrameBatch batch;
    const Status status = host().Encode(request, setpoint, batch);
    EXPECT_FALSE(batch.frames().empty()) << "every tick writes the drive";
    for (const CanFrame& frame : batch.frames()) {
      EXPECT_EQ(world_->bus().Send(frame), Status::kOk);
    }
    world_->Advance(period_s_);
    return status;
  }
  void Tick(DriveRequest request, const DriveSetpoint& setpoint = {}) {
    EXPECT_EQ(TryTick(request, setpoint), Status::kOk);
  }
  void Ticks(double time_s, DriveRequest request, const DriveSetpoint& setpoint = {}) {
    for (double t = 0; t < time_s; t += period_s_) Tick(request, setpoint);
  }
  bool TickUntil(const std::function<bool()>& reached, double time_s, DriveRequest request,
                 const DriveSetpoint& setpoint = {}) {
    for (double t = 0; t < time_s; t += period_s_) {
      Tick(request, setpoint);
      Listen();
      if (reached()) return true;
    }
    return false;
  }
  bool TickUntil(DriveState state, double time_s, DriveRequest request,
                 const DriveSetpoint& setpoint = {}) {
    return TickUntil([&] { return host().state() == state; }, time_s, request, setpoint);
  }

  /// A setpoint that holds the joint at a position.
  [[nodiscard]] DriveSetpoint Hold(float position_rad) const {
    DriveSetpoint setpoint;
    setpoint.position_rad = position_rad;
    setpoint.kp_nm_per_rad = std::min(GetParam().entry.kp_nm_per_rad, 100.0F);
    setpoint.kd_nm_s_per_rad = std::min(GetParam().entry.kd_nm_s_per_rad, 2.0F);
    return setpoint;
  }
  [[nodiscard]] DriveSetpoint HoldHere() const { return Hold(host().feedback().position_rad); }

  [[nodiscard]] bool FindDrive() {
    return TickUntil(DriveState::kDisabled, 5, DriveRequest::kDisable);
  }
  [[nodiscard]] bool Arm() {
    if (!FindDrive()) return false;
    const DriveSetpoint hold = HoldHere();
    return TickUntil(DriveState::kEnabled, 2, DriveRequest::kEnable, hold);
  }

  DriveBank bank_;
  std::unique_ptr<World> world_;
  SimulatedWorld* simulated_ = nullptr;  // null on a real bus
  double period_s_ = 0.001;
};

// On a real bus the motor turns only when the user has allowed it.
#define NEEDS_ARM() \
  if (TheOptions().real() && !TheOptions().arm) GTEST_SKIP() << "drives the motor: add --arm"
#define NEEDS_SIMULATION() \
  if (TheOptions().real()) GTEST_SKIP() << "breaks something on purpose: in simulation only"

TEST_P(DriveContract, ReportsItsPositionWhileDisabled) {
  EXPECT_EQ(host().state(), DriveState::kUnknown);
  ASSERT_TRUE(FindDrive());
  EXPECT_TRUE(std::isfinite(host().feedback().position_rad));
  EXPECT_EQ(host().feedback().error, 0U);
  int positions = 0;
  for (int i = 0; i < 100; ++i) {
    ReceivedFrame received;
    bool heard = false;
    while (world_->bus().Receive(received) == Status::kOk) {
      heard = host().Decode(received.frame) || heard;
    }
    positions += heard ? 1 : 0;
    FrameBatch batch;
    EXPECT_EQ(host().Encode(DriveRequest::kDisable, {}, batch), Status::kOk);
    for (const CanFrame& frame : batch.frames()) EXPECT_EQ(world_->bus().Send(frame), Status::kOk);
    world_->Advance(period_s_);
  }
  EXPECT_GE(positions, 90) << "a measurement in nearly every tick";
  if (simulated_ != nullptr) {
    EXPECT_FALSE(simulated_->drive->enabled());
    EXPECT_EQ(simulated_->drive->torque_nm(), 0);
  }
}

TEST_P(DriveContract, FeedbackIsThatOfTheJoint) {
  NEEDS_SIMULATION();
  ASSERT_TRUE(FindDrive());
  for (const double angle : {-1.0, -0.2, 0.0, 0.3, 1.1}) {
    simulated_->rotor().position_rad = angle;
    simulated_->rotor().velocity_rad_s = 0;
    Ticks(0.02, DriveRequest::kDisable);
    Listen();
    EXPECT_NEAR(static_cast<double>(host().feedback().position_rad), angle,
                2 * M_PI / 65536 + 2 * GetParam().position_resolution_rad() +
                    GetParam().steps.reported_rad);
  }
  simulated_->rotor().position_rad = 0;
  simulated_->rotor().velocity_rad_s = 3;
  simulated_->rotor().damping_nm_s_per_rad = 0;
  Ticks(0.02, DriveRequest::kDisable);
  Listen();
  EXPECT_NEAR(static_cast<double>(host().feedback().velocity_rad_s), 3, 0.05);
}

TEST_P(DriveContract, ArmsWhereItStandsThroughEnablingOnly) {
  NEEDS_ARM();
  ASSERT_TRUE(FindDrive());
  const float start = host().feedback().position_rad;
  // The executor's setpoint is elsewhere. The drive must not move to it before it is enabled.
  const DriveSetpoint elsewhere = Hold(start + 0.2F);
  bool enabling = false;
  for (double t = 0; t < 2 && host().state() != DriveState::kEnabled; t += period_s_) {
    Tick(DriveRequest::kEnable, elsewhere);
    EXPECT_NEAR(host().encoded_setpoint().position_rad, start, 0.02F);
    Listen();
    const DriveState state = host().state();
    enabling = enabling || state == DriveState::kEnabling;
    ASSERT_TRUE(state == DriveState::kDisabled || state == DriveState::kEnabling ||
                state == DriveState::kEnabled)
        << static_cast<int>(state);
  }
  EXPECT_EQ(host().state(), DriveState::kEnabled);
  EXPECT_TRUE(enabling);
  EXPECT_NEAR(host().feedback().position_rad, start, 0.02F);
}

TEST_P(DriveContract, SetpointReachesTheDriveWithinItsResolution) {
  NEEDS_ARM();
  ASSERT_TRUE(Arm());
  const float start = host().feedback().position_rad;
  const double ratio = static_cast<double>(joint().gear_ratio);
  for (int i = 0; i < 200; ++i) {
    DriveSetpoint asked = Hold(start + 0.02F * std::sin(0.1F * static_cast<float>(i)));
    asked.velocity_rad_s = 0.05F * std::cos(0.1F * static_cast<float>(i));
    asked.torque_nm = 0.04F * std::sin(0.3F * static_cast<float>(i));
    Tick(DriveRequest::kEnable, asked);
    const DriveSetpoint encoded = host().encoded_setpoint();
    ASSERT_NEAR(encoded.position_rad, asked.position_rad,
                GetParam().position_resolution_rad() / ratio + 1e-6);
    ASSERT_NEAR(encoded.velocity_rad_s, asked.velocity_rad_s,
                GetParam().velocity_resolution_rad_s() / ratio + 1e-6);
    ASSERT_NEAR(encoded.torque_nm, asked.torque_nm,
                GetParam().torque_resolution_nm() * ratio + 1e-6);
    if (simulated_ == nullptr) continue;
    // With synchronous PDOs this takes the SYNC of the next tick, and a period of interpolation.
    Tick(DriveRequest::kEnable, asked);
    Tick(DriveRequest::kEnable, asked);
    ASSERT_TRUE(simulated_->drive->target_rad().has_value());
    ASSERT_NEAR(*simulated_->drive->target_rad(), static_cast<double>(encoded.position_rad), 2e-6);
  }
}

TEST_P(DriveContract, MovesTheJointToItsSetpoint) {
  NEEDS_ARM();
  ASSERT_TRUE(Arm());
  const float start = host().feedback().position_rad;
  for (const float way : {0.2F, -0.2F}) {
    DriveSetpoint setpoint;
    for (float t = 0; t < 1; t += static_cast<float>(period_s_)) {
      setpoint = Hold(start + way * (3 - 2 * t) * t * t);
      setpoint.velocity_rad_s = 6 * way * (1 - t) * t;
      Tick(DriveRequest::kEnable, setpoint);
      ASSERT_EQ(host().state(), DriveState::kEnabled);
    }
    Ticks(0.2, DriveRequest::kEnable, Hold(start + way));
    Listen();
    EXPECT_NEAR(host().feedback().position_rad, start + way, 0.01F);
    if (simulated_ != nullptr) {
      EXPECT_NEAR(simulated_->rotor().position_rad, static_cast<double>(start + way), 0.01);
    }
    for (float t = 0; t < 1; t += static_cast<float>(period_s_)) {
      Tick(DriveRequest::kEnable, Hold(start + way * (1 - (3 - 2 * t) * t * t)));
    }
  }
}

TEST_P(DriveContract, NothingBeyondItsRangesIsEverEncoded) {
  NEEDS_SIMULATION();
  ASSERT_TRUE(Arm());
  const ShaftRanges ranges = CommandRanges(GetParam().entry.config);
  constexpr float kHuge = 3e38F;
  for (const float value : {1e3F, 1e9F, kHuge}) {
    for (const float sign : {-1.0F, 1.0F}) {
      DriveSetpoint asked = Hold(sign * value);
      asked.velocity_rad_s = sign * value;
      asked.torque_nm = sign * value;
      FrameBatch batch;  // It is not sent, since a drive may take such a jump for an error.
      ASSERT_EQ(host().Encode(DriveRequest::kEnable, asked, batch), Status::kOk);
      const DriveSetpoint encoded = host().encoded_setpoint();
      const float position = joint().ToDrivePosition(encoded.position_rad);
      const float velocity = joint().ToDriveVelocity(encoded.velocity_rad_s);
      const float torque = joint().ToDriveTorque(encoded.torque_nm);
      EXPECT_LE(position, ranges.position_rad.max * 1.00001F);
      EXPECT_GE(position, ranges.position_rad.min * 1.00001F);
      EXPECT_LE(velocity, ranges.velocity_rad_s.max * 1.00001F);
      EXPECT_GE(velocity, ranges.velocity_rad_s.min * 1.00001F);
      EXPECT_LE(torque, ranges.torque_nm.max * 1.00001F);
      EXPECT_GE(torque, ranges.torque_nm.min * 1.00001F);
      EXPECT_GT(sign * joint().direction * position, 0) << "saturated, not wrapped";
      EXPECT_GT(sign * joint().direction * velocity, 0);
      EXPECT_GT(sign * joint().direction * torque, 0);
    }
  }
}

TEST_P(DriveContract, DisablingTakesTheTorqueAwayAtOnce) {
  NEEDS_ARM();
  ASSERT_TRUE(Arm());
  DriveSetpoint setpoint = HoldHere();
  setpoint.torque_nm = 0.1F;
  Ticks(0.05, DriveRequest::kEnable, setpoint);
  Ticks(0.003, DriveRequest::kDisable);
  if (simulated_ != nullptr) {
    EXPECT_FALSE(simulated_->drive->enabled());
    EXPECT_EQ(simulated_->drive->torque_nm(), 0);
  }
  EXPECT_TRUE(TickUntil(DriveState::kDisabled, 0.3, DriveRequest::kDisable));
  for (int i = 0; i < 200; ++i) {
    Tick(DriveRequest::kDisable);
    EXPECT_EQ(host().state(), DriveState::kDisabled);
  }
  EXPECT_EQ(host().feedback().error, 0U);
}

TEST_P(DriveContract, EnablesAgainAfterDisabling) {
  NEEDS_ARM();
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(Arm()) << i;
    const DriveSetpoint hold = HoldHere();
    Ticks(0.05, DriveRequest::kEnable, hold);
    // The host does not wait for the drive to confirm.
    Ticks(0.001 * i, DriveRequest::kDisable);
  }
  const DriveSetpoint hold = HoldHere();
  EXPECT_TRUE(TickUntil(DriveState::kEnabled, 2, DriveRequest::kEnable, hold));
}

TEST_P(DriveContract, BrakesWithoutPositionGain) {
  NEEDS_SIMULATION();
  ASSERT_TRUE(Arm());
  DriveSetpoint brake;
  brake.kd_nm_s_per_rad = 2;
  simulated_->rotor().velocity_rad_s = 3;
  for (int i = 0; i < 300; ++i) {
    Tick(DriveRequest::kEnable, brake);
    ASSERT_EQ(host().state(), DriveState::kEnabled);
  }
  EXPECT_NEAR(simulated_->rotor().velocity_rad_s, 0, 0.05);
  Ticks(0.01, DriveRequest::kDisable);
  EXPECT_FALSE(simulated_->drive->enabled());
}

TEST_P(DriveContract, ASetpointThatIsNoNumberDisables) {
  NEEDS_SIMULATION();
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    ASSERT_TRUE(Arm());
    DriveSetpoint setpoint = HoldHere();
    setpoint.velocity_rad_s = bad;
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(TryTick(DriveRequest::kEnable, setpoint), Status::kInvalidArgument);
    }
    EXPECT_FALSE(simulated_->drive->enabled());
    EXPECT_EQ(simulated_->drive->torque_nm(), 0);
  }
}

TEST_P(DriveContract, ReportsAnErrorAndDoesNotClearItByItself) {
  NEEDS_SIMULATION();
  ASSERT_TRUE(Arm());
  const DriveSetpoint hold = HoldHere();
  Ticks(0.1, DriveRequest::kEnable, hold);
  simulated_->drive->RaiseError(0x20);
  ASSERT_TRUE(TickUntil(DriveState::kFault, 0.15, DriveRequest::kEnable, hold));
  EXPECT_EQ(host().feedback().error, 0x20U);
  const auto stays = [&](double time_s, DriveRequest request) {
    for (double t = 0; t < time_s; t += period_s_) {
      Tick(request, hold);
      ASSERT_EQ(host().state(), DriveState::kFault);
    }
    EXPECT_EQ(simulated_->drive->torque_nm(), 0);
  };
  stays(1, DriveRequest::kEnable);
  stays(0.5, DriveRequest::kDisable);
  stays(1, DriveRequest::kEnable);
  // The operator orders it.
  Tick(DriveRequest::kClearErrors);
  const bool cleared =
      TickUntil([&] { return host().state() != DriveState::kFault; }, 0.5, DriveRequest::kDisable);
  EXPECT_EQ(cleared, nature().clears_errors);
  if (!cleared) return;
  EXPECT_EQ(host().feedback().error, 0U);
  EXPECT_TRUE(Arm());
}

TEST_P(DriveContract, LeftAloneItsWatchdogTakesOverInTheStatedTime) {
  NEEDS_ARM();
  const double watchdog_s = GetParam().entry.watchdog_s;
  if (watchdog_s <= 0) GTEST_SKIP() << "the drive has none, says its file";
  ASSERT_TRUE(Arm());
  const DriveSetpoint hold = HoldHere();
  Ticks(0.2, DriveRequest::kEnable, hold);
  if (simulated_ != nullptr) {
    EXPECT_EQ(simulated_->drive->watchdog_expiries(), 0);
    double silent_s = 0;
    const auto& drive = *simulated_->drive;
    for (; drive.watchdog_expiries() == 0 && silent_s < 1; silent_s += 0.0005) {
      world_->Advance(0.0005);
    }
    EXPECT_LE(silent_s, watchdog_s + 0.001);
    EXPECT_GE(silent_s, 0.5 * watchdog_s) << "a tick or two that are lost do not trip it";
    world_->Advance(0.3);
    EXPECT_EQ(drive.torque_nm(), 0) << "the joint is limp";
  } else {
    world_->Advance(2 * watchdog_s + 0.3);
  }
  // The host is back, and repeats its last request.
  Ticks(0.3, DriveRequest::kEnable, hold);
  Listen();
  if (nature().latches_watchdog) {
    EXPECT_EQ(host().state(), DriveState::kFault);
    EXPECT_NE(host().feedback().error, 0U);
    Ticks(0.1, DriveRequest::kDisable);
    EXPECT_EQ(host().state(), DriveState::kFault) << "only the operator clears it";
    Tick(DriveRequest::kClearErrors);
    EXPECT_TRUE(TickUntil(DriveState::kDisabled, 1, DriveRequest::kDisable));
    EXPECT_TRUE(Arm());
  } else {
    EXPECT_EQ(host().state(), DriveState::kEnabled) << "the protocol resumes by itself";
  }
}

TEST_P(DriveContract, ALateTickOrTwoDoNotTripTheWatchdog) {
  NEEDS_ARM();
  if (GetParam().entry.watchdog_s < 5 * period_s_) GTEST_SKIP() << "the watchdog is too short";
  ASSERT_TRUE(Arm());
  const DriveSetpoint hold = HoldHere();
  for (int i = 0; i < 20; ++i) {
    Ticks(0.02, DriveRequest::kEnable, hold);
    world_->Advance(2 * period_s_);
    Listen();
    ASSERT_EQ(host().state(), DriveState::kEnabled);
  }
}

INSTANTIATE_TEST_SUITE_P(Drives, DriveContract, ::testing::ValuesIn(Cases()),
                         [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  // GoogleTest makes the cases in InitGoogleTest, so the options have to be read before.
  std::vector<char*> rest{argv[0]};
  tumbler::Options& options = tumbler::TheOptions();
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    std::string* value = argument == "--bus"      ? &options.bus
                         : argument == "--drives" ? &options.drives
                         : argument == "--joint"  ? &options.joint
                                                  : nullptr;
    if (value != nullptr && i + 1 < argc) {
      *value = argv[++i];
    } else if (argument == "--arm") {
      options.arm = true;
    } else {
      rest.push_back(argv[i]);
    }
  }
  if (options.real() && (options.drives.empty() || options.joint.empty())) {
    std::cerr << "drive_contract_test: --bus needs --drives FILE and --joint NAME\n";
    return 1;
  }
  int count = static_cast<int>(rest.size());
  rest.push_back(nullptr);
  ::testing::InitGoogleTest(&count, rest.data());
  return RUN_ALL_TESTS();
}
