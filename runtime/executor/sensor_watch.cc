#include "runtime/executor/sensor_watch.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/core/feedback.h"
#include "runtime/executor/numbers.h"

namespace tumbler {
namespace {

/// The time in which a departure of attitude and rates is forgotten. A bias of the rate by b shows
/// as b times this, and a step of the attitude as itself.
constexpr float kForget_s = 0.1F;

/// The same of a turn out of the plane: a robot begins to turn slowly.
constexpr float kForgetTwist_s = 0.25F;

/// A turn out of the plane, of late, that is doubtful, unless it is less than this share of the
/// turn in it, of which a sensor that sits a little askew has some.
constexpr float kDoubtful_rad = 0.01F, kDoubtfulShare = 0.25F;

/// The share of the largest rate that may be out of the plane: legs twist when they land.
constexpr float kOutOfPlane = 0.25F;

/// How far the length of a quaternion, squared, may be from one. Rounding on the wire costs 1e-4.
constexpr float kLength = 0.05F;

/// A link that turns slower than this, about every axis, rests. A sensor's noise is a tenth of it.
constexpr float kRest_rad_s = 0.2F;

/// After so many ticks the promptest report counts as one step of its clock slower, because the
/// clocks of host and sensor do not run alike: at 1 kHz, 100 ppm.
constexpr std::int32_t kCreepTicks = 1000;

/// What is older, in ticks, is no older than this.
constexpr std::int32_t kOldest = 1 << 30;

}  // namespace

const char* ToString(SensorStatus status) noexcept {
  static constexpr std::array<const char*, kSensorStatusCount> kNames{
      "none",   "ok",          "no data", "stale",    "late",
      "frozen", "no rotation", "tilted",  "too fast", "inconsistent"};
  return kNames[static_cast<std::size_t>(status)];
}

float AngleOf(float x, float y) noexcept {
  // arctan of at most one: [Abramowitz and Stegun, Handbook of Mathematical Functions, 4.4.49].
  constexpr std::array<float, 9> kArctan{1.0F,           -0.3333314528F, 0.1999355085F,
                                         -0.1420889944F, 0.1065626393F,  -0.0752896400F,
                                         0.0429096138F,  -0.0161657367F, 0.0028662257F};
  constexpr float kHalfPi = 1.5707963F;
  constexpr float kPi = 3.1415927F;
  // A negative zero stays one, so that the angle of (1, -0) is -0.
  const float ax = x < 0 ? -x : x;
  const float ay = y < 0 ? -y : y;
  const float large = ax > ay ? ax : ay;
  if (!(large > 0)) return 0;
  const float z = (ax > ay ? ay : ax) / large;
  const float z2 = z * z;
  float sum = kArctan[8];
  for (std::size_t i = 8; i-- > 0;) sum = sum * z2 + kArctan[i];
  float angle = sum * z;
  if (ay > ax) angle = kHalfPi - angle;
  if (x < 0) angle = kPi - angle;
  return y < 0 ? -angle : angle;
}

bool SensorSettings::IsValid() const noexcept {
  if (!(age_ticks_max >= 1 && IsPositive(tilt_sine_max) && IsPositive(rate_max_rad_s) &&
        IsPositive(twist_max_rad) && IsPositive(jump_max_rad) && IsPositive(late_max_s))) {
    return false;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      float dot = 0;
      for (std::size_t c = 0; c < 3; ++c) dot += mounting[i][c] * mounting[k][c];
      if (!(Magnitude(dot - (i == k ? 1.0F : 0.0F)) < 1e-3F)) return false;
    }
  }
  const auto& m = mounting;
  const float turn = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                     m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                     m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  return turn > 0 &&
         std::ranges::all_of(chain, [](float x) { return x == 0 || x == 1 || x == -1; });
}

