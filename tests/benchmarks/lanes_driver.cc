// The program in which scripts/count-instructions counts what robots in lanes take. It plays the
// shipped handstand and its hold through drives, calls the counted function once, and prints how
// many steps of integration that was, or stages of them.
// usage: lanes_driver drive|classically|rank KERNEL
// KERNEL: one (robot), or what kernels for packets are called: SSE2, AVX2

#include <array>
#include <cmath>
#include <cstdio>
#include <span>
#include <string_view>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_scene.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

constexpr LaneSteps kSteps;

template <class S>
[[gnu::noinline]] void CountedLanes(const LaneKernel<S>& kernel, bool classically,
                                    const LaneModel& model, const LaneRobot<S>& robot,
                                    std::span<const LaneSetpoint<S>> setpoints,
                                    LaneState<S>& state) {
  HeldSetpoints<S> held{};
  for (std::size_t j = 0; j < model.joints; ++j) held[j] = setpoints[j];
  if (classically) {
    kernel.drive_classically(model, robot, kSteps, setpoints, held, state, Packet::kLanes);
  } else {
    LaneWatch<S> watch{};
    kernel.drive(model, robot, kSteps, setpoints, held, state, watch);
  }
}

[[gnu::noinline]] void CountedRanking(const RankingKernel& kernel, const LaneModel& model,
                                      const LaneRobot<WidePacket>& robot,
                                      std::span<const LaneSetpoint<float>> setpoints,
                                      LaneState<WidePacket>& state) {
  HeldSetpoints<float> held{};
  for (std::size_t j = 0; j < model.joints; ++j) held[j] = setpoints[j];
  LaneWatch<WidePacket> watch{};
  kernel.drive(model, robot, kSteps, setpoints, held, state, watch);
}

/// The shipped handstand and its hold, as one robot plays it.
struct Handstand {
  PrimitiveFile file = LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
  LaneScene scene = MakeLaneScene(TaskOf(file).problem.scene, {});
  LaneState<double> start{};
  std::vector<LaneSetpoint<double>> setpoints;
  int ticks = static_cast<int>((file.primitive.duration_s + 0.5) / kSteps.tick_s);

  Handstand() {
    start.q[0] = file.entry.root_x_m;
    start.q[1] = file.entry.root_z_m;
    start.q[2] = file.entry.root_pitch_rad;
    for (std::size_t j = 0; j < scene.model.joints; ++j)
      start.q[3 + j] = file.entry.joint_positions_rad[j];
    for (int k = 0; k < ticks; ++k) {
      const double t = kSteps.tick_s * k;
      for (const JointMotion<double>& joint : file.primitive.motions()) {
        const auto at = joint.position.Evaluate(t);
        const double velocity = t < file.primitive.duration_s ? at.first : 0;
        setpoints.push_back(
            {at.value, velocity, static_cast<double>(joint.torque.Evaluate(t).value)});
      }
    }
  }
  template <class N>
  [[nodiscard]] std::vector<LaneSetpoint<N>> In(N (*in_lanes)(double)) const {
    std::vector<LaneSetpoint<N>> of;
    for (const LaneSetpoint<double>& s : setpoints)
      of.push_back({in_lanes(s.position), in_lanes(s.velocity), in_lanes(s.third)});
    return of;
  }
  /// Prints how many steps or stages it took, unless the robot fell.
  [[nodiscard]] int Say(double pitch_rad, int per_step) const {
    if (!(std::abs(pitch_rad - file.exit.root_pitch_rad) < 0.1)) {
      std::fputs("lanes_driver: the robot fell\n", stderr);
      return 1;
    }
    std::printf("%d\n", ticks * kSteps.per_tick * per_step);
    return 0;
  }
};

template <template <class> class T>
T<Packet> InAllLanes(const T<double>& one) {
  std::array<T<double>, Packet::kLanes> each;
  each.fill(one);
  return PackLanes<T>(each);
}

int CountOne(const LaneKernel<double>& kernel, bool classically) {
  const Handstand handstand;
  LaneState<double> state = handstand.start;
  CountedLanes<double>(kernel, classically, handstand.scene.model, handstand.scene.robot,
                       handstand.setpoints, state);
  return handstand.Say(state.q[2], classically ? 4 : 1);
}

int CountEight(const LaneKernel<Packet>& kernel, bool classically) {
  const Handstand handstand;
  LaneState<Packet> state = InAllLanes<LaneState>(handstand.start);
  const auto setpoints = handstand.In(Packet::Of);
  CountedLanes<Packet>(kernel, classically, handstand.scene.model,
                       InAllLanes<LaneRobot>(handstand.scene.robot), setpoints, state);
  return handstand.Say(state.q[2].lane(0), classically ? 4 : 1);
}

int CountRanking(const RankingKernel& kernel) {
  const Handstand handstand;
  const auto robot = InAllLanes<LaneRobot>(handstand.scene.robot);
  const auto eight = InAllLanes<LaneState>(handstand.start);
  LaneState<WidePacket> state = WidenLanes<LaneState>(eight, eight);
  const auto setpoints =
      handstand.In<float>([](double number) { return static_cast<float>(number); });
  CountedRanking(kernel, handstand.scene.model, WidenLanes<LaneRobot>(robot, robot), setpoints,
                 state);
  return handstand.Say(state.q[2].lane(0), 1);
}

int Main(std::string_view what, std::string_view name) {
  if (what == "rank") {
    for (const RankingKernel* kernel : RankingKernels())
      if (name == kernel->name) return CountRanking(*kernel);
    name = "";
  }
  const bool classically = what == "classically";
  if (name == "one") return CountOne(OneRobotKernel(), classically);
  for (const LaneKernel<Packet>* kernel : PacketKernels())
    if (name == kernel->name) return CountEight(*kernel, classically);
  std::fputs("lanes_driver: this processor has no such kernel\n", stderr);
  return 2;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return argc == 3 ? tumbler::Main(argv[1], argv[2]) : 2; }
