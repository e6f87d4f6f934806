#include "firmware_interface/devices/sample_times.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drive_bank.h"
#include "firmware_interface/devices/make_simulated.h"

namespace tumbler {
namespace {

/// Four drives of any protocol, with all delays of the host, fit into it.
constexpr std::int64_t kTick_ns = 2'500'000;

/// What a drive takes to answer on an idle bus.
constexpr std::int64_t kTurnaround_ns = SimulatedMotorConfig{}.turnaround_ns;

/// How the host's frames get onto the bus.
struct HostDelays {
  double first_max_us = 0;    ///< Of the first frame of a tick.
  double between_max_us = 0;  ///< Of each further one after the one before.
};

/// A host, its drives, another node that sends at random, and somebody who hears all of it with the
/// time at which each frame ended.
class Listened {
 public:
  Listened(const std::vector<DriveConfig>& configs, unsigned seed) : random_(seed) {
    SimulatedPortConfig listens;
    listens.listen_only = true;
    listens.receive_capacity = 4096;
    listener_ = &bus_.Attach(listens);
    SimulatedPortConfig queue;
    queue.transmit_capacity = 64;
    host_ = &bus_.Attach(queue);
    stranger_ = &bus_.Attach();
    for (const DriveConfig& config : configs) {
      DriveEntry entry;
      entry.config = config;
      entry.watchdog_s = 0.1;
      entry.kp_nm_per_rad = entry.kd_nm_s_per_rad = 1;
      SimulatedMotorConfig motor;
      motor.encoder_step_rad = 0;
      drives_.push_back(MakeSimulatedDrive(entry, motor));
      drives_.back()->AttachTo(bus_);
      EXPECT_EQ(bank_.Add(config), Status::kOk);
      times_.Add(config);
    }
  }

