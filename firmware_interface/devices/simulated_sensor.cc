#include "firmware_interface/devices/simulated_sensor.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/core/functions.h"

namespace tumbler {
namespace {

using Quaternion = std::array<double, 4>;

Quaternion Product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}
Quaternion Conjugate(const Quaternion& q) { return {q[0], -q[1], -q[2], -q[3]}; }

/// The rotation about axis 1, 2 or 3 (x, y, z).
Quaternion About(std::size_t axis, double angle_rad) {
  const auto [sine, cosine] = portable::SinCos(angle_rad / 2);
  Quaternion q{cosine, 0, 0, 0};
  q[axis] = sine;
  return q;
}

/// The vector, given in the link's frame, in the axes of a frame that q turns into the link's.
std::array<double, 3> InFrame(const Quaternion& q, const std::array<double, 3>& vector) {
  const Quaternion turned = Product(Product(Conjugate(q), {0, vector[0], vector[1], vector[2]}), q);
  return {turned[1], turned[2], turned[3]};
}

}  // namespace

SimulatedSensor::SimulatedSensor(const SensorEntry& entry, const SimulatedSensorConfig& config)
    : entry_(entry), config_(config), random_(config.seed) {
  const auto& rpy = entry.mount_rpy_rad;
  mounting_ = Product(Product(About(3, rpy[2]), About(2, rpy[1])), About(1, rpy[0]));
  mounting_ = Product(About(1, config.mount_error_rad), mounting_);
  if (!(entry.rate_hz > 0 && config.delay_s >= 0)) {
    throw std::invalid_argument("a sensor's rate is above 0, and its delay is not negative");
  }
}

void SimulatedSensor::AttachTo(SimulatedBus& bus) {
  SimulatedPortConfig port;
  port.transmit_capacity = 16;
  port_ = &bus.Attach(*this, port);
}

// A sum of twelve uniform numbers: no library's logarithm, so that all machines agree.
double SimulatedSensor::Normal() noexcept {
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += static_cast<double>(random_() >> 11U) * 0x1p-53;
  return sum;
}

SimulatedSensor::Report SimulatedSensor::Measured(double pitch_rad, double rate_rad_s,
                                                  const SensorFailure* offset,
                                                  bool swapped) noexcept {
  double pitch = pitch_rad + config_.bias_rad + config_.noise_rad * Normal();
  if (offset != nullptr) pitch += offset->offset_rad;
  std::array<double, 3> rate{0, -(rate_rad_s + config_.rate_bias_rad_s), 0};
  for (double& x : rate) x += config_.rate_noise_rad_s * Normal();
  Report report;
  // Pitch is about -y. The sensor's attitude is the link's, times the mounting.
  report.attitude = Product(About(2, -pitch), mounting_);
  report.rate_rad_s = InFrame(mounting_, rate);
  if (swapped) {
    std::swap(report.attitude[2], report.attitude[3]);
    std::swap(report.rate_rad_s[1], report.rate_rad_s[2]);
  }
  return report;
}

void SimulatedSensor::Send(const Report& report) noexcept {
  if (port_ == nullptr) return;
  const double every = entry_.time_rate_hz > 0 ? entry_.rate_hz / entry_.time_rate_hz : 0;
  const bool timed = every > 0 && sent_ % std::max<std::int64_t>(1, std::llround(every)) == 0;
  SensorProtocols::With(entry_.config, [&](auto protocol, const auto& own) {
    const auto messages = decltype(protocol)::Messages(own);
    const auto frames = decltype(protocol)::Frames(own, report);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      // A message that finds no mailbox is lost, as in firmware.
      if (timed || !messages[i].is_time) (void)port_->Send(frames[i]);
    }
  });
  ++sent_;
}

void SimulatedSensor::Measure(double pitch_rad, double rate_rad_s,
                              std::int64_t enabled_ns) noexcept {
  const std::int64_t now_ns = next_ns_;
  ++count_;
  next_ns_ = std::llround(static_cast<double>(count_) * 1e9 / entry_.rate_hz);
  const SensorFailure* offset = nullptr;
  const SensorFailure* late = nullptr;
  bool silent = false, frozen = false, swapped = false;
  for (const SensorFailure& failure : config_.failures) {
    if (failure.since_enabled && enabled_ns < 0) continue;
    const double since_s =
        static_cast<double>(now_ns - (failure.since_enabled ? enabled_ns : 0)) * 1e-9 -
        failure.start_s;
    if (!(since_s >= 0 && since_s < failure.duration_s)) continue;
    silent = silent || failure.fault == SensorFault::kSilent;
    frozen = frozen || failure.fault == SensorFault::kFrozen;
    swapped = swapped || failure.fault == SensorFault::kSwappedAxis;
    if (failure.fault == SensorFault::kOffset) offset = &failure;
    if (failure.fault == SensorFault::kLate) late = &failure;
  }
  if (!frozen) last_ = Measured(pitch_rad, rate_rad_s, offset, swapped);
  last_.time = static_cast<std::uint32_t>(now_ns / 100'000);
  last_.due_ns =
      now_ns + std::llround((config_.delay_s + (late != nullptr ? late->late_s : 0)) * 1e9);
  // When a delay ends, the reports that it still holds back are never sent.
  while (!waiting_.empty() && waiting_.back().due_ns > last_.due_ns) waiting_.pop_back();
  waiting_.push_back(last_);
  while (!waiting_.empty() && waiting_.front().due_ns <= now_ns) {
    if (!silent) Send(waiting_.front());
    waiting_.erase(waiting_.begin());
  }
}

}  // namespace tumbler
