#include "offline/pages/run_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>

#include "common/files/sequence_toml.h"

namespace tumbler {
namespace {

constexpr double kTurn_rad = 2 * std::numbers::pi;
/// Time between two samples of a run's plan. A display shows no finer motion.
constexpr double kPlanSpacing_s = 0.005;

/// The primitive's own time at tick i [s]. It advances with the speed of the run, goes on past
/// the primitive's end while that is held, and stands still once the motion was broken off.
/// @param last_running  a tick up to which the motion is known to be played; is moved on.
double PlanTime(const RunData& run, std::size_t i, std::size_t& last_running) {
  for (std::size_t k = last_running; k <= i; ++k) {
    if (PlaysMotion(run.ticks[k].state, run.ticks[k].reaction)) last_running = k;
  }
  const RunTick& last = run.ticks[last_running];
  const RunTick& next = run.ticks[std::min(last_running + 1, run.ticks.size() - 1)];
  const bool rolled_out = last.state == ExecutorState::kFault && next.reaction == Reaction::kHold;
  const bool ended = next.state == ExecutorState::kSettling || rolled_out;
  return last.primitive_time_s + (ended ? run.ticks[i].time_s - last.time_s : 0);
}

}  // namespace

void AddPlan(RunData& run, RobotPaths& paths, int start_node) {
  const std::size_t step =
      std::max<std::size_t>(1, static_cast<std::size_t>(kPlanSpacing_s / run.period_s));
  double dx = 0, turn = 0;
  int node = run.bands.empty() ? start_node : run.bands.front().node;
  std::optional<double> began;  // start of the present node [s]
  std::size_t band = 0;
  std::size_t last_running = 0;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const RunTick& tick = run.ticks[i];
    if (band < run.bands.size() && tick.time_s >= run.bands[band].from_s) {
      const int next = run.bands[band].node;
      if (began) {
        // The next node begins where this one ends.
        const ReportSample& end = run.plan.back();
        const ReportSample& begin = paths.PlanOf(next).front();
        dx = end.link_poses[0][0] - begin.link_poses[0][0];
        turn = kTurn_rad * std::round((end.root_pitch_rad - begin.root_pitch_rad) / kTurn_rad);
      }
      node = next;
      began = tick.time_s;
      ++band;
    } else if (i % step != 0 && i + 1 != run.ticks.size()) {
      continue;
    }
    const double t = began ? PlanTime(run, i, last_running) : 0;
    ReportSample sample = paths.PlanAt(node, t);
    sample.time_s = tick.time_s;
    Place(sample, dx, turn);
    run.plan.push_back(std::move(sample));
  }
}

RunData ReadPlan(const std::string& path) {
  const SequenceFile motion = LoadMotion(path);
  if (motion.graph.node_count > 1) {
    throw std::runtime_error(fmt::format(
        "{}: is a sequence, whose plan depends on how it is played: give its primitives, or the "
        "record of a run",
        path));
  }
  const PrimitiveFile& file = motion.primitives.front();
  const Primitive<double>& primitive = file.primitive;
  RobotPaths paths(motion);
  RunData run;
  run.name = path;
  run.scene = paths.scene();
  run.passive_names = paths.passive_names();
  run.robot_hash = file.provenance.robot_hash;
  for (const ReportSample& step : paths.PlanOf(motion.graph.start)) {
    const bool last = &step == &paths.PlanOf(motion.graph.start).back();
    if (!last && !run.plan.empty() &&
        step.time_s < run.plan.back().time_s + kPlanSpacing_s - 1e-9) {
      continue;
    }
    ReportSample& sample = run.plan.emplace_back(step);
    for (std::size_t j = 0; j < primitive.motions().size(); ++j) {
      const auto position = primitive.joints[j].position.Evaluate(sample.time_s);
      const bool over = sample.time_s > primitive.duration_s;
      sample.joint_positions_rad[j] = position.value;
      sample.joint_velocities_rad_s[j] = over ? 0 : position.first;
      sample.joint_torques_nm[j] = primitive.joints[j].torque.Evaluate(sample.time_s).value;
    }
  }
  const std::string name(primitive.name.view());
  run.bands.push_back({0, primitive.duration_s, 0, name});
  run.facts = {{"outcome", "a plan, not a run"},
               {"motion", name + " (" + path + ")"},
               {"duration", fmt::format("{:.3f} s", primitive.duration_s)},
               {"made by", MakerOf(file.provenance)}};
  if (file.window) {
    for (auto& line : WindowLines(*file.window)) run.facts.push_back(std::move(line));
  }
  return run;
}

}  // namespace tumbler
