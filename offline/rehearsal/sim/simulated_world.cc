#include "offline/rehearsal/sim/simulated_world.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "firmware_interface/can/bus_faults_toml.h"
#include "firmware_interface/can/simulated_bus.h"
#include "offline/rehearsal/twin/simulated_robot.h"
#include "offline/rehearsal/twin/truth_log.h"
#include "offline/rehearsal/twin/twin_toml.h"
#include "runtime/core/tick.h"

namespace tumbler {
namespace {

class SimulatedWorld final : public World {
 public:
  SimulatedWorld(const SequenceFile& file, const DrivesConfig& drives,
                 const SimulatedWorldConfig& config)
      : file_(file),
        robot_(MakeRobot(SimulatedMotion(file), drives, config.twin_file)),
        host_(robot_.bus().Attach()),
        truth_(
            {.log_file = config.truth_log, .lcm_url = config.lcm_url, .sink = config.truth_sink}),
        paced_(config.paced) {
    expected_pitch_rad_ =
        file.RobotPitch(file.graph.start, file.PrimitiveOf(file.graph.start).entry.root_pitch_rad);
    const auto advance = [this](std::int64_t time_ns) { robot_.AdvanceTo(time_ns); };
    if (!config.bus_faults.empty()) {
      std::vector<std::string> nodes;  // in the order in which they were attached
      for (const DriveEntry& entry : drives.drives) nodes.push_back(entry.joint);
      nodes.emplace_back("host");
      robot_.bus().SetFaults(LoadBusFaults(config.bus_faults, nodes));
    }
    if (paced_) {
      clock_ = std::make_unique<PacedClock>(advance);
    } else {
      clock_ = std::make_unique<VirtualClock>(advance);
    }
  }
  CanBus& bus() override { return host_; }
  Clock& clock() override { return *clock_; }
  [[nodiscard]] bool real_time() const override { return paced_; }

  void Observe(const ControlLoop& loop) override {
    const TickRecord& record = loop.record();
    const ExecutorState state = record.state;
    const TwinState truth = robot_.state();
    truth_.Observe(robot_);
    if (last_ == ExecutorState::kRunning && state == ExecutorState::kSettling) {
      const auto node = static_cast<int>(record.node);
      const PrimitiveFile& primitive = file_.PrimitiveOf(node);
      expected_pitch_rad_ += primitive.exit.root_pitch_rad - primitive.entry.root_pitch_rad;
      Passage& passage = passages_.emplace_back();
      passage.node = std::string(file_.graph.node(node).name.view());
      passage.expected_pitch_rad = expected_pitch_rad_;
      passage.pitch_at_end_rad = truth.root_pitch_rad;
      passage.tolerance_rad = std::max(
          passage.tolerance_rad, file_.exit_pitch_tolerance_rad[static_cast<std::size_t>(node)]);
      end_ns_ = loop.time_ns();
    }
    const auto later_ns = static_cast<std::int64_t>(Passage::kLater_s * 1e9);
    const bool next = last_ == ExecutorState::kSettling && state == ExecutorState::kRunning;
    if (!passages_.empty() && !passages_.back().pitch_later_rad &&
        (next || loop.time_ns() >= end_ns_ + later_ns) && state != ExecutorState::kDisarmed) {
      passages_.back().pitch_later_rad = truth.root_pitch_rad;
      passages_.back().pitch_rate_later_rad_s = truth.root_pitch_rate_rad_s;
    }
    last_ = state;
  }
  void Summarize(RunSummary& summary) override {
    summary.passages = passages_;
    summary.measured_load = robot_.bus().load();
    for (const PostureEvent& event : robot_.posture().events()) {
      if (event.kind != PostureEvent::Kind::kFall) continue;
      summary.falls.push_back({static_cast<double>(event.time_ns) / 1e9, Describe(event)});
    }
  }

 private:
  static SimulatedRobot MakeRobot(const SimulatedMotion& motion, const DrivesConfig& drives,
                                  const std::string& twin_file) {
    return {motion, drives,
            twin_file.empty() ? SimulatedRobotConfig{} : LoadTwin(twin_file, motion)};
  }

  const SequenceFile& file_;
  SimulatedRobot robot_;
  SimulatedPort& host_;
  TruthLog truth_;
  bool paced_;
  std::unique_ptr<Clock> clock_;
  ExecutorState last_ = ExecutorState::kDisarmed;
  double expected_pitch_rad_ = 0;
  std::int64_t end_ns_ = 0;
  std::vector<Passage> passages_;
};

}  // namespace

Simulation MakeSimulation() {
  Simulation simulation;
  simulation.drives_file_of = [](const std::string& twin_file) {
    return ReadTwinSources(twin_file).drives;
  };
  simulation.make_world = [](const SequenceFile& motion, const DrivesConfig& drives,
                             const SimulatedWorldConfig& config) {
    return std::make_unique<SimulatedWorld>(motion, drives, config);
  };
  return simulation;
}

}  // namespace tumbler
