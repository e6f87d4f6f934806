#include "firmware_interface/devices/xsens_mti.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "common/files/toml_reader.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/simulated_sensor.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

CanFrame MtiFrame(std::uint32_t id, const std::vector<std::uint8_t>& bytes) {
  CanFrame frame;
  frame.id = id;
  frame.size = static_cast<std::uint8_t>(bytes.size());
  for (std::size_t i = 0; i < bytes.size(); ++i) frame.data[i] = bytes[i];
  return frame;
}

TEST(XsensMti, DecodesFramesMadeByHand) {
  XsensMti sensor{XsensMtiConfig{}};
  // 0x7fff / 32767 = 1, 0xc000 = -16384, 0x2000 = 8192, 0xffff = -1.
  EXPECT_EQ(sensor.Decode(MtiFrame(0x021, {0x7f, 0xff, 0xc0, 0x00, 0x20, 0x00, 0xff, 0xff})),
            InertialPart::kAttitude);
  EXPECT_FLOAT_EQ(sensor.reading().attitude[0], 1.0F);
  EXPECT_FLOAT_EQ(sensor.reading().attitude[1], -16384.0F / 32767);
  EXPECT_FLOAT_EQ(sensor.reading().attitude[2], 8192.0F / 32767);
  EXPECT_FLOAT_EQ(sensor.reading().attitude[3], -1.0F / 32767);
  // 0x0200 / 512 = 1 rad/s, 0xfe00 = -512 -> -1, 0x0001 -> 1/512.
  EXPECT_EQ(sensor.Decode(MtiFrame(0x032, {0x02, 0x00, 0xfe, 0x00, 0x00, 0x01})),
            InertialPart::kRate);
  EXPECT_EQ(sensor.reading().rate_rad_s, (std::array<float, 3>{1, -1, 1.0F / 512}));
  EXPECT_EQ(sensor.Decode(MtiFrame(0x005, {0x01, 0x02, 0x03, 0x04})), InertialPart::kTime);
  EXPECT_EQ(sensor.reading().time, 0x01020304U);
}

TEST(XsensMti, TakesNothingOfWhatIsNotItsOwnOrIsMalformed) {
  XsensMti sensor{XsensMtiConfig{}};
  const InertialReading before = sensor.reading();
  EXPECT_EQ(sensor.Decode(MtiFrame(0x011, {1, 2, 3, 4, 5, 6, 7, 8})), InertialPart::kNone);
  EXPECT_EQ(sensor.Decode(MtiFrame(0x021, {1, 2, 3, 4, 5, 6, 7})), InertialPart::kOther);
  EXPECT_EQ(sensor.Decode(MtiFrame(0x032, {1, 2, 3, 4, 5})), InertialPart::kOther);
  EXPECT_EQ(sensor.Decode(MtiFrame(0x005, {})), InertialPart::kOther);
  CanFrame extended = MtiFrame(0x021, {1, 2, 3, 4, 5, 6, 7, 8});
  extended.extended = true;
  EXPECT_EQ(sensor.Decode(extended), InertialPart::kNone);
  CanFrame remote = MtiFrame(0x032, {1, 2, 3, 4, 5, 6});
  remote.remote = true;
  EXPECT_EQ(sensor.Decode(remote), InertialPart::kNone);
  EXPECT_EQ(sensor.reading().attitude, before.attitude);
  EXPECT_EQ(sensor.reading().rate_rad_s, before.rate_rad_s);
}

TEST(XsensMti, CountsReportsThatRepeatTheSameNumbers) {
  XsensMti sensor{XsensMtiConfig{}};
  const CanFrame attitude = MtiFrame(0x021, {0x7f, 0xff, 0, 0, 0, 0, 0, 1});
  const CanFrame rate = MtiFrame(0x032, {0, 0, 0, 1, 0, 0});
  for (std::uint32_t i = 0; i < 5; ++i) {
    sensor.Decode(attitude);
    sensor.Decode(rate);
    EXPECT_EQ(sensor.reading().repeats, i);
  }
  sensor.Decode(attitude);
  sensor.Decode(MtiFrame(0x032, {0, 0, 0, 2, 0, 0}));
  EXPECT_EQ(sensor.reading().repeats, 0U) << "the rate is another one";
}

