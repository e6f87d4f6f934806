#pragma once

#include <array>
#include <cstdint>

#include "firmware_interface/can/frame.h"

namespace tumbler {

/// The last report of an inertial sensor.
struct InertialReading {
  /// The sensor's attitude as a quaternion w, x, y, z, which turns vectors of the sensor's frame
  /// into those of a world whose z is up. Its heading may be any.
  std::array<float, 4> attitude{1, 0, 0, 0};
  /// Rate of turn about the axes of the sensor's frame.
  std::array<float, 3> rate_rad_s{};
  /// When it was measured, by the sensor's own clock, in steps of `InertialSensor::kTimeStep_s`;
  /// wraps. Where the sensor does not say: 0.
  std::uint32_t time = 0;
  /// How many reports in a row have had exactly the numbers of the one before. A sensor that works
  /// has noise.
  std::uint32_t repeats = 0;
};

/// What a sensor measures at one time, for its side of the bus.
struct SensorReport {
  std::array<double, 4> attitude{1, 0, 0, 0};  ///< As `InertialReading::attitude`.
  std::array<double, 3> rate_rad_s{};
  std::uint32_t time = 0;
};

/// A message that a sensor sends.
struct SensorMessage {
  const char* key;   ///< That gives its identifier in drives files.
  const char* what;  ///< It brings, in the plural.
  std::uint32_t id = 0;
  int size = 0;          ///< [bytes]
  bool is_time = false;  ///< Whether it is sent at the rate of sample times, or not at all.
};

/// What a frame brought.
enum class InertialPart : std::uint8_t {
  kNone,   ///< It is not the sensor's.
  kOther,  ///< The sensor's, but malformed.
  kAttitude,
  kRate,
  kTime,
};

/// Host side of an inertial sensor on the bus, which sends by its own clock. It has no clock and no
/// bus of its own.
///
/// Real time: no heap, no locks, no exceptions. Freestanding.
class InertialSensor {
 public:
  static constexpr float kTimeStep_s = 1e-4F;

  InertialSensor() = default;
  InertialSensor(const InertialSensor&) = delete;  // One object speaks for one sensor.
  InertialSensor& operator=(const InertialSensor&) = delete;
  virtual ~InertialSensor() = default;

  /// The identifiers of its frames, of 11 bits.
  [[nodiscard]] const std::array<std::uint32_t, 3>& ids() const noexcept { return ids_; }
  /// Takes a frame, and updates `reading()` from it.
  virtual InertialPart Decode(const CanFrame& frame) noexcept = 0;
  [[nodiscard]] const InertialReading& reading() const noexcept { return reading_; }

 protected:
  std::array<std::uint32_t, 3> ids_{};
  InertialReading reading_;
};

}  // namespace tumbler
