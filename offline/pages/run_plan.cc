#include "offline/pages/run_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>

#include "common/files/sequence_toml.h"
#include "offline/pages/run_events.h"

namespace tumbler {
namespace {

constexpr double kTurn_rad = 2 * std::numbers::pi;
/// Time between two samples of a run's plan. A display shows no finer motion.
constexpr double kPlanSpacing_s = 0.005;

}  // namespace

RunPlan::RunPlan(RobotPaths& paths, double period_s, std::optional<int> start_node)
    : paths_(paths),
      step_(std::max<std::size_t>(1, static_cast<std::size_t>(kPlanSpacing_s / period_s))),
      node_(start_node) {}

std::optional<ReportSample> RunPlan::Take(const RunTick& tick) {
  if (!last_ || PlaysMotion(tick.state, tick.reaction)) {
    played_ = tick;
    after_played_.reset();
  } else if (!after_played_) {
    after_played_ = tick;
  }
  const bool begins = BeginsNode(tick, last_ ? &*last_ : nullptr);
  last_ = tick;
  const bool due = begins || ticks_ % step_ == 0;
  ++ticks_;
  if (begins) {
    if (began_) {
      // The next node begins where this one ends.
      const ReportSample& begin = paths_.PlanOf(tick.node).front();
      dx_m_ = sample_.link_poses[0][0] - begin.link_poses[0][0];
      turn_rad_ =
          kTurn_rad * std::round((sample_.root_pitch_rad - begin.root_pitch_rad) / kTurn_rad);
    }
    node_ = tick.node;
    began_ = true;
  }
  given_ = due && node_;
  if (!given_) return std::nullopt;
  return SampleAt(*node_, tick);
}

std::optional<ReportSample> RunPlan::Last() {
  if (given_ || !last_ || !node_) return std::nullopt;
  return SampleAt(*node_, *last_);
}

/// It advances with the speed of the run, goes on past the primitive's end while that is held, and
/// stands still once the motion was broken off.
double RunPlan::PrimitiveTimeAt(const RunTick& tick) const {
  if (!after_played_) return played_.primitive_time_s;
  const bool rolled_out =
      played_.state == ExecutorState::kFault && after_played_->reaction == Reaction::kHold;
  const bool ended = after_played_->state == ExecutorState::kSettling || rolled_out;
  return played_.primitive_time_s + (ended ? tick.time_s - played_.time_s : 0);
}

ReportSample RunPlan::SampleAt(int node, const RunTick& tick) {
  sample_ = paths_.PlanAt(node, began_ ? PrimitiveTimeAt(tick) : 0);
  sample_.time_s = tick.time_s;
  Place(sample_, dx_m_, turn_rad_);
  return sample_;
}

void AddPlan(RunData& run, RobotPaths& paths, int start_node) {
  RunPlan plan(paths, run.period_s, run.bands.empty() ? start_node : run.bands.front().node);
  const auto add = [&run](std::optional<ReportSample> sample) {
    if (sample) run.plan.push_back(std::move(*sample));
  };
  for (const RunTick& tick : run.ticks) add(plan.Take(tick));
  add(plan.Last());
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
