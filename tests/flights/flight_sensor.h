#pragma once

#include <cstdint>

#include "firmware_interface/can/simulated_bus.h"
#include "runtime/executor/tick.h"
#include "tests/flights/flight_setting.h"

namespace tumbler::testing {

/// How the robot of a flight lies, and the sensor that measures it. It does what the plan says
/// unless something happens to it: this is no physics.
class FlightSensor final : public SimulatedNode {
 public:
  explicit FlightSensor(const FlightSetting& setting);
  void AttachTo(SimulatedBus& bus);

  /// Lets time pass. @param turned_rad, rate_rad_s  of the sensor's link against the root.
  void AdvanceTo(std::int64_t time_ns, double turned_rad, double rate_rad_s);
  /// Takes note of a tick of the executor.
  void Follow(const TickRecord& record, ExecutorState after);

  void Fail(FlightSensorFault fault, std::int64_t duration_ns);
  /// It falls, and lies with this pitch.
  void Fall(double pitch_rad);
  /// It is put down as one of the beginnings has it.
  void PutDown();

  void OnFrame(const ReceivedFrame& /*received*/, SimulatedPort& /*port*/) noexcept override {}

 private:
  void Send(std::int64_t time_ns, double pitch_rad, double rate_rad_s);

  const FlightSetting& setting_;
  SimulatedPort* port_ = nullptr;
  std::int64_t now_ns_ = 0, next_ns_ = 0;
  double pitch_rad_ = 0, rate_rad_s_ = 0;
  double wanted_rad_ = 0;
  double run_from_rad_ = 0;
  bool fallen_ = false;
  bool runs_ = false;
  int put_down_ = 0;
  std::uint32_t noise_ = 1;
  FlightSensorFault fault_ = FlightSensorFault::kSilent;
  std::int64_t fails_until_ns_ = -1;
  CanFrame last_attitude_, last_rate_;
};

}  // namespace tumbler::testing