void SensorWatch::Start(float period_s) noexcept {
  const SensorSettings settings = settings_;
  *this = SensorWatch(*sensor_, settings);
  ids_ = sensor_->ids();
  chain_ = settings.chain;
  age_ticks_max_ = settings.age_ticks_max;
  // One comparison less in every tick.
  if (settings.repeats_max == 0) settings_.repeats_max = std::numeric_limits<std::uint32_t>::max();
  for (std::size_t of = 0; of < 3; ++of) {
    for (std::size_t along = 0; along < 3; ++along)
      mounting_[of][along] = settings.mounting[along][of];
  }
  period_s_ = period_s;
  // Of a tick, which is what most reports take.
  twist_kept_ = std::max(1 - period_s / kForgetTwist_s, 0.0F);
  twist_lead_s_ = settings.twist_max_rad / (kOutOfPlane * settings.rate_max_rad_s);
  twist_square_max_ = settings.twist_max_rad * settings.twist_max_rad;
  steps_per_tick_ = static_cast<std::int64_t>(period_s / InertialSensor::kTimeStep_s * 65536);
}

void SensorWatch::Trust() noexcept {
  implausible_ = SensorStatus::kOk;
  parted_rad_ = 0;
  tilt_rad_ = 0;
}

bool SensorWatch::Take(const CanFrame& frame, std::int32_t age_ticks) noexcept {
  const InertialPart part = sensor_->Decode(frame);
  if (part == InertialPart::kNone) return false;
  Count(part, sensor_->reading(), age_ticks);
  return true;
}

void SensorWatch::TakeTime(std::uint32_t time) noexcept {
  // Differences are taken with wrapping, so that it does not matter what the clocks began with.
  const auto now = static_cast<std::uint32_t>(host_time_ >> 16);
  if (!has_promptest_) first_time_ = time - now;
  const auto behind = static_cast<std::int32_t>(now - (time - first_time_));
  if (!has_promptest_ || behind < promptest_) promptest_ = behind;
  has_promptest_ = true;
  // The difference of two int32 that are in order is in the range of an uint32.
  const auto later = static_cast<std::uint32_t>(behind) - static_cast<std::uint32_t>(promptest_);
  is_late_ = static_cast<float>(later) * InertialSensor::kTimeStep_s > settings_.late_max_s;
}

void SensorWatch::EndTick(int elapsed, const InertialReading& reading) noexcept {
  host_time_ += elapsed * steps_per_tick_;
  creep_ticks_ += elapsed;
  if (creep_ticks_ >= kCreepTicks) {
    promptest_ += creep_ticks_ / kCreepTicks;
    creep_ticks_ = 0;
    age_ticks_ = std::min(age_ticks_, kOldest);  // here, because it may be late
  }
  if (age_ticks_ >= 0) age_ticks_ += elapsed;
  if (attitude_age_ticks_ >= 0 && rate_age_ticks_ >= 0) {
    waiting_ = InertialPart::kNone;
    TakeReport(reading, std::max(attitude_age_ticks_, rate_age_ticks_));
  } else {
    JoinParts(elapsed, reading);
  }
  attitude_age_ticks_ = rate_age_ticks_ = -1;
  status_ = implausible_;
  if (status_ != SensorStatus::kOk) return;
  if (IsOld()) {
    status_ = age_ticks_ < 0 ? SensorStatus::kNoData : SensorStatus::kStale;
  } else if (is_late_) {
    status_ = SensorStatus::kLate;
  }
}

// The halves of a report may come in two ticks. It is as old as the older of them.
void SensorWatch::JoinParts(int elapsed, const InertialReading& reading) noexcept {
  if (waiting_ != InertialPart::kNone)
    waiting_age_ticks_ = std::min(waiting_age_ticks_ + elapsed, kOldest);
  const bool is_attitude = attitude_age_ticks_ >= 0;
  const std::int32_t age_ticks = is_attitude ? attitude_age_ticks_ : rate_age_ticks_;
  if (age_ticks < 0) return;
  const InertialPart part = is_attitude ? InertialPart::kAttitude : InertialPart::kRate;
  if (waiting_ == InertialPart::kNone || waiting_ == part) {
    waiting_ = part;
    waiting_age_ticks_ = age_ticks;
  } else {
    waiting_ = InertialPart::kNone;
    TakeReport(reading, std::max(waiting_age_ticks_, age_ticks));
  }
}

