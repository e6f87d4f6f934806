#include "offline/pages/viewed_robot.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "offline/pages/page_file.h"
#include "offline/pages/truth.h"
#include "runtime/executor/tick.h"

namespace tumbler {
namespace {

constexpr double kWholeTurn_rad = 2 * std::numbers::pi;
/// So many states without a truth, and where the robot is counts as unknown.
constexpr std::int64_t kTruthLasts_states = 500;
/// Beyond these nothing is drawn: a robot there is none.
constexpr double kFarthest = 1e4;

bool IsNear(double value) { return std::abs(value) < kFarthest; }

}  // namespace

ViewedRobot::ViewedRobot(const SequenceFile& motion)
    : node_count_(motion.graph.node_count), start_node_(motion.graph.start), paths_(motion) {
  for (int node = 0; node < node_count_; ++node) paths_.PlanOf(node);
  Forget();
}

Json ViewedRobot::Scene() const { return SceneToJson(paths_.scene()); }

const std::vector<std::string>& ViewedRobot::joints() const { return paths_.scene().joint_names; }

void ViewedRobot::Forget() {
  state_.reset();
  truth_.reset();
  node_ = start_node_;
  begun_ = false;
  shift_m_ = turn_rad_ = played_to_s_ = 0;
}

void ViewedRobot::Take(const state_t& state) {
  if (truth_ && ++states_since_truth_ > kTruthLasts_states) truth_.reset();
  state_ = state;
  const auto now_s = static_cast<double>(state.primitive_time_s);
  const bool running =
      PlaysMotion(static_cast<ExecutorState>(state.state), static_cast<Reaction>(state.reaction));
  if (!running || state.node < 0 || state.node >= node_count_ || !std::isfinite(now_s)) return;
  if (!begun_ || state.node != node_ || now_s < played_to_s_) {
    if (begun_) {
      const ReportSample end = paths_.PlanAt(node_, played_to_s_);
      const ReportSample& begin = paths_.PlanOf(int{state.node}).front();
      shift_m_ += end.link_poses[0][0] - begin.link_poses[0][0];
      turn_rad_ +=
          kWholeTurn_rad * std::round((end.root_pitch_rad - begin.root_pitch_rad) / kWholeTurn_rad);
    }
    node_ = state.node;
    begun_ = true;
  }
  played_to_s_ = now_s;
}

void ViewedRobot::Take(const truth_t& truth) {
  if (!IsNear(truth.root_x_m) || !IsNear(truth.root_z_m) || !IsNear(truth.root_pitch_rad)) return;
  std::vector<double> passive_rad = PassiveOf(truth, paths_.passive_names());
  if (!std::ranges::all_of(passive_rad, IsNear)) return;
  truth_ = {{truth.root_x_m, truth.root_z_m, truth.root_pitch_rad}, std::move(passive_rad)};
  states_since_truth_ = 0;
}

ViewedRobot::Unmeasured ViewedRobot::WhereTheRestIs() {
  if (truth_) return *truth_;
  const ReportSample plan = paths_.PlanAt(node_, played_to_s_);
  return {
      {plan.link_poses[0][0] + shift_m_, plan.link_poses[0][1], plan.root_pitch_rad + turn_rad_},
      plan.passive_positions_rad};
}

Json ViewedRobot::Poses() {
  if (!state_ || state_->joints.size() != joints().size()) return nullptr;
  std::vector<double> positions_rad;
  for (const joint_state_t& joint : state_->joints) {
    if (joint.reply_age_ticks < 0) return nullptr;
    positions_rad.push_back(static_cast<double>(joint.measured_position_rad));
    if (!IsNear(positions_rad.back())) return nullptr;
  }
  Json poses = Json::Array();
  const Unmeasured rest = WhereTheRestIs();
  for (const auto& pose : paths_.Pose(rest.root, positions_rad, rest.passive_rad).link_poses) {
    Json link = Json::Array();
    // A tenth of a millimetre is less than a picture shows.
    for (const double number : pose) link.Append(std::round(number * 1e4) / 1e4);
    poses.Append(link);
  }
  return poses;
}

}  // namespace tumbler
