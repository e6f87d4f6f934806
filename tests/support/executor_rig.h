#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "runtime/executor/executor.h"
#include "runtime/executor/sensor_watch.h"
#include "tests/support/scripted_drive.h"

namespace tumbler::testing {

/// An executor with scripted drives. Their joints go exactly where they are sent, one tick later.
class ExecutorRig {
 public:
  ExecutorRig(const ExecutorConfig& config, const Primitive<float>& primitive)
      : ExecutorRig(config, GraphOf(primitive), {primitive}) {}
  ExecutorRig(const ExecutorConfig& config, const SequenceGraph<float>& graph,
              std::vector<Primitive<float>> primitives)
      : primitives_(std::move(primitives)) {
    const Primitive<float>& first =
        primitives_.at(static_cast<std::size_t>(graph.node(graph.start).primitive));
    for (int i = 0; i < first.joint_count; ++i) {
      drives.push_back(std::make_unique<ScriptedDrive>(static_cast<std::uint32_t>(100 + i)));
      pointers_.push_back(drives.back().get());
      const auto role = static_cast<std::size_t>(graph.RoleOf(graph.start, i));
      drives.back()->reply.position_rad = first.joints[role].position.control_points()[0];
    }
    config_ = config;
    graph_ = graph;
    Reconfigure();
  }

  /// Configures the executor again, after something about the drives was changed.
  void Reconfigure() {
    std::unique_ptr<SensorWatch> watch;
    if (sensor.device != nullptr)
      watch = std::make_unique<SensorWatch>(*sensor.device, sensor.settings);
    configured = executor.Configure(config_, graph_, primitives_, pointers_, watch.get());
    if (configured == Status::kOk) watch_ = std::move(watch);
  }

  /// One tick in which every drive that is not silent answers.
  const TickRecord& Tick(OperatorCommand command = OperatorCommand::kNone) {
    received_.clear();
    for (std::size_t i = 0; i < drives.size(); ++i) {
      ScriptedDrive& drive = *drives[i];
      const bool obeys =
          follow && drive.request == DriveRequest::kEnable && drive.setpoint.kp_nm_per_rad > 0;
      if (obeys) drive.reply.position_rad = drive.setpoint.position_rad;
      for (int n = silent[i] ? 0 : replies[i]; n > 0; --n)
        received_.push_back({drive.Answer(), stamp_ns});
    }
    for (const CanFrame& frame : sensor_frames) received_.push_back({frame, 0});
    if (foreign_id != 0) {
      CanFrame frame;
      frame.id = foreign_id;
      received_.push_back({frame, 0});
    }
    input.received = received_;
    input.command = command;
    executor.Tick(input, output);
    input.tick += 1;
    return output.record;
  }

  /// Ticks until the executor is in `state`; false when it does not get there in `ticks_max`.
  bool TickUntil(ExecutorState state, int ticks_max = 100000,
                 const std::function<void()>& each = {}) {
    for (int i = 0; i < ticks_max && executor.state() != state; ++i) {
      Tick();
      if (each) each();
    }
    return executor.state() == state;
  }

  /// Brings the executor from disarmed into `state`, each joint following. @returns false if that
  /// failed.
  bool Reach(ExecutorState state) {
    Tick();
    if (state == ExecutorState::kDisarmed) return true;
    Tick(OperatorCommand::kArm);
    if (state == ExecutorState::kArming) return executor.state() == state;
    if (!TickUntil(ExecutorState::kHolding, 1000)) return false;
    if (state == ExecutorState::kHolding) return true;
    Tick(OperatorCommand::kMoveToStart);
    for (int i = 0; i < 3 && state == ExecutorState::kMovingToStart; ++i) Tick();
    if (state == ExecutorState::kMovingToStart) return executor.state() == state;
    if (!TickUntil(ExecutorState::kHolding)) return false;
    Tick(OperatorCommand::kRun);
    for (std::int64_t i = 0; i < executor.run_ticks() / 3; ++i) Tick();
    if (state == ExecutorState::kRunning) return executor.state() == state;
    if (state == ExecutorState::kStopping) {
      Tick(OperatorCommand::kStop);
      return executor.state() == state;
    }
    if (state == ExecutorState::kSettling) return TickUntil(state);
    if (state == ExecutorState::kFault) {
      input.tick += 100;  // A late tick: damps while running.
      Tick();
      return executor.state() == state;
    }
    return false;
  }

  Executor executor;
  Status configured = Status::kInvalidArgument;
  std::vector<std::unique_ptr<ScriptedDrive>> drives;
  std::array<bool, kMaxJoints> silent{};
  std::array<int, kMaxJoints> replies = OneEach();  ///< Of each drive in each tick.
  std::int64_t stamp_ns = 0;                        ///< Of the replies.
  std::uint32_t foreign_id = 0;  ///< Of a frame of somebody else in each tick; 0: there is none.
  bool follow = true;
  struct {
    InertialSensor* device = nullptr;  ///< Null: there is none.
    SensorSettings settings;
  } sensor;                             ///< Takes effect with Reconfigure.
  std::vector<CanFrame> sensor_frames;  ///< Sent in every tick.
  TickInput input;
  TickOutput output;

 private:
  static constexpr std::array<int, kMaxJoints> OneEach() {
    std::array<int, kMaxJoints> each{};
    for (int& replies_of_one : each) replies_of_one = 1;
    return each;
  }

  std::unique_ptr<SensorWatch> watch_;
  ExecutorConfig config_;
  SequenceGraph<float> graph_;
  std::vector<Primitive<float>> primitives_;
  std::vector<Drive*> pointers_;
  std::vector<ReceivedFrame> received_;
};

}  // namespace tumbler::testing
