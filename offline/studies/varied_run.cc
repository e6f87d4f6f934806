#include "offline/studies/varied_run.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "runtime/assembly/run_checks.h"
#include "runtime/assembly/run_parts.h"

namespace tumbler {
namespace {

/// A host whose frames reach the bus late.
class LateHost final : public CanBus {
 public:
  LateHost(SimulatedPort& port, double delay_s)
      : port_(port), delay_ns_(std::llround(1e9 * delay_s)) {}
  Status Send(const CanFrame& frame) noexcept override { return port_.SendAfter(delay_ns_, frame); }
  Status Receive(ReceivedFrame& received) noexcept override { return port_.Receive(received); }
  [[nodiscard]] CanControllerState controller_state() const noexcept override {
    return port_.controller_state();
  }

 private:
  SimulatedPort& port_;
  std::int64_t delay_ns_;
};

/// Gives a robot its own motors and gains.
/// @param drives  as the host has them.
/// @returns the drives as they are.
DrivesConfig VaryDrives(const RobotVariation& variation, std::vector<JointMotor>& motors,
                        DrivesConfig& drives) {
  for (std::size_t j = 0; j < variation.joints.size(); ++j) {
    const RobotVariation::Joint& joint = variation.joints[j];
    motors[j].torque_max_nm = *motors[j].torque_max_nm * joint.torque_limit;
    motors[j].torque_factor = *motors[j].torque_factor * joint.torque;
    // What is taken off leaves at least nothing.
    const auto add = [](std::optional<double>& constant_s, double more_s) {
      constant_s = std::max(0.0, *constant_s + more_s);
    };
    add(motors[j].velocity_filter_s, joint.velocity_filter_s);
    add(motors[j].torque_time_constant_s, joint.torque_lag_s);
    DriveEntry& drive = drives.drives[j];
    drive.kp_nm_per_rad *= static_cast<float>(joint.gain);
    drive.kd_nm_s_per_rad *= static_cast<float>(joint.gain);
  }
  // The host does not know that an encoder's zero is elsewhere.
  DrivesConfig true_drives = drives;
  for (std::size_t j = 0; j < variation.joints.size(); ++j) {
    const auto zero_rad = static_cast<float>(variation.joints[j].zero_rad);
    std::visit([zero_rad](auto& drive) { drive.joint.zero_offset_rad -= zero_rad; },
               true_drives.drives[j].config);
  }
  return true_drives;
}

}  // namespace

SharedRobot ShareRobot(const SimulatedMotion& motion, DrivesConfig drives,
                       SimulatedRobotConfig config) {
  CheckRanges(*std::make_unique<const Sequence<float>>(ToRuntime(motion.file())), drives);
  CheckSchedule(drives, [](const std::string& /*sentence*/) {});
  SharedRobot shared{std::move(drives), std::move(config), {}};
  const Problem& problem = motion.problem();
  if (problem.space) {
    shared.space_scene =
        shared.config.space_scene ? *shared.config.space_scene : problem.space->scene;
  } else {
    shared.scene = shared.config.scene ? *shared.config.scene : problem.scene;
  }
  if (const auto contact = std::exchange(shared.config.twin.contact, std::nullopt))
    (shared.space_scene ? shared.space_scene->contact : shared.scene.contact) = *contact;
  shared.config.motors.resize(shared.drives.drives.size());
  for (std::size_t j = 0; j < shared.config.motors.size(); ++j) {
    JointMotor& motor = shared.config.motors[j];
    const MotorFacts& stated = shared.drives.drives[j].motor;
    if (!motor.torque_max_nm) motor.torque_max_nm = LargestTorqueLimit(motion.file(), j);
    motor.torque_factor = motor.torque_factor.value_or(stated.torque_factor);
    motor.torque_time_constant_s =
        motor.torque_time_constant_s.value_or(stated.torque_time_constant_s);
    motor.velocity_filter_s = motor.velocity_filter_s.value_or(stated.velocity_filter_s);
  }
  return shared;
}

VariedRun::VariedRun(Play play, const SharedRobot& shared, const RobotVariation& variation) {
  shared.WithScene([&](const auto& scene) {
    start_positions_ = variation.StartPositions(scene.robot);
    start_rates_ = variation.StartRates(scene.robot);
  });
  const SequenceFile& file = play.motion.file();
  SimulatedRobotConfig config = shared.config;
  if (shared.space_scene) {
    config.space_scene = Varied(*shared.space_scene, variation);
  } else {
    config.scene = Varied(shared.scene, variation);
  }
  RunParts parts{file, std::move(play.sequence), shared.drives};
  if (parts.sequence == nullptr)
    parts.sequence = std::make_unique<const Sequence<float>>(ToRuntime(file));
  const DrivesConfig true_drives = VaryDrives(variation, config.motors, parts.drives);
  robot_ = std::make_unique<SimulatedRobot>(play.motion, true_drives, config);
  assembly_ = std::make_unique<Assembly>(std::move(parts));
  if (assembly_->Configure(ExecutorConfigOf(play.settings, drives())) != Status::kOk)
    throw Refused(std::string(file.path) + ": the executor does not take this motion");
  host_ = std::make_unique<LateHost>(robot_->bus().Attach(drives().HostPort()), variation.delay_s);
  clock_ =
      std::make_unique<PausingClock>([this](std::int64_t time_ns) { robot_->AdvanceTo(time_ns); });
  procedure_ = std::make_unique<RunProcedure>(
      ProcedureConfigOf(play.settings, drives(), assembly_->parts().sequence->graph));
  loop_ = std::make_unique<ControlLoop>(
      ControlLoop::Parts{assembly_->executor(), *host_, *clock_, *procedure_, mailbox_, play.feed},
      static_cast<std::int64_t>(std::llround(1e9 / drives().rate_hz)), 0);
}

void VariedRun::DisplaceAtStart() { robot_->Displace(start_positions_, start_rates_); }

}  // namespace tumbler
