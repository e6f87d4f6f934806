#include "tests/offline/sample_runs.h"

#include <cmath>
#include <cstddef>
#include <vector>

#include "tests/offline/sample_motion.h"

namespace tumbler {
namespace {

constexpr int kBefore = 20;  // number of ticks before time 0
constexpr int kTicks = 200;

ExecutorState StateAt(int i) {
  const int since = i - kBefore;
  if (since < -10) return ExecutorState::kDisarmed;
  if (since < 0) return ExecutorState::kHolding;
  if (since < 120) return ExecutorState::kRunning;
  return since < 150 ? ExecutorState::kSettling : ExecutorState::kHolding;
}

JointSetpoint At(double t, std::size_t j, double beside) {
  const double phase = 2 * t + static_cast<double>(j);
  return {static_cast<float>(std::sin(phase) + beside), static_cast<float>(2 * std::cos(phase)),
          static_cast<float>(0.5 * std::cos(phase))};
}

}  // namespace

RunData SampleRun() {
  const ReportData motion = SampleMotion();
  RunData run;
  run.name = "records/first.rec";
  run.recorded = true;
  run.facts = {{"outcome", "completed"}, {"motion", "handstand"}};
  run.scene = motion;
  run.scene.samples.clear();
  run.robot_hash = "fnv1a64:0";
  run.period_s = 0.01;
  for (int i = 0; i < kTicks; ++i) {
    RunTick tick;
    tick.tick = i;
    tick.time_s = (i - kBefore) / 100.0;
    tick.state = StateAt(i);
    run.ticks.push_back(tick);
    for (std::size_t j = 0; j < 2; ++j) {
      JointRecord joint;
      joint.planned = At(tick.time_s, j, 0);
      joint.limited = joint.encoded = At(tick.time_s, j, 0.01);
      const JointSetpoint reached = At(tick.time_s, j, 0.02);
      joint.measured = {reached.position_rad, reached.velocity_rad_s, reached.torque_nm};
      joint.reply_age_ticks = i < 3 ? -1 : 0;
      run.joint_ticks.push_back(joint);
    }
  }
  for (const ReportSample& sample : motion.samples) {
    ReportSample truth = sample;
    truth.forces.clear();
    for (std::size_t j = 0; j < 2; ++j) {
      truth.joint_positions_rad[j] = double{At(truth.time_s, j, 0.03).position_rad};
    }
    run.truth.push_back(truth);
    for (auto& pose : truth.link_poses) pose[0] += 0.1;
    run.plan.push_back(truth);
  }
  run.bands = {{0, 1.5, 0, "handstand"}};
  run.events = {{-0.1, RunEvent::Kind::kRequest, "arm"},
                {0, RunEvent::Kind::kRequest, "run"},
                {0, RunEvent::Kind::kState, "running: handstand"},
                {0.9, RunEvent::Kind::kFault, "following error of joint leg1: 0.4 rad, limit 0.35"},
                {1.2, RunEvent::Kind::kState, "settling: handstand"}};
  run.latencies = {{"wake-up", "from the deadline to when the loop was awake", {}}};
  for (int i = 0; i < 1000; ++i) run.latencies[0].values_ns.push_back(5000 + 10 * i);
  run.latencies[0].values_ns.push_back(2'000'000);
  return run;
}

}  // namespace tumbler