TEST(XsensMti, ReadsWhatTheSensorsSideWritesToHalfAStepOfTheWire) {
  const XsensMtiConfig config{0x123, 0x7ff, 0};
  ASSERT_EQ(config.Validate(), Status::kOk);
  XsensMti sensor{config};
  for (double x = -1; x <= 1; x += 0.0137) {
    EXPECT_EQ(sensor.Decode(XsensQuaternionFrame(config, {x, -x, x / 3, 1})),
              InertialPart::kAttitude);
    EXPECT_NEAR(static_cast<double>(sensor.reading().attitude[0]), x, 0.51 / 32767);
    EXPECT_NEAR(static_cast<double>(sensor.reading().attitude[1]), -x, 0.51 / 32767);
    sensor.Decode(XsensRateFrame(config, {60 * x, 0, -60 * x}));
    EXPECT_NEAR(static_cast<double>(sensor.reading().rate_rad_s[0]), 60 * x, 0.51 / 512);
  }
  sensor.Decode(XsensRateFrame(config, {1e9, -1e9, NAN}));
  EXPECT_EQ(sensor.reading().rate_rad_s[0], 32767.0F / 512);
  EXPECT_EQ(sensor.reading().rate_rad_s[1], -32767.0F / 512);
  EXPECT_EQ(XsensMtiConfig({0x21, 0x21, 5}).Validate(), Status::kInvalidArgument);
  EXPECT_EQ(XsensMtiConfig({0x800, 0x21, 5}).Validate(), Status::kInvalidArgument);
}

// ---- The drives file ----------------------------------------------------------------------------

std::string WithSensor(const std::string& more = "") {
  return testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml")) +
         "\n[sensor]\nprotocol = \"xsens-mti\"\nlink = \"base_link\"\n" + more;
}

TEST(SensorToml, ATickOfTwoDrivesAndASensorTakes790BitsAnd956WithTheReserve) {
  const DrivesConfig config = ParseDrives(WithSensor(), "drives.toml");
  ASSERT_TRUE(config.sensor);
  EXPECT_EQ(config.WorstCaseTickBits(), 2 * 270 + 135 + 115);
  EXPECT_EQ(config.WorstCaseTickBits() + 31 + 135, 956);
  EXPECT_EQ(ParseDrives(WithSensor("time_rate_hz = 100\n"), "d").WorstCaseTickBits(), 800);
  const std::vector<CanId> received = config.HostReceives();
  EXPECT_NE(std::ranges::find(received, CanId(0x021)), received.end());
  EXPECT_NE(std::ranges::find(received, CanId(0x032)), received.end());
  EXPECT_EQ(std::ranges::find(received, CanId(0x005)), received.end());
  EXPECT_EQ(config.sensor->rate_hz, 1000);
}

TEST(SensorToml, RefusesWhatCannotBeWithTheKey) {
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"quaternion_id = 0x800\n", "quaternion_id"},
      {"quaternion_id = 17\n", "joint 'leg1'"},
      {"rate_id = 2\n", "joint 'leg2'"},
      {"rate_id = 0x21\n", "quaternion_id"},
      {"age_max_s = 0.001\n", "1.5 / rate_hz"},
      {"mount_rpy_rad = [0, 0]\n", "mount_rpy_rad"},
      {"jump_max_rad = nan\n", "jump_max_rad"},
      {"time_rate_hz = 5000\n", "time_rate_hz"},
      {"tilt = 3\n", "tilt"},
  };
  for (const auto& [line, fragment] : wrong) {
    try {
      (void)ParseDrives(WithSensor(line), "drives.toml");
      ADD_FAILURE() << line << " was accepted";
    } catch (const FileError& error) {
      EXPECT_NE(std::string(error.what()).find(fragment), std::string::npos) << error.what();
    }
  }
}

// ---- The simulated sensor -----------------------------------------------------------------------