  /// One tick. @returns the frames that the host sent.
  std::vector<CanFrame> Tick(const HostDelays& delays, double strangers) {
    std::vector<ReceivedFrame> received;
    ReceivedFrame one;
    while (host_->Receive(one) == Status::kOk) received.push_back(one);
    times_.Receive(received);
    for (const ReceivedFrame& frame : received) {
      for (Drive* drive : bank_.drives()) drive->Decode(frame.frame);
    }
    std::vector<CanFrame> sent;
    for (Drive* drive : bank_.drives()) {
      FrameBatch batch;
      DriveSetpoint setpoint;
      setpoint.position_rad = static_cast<float>(Uniform(1));
      EXPECT_EQ(drive->Encode(DriveRequest::kEnable, setpoint, batch), Status::kOk);
      for (const CanFrame& frame : batch.frames()) sent.push_back(frame);
    }
    times_.Send(bus_.now_ns(), sent);
    double delay_us = Uniform(delays.first_max_us);
    for (const CanFrame& frame : sent) {
      EXPECT_EQ(host_->SendAfter(static_cast<std::int64_t>(1000 * delay_us), frame), Status::kOk);
      delay_us += Uniform(delays.between_max_us);
    }
    if (Uniform(1) < strangers) {
      CanFrame frame;
      frame.id = 5;  // before every reply
      frame.size = 8;
      frame.data[0] = static_cast<std::uint8_t>(Uniform(255));
      static_cast<void>(
          stranger_->SendAfter(static_cast<std::int64_t>(1000 * Uniform(400)), frame));
    }
    const std::int64_t end_ns = bus_.now_ns() + kTick_ns;
    while (bus_.now_ns() < end_ns) {
      bus_.AdvanceTo(bus_.now_ns() + 50'000);
      for (const auto& drive : drives_) drive->Step(bus_.now_ns(), PositionAt(bus_.now_ns()), 1);
    }
    return sent;
  }

  /// Every joint turns by a radian a second, so that a position tells its time.
  static double PositionAt(std::int64_t time_ns) { return 1e-9 * static_cast<double>(time_ns); }
  /// When a joint was where its drive has reported it last.
  [[nodiscard]] std::int64_t ReportedTime(std::size_t joint) const {
    return std::llround(1e9 * double{bank_.drives()[joint]->feedback().position_rad});
  }

  /// The frames that ended since the last call.
  std::vector<ReceivedFrame> Heard() {
    std::vector<ReceivedFrame> heard;
    ReceivedFrame one;
    while (listener_->Receive(one) == Status::kOk) heard.push_back(one);
    return heard;
  }

  [[nodiscard]] const SampleTimes& times() const { return times_; }
  [[nodiscard]] std::size_t count() const { return drives_.size(); }

 private:
  double Uniform(double max) { return std::uniform_real_distribution<>(0, max)(random_); }

  std::mt19937 random_;
  SimulatedBus bus_;
  SimulatedPort* listener_ = nullptr;
  SimulatedPort* host_ = nullptr;
  SimulatedPort* stranger_ = nullptr;
  std::vector<std::unique_ptr<SimulatedDrive>> drives_;
  DriveBank bank_;
  SampleTimes times_;
};

template <typename Protocol>
std::vector<DriveConfig> Drives(int count) {
  std::vector<DriveConfig> drives;
  for (int i = 0; i < count; ++i) drives.emplace_back(Protocol::Example(i));
  return drives;
}

/// By how much what is found is later than the frame at which a drive samples its joint, of all
/// drives and ticks [ns].
struct Lateness {
  std::int64_t least = 0, most = 0;
  int ticks = 0;
};
template <typename Protocol>
Lateness LatenessOf(int count, const HostDelays& delays, double strangers, unsigned seed) {
  Listened rig(Drives<Protocol>(count), seed);
  Lateness late{kTick_ns, -kTick_ns, 0};
  std::vector<std::optional<std::int64_t>> asked(rig.count());
  for (int tick = 0; tick < 400; ++tick) {
    rig.Tick(delays, strangers);
    const std::vector<std::optional<std::int64_t>> before = asked;
    for (const ReceivedFrame& heard : rig.Heard()) {
      for (std::size_t j = 0; j < rig.count(); ++j) {
        const auto config = Protocol::Example(static_cast<int>(j));
        if (Protocol::SamplesAt(config, heard.frame)) asked[j] = heard.time_ns;
      }
    }
    if (tick < 300) continue;  // Set-up takes some.
    for (std::size_t j = 0; j < rig.count(); ++j) {
      const auto sampled_ns = rig.times().sampled_ns(j);
      if (!sampled_ns || !before[j]) continue;
      late.least = std::min(late.least, *sampled_ns - *before[j]);
      late.most = std::max(late.most, *sampled_ns - *before[j]);
      ++late.ticks;
    }
  }
  return late;
}

TEST(SampleTimes, AreThoseOfTheEndsOfSetpointsOnWhichDrivesAnswer) {
  for (int count = 2; count <= 4; ++count) {
    const Lateness late = LatenessOf<MitProtocol>(count, {}, 0, 1);
    EXPECT_EQ(late.least, 0) << count;
    EXPECT_EQ(late.most, 0) << count;
    EXPECT_EQ(late.ticks, 100 * count);
  }
}

TEST(SampleTimes, OfADriveThatAnswersOnAnIdleBusHaveTheTimeItTakesForThat) {
  const Lateness late = LatenessOf<MitProtocol>(1, {}, 0, 1);
  EXPECT_GT(late.least, 0);
  EXPECT_LE(late.most, kTurnaround_ns);
}

TEST(SampleTimes, DoNotDependOnHowTheHostsFramesAndThoseOfOthersMixWithReplies) {
  unsigned seed = 0;
  for (int count = 1; count <= 4; ++count) {
    for (const HostDelays& delays : {HostDelays{300, 0}, HostDelays{0, 40}, HostDelays{100, 150}}) {
      for (const double strangers : {0.0, 0.5}) {
        const Lateness late = LatenessOf<MitProtocol>(count, delays, strangers, ++seed);
        EXPECT_GE(late.least, 0) << count << " " << delays.between_max_us << " " << strangers;
        EXPECT_LE(late.most, 2 * kTurnaround_ns)
            << count << " " << delays.between_max_us << " " << strangers;
        EXPECT_GT(late.ticks, 90 * count);
      }
    }
  }
}

TEST(SampleTimes, OfDrivesThatAnswerSyncAreThoseOfItsEnd) {
  for (int count = 1; count <= 4; ++count) {
    const Lateness late = LatenessOf<Cia402Protocol>(count, {}, 0, 1);
    EXPECT_GE(late.least, 0) << count;
    EXPECT_LE(late.most, kTurnaround_ns) << count;
    EXPECT_GT(late.ticks, 0) << count;
  }
}

TEST(SampleTimes, OfDrivesWithAClockOfTheirOwnAreThoseOfTheBeginningsOfTheirReports) {
  for (int count = 1; count <= 2; ++count) {
    Listened rig(Drives<CanSimpleProtocol>(count), 1);
    int reports = 0;
    for (int tick = 0; tick < 200; ++tick) {
      rig.Tick({}, 0.2);
      for (std::size_t j = 0; j < rig.count(); ++j) {
        const auto sampled_ns = rig.times().sampled_ns(j);
        if (!sampled_ns) continue;
        const std::int64_t late_ns = *sampled_ns - rig.ReportedTime(j);
        EXPECT_GE(late_ns, -1000) << "a microsecond is what a float leaves of a position";
        // The report waits for a frame that is under way, the stranger's and those of others.
        EXPECT_LE(late_ns, kTurnaround_ns + std::int64_t{130'000} * (count + 3)) << count;
        ++reports;
      }
    }
    EXPECT_GT(reports, 100 * count);
  }
}

}  // namespace
}  // namespace tumbler
