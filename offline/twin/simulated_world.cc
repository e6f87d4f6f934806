#include "offline/twin/simulated_world.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware_interface/can/bus_faults_toml.h"
#include "firmware_interface/can/simulated_bus.h"
#include "offline/twin/damping_notes.h"
#include "offline/twin/purpose_judge.h"
#include "offline/twin/simulated_robot.h"
#include "offline/twin/truth_sampler.h"
#include "offline/twin/twin_toml.h"
#include "runtime/executor/tick.h"

namespace tumbler {
namespace {

/// The robot of a twin file, or that of the motion. Where nothing else is said of its start, it
/// lies as at the start of the run's first node.
SimulatedRobotConfig RobotOf(const SimulatedMotion& motion, const SimulatedWorldConfig& config) {
  SimulatedRobotConfig robot;
  if (!config.twin_file.empty()) robot = LoadTwin(config.twin_file, motion);
  if (!robot.start && config.begin >= 0) robot.start = StartOf(motion.file(), config.begin);
  return robot;
}

class SimulatedWorld final : public World {
 public:
  SimulatedWorld(const SequenceFile& file, const DrivesConfig& drives,
                 const SimulatedWorldConfig& config)
      : SimulatedWorld(SimulatedMotion(file, TaskSpaces::kPlaneAndSpace), file, drives, config) {}
  CanBus& bus() override { return host_; }
  Clock& clock() override { return *clock_; }
  [[nodiscard]] bool real_time() const override { return paced_; }

  void Observe(const ControlLoop& loop) override {
    truth_.Observe(robot_);
    judge_.Observe(loop.record(), loop.time_ns(), robot_.state());
  }
  void Summarize(RunSummary& summary) override {
    summary.passages = judge_.passages();
    summary.left_out = judge_.left_out();
    summary.broken_off = judge_.moving();
    summary.measured_load = robot_.bus().load();
    // A robot that falls as the run ends lies only some time after it. What limp legs pass through
    // then says nothing of the run.
    const std::int64_t end_ns = robot_.now_ns();
    summary.after_torque_off = LeaveAlone();
    for (const PostureEvent& event : robot_.posture().events()) {
      const double time_s = static_cast<double>(event.time_ns) / 1e9;
      if (event.kind == PostureEvent::Kind::kFall)
        summary.falls.push_back({time_s, Describe(event)});
      if (event.kind == PostureEvent::Kind::kOverlap && event.time_ns <= end_ns)
        summary.overlaps.push_back({time_s, Describe(event)});
    }
  }

 private:
  SimulatedWorld(const SimulatedMotion& motion, const SequenceFile& file,
                 const DrivesConfig& drives, const SimulatedWorldConfig& config)
      : robot_(motion, drives, RobotOf(motion, config)),
        fixed_(!motion.problem().space && motion.scene().robot.root_dofs == 0),
        hinged_(!motion.problem().space && motion.scene().robot.hinged()),
        judge_(motion.problem().space ? PurposeJudge(file, motion.problem().space->scene.robot)
                                      : PurposeJudge(file, motion.scene().robot)),
        host_(robot_.bus().Attach(drives.HostPort())),
        truth_(config.truth_sink),
        paced_(config.paced) {
    const auto advance = [this](std::int64_t time_ns) { robot_.AdvanceTo(time_ns); };
    if (!config.bus_faults.empty()) {
      std::vector<std::string> nodes;  // in the order in which they were attached
      for (const DriveEntry& entry : drives.drives) nodes.push_back(entry.joint);
      if (drives.sensor) nodes.emplace_back("sensor");
      nodes.emplace_back("host");
      robot_.bus().SetFaults(LoadBusFaults(config.bus_faults, nodes));
    }
    if (paced_) {
      clock_ = std::make_unique<PacedClock>(advance);
    } else {
      clock_ = std::make_unique<VirtualClock>(advance);
    }
  }

  /// Lets the robot be for a while after the run, without torque, and says what becomes of it.
  std::string LeaveAlone() {
    constexpr std::int64_t kStep_ns = 1'000'000;
    constexpr int kSteps = 3000;
    double swing_rad_s = 0, joints_rad_s = 0;  // in the last second
    for (int i = 0; i < kSteps; ++i) {
      robot_.AdvanceTo(robot_.now_ns() + kStep_ns);
      if (i < kSteps - 1000) continue;
      const TwinState& state = robot_.state();
      swing_rad_s = std::max(swing_rad_s, std::abs(state.root_pitch_rate_rad_s));
      for (const std::vector<double>* rates :
           {&state.joint_velocities_rad_s, &state.passive_velocities_rad_s}) {
        for (const double rate : *rates) joints_rad_s = std::max(joints_rad_s, std::abs(rate));
      }
    }
    const PostureWatch& posture = robot_.posture();
    if (robot_.state().held) return "stays, held as at the start";
    if (!posture.resting_as().empty()) return "stays, " + posture.resting_as();
    if (hinged_) return fmt::format("swings on its bar, at {:.2f} rad/s at most", swing_rad_s);
    if (fixed_) {
      return fmt::format(
          "is limp where it is fixed to the world, its joints at {:.2f} rad/s at most",
          joints_rad_s);
    }
    // A fall from the height of a hand is faster than this.
    constexpr double kDrop_m_s = 0.75;
    const double speed_m_s = posture.sinking_max_m_s();
    if (speed_m_s == 0)
      return fmt::format("has neither sunk nor come to rest; z {:.3f} m", robot_.state().root_z_m);
    return fmt::format("{}, at {:.2f} m/s at most; z {:.3f} m",
                       speed_m_s > kDrop_m_s ? "drops" : "has sunk", speed_m_s,
                       robot_.state().root_z_m);
  }

  SimulatedRobot robot_;
  bool fixed_, hinged_;
  PurposeJudge judge_;
  SimulatedPort& host_;
  TruthSampler truth_;
  bool paced_;
  std::unique_ptr<Clock> clock_;
};

}  // namespace

Simulation MakeSimulation() {
  Simulation simulation;
  simulation.drives_file_of = [](const std::string& twin_file) {
    return ReadTwinSources(twin_file).drives;
  };
  simulation.robot_file_of = [](const std::string& twin_file) {
    return ReadTwinSources(twin_file).robot;
  };
  simulation.make_world = [](const SequenceFile& motion, const DrivesConfig& drives,
                             const SimulatedWorldConfig& config) {
    return std::make_unique<SimulatedWorld>(motion, drives, config);
  };
  simulation.damping_notes = [](const SequenceFile& file, const DrivesConfig& drives,
                                const SimulatedWorldConfig* config) {
    const SimulatedMotion motion(file, TaskSpaces::kPlaneAndSpace);
    if (config == nullptr) return DampingNotes(motion, drives, nullptr);
    const TwinConfig twin = RobotOf(motion, *config).twin;
    const bool fixed = twin.steps == TwinConfig::Steps::kFixed;
    return DampingNotes(motion, drives, fixed ? &twin : nullptr);
  };
  return simulation;
}

}  // namespace tumbler
