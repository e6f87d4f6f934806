#include "offline/rehearsal/sim/purpose_judge.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>

namespace tumbler {

PurposeJudge::PurposeJudge(const SequenceFile& file, bool free_root, bool hinged)
    : file_(file), free_root_(free_root), hinged_(hinged) {
  expected_pitch_rad_ =
      file.RobotPitch(file.graph.start, file.PrimitiveOf(file.graph.start).entry.root_pitch_rad);
}

void PurposeJudge::Observe(const TickRecord& record, std::int64_t time_ns, const TwinState& truth) {
  Watch(time_ns, truth);
  const ExecutorState state = record.state;
  const bool rolls = state == ExecutorState::kFault && record.reaction == Reaction::kRollOut;
  const bool rolled_out =
      rolls_ && state == ExecutorState::kFault && record.reaction == Reaction::kHold;
  rolls_ = rolls;
  if ((last_ == ExecutorState::kRunning && state == ExecutorState::kSettling) || rolled_out)
    Begin(static_cast<int>(record.node), time_ns, truth);
  const bool next = last_ == ExecutorState::kSettling && state == ExecutorState::kRunning;
  // Without torque nothing is asked of the robot. A tick before it may have settled long enough.
  const bool let_go = last_ == ExecutorState::kSettling && state == ExecutorState::kDisarmed;
  if (!passages_.empty() && (state != ExecutorState::kDisarmed || let_go)) {
    Passage& passage = passages_.back();
    const double since_end_s = 1e-9 * static_cast<double>(time_ns - end_ns_);
    // An edge may give the motion longer to settle than its primitive does.
    const bool settled = state != ExecutorState::kSettling;
    for (JudgedTarget& judged : passage.purpose) {
      const bool rests =
          !passage.swings_on && (judged.target.when == PurposeTarget::When::kSettled ||
                                 judged.target.when == PurposeTarget::When::kLater);
      const bool due = since_end_s >= InstantOf(judged.target) && (settled || !rests);
      if (judged.result || !(next || due)) continue;
      judged.result = ResultOf(judged.target, truth);
      judged.after_s = since_end_s;
    }
    if (!passage.pitch_later_rad && (next || (settled && since_end_s >= Passage::kLater_s))) {
      passage.pitch_later_rad = truth.root_pitch_rad;
      passage.later_s = since_end_s;
    }
  }
  if (last_ != ExecutorState::kRunning && state == ExecutorState::kRunning) {
    start_x_m_ = truth.root_x_m;
    moving_ = record.node;
    // The motion is planned from its entry, of which the last one's exit may be off by a little.
    // How the robot lies decides with which node a run begins, and it may have turned about.
    const double entry =
        file_.RobotPitch(record.node, file_.PrimitiveOf(record.node).entry.root_pitch_rad);
    const double near = next ? expected_pitch_rad_ : truth.root_pitch_rad;
    constexpr double kTurn = 2 * std::numbers::pi;
    expected_pitch_rad_ = entry + kTurn * std::round((near - entry) / kTurn);
  }
  last_ = state;
}

/// Keeps the speeds of the last kRestWatched_s.
void PurposeJudge::Watch(std::int64_t time_ns, const TwinState& truth) {
  const double speed = std::max({std::abs(truth.root_vx_m_s), std::abs(truth.root_vz_m_s),
                                 std::abs(truth.root_pitch_rate_rad_s)});
  speeds_.emplace_back(time_ns, speed);
  while (speeds_.front().first < time_ns - std::llround(1e9 * kRestWatched_s)) speeds_.pop_front();
}

/// Makes room for a passage: nothing that was amiss is forgotten while there is something else.
void PurposeJudge::LeaveOutOne() {
  std::size_t i = 0;
  while (i < passages_.size() &&
         (passages_[i].amiss() || passages_[i].unjudged() || (i > 0 && passages_[i - 1].amiss()))) {
    ++i;
  }
  if (i == passages_.size()) i /= 2;  // What was amiss at first and at last says most.
  ++left_out_.motions;
  if (passages_[i].amiss()) ++left_out_.amiss;
  if (passages_[i].unjudged()) ++left_out_.unjudged;
  passages_.erase(passages_.begin() + static_cast<std::ptrdiff_t>(i));
}

/// Begins with the passage of a node whose motion has just ended.
void PurposeJudge::Begin(int node, std::int64_t time_ns, const TwinState& truth) {
  moving_ = -1;
  const PrimitiveFile& primitive = file_.PrimitiveOf(node);
  const double tolerance_rad = file_.exit_pitch_tolerance_rad[static_cast<std::size_t>(node)];
  entry_ = primitive.entry;
  settle_s_ = primitive.primitive.settle_s;
  turned_rad_ = expected_pitch_rad_ - entry_.root_pitch_rad;
  expected_pitch_rad_ += primitive.exit.root_pitch_rad - entry_.root_pitch_rad;
  end_ns_ = time_ns;
  if (passages_.size() >= kKept) LeaveOutOne();
  Passage& passage = passages_.emplace_back();
  passage.node = std::string(file_.graph.node(node).name.view());
  passage.free_root = free_root_;
  passage.hinged = hinged_;
  passage.swings_on = hinged_ && !primitive.primitive.feedback.present();
  passage.expected_pitch_rad = expected_pitch_rad_;
  passage.pitch_at_end_rad = truth.root_pitch_rad;
  passage.tolerance_rad = std::max(passage.tolerance_rad, tolerance_rad);
  duration_s_ = primitive.primitive.duration_s;
  for (const PurposeFigure& figure : primitive.purpose) {
    if (CanJudge(figure)) passage.purpose.push_back({figure, std::nullopt});
  }
}

/// Whether the robot's root shows it after the motion. The rest was judged when the motion was
/// made.
bool PurposeJudge::CanJudge(const PurposeTarget& target) const {
  return !target.of_point() && !(target.at_time() && target.time_s < duration_s_);
}

/// When a target is due, after the end of the motion [s].
double PurposeJudge::InstantOf(const PurposeTarget& target) const {
  switch (target.when) {
    case PurposeTarget::When::kEnd:
      return 0;
    case PurposeTarget::When::kSettled:
      return settle_s_;
    case PurposeTarget::When::kLater:
      return Passage::kLater_s;
    case PurposeTarget::When::kTime:
      return target.time_s - duration_s_;
  }
  return 0;
}

/// The robot's value, in the coordinates of the task: there the motion begins at the entry.
double PurposeJudge::ResultOf(const PurposeTarget& target, const TwinState& truth) const {
  switch (target.of) {
    case PurposeTarget::Of::kX:
      return truth.root_x_m - start_x_m_ + entry_.root_x_m;
    case PurposeTarget::Of::kZ:
      return truth.root_z_m;
    case PurposeTarget::Of::kPitch:
      return truth.root_pitch_rad - turned_rad_;
    case PurposeTarget::Of::kXRate:
      return truth.root_vx_m_s;
    case PurposeTarget::Of::kZRate:
      return truth.root_vz_m_s;
    case PurposeTarget::Of::kPitchRate:
      return truth.root_pitch_rate_rad_s;
    case PurposeTarget::Of::kSpeed:
      return std::max_element(speeds_.begin(), speeds_.end(),
                              [](const auto& a, const auto& b) { return a.second < b.second; })
          ->second;
    case PurposeTarget::Of::kPointX:
    case PurposeTarget::Of::kPointZ:
    case PurposeTarget::Of::kPointXRate:
    case PurposeTarget::Of::kPointZRate:
      break;
  }
  return 0;
}

}  // namespace tumbler
