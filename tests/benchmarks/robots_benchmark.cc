// How many robots that differ from the model play the shipped handstand, with its hold, in a second
// of processor time of one thread: in the twin, which figures are of, and in lanes, eight at once;
// and the robot that tumbler export writes, under the same law and setpoints, in MuJoCo.
// `items_per_second` is robots a second; what others are compared with is the twin's, of the same
// run.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "offline/programs/mjcf.h"
#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/variation.h"
#include "offline/studies/lane_trials.h"
#include "offline/studies/trial.h"
#include "offline/twin/simulated_robot.h"
#include "tests/support/files.h"
#ifdef TUMBLER_WITH_MUJOCO
#include "tests/support/mujoco_model.h"
#endif

namespace tumbler {
namespace {

RobustnessStudy Handstands() {
  RobustnessStudy study;
  study.motion = testing::SourcePath("primitives/handstand.toml");
  study.seed = 4242;
  return study;
}

/// Plays `each` robots at a time.
template <class Play>
void Measure(benchmark::State& state, std::int64_t each, const Play& play) {
  for (auto _ : state) play();
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations()) * each);
}

/// The setpoints of the model's run, told to robots by a kernel alone, all in one call. No judge
/// looks at these robots, but they have to end as upright as the model.
template <class S>
class BareLanes {
 public:
  explicit BareLanes(const Trials& trials) {
    const Script& script = trials.script();
    LaneDrive drive;
    const DriveEntry& entry = trials.drives().drives.front();
    drive.kp = static_cast<double>(entry.kp_nm_per_rad);
    drive.kd = static_cast<double>(entry.kd_nm_s_per_rad);
    drive.torque_max_nm = *trials.robot().motors.front().torque_max_nm;
    drive.delay_s = std::min(script.delay_s.front(), script.tick_s);
    steps_.tick_s = script.tick_s;
    upright_rad_ = script.ticks.back().pitch_rad;
    const PrimitivePose start = trials.robot().start.value_or(StartOf(trials.motion().file()));
    std::array<LaneRobot<double>, Packet::kLanes> robots{};
    std::array<LaneState<double>, Packet::kLanes> states{};
    for (std::size_t i = 0; i < Packet::kLanes; ++i) {
      const LaneScene scene = MakeLaneScene(Varied(trials.scene(), trials.Draw(i)), drive);
      model_ = scene.model;
      robots[i] = scene.robot;
      states[i].q[0] = start.root_x_m;
      states[i].q[1] = start.root_z_m;
      states[i].q[2] = start.root_pitch_rad;
      std::copy(start.joint_positions_rad.begin(), start.joint_positions_rad.end(),
                states[i].q.begin() + 3);
    }
    if constexpr (std::is_same_v<S, Packet>) {
      robot_ = PackLanes<LaneRobot>(robots);
      start_ = PackLanes<LaneState>(states);
    } else {
      robot_ = robots[0];
      start_ = states[0];
    }
    for (const ScriptTick& tick : script.ticks) {
      if (tick.held) continue;
      for (const JointSetpoint& s : tick.setpoints) {
        setpoints_.push_back({Of(static_cast<double>(s.position_rad)),
                              Of(static_cast<double>(s.velocity_rad_s)),
                              Of(static_cast<double>(s.torque_nm))});
      }
    }
  }

  void Play(const LaneKernel<S>& kernel) {
    LaneState<S> state = start_;
    HeldSetpoints<S> held{};
    LaneWatch<S> watch;
    std::copy_n(setpoints_.begin(), model_.joints, held.begin());
    kernel.drive(model_, robot_, steps_, setpoints_, held, state, watch);
    if (!(std::abs(PitchOf(state) - upright_rad_) < 0.1)) throw std::runtime_error("a robot fell");
  }

 private:
  static S Of(double all) {
    if constexpr (std::is_same_v<S, Packet>) {
      return Packet::Of(all);
    } else {
      return all;
    }
  }

  static double PitchOf(const LaneState<S>& state) {
    if constexpr (std::is_same_v<S, Packet>) {
      return state.q[2].lane(Packet::kLanes - 1);
    } else {
      return state.q[2];
    }
  }

