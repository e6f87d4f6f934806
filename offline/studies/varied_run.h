#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/core/sequence.h"
#include "firmware_interface/devices/drives_toml.h"
#include "offline/problem/simulated_motion.h"
#include "offline/scene/space_scene.h"
#include "offline/scene/variation.h"
#include "offline/twin/simulated_robot.h"
#include "runtime/assembly/assembly.h"
#include "runtime/assembly/clock.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/executor/run_procedure.h"
#include "runtime/run/control_loop.h"

namespace tumbler {

/// What all robots of a study share.
struct SharedRobot {
  DrivesConfig drives;
  SimulatedRobotConfig config;  ///< Every motor has its torque limit.
  Scene scene;                  ///< The robot that is the model, and its ground.
  /// The same of a robot in space, where `scene` is empty.
  std::optional<SpaceScene> space_scene = {};

  /// Calls `work` with the scene, a `Scene` or a `SpaceScene`.
  template <class Work>
  auto WithScene(Work&& work) const {
    return space_scene ? work(*space_scene) : work(scene);
  }
};

/// @param motion  of a robot in the plane or in space.
/// @param drives  one for each joint of the motion, in its order.
/// @param config  of a twin file. Its own law of contact becomes the scene's, so that a robot's
///                factors are of it.
/// @throws Refused  when the motion does not fit the drives or their bus, as in a run.
SharedRobot ShareRobot(const SimulatedMotion& motion, DrivesConfig drives,
                       SimulatedRobotConfig config);

/// Virtual time in which the loop can be kept from waking.
class PausingClock final : public Clock {
 public:
  /// @param advance_to_ns  moves the world on to a time.
  explicit PausingClock(std::function<void(std::int64_t)> advance_to_ns)
      : clock_(std::move(advance_to_ns)) {}
  /// Makes the next sleep longer.
  void Pause(std::int64_t duration_ns) noexcept { pause_ns_ = duration_ns; }
  [[nodiscard]] std::int64_t now_ns() const noexcept override { return clock_.now_ns(); }
  void SleepUntil(std::int64_t time_ns) noexcept override {
    clock_.SleepUntil(time_ns + std::exchange(pause_ns_, 0));
  }

 private:
  VirtualClock clock_;
  std::int64_t pause_ns_ = 0;
};

/// A run of a robot that differs from the model, in virtual time: the runtime as `tumbler run` has
/// it, simulated drives on a simulated bus, and the twin. The host does not know in what the robot
/// differs, but for the gains.
class VariedRun {
 public:
  /// What is played.
  struct Play {
    const SimulatedMotion& motion;  ///< Has to outlive the run.
    /// The same motion for the executor; null: as it is in its file.
    std::unique_ptr<const Sequence<float>> sequence;
    RunSettings settings;
    TickFeed* feed = nullptr;  ///< Gets every tick; null: none does.
  };

  /// @param shared  with what happens to this robot alone in its `config`.
  /// @throws Refused  when the executor does not take the motion.
  VariedRun(Play play, const SharedRobot& shared, const RobotVariation& variation);

  /// Executes a tick. @returns false once the run is over.
  bool Step() { return loop_->Step(); }
  /// Keeps the loop from waking for so long.
  void Pause(std::int64_t duration_ns) { clock_->Pause(duration_ns); }
  /// Moves the robot by what it differs in at the start of its first motion.
  void DisplaceAtStart();

  [[nodiscard]] const ControlLoop& loop() const { return *loop_; }
  [[nodiscard]] const TickRecord& record() const { return loop_->record(); }
  [[nodiscard]] SimulatedRobot& robot() { return *robot_; }
  [[nodiscard]] RunProcedure& procedure() { return *procedure_; }
  [[nodiscard]] OperatorMailbox& mailbox() { return mailbox_; }
  /// The drives as the host has them.
  [[nodiscard]] const DrivesConfig& drives() const { return assembly_->parts().drives; }

 private:
  std::vector<double> start_positions_, start_rates_;  // added when the first motion begins
  std::unique_ptr<SimulatedRobot> robot_;
  std::unique_ptr<Assembly> assembly_;
  std::unique_ptr<CanBus> host_;
  std::unique_ptr<PausingClock> clock_;
  std::unique_ptr<RunProcedure> procedure_;
  OperatorMailbox mailbox_;
  std::unique_ptr<ControlLoop> loop_;
};

}  // namespace tumbler
