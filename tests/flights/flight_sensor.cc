#include "tests/flights/flight_sensor.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "firmware_interface/devices/xsens_mti.h"

namespace tumbler::testing {
namespace {

constexpr double kFastest_rad_s = 20;
constexpr double kApproach_s = 0.04;

}  // namespace

FlightSensor::FlightSensor(const FlightSetting& setting) : setting_(setting) {
  PutDown();
  pitch_rad_ = wanted_rad_;
}

void FlightSensor::AttachTo(SimulatedBus& bus) {
  SimulatedPortConfig config;
  config.restart_ns = 0;
  port_ = &bus.Attach(*this, config);
}

void FlightSensor::Fail(FlightSensorFault fault, std::int64_t duration_ns) {
  fault_ = fault;
  fails_until_ns_ = now_ns_ + duration_ns;
}

void FlightSensor::Fall(double pitch_rad) {
  fallen_ = true;
  wanted_rad_ = pitch_rad;
}

void FlightSensor::PutDown() {
  fallen_ = false;
  const auto beginnings = setting_.graph.beginnings();
  if (beginnings.empty()) return;
  const SequenceBeginning<float>* beginning =
      &beginnings[static_cast<std::size_t>(put_down_++) % beginnings.size()];
  for (const SequenceBeginning<float>& each : beginnings) {
    if (each.node == setting_.executor.begin) beginning = &each;
  }
  wanted_rad_ = static_cast<double>(beginning->pitch_rad);
}

void FlightSensor::Follow(const TickRecord& record, ExecutorState after) {
  if (!setting_.has_sensor) return;
  const bool runs = record.state == ExecutorState::kRunning;
  if (runs && !runs_) {
    run_from_rad_ = wanted_rad_;
    fallen_ = false;
  }
  runs_ = runs && after == ExecutorState::kRunning;
  if (!runs || fallen_) return;
  const SequenceGraph<float>& graph = setting_.graph;
  const SequenceNode& node = graph.node(record.node);
  const Primitive<float>& primitive = setting_.primitives[static_cast<std::size_t>(node.primitive)];
  const double end =
      static_cast<double>(graph.last_pitch_rad[static_cast<std::size_t>(record.node)]);
  if (primitive.feedback.present()) {
    wanted_rad_ =
        static_cast<double>(primitive.feedback.angle.Evaluate(record.primitive_time_s).value +
                            (node.swapped ? graph.swap_pitch_rad : 0.0F));
  } else {
    const double share = static_cast<double>(record.primitive_time_s / primitive.duration_s);
    const double way = std::remainder(end - run_from_rad_, 2 * std::numbers::pi);
    wanted_rad_ = run_from_rad_ + std::min(1.2 * share, 1.0) * way;
  }
  // What is beyond the graph's own knowledge ends where it says.
  if (after != ExecutorState::kRunning) wanted_rad_ = end;
}

void FlightSensor::AdvanceTo(std::int64_t time_ns, double turned_rad, double rate_rad_s) {
  const double passed_s = static_cast<double>(time_ns - now_ns_) * 1e-9;
  now_ns_ = time_ns;
  const double left = std::remainder(wanted_rad_ - pitch_rad_, 2 * std::numbers::pi);
  rate_rad_s_ = std::clamp(left / kApproach_s, -kFastest_rad_s, kFastest_rad_s);
  if (std::abs(left) < 1e-4) rate_rad_s_ = 0;
  pitch_rad_ += passed_s * rate_rad_s_;
  if (time_ns < next_ns_) return;
  next_ns_ = time_ns + setting_.sensor_every * setting_.period_ns;
  Send(time_ns, pitch_rad_ + turned_rad, rate_rad_s_ + rate_rad_s);
}

void FlightSensor::Send(std::int64_t time_ns, double pitch_rad, double rate_rad_s) {
  const bool fails = time_ns < fails_until_ns_;
  const auto is = [&](FlightSensorFault fault) { return fails && fault_ == fault; };
  if (is(FlightSensorFault::kSilent)) return;
  noise_ = noise_ * 1664525U + 1013904223U;
  const double noise = static_cast<double>(noise_ >> 16) / 65536 - 0.5;
  double pitch = pitch_rad + 5e-4 * noise, rate = rate_rad_s + 0.01 * noise;
  if (is(FlightSensorFault::kInconsistent)) pitch += 0.3;
  if (is(FlightSensorFault::kTooFast)) rate = 45;
  const double c = std::cos(pitch / 2), s = -std::sin(pitch / 2);
  std::array<double, 4> attitude{c, 0, s, 0};
  if (is(FlightSensorFault::kTilted)) {
    constexpr double kCosine = 0.95, kSine = 0.31;  // of half the tilt
    attitude = {c * kCosine, c * kSine, s * kCosine, -s * kSine};
  }
  if (is(FlightSensorFault::kNoRotation)) {
    for (double& x : attitude) x *= 0.8;
  }
  const XsensMtiConfig& ids = setting_.sensor_ids;
  if (!is(FlightSensorFault::kFrozen) || last_attitude_.size == 0) {
    last_attitude_ = XsensQuaternionFrame(ids, attitude);
    last_rate_ = XsensRateFrame(ids, {0, -rate, 0});
  }
  if (setting_.sensor_has_time) {
    const std::int64_t late_ns = is(FlightSensorFault::kLate) ? 60'000'000 : 0;
    const auto steps =
        static_cast<std::uint32_t>(std::max<std::int64_t>(time_ns - late_ns, 0) / 100'000);
    static_cast<void>(port_->Send(XsensTimeFrame(ids, steps)));
  }
  static_cast<void>(port_->Send(last_attitude_));
  static_cast<void>(port_->Send(last_rate_));
}

}  // namespace tumbler::testing
