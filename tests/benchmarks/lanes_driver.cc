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

double Of(double all, double /*like*/) { return all; }
Packet Of(double all, const Packet& /*like*/) { return Packet::Of(all); }
double FirstOf(double number) { return number; }
double FirstOf(const Packet& packet) { return packet.lane(0); }

LaneRobot<double> RobotOf(const std::array<LaneRobot<double>, Packet::kLanes>& all, double) {
  return all[0];
}
LaneRobot<Packet> RobotOf(const std::array<LaneRobot<double>, Packet::kLanes>& all, Packet) {
  return PackLanes<LaneRobot>(all);
}

template <class S>
int Count(const LaneKernel<S>& kernel, bool classically) {
  const PrimitiveFile file =
      LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
  const LaneScene scene = MakeLaneScene(TaskOf(file).problem.scene, {});
  std::array<LaneRobot<double>, Packet::kLanes> robots;
  robots.fill(scene.robot);
  const Primitive<double>& primitive = file.primitive;
  LaneState<S> state{};
  state.q[0] = Of(file.entry.root_x_m, S{});
  state.q[1] = Of(file.entry.root_z_m, S{});
  state.q[2] = Of(file.entry.root_pitch_rad, S{});
  for (std::size_t j = 0; j < scene.model.joints; ++j)
    state.q[3 + j] = Of(file.entry.joint_positions_rad[j], S{});
  std::vector<LaneSetpoint<S>> setpoints;
  const int ticks = static_cast<int>((primitive.duration_s + 0.5) / kSteps.tick_s);
  for (int k = 0; k < ticks; ++k) {
    const double t = kSteps.tick_s * k;
    for (const JointMotion<double>& joint : primitive.motions()) {
      const auto at = joint.position.Evaluate(t);
      const double velocity = t < primitive.duration_s ? at.first : 0;
      setpoints.push_back({Of(at.value, S{}), Of(velocity, S{}),
                           Of(static_cast<double>(joint.torque.Evaluate(t).value), S{})});
    }
  }
  CountedLanes<S>(kernel, classically, scene.model, RobotOf(robots, S{}), setpoints, state);
  if (!(std::abs(FirstOf(state.q[2]) - file.exit.root_pitch_rad) < 0.1)) {
    std::fputs("lanes_driver: the robot fell\n", stderr);
    return 1;
  }
  std::printf("%d\n", ticks * kSteps.per_tick * (classically ? 4 : 1));
  return 0;
}

/// Sixteen robots in single precision.
int CountRanking(const RankingKernel& kernel) {
  const PrimitiveFile file =
      LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
  const LaneScene scene = MakeLaneScene(TaskOf(file).problem.scene, {});
  std::array<LaneRobot<double>, Packet::kLanes> robots;
  robots.fill(scene.robot);
  const LaneRobot<Packet> eight = PackLanes<LaneRobot>(robots);
  LaneState<double> start{};
  start.q[0] = file.entry.root_x_m;
  start.q[1] = file.entry.root_z_m;
  start.q[2] = file.entry.root_pitch_rad;
  for (std::size_t j = 0; j < scene.model.joints; ++j)
    start.q[3 + j] = file.entry.joint_positions_rad[j];
  std::array<LaneState<double>, Packet::kLanes> states;
  states.fill(start);
  const LaneState<Packet> eight_states = PackLanes<LaneState>(states);
  LaneState<WidePacket> state = WidenLanes<LaneState>(eight_states, eight_states);
  std::vector<LaneSetpoint<float>> setpoints;
  const auto ticks = static_cast<int>((file.primitive.duration_s + 0.5) / kSteps.tick_s);
  for (int k = 0; k < ticks; ++k) {
    const double t = kSteps.tick_s * k;
    for (const JointMotion<double>& joint : file.primitive.motions()) {
      const auto at = joint.position.Evaluate(t);
      const double velocity = t < file.primitive.duration_s ? at.first : 0;
      setpoints.push_back({static_cast<float>(at.value), static_cast<float>(velocity),
                           static_cast<float>(joint.torque.Evaluate(t).value)});
    }
  }
  CountedRanking(kernel, scene.model, WidenLanes<LaneRobot>(eight, eight), setpoints, state);
  if (!(std::abs(state.q[2].lane(0) - file.exit.root_pitch_rad) < 0.1)) {
    std::fputs("lanes_driver: the robot fell\n", stderr);
    return 1;
  }
  std::printf("%d\n", ticks * kSteps.per_tick);
  return 0;
}

int Main(std::string_view what, std::string_view name) {
  if (what == "rank") {
    for (const RankingKernel* kernel : RankingKernels())
      if (name == kernel->name) return CountRanking(*kernel);
    name = "";
  }
  const bool classically = what == "classically";
  if (name == "one") return Count(OneRobotKernel(), classically);
  for (const LaneKernel<Packet>* kernel : PacketKernels())
    if (name == kernel->name) return Count(*kernel, classically);
  std::fputs("lanes_driver: this processor has no such kernel\n", stderr);
  return 2;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return argc == 3 ? tumbler::Main(argv[1], argv[2]) : 2; }