/// What a host decodes of a simulated sensor over a time.
struct Heard {
  std::vector<std::int64_t> times_ns;
  std::vector<InertialReading> readings;
};
Heard Listen(const SimulatedSensorConfig& errors, double pitch_rad, double rate_rad_s,
             double until_s, const std::array<double, 3>& mount = {}) {
  SensorEntry entry;
  entry.mount_rpy_rad = mount;
  SimulatedSensor sensor(entry, errors);
  SimulatedBus bus(1'000'000);
  SimulatedPort& host = bus.Attach();
  sensor.AttachTo(bus);
  XsensMti codec{std::get<XsensMtiConfig>(entry.config)};
  Heard heard;
  while (static_cast<double>(sensor.next_ns()) < until_s * 1e9) {
    bus.AdvanceTo(sensor.next_ns());
    sensor.Measure(pitch_rad, rate_rad_s, 0);
    bus.AdvanceTo(sensor.next_ns() - 1);
    ReceivedFrame received;
    while (host.Receive(received) == Status::kOk) {
      if (codec.Decode(received.frame) != InertialPart::kRate) continue;
      heard.times_ns.push_back(received.time_ns);
      heard.readings.push_back(codec.reading());
    }
  }
  return heard;
}

double PitchOf(const InertialReading& reading) {
  const double w = static_cast<double>(reading.attitude[0]),
               y = static_cast<double>(reading.attitude[2]);
  return -2 * std::atan2(y, w);
}

TEST(SimulatedSensor, NoiseAndBiasAreThoseOfItsConfiguration) {
  SimulatedSensorConfig errors;
  errors.noise_rad = 5e-3;
  errors.rate_noise_rad_s = 20e-3;
  errors.bias_rad = 0.01;
  const Heard heard = Listen(errors, 0.4, -1.5, 4);
  ASSERT_EQ(heard.readings.size(), 4000U);
  double mean = 0, square = 0, rate_mean = 0, rate_square = 0;
  for (const InertialReading& reading : heard.readings) {
    mean += PitchOf(reading) / 4000;
    rate_mean -= static_cast<double>(reading.rate_rad_s[1]) / 4000;
  }
  for (const InertialReading& reading : heard.readings) {
    square += std::pow(PitchOf(reading) - mean, 2) / 4000;
    rate_square += std::pow(-static_cast<double>(reading.rate_rad_s[1]) - rate_mean, 2) / 4000;
  }
  EXPECT_NEAR(mean, 0.41, 4e-4);
  EXPECT_NEAR(std::sqrt(square), 5e-3, 3e-4);
  EXPECT_NEAR(rate_mean, -1.5, 2e-3);
  EXPECT_NEAR(std::sqrt(rate_square), 20e-3, 1.2e-3);
}

TEST(SimulatedSensor, FailsAsItIsTold) {
  SimulatedSensorConfig errors;
  errors.failures = {{SensorFault::kSilent, 0.1, false, 0.05}};
  EXPECT_EQ(Listen(errors, 0, 0, 0.3).readings.size(), 250U);
  errors.failures = {{SensorFault::kFrozen, 0.1, false, 0.05}};
  Heard heard = Listen(errors, 0, 0, 0.3);
  EXPECT_EQ(heard.readings[120].repeats, 21U);
  EXPECT_EQ(heard.readings[160].repeats, 0U);
  errors.noise_rad = 0;
  errors.failures = {{SensorFault::kOffset, 0.1, false, 1e9, 0.3}};
  heard = Listen(errors, 0.2, 0, 0.2);
  EXPECT_NEAR(PitchOf(heard.readings[50]), 0.2, 1e-4);
  EXPECT_NEAR(PitchOf(heard.readings[150]), 0.5, 1e-4);
  errors.failures = {{SensorFault::kLate, 0.1, false, 0.15, 0, 0.1}};
  heard = Listen(errors, 0.2, 0, 0.35);
  EXPECT_NEAR(static_cast<double>(heard.readings.size()), 250, 1)
      << "100 reports are held back, and given up at the end";
  std::int64_t gap_ns = 0;
  for (std::size_t i = 1; i < heard.times_ns.size(); ++i)
    gap_ns = std::max(gap_ns, heard.times_ns[i] - heard.times_ns[i - 1]);
  EXPECT_NEAR(static_cast<double>(gap_ns), 0.1e9, 2e6);
}

}  // namespace
}  // namespace tumbler