  LaneModel model_;
  double upright_rad_ = 0;  // the model's pitch at last
  LaneRobot<S> robot_{};
  LaneState<S> start_{};
  LaneSteps steps_;
  std::vector<LaneSetpoint<S>> setpoints_;
};

#ifdef TUMBLER_WITH_MUJOCO
/// The model in MuJoCo, with its contacts, in the steps that tumbler export writes. No judge looks,
/// but the robot has to end as upright as the model.
class InMujoco {
 public:
  explicit InMujoco(const Trials& trials) : script_(trials.script()) {
    const DriveEntry& entry = trials.drives().drives.front();
    gains_ = {static_cast<double>(entry.kp_nm_per_rad), static_cast<double>(entry.kd_nm_s_per_rad)};
    model_ = testing::LoadMjcf(ToMjcf(trials.motion(), gains_));
    data_.reset(mj_makeData(model_.get()));
  }
  [[nodiscard]] double step_s() const { return model_->opt.timestep; }

  void Play() {
    mj_resetDataKeyframe(model_.get(), data_.get(), 0);
    int ticks = 0;
    for (const ScriptTick& tick : script_.ticks) {
      if (tick.held) continue;
      for (std::size_t j = 0; j < tick.setpoints.size(); ++j) {
        const JointSetpoint& s = tick.setpoints[j];
        data_->ctrl[j] = gains_.kp_nm_per_rad * static_cast<double>(s.position_rad) +
                         gains_.kd_nm_s_per_rad * static_cast<double>(s.velocity_rad_s) +
                         static_cast<double>(s.torque_nm);
      }
      ++ticks;
      const double until_s = ticks * script_.tick_s - 0.5 * step_s();
      while (data_->time < until_s) mj_step(model_.get(), data_.get());
    }
    const int pitch = mj_name2id(model_.get(), mjOBJ_JOINT, "pitch");
    const double off_rad = data_->qpos[model_->jnt_qposadr[pitch]] - script_.ticks.back().pitch_rad;
    if (!(std::abs(off_rad) < 0.15)) throw std::runtime_error("the robot fell in MuJoCo");
  }

 private:
  const Script& script_;
  DriveGains gains_;
  testing::MujocoModel model_;
  testing::MujocoData data_;
};
#endif

int Main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  Trials twin(Handstands());
  std::uint64_t next = 0;
  const auto add = [](const std::string& name, auto measure) {
    benchmark::RegisterBenchmark(name.c_str(), measure)->Unit(benchmark::kMillisecond)->MinTime(4);
  };
  add("twin, as tumbler robustness plays it", [&](benchmark::State& state) {
    Measure(state, 1, [&] { benchmark::DoNotOptimize(twin.Play(next++)); });
  });
  const LaneTrials lanes(Handstands());
  std::uint64_t first = 0;
  add("lanes, as --lanes plays them", [&](benchmark::State& state) {
    Measure(state, Packet::kLanes, [&] {
      std::array<std::uint64_t, Packet::kLanes> indices{};
      std::iota(indices.begin(), indices.end(), first);
      first += Packet::kLanes;
      benchmark::DoNotOptimize(lanes.Play(indices));
    });
  });
  BareLanes<Packet> packets(twin);
  for (const LaneKernel<Packet>* kernel : PacketKernels()) {
    add(std::string("the lanes' physics alone, ") + kernel->name,
        [&, kernel](benchmark::State& state) {
          Measure(state, Packet::kLanes, [&] { packets.Play(*kernel); });
        });
  }
  BareLanes<double> one(twin);
  add(std::string("the lanes' physics alone, ") + OneRobotKernel().name,
      [&](benchmark::State& state) { Measure(state, 1, [&] { one.Play(OneRobotKernel()); }); });
#ifdef TUMBLER_WITH_MUJOCO
  InMujoco mujoco(twin);
  add("MuJoCo " + std::string(mj_versionString()) + ", steps of " +
          std::to_string(std::lround(1e6 * mujoco.step_s())) + " us",
      [&](benchmark::State& state) { Measure(state, 1, [&] { mujoco.Play(); }); });
#endif
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return tumbler::Main(argc, argv); }
