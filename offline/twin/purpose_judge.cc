#include "offline/twin/purpose_judge.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "common/core/index.h"
#include "offline/scene/quaternion.h"

namespace tumbler {

template <class Robot>
PurposeJudge::PurposeJudge(const SequenceFile& file, const Robot& robot, bool hinged)
    : file_(file),
      free_root_(robot.root_dofs > 0),
      hinged_(hinged),
      root_dofs_(Index(robot.root_dofs)),
      q_(robot.tree.dofs.size()),
      qd_(robot.tree.dofs.size()) {
  for (std::size_t j = 0; j < robot.joint_count(); ++j) joint_dofs_.push_back(robot.DofOfJoint(j));
  for (const PassiveJoint& joint : robot.passive) passive_dofs_.push_back(Index(joint.dof));
  for (const PrimitiveFile& primitive : file.primitives) {
    std::vector<PurposeGauge>& gauges = gauges_.emplace_back();
    for (const PurposeFigure& figure : primitive.purpose) gauges.emplace_back(figure, robot);
  }
  expected_pitch_rad_ =
      file.RobotPitch(file.graph.start, file.PrimitiveOf(file.graph.start).entry.root_pitch_rad);
}

PurposeJudge::PurposeJudge(const SequenceFile& file, const PlanarRobot& robot)
    : PurposeJudge(file, robot, robot.hinged()) {}
PurposeJudge::PurposeJudge(const SequenceFile& file, const SpaceRobot& robot)
    : PurposeJudge(file, robot, false) {}

void PurposeJudge::Observe(const TickRecord& record, std::int64_t time_ns, const TwinState& truth) {
  Watch(time_ns, truth);
  const ExecutorState state = record.state;
  const bool rolls = state == ExecutorState::kFault && record.reaction == Reaction::kRollOut;
  const bool rolled_out =
      rolls_ && state == ExecutorState::kFault && record.reaction == Reaction::kHold;
  rolls_ = rolls;
  if ((last_ == ExecutorState::kRunning && state == ExecutorState::kSettling) || rolled_out)
    EndMotion(static_cast<int>(record.node), time_ns, truth);
  const bool next = last_ == ExecutorState::kSettling && state == ExecutorState::kRunning;
  // Without torque nothing is asked of the robot. A tick before it may have settled long enough.
  const bool let_go = last_ == ExecutorState::kSettling && state == ExecutorState::kDisarmed;
  if (ended_ >= 0 && (state != ExecutorState::kDisarmed || let_go)) {
    // An edge may give the motion longer to settle than its primitive does.
    const bool settled = state != ExecutorState::kSettling;
    JudgeLast(1e-9 * static_cast<double>(time_ns - end_ns_), settled, next, truth);
  }
  if (last_ != ExecutorState::kRunning && state == ExecutorState::kRunning)
    BeginMotion(record.node, next, truth);
  if (state == ExecutorState::kRunning || rolls)
    JudgeUnderWay(static_cast<double>(record.primitive_time_s), truth);
  last_ = state;
}

void PurposeJudge::BeginMotion(int node, bool after_another, const TwinState& truth) {
  start_x_m_ = truth.root_x_m;
  ended_ = -1;
  moving_ = node;
  // The motion is planned from its entry, of which the last one's exit may be off by a little.
  // How the robot lies decides with which node a run begins, and it may have turned about.
  const PrimitiveFile& primitive = file_.PrimitiveOf(node);
  if (truth.is_in_space()) {
    task_ = TaskFrame(primitive.entry, truth.root_x_m, truth.root_y_m,
                      ToRotation(truth.root_quaternion));
  }
  const double entry = file_.RobotPitch(node, primitive.entry.root_pitch_rad);
  const double near = after_another ? expected_pitch_rad_ : truth.root_pitch_rad;
  constexpr double kTurn = 2 * std::numbers::pi;
  expected_pitch_rad_ = entry + kTurn * std::round((near - entry) / kTurn);
  turned_rad_ = expected_pitch_rad_ - primitive.entry.root_pitch_rad;
  const auto of = Index(file_.graph.node(node).primitive);
  under_way_.clear();
  for (std::size_t i = 0; i < primitive.purpose.size(); ++i)
    under_way_.push_back({primitive.purpose[i], {}, {}, gauges_[of][i].obstacle()});
}

/// Judges what is asked for before the motion ends, at its time in the motion.
void PurposeJudge::JudgeUnderWay(double time_s, const TwinState& truth) {
  for (std::size_t i = 0; i < under_way_.size(); ++i) {
    JudgedTarget& judged = under_way_[i];
    if (judged.result || !judged.target.at_time() || !judged.obstacle.empty()) continue;
    const Primitive<double>& primitive = file_.PrimitiveOf(moving_).primitive;
    if (judged.target.time_s >= primitive.duration_s) continue;
    // The executor's time has single precision.
    constexpr double kRounding_s = 1e-6;
    if (time_s < judged.target.time_s - kRounding_s) continue;
    judged.Judge(ResultOf(i, moving_, truth));
    judged.after_s = time_s - primitive.duration_s;
  }
}

/// Judges what is asked for at the end of the last motion, and after it.
/// @param settled  whether the sequence lets it settle no longer.
/// @param next     whether the next motion just begins.
void PurposeJudge::JudgeLast(double since_end_s, bool settled, bool next, const TwinState& truth) {
  Passage& passage = passages_.back();
  const Primitive<double>& primitive = file_.PrimitiveOf(ended_).primitive;
  for (std::size_t i = 0; i < passage.purpose.size(); ++i) {
    JudgedTarget& judged = passage.purpose[i];
    if (judged.result || !judged.obstacle.empty()) continue;
    const bool rests = !passage.swings_on && (judged.target.when == PurposeTarget::When::kSettled ||
                                              judged.target.when == PurposeTarget::When::kLater);
    const double due_s =
        DueTime(judged.target, primitive.duration_s, primitive.settle_s) - primitive.duration_s;
    if (!next && !(since_end_s >= due_s && (settled || !rests))) continue;
    judged.Judge(ResultOf(i, ended_, truth));
    judged.after_s = since_end_s;
  }
  if (!passage.pitch_later_rad && (next || (settled && since_end_s >= Passage::kLater_s))) {
    passage.pitch_later_rad = AngleOf(truth, ended_);
    passage.later_s = since_end_s;
  }
}

/// Keeps the speeds of the last kRestWatched_s.
void PurposeJudge::Watch(std::int64_t time_ns, const TwinState& truth) {
  double speed = std::max({std::abs(truth.root_vx_m_s), std::abs(truth.root_vy_m_s),
                           std::abs(truth.root_vz_m_s), std::abs(truth.root_pitch_rate_rad_s)});
  for (const double rate : truth.root_angular_velocity_rad_s)
    speed = std::max(speed, std::abs(rate));
  speeds_.emplace_back(time_ns, speed);
  const std::int64_t watched_ns = std::llround(1e9 * kRestWatched_s);
  while (speeds_.front().first < time_ns - watched_ns) speeds_.pop_front();
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
void PurposeJudge::EndMotion(int node, std::int64_t time_ns, const TwinState& truth) {
  moving_ = -1;
  const PrimitiveFile& primitive = file_.PrimitiveOf(node);
  const double tolerance_rad = file_.exit_pitch_tolerance_rad[Index(node)];
  expected_pitch_rad_ += primitive.exit.root_pitch_rad - primitive.entry.root_pitch_rad;
  ended_ = node;
  end_ns_ = time_ns;
  if (passages_.size() >= kKept) LeaveOutOne();
  Passage& passage = passages_.emplace_back();
  passage.node = std::string(file_.graph.node(node).name.view());
  passage.free_root = free_root_;
  passage.in_space = truth.is_in_space();
  passage.hinged = hinged_;
  passage.swings_on = hinged_ && !primitive.primitive.feedback.present();
  passage.expected_pitch_rad = expected_pitch_rad_;
  passage.pitch_at_end_rad = AngleOf(truth, node);
  passage.tolerance_rad = std::max(passage.tolerance_rad, tolerance_rad);
  passage.purpose = std::move(under_way_);
}

void PurposeJudge::TakeRootInSpace(const TwinState& truth) {
  q_[0] = truth.root_x_m;
  q_[1] = truth.root_y_m;
  q_[2] = truth.root_z_m;
  qd_[0] = truth.root_vx_m_s;
  qd_[1] = truth.root_vy_m_s;
  qd_[2] = truth.root_vz_m_s;
  axes_ = ToRotation(truth.root_quaternion);
  // In these axes the root's angles are 0, and their rates the angular velocity about -y, x and z.
  const std::array<double, 3>& w = truth.root_angular_velocity_rad_s;
  const SpaceVector local = axes_.TransposeTimes({w[0], w[1], w[2]});
  qd_[3] = -local.y();
  qd_[4] = local.x();
  qd_[5] = local.z();
  task_.Enter(q_, qd_, axes_);
}

double PurposeJudge::AngleOf(const TwinState& truth, int node) const {
  if (!truth.is_in_space()) return truth.root_pitch_rad;
  return TiltBetween(truth.root_quaternion, file_.PrimitiveOf(node).exit.root_quaternion);
}

/// What a target of a node's purpose asks for, in the coordinates of its task: there the motion
/// begins at the entry.
double PurposeJudge::ResultOf(std::size_t target, int node, const TwinState& truth) {
  const PrimitiveFile& primitive = file_.PrimitiveOf(node);
  if (primitive.purpose[target].of == PurposeTarget::Of::kSpeed) {
    return std::max_element(speeds_.begin(), speeds_.end(),
                            [](const auto& a, const auto& b) { return a.second < b.second; })
        ->second;
  }
  if (truth.is_in_space()) {
    TakeRootInSpace(truth);
  } else if (root_dofs_ > 0) {
    q_[0] = truth.root_x_m - start_x_m_ + primitive.entry.root_x_m;
    q_[1] = truth.root_z_m;
    q_[2] = truth.root_pitch_rad - turned_rad_;
    qd_[0] = truth.root_vx_m_s;
    qd_[1] = truth.root_vz_m_s;
    qd_[2] = truth.root_pitch_rate_rad_s;
  }
  for (std::size_t j = 0; j < joint_dofs_.size(); ++j) {
    const std::size_t role = joint_dofs_[Index(file_.graph.RoleOf(node, static_cast<int>(j)))];
    q_[role] = truth.joint_positions_rad[j];
    qd_[role] = truth.joint_velocities_rad_s[j];
  }
  for (std::size_t i = 0; i < passive_dofs_.size(); ++i) {
    q_[passive_dofs_[i]] = truth.passive_positions_rad[i];
    qd_[passive_dofs_[i]] = truth.passive_velocities_rad_s[i];
  }
  return gauges_[Index(file_.graph.node(node).primitive)][target].At(q_, qd_, axes_);
}

}  // namespace tumbler