SensorWatch::Lanes SensorWatch::InLink(float x, float y, float z) const noexcept {
  return mounting_[0] * x + mounting_[1] * y + mounting_[2] * z;
}

void SensorWatch::TakeReport(const InertialReading& reading,
                             std::int32_t report_age_ticks) noexcept {
  const auto [w, x, y, z] = reading.attitude;
  const auto& rate = reading.rate_rad_s;
  const float ww = w * w, xx = x * x, yy = y * y, zz = z * z;
  // The world's z in the axes of the sensor: the third row of its rotation.
  const Lanes up = InLink(2 * (x * z - w * y), 2 * (y * z + w * x), ww - xx - yy + zz);
  const Lanes turn = InLink(rate[0], rate[1], rate[2]);
  const float pitch_rad = AngleOf(up[2], up[0]);
  const float rate_rad_s = -turn[1];

  const bool fresh = IsOld();
  const std::int32_t since =
      std::max<std::int32_t>(age_ticks_ - report_age_ticks, 0);  // the last report
  if (fresh) {
    parted_rad_ = 0;  // What the sensor did meanwhile is not known.
    twist_rad_ = Lanes{};
  } else {
    const float time_s = static_cast<float>(since) * period_s_;
    const float turned = 0.5F * (rate_rad_s + rate_rad_s_) * time_s;
    parted_rad_ += WithoutTurns(pitch_rad - pitch_rad_) - turned;
    parted_rad_ -= parted_rad_ * std::min(time_s / kForget_s, 1.0F);
    const float kept = since == 1 ? twist_kept_ : std::max(1 - time_s * (1 / kForgetTwist_s), 0.0F);
    twist_rad_ = kept * (twist_rad_ + turn * time_s);
  }
  pitch_rad_ = pitch_rad;
  rate_rad_s_ = rate_rad_s;
  age_ticks_ = report_age_ticks;
  if (implausible_ != SensorStatus::kOk) return TakeTilt(reading, up, turn);
  // Out of the plane it has turned too far, or is about to.
  const Lanes twist = twist_rad_ + turn * twist_lead_s_;
  const float twist_square = twist[0] * twist[0] + twist[2] * twist[2];
  is_doubtful_ = twist_square > kDoubtful_rad * kDoubtful_rad &&
                 twist_square > kDoubtfulShare * kDoubtfulShare * (twist[1] * twist[1]);
  if (reading.repeats > settings_.repeats_max) {
    implausible_ = SensorStatus::kFrozen;
  } else if (!(Magnitude(ww + xx + yy + zz - 1) <= kLength)) {
    implausible_ = SensorStatus::kNoRotation;
  } else if (!(Magnitude(up[1]) <= settings_.tilt_sine_max && twist_square <= twist_square_max_)) {
    implausible_ = SensorStatus::kTilted;
    TakeTilt(reading, up, turn);
  } else if (!(Magnitude(rate_rad_s) <= settings_.rate_max_rad_s)) {
    implausible_ = SensorStatus::kTooFast;
  } else if (!(Magnitude(parted_rad_) <= settings_.jump_max_rad)) {
    implausible_ = SensorStatus::kInconsistent;
  }
}

// Of a sensor that is not believed any more because it was tilted: whether it still is. What shows
// the robot on its side has to be a rotation, and news.
void SensorWatch::TakeTilt(const InertialReading& reading, Lanes up, Lanes turn) noexcept {
  tilt_rad_ = 0;
  const float length = up[0] * up[0] + up[1] * up[1] + up[2] * up[2];
  if (implausible_ != SensorStatus::kTilted || reading.repeats > settings_.repeats_max ||
      !(Magnitude(length - 1) <= kLength) || !(Magnitude(up[1]) > settings_.tilt_sine_max)) {
    return;
  }
  tilt_rad_ = AngleOf(std::sqrt(up[0] * up[0] + up[2] * up[2]), Magnitude(up[1]));
  tilt_rests_ =
      turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2] <= kRest_rad_s * kRest_rad_s;
}

}  // namespace tumbler
