#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/drives/drives_toml.h"
#include "firmware_interface/drives/make_simulated.h"
#include "firmware_interface/drives/rotor_plant.h"
#include "runtime/core/executor.h"
#include "tests/support/frame_checker.h"
#include "tests/support/protocol_side.h"

namespace tumbler::testing {

/// An executor, its drives as simulated nodes with rotors, and the bus between them, in virtual
/// time. Every frame that the host hands to the bus, taken or not, and every frame that it receives
/// goes to a `FrameJudge`.
class FaultBench {
 public:
  struct Config {
    DrivesConfig drives;  ///< one for each joint of the primitives
    ExecutorConfig executor;
    SequenceGraph<float> graph;
    std::vector<Primitive<float>> primitives;
    double offset_rad = 0;       ///< Where the joints are, against the start of the motion.
    int transmit_capacity = 10;  ///< Frames, of the host's queue.
    std::int64_t plant_step_ns = 250'000;
    bool spoilt_replies = false;  ///< as FrameRules
  };
  explicit FaultBench(Config config);
  [[nodiscard]] static FrameRules RulesOf(const Config& config);

  /// One control period. The reference is good until the next.
  const TickRecord& Tick(OperatorCommand command = OperatorCommand::kNone, std::int8_t branch = -1);
  /// Lets periods pass without a tick.
  void Miss(int periods) { tick_ += periods; }
  bool TickUntil(ExecutorState state, int ticks_max);
  /// From the beginning into a state, as ExecutorRig does. False if that failed.
  bool Reach(ExecutorState state);

  /// Joint i's drive, and what the tests know of its protocol.
  [[nodiscard]] const DriveConfig& DriveOf(std::size_t i) const {
    return config_.drives.drives[i].config;
  }
  [[nodiscard]] const ProtocolSide& SideOfDrive(std::size_t i) const { return SideOf(DriveOf(i)); }
  /// Adds a disturbance from now on. Those that are over are forgotten.
  void Disturb(BusFault fault, std::int64_t duration_ns = std::int64_t{1} << 60);

  Executor executor;
  TickOutput output;
  SimulatedBus bus;
  SimulatedPort& host;
  std::vector<std::unique_ptr<SimulatedDrive>> drives;
  std::unique_ptr<RotorPlant> plant;
  SimulatedPort& stranger;  ///< another node, to send what it likes
  FrameJudge judge;
  Status configured = Status::kInvalidArgument;
  std::optional<Status> receive_status;  ///< What the link is to report instead of its own.
  /// Called with each tick's frames as they are handed to the bus.
  std::function<void(const CanFrame&)> on_sent;
  /// Called around what a real loop does in a tick: the executor, and handing over its frames.
  void (*enter_loop)() = nullptr;
  void (*leave_loop)() = nullptr;
  /// Called when bus and plant have got to a tick, before it.
  std::function<void()> before_tick;
  bool keep_log = false;
  std::vector<LoggedFrame> log;
  std::int64_t missing_writes = 0;  ///< ticks in which a drive got no frame

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
