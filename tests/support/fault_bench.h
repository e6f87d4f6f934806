#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/rotor_plant.h"
#include "runtime/executor/executor.h"
#include "tests/support/frame_checker.h"
#include "tests/support/protocol_side.h"

namespace tumbler::testing {

/// An executor, its drives as simulated nodes with rotors, and the bus between them, in virtual
/// time. Every frame that the host hands to the bus, taken or not, and every frame that it receives
/// goes to a `FrameJudge`.
class FaultBench {
 public:
  struct Config {
    DrivesConfig drives;  ///< One drive for each joint of the primitives.
    ExecutorConfig executor;
    SequenceGraph<float> graph;
    std::vector<Primitive<float>> primitives;
    double offset_rad = 0;       ///< Positions of the joints, less the start of the motion.
    int transmit_capacity = 10;  ///< Of the host's queue [frames].
    std::int64_t plant_step_ns = 250'000;
    bool spoilt_replies = false;  ///< as FrameRules
  };
  explicit FaultBench(Config config);
  [[nodiscard]] static FrameRules RulesOf(const Config& config);

  /// Executes one control period. The reference is valid until the next.
  const TickRecord& Tick(OperatorCommand command = OperatorCommand::kNone, std::int8_t branch = -1);
  /// Lets periods pass without a tick.
  void Miss(int periods) { tick_ += periods; }
  bool TickUntil(ExecutorState state, int ticks_max);
  /// Brings the executor from the beginning into a state, as ExecutorRig does. @returns false if
  /// that failed.
  bool Reach(ExecutorState state);

  /// Joint i's drive, and what the tests know of its protocol.
  [[nodiscard]] const DriveConfig& DriveOf(std::size_t i) const {
    return config_.drives.drives[i].config;
  }
  [[nodiscard]] const ProtocolSide& SideOfDrive(std::size_t i) const { return SideOf(DriveOf(i)); }
  /// Adds a disturbance that begins now. Disturbances that are over are forgotten.
  void Disturb(BusFault fault, std::int64_t duration_ns = std::int64_t{1} << 60);

  Executor executor;
  TickOutput output;
  SimulatedBus bus;
  SimulatedPort& host;
  std::vector<std::unique_ptr<SimulatedDrive>> drives;
  std::unique_ptr<RotorPlant> plant;
  SimulatedPort& stranger;  ///< Another node, with which a test can send any frame.
  FrameJudge judge;
  Status configured = Status::kInvalidArgument;
  std::optional<Status> receive_status;  ///< Reported instead of the link's own status.
  /// Called with each frame of a tick as it is handed to the bus.
  std::function<void(const CanFrame&)> on_sent;
  /// Called around the part of a tick that a real loop has: the executor, and handing over its
  /// frames.
  void (*enter_loop)() = nullptr;
  void (*leave_loop)() = nullptr;
  /// Called when bus and plant have got to a tick, before it.
  std::function<void()> before_tick;
  bool keep_log = false;
  std::vector<LoggedFrame> log;
  std::int64_t missing_writes = 0;  ///< Ticks in which a drive got no frame.

  [[nodiscard]] std::int64_t tick() const noexcept { return tick_; }
  [[nodiscard]] std::int64_t now_ns() const noexcept { return tick_ * period_ns_; }
  [[nodiscard]] std::int64_t period_ns() const noexcept { return period_ns_; }
  [[nodiscard]] const Config& config() const noexcept { return config_; }

 private:
  void Judge(std::int64_t time_ns, const CanFrame& frame);

  Config config_;
  DriveBank bank_;
  BusFaultPlan plan_;
  std::vector<ReceivedFrame> received_;
  std::int64_t period_ns_;
  std::int64_t tick_ = 0;
  Status send_status_ = Status::kOk;
};

}  // namespace tumbler::testing
