#include "runtime/core/executor.h"

#include <algorithm>
#include <cmath>

namespace tumbler {
namespace {

/// How far the commanded position may be from the primitive's first one when it starts to run: what
/// a float and the limits can leave of a move that ends exactly there.
constexpr float kAtStart_rad = 1e-4F;

/// How far the limited setpoint may be from the planned one when a motion counts as finished.
constexpr float kFinished_rad = 1e-4F;

constexpr float Magnitude(float x) noexcept { return x < 0 ? -x : x; }

constexpr bool InRange(float x, float min, float max) noexcept {
  return x >= min && x <= max;
}  // False for NaN.

constexpr bool IsPositive(float x) noexcept { return x > 0 && IsFinite(x); }

/// Smallest integer >= x, for 0 <= x < 2^31.
constexpr std::int64_t CeilTicks(float x) noexcept {
  const auto whole = static_cast<std::int64_t>(x);
  return static_cast<float>(whole) < x ? whole + 1 : whole;
}

bool IsLinkUp(Status status) noexcept {
  return status == Status::kOk || status == Status::kWouldBlock;
}

bool AllFinite(const DriveFeedback& feedback) noexcept {
  return AreFinite(feedback.position_rad, feedback.velocity_rad_s, feedback.torque_nm,
                   feedback.temperature_c);
}

bool IsValid(const ExecutorConfig& config, int joint_count) noexcept {
  if (!(InRange(config.period_s, 1e-5F, 1.0F) && InRange(config.speed, 0.1F, 1.0F) &&
        InRange(config.move_fraction, 0.001F, 1.0F) && InRange(config.torque_rise_s, 1e-6F, 1e3F) &&
        config.stale_ticks_max >= 1 && config.sequence_errors_max >= 1 &&
        config.late_ticks_max >= 0 && config.arming_ticks_max >= 1)) {
    return false;
  }
  if (config.collapse.configured ? !InRange(config.collapse.stiffness, 0.01F, 1.0F)
                                 : config.reactions.Has(Reaction::kCollapse)) {
    return false;
  }
  for (int i = 0; i < joint_count; ++i) {
    const JointConfig& joint = config.joints[static_cast<std::size_t>(i)];
    if (!(InRange(joint.kp_nm_per_rad, 0, 1e6F) && InRange(joint.kd_nm_s_per_rad, 0, 1e6F) &&
          InRange(joint.damping_nm_s_per_rad, 0, 1e6F) && IsFinite(joint.temperature_max_c))) {
      return false;
    }
  }
  return true;
}

bool IsValid(const SequenceGraph<float>& graph, int primitive_count) noexcept {
  const auto within = [](int i, int count) { return i >= 0 && i < count; };
  if (graph.node_count > kMaxSequenceNodes || graph.edge_count > kMaxSequenceEdges ||
      !within(graph.start, graph.node_count) || graph.edge_count < 0) {
    return false;
  }
  for (const SequenceNode& node : graph.nodes()) {
    if (!within(node.primitive, primitive_count)) return false;
  }
  for (const SequenceEdge<float>& edge : graph.edges()) {
    if (!within(edge.from, graph.node_count) || !within(edge.to, graph.node_count) ||
        !InRange(edge.settle_s, 0, 1e6F)) {
      return false;
    }
  }
  return true;
}

bool IsValid(const JointMotion<float>& motion, const ExecutorConfig& config) noexcept {
  const JointLimits<float>& limits = motion.limits;
  if (!(IsFinite(limits.position_min_rad) && IsFinite(limits.position_max_rad) &&
        limits.position_min_rad < limits.position_max_rad &&
        IsPositive(limits.velocity_max_rad_s) && IsPositive(limits.acceleration_max_rad_s2) &&
        IsPositive(limits.torque_max_nm))) {
    return false;
  }
  const auto start = motion.position.Evaluate(motion.position.start_s());
  return Magnitude(start.first) * config.speed <=
             limits.acceleration_max_rad_s2 * config.period_s &&
         InRange(start.value, limits.position_min_rad, limits.position_max_rad);
}

// Whether the pose of kCollapse is within the limits of whichever path its joint may follow.
bool IsValid(const CollapseConfig& collapse, const Primitive<float>& primitive) noexcept {
  if (!collapse.configured) return true;
  for (int i = 0; i < primitive.joint_count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const JointLimits<float>& limits = primitive.joints[index].limits;
    if (!InRange(collapse.position_rad[index], limits.position_min_rad, limits.position_max_rad)) {
      return false;
    }
  }
  return true;
}

bool IsValid(const Primitive<float>& primitive, const ExecutorConfig& config) noexcept {
  if (!IsPositive(primitive.duration_s) || primitive.duration_s > 1e4F ||
      !InRange(primitive.settle_s, 0, 1e6F) || !IsPositive(primitive.entry_tolerance_rad) ||
      !IsPositive(primitive.following_tolerance_rad)) {
    return false;
  }
  return std::ranges::all_of(primitive.motions(), [&](const JointMotion<float>& motion) {
    return IsValid(motion, config);
  });
}

}  // namespace

Status Executor::Configure(const ExecutorConfig& config, const SequenceGraph<float>& graph,
                           std::span<const Primitive<float>> primitives,
                           std::span<Drive* const> drives) noexcept {
  if (state_ != ExecutorState::kDisarmed) return Status::kWouldBlock;
  const auto count = static_cast<int>(drives.size());
  if (count < 1 || count > kMaxJoints || !IsValid(config, count) ||
      !IsValid(graph, static_cast<int>(primitives.size())) || config.branch >= graph.edge_count) {
    return Status::kInvalidArgument;
  }
  for (const Drive* const drive : drives) {
    if (drive == nullptr) return Status::kInvalidArgument;
  }
  for (const Primitive<float>& primitive : primitives) {
    if (primitive.joint_count != count || !IsValid(primitive, config) ||
        !IsValid(config.collapse, primitive)) {
      return Status::kInvalidArgument;
    }
  }

  config_ = config;
  graph_ = graph;
  primitives_ = primitives;
  joint_count_ = count;
  time_per_tick_s_ = config.period_s * config.speed;
  primitive_time_s_ = 0;
  keep_torque_ = false;
  cycles_done_ = 0;
  for (int i = 0; i < count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    joints_[index] = Joint{};
    joints_[index].drive = drives[index];
    joints_[index].rhythm = drives[index]->reply_rhythm();
  }
  SetNode(graph_.start);
  return Status::kOk;
}

void Executor::SetNode(int node) noexcept {
  node_ = node;
  primitive_ = &primitives_[static_cast<std::size_t>(graph_.node(node).primitive)];
  run_ticks_ = CeilTicks(primitive_->duration_s / time_per_tick_s_);
  for (int i = 0; i < joint_count_; ++i) {
    Joint& joint = joints_[static_cast<std::size_t>(i)];
    const auto role = static_cast<std::size_t>(graph_.RoleOf(node, i));
    joint.motion = &primitive_->joints[role];
    joint.limits = MakeSafetyLimits(joint.motion->limits, config_.period_s, config_.torque_rise_s);
    joint.acceleration_max_rad_s2 = joint.motion->limits.acceleration_max_rad_s2;
    const JointMotion<float>& first = *joints_[0].motion;
    joint.shares_position_knots = joint.motion->position.HasKnotsOf(first.position);
    joint.shares_torque_knots = joint.motion->torque.HasKnotsOf(first.torque);
  }
}

int Executor::NextEdgeHere() const noexcept {
  SequenceRequest request =
      PlannedRequest(config_.cycles, graph_.BranchName(config_.branch), cycles_done_, branched_);
  if (wanted_branch_ >= 0) request.branch = graph_.BranchName(wanted_branch_);
  request.stop = finish_;
  return NextEdge(graph_, node_, cycles_done_, request);
}

void Executor::FollowEdge(int edge) noexcept {
  if (graph_.edge(edge).when == EdgeCondition::kBranch) {
    const std::string_view taken = graph_.BranchName(edge);
    if (wanted_branch_ >= 0 && graph_.BranchName(wanted_branch_) == taken) {
      wanted_branch_ = -1;
    } else {
      branched_ = true;
    }
  }
  SetNode(graph_.edge(edge).to);
  const float tolerance = primitive_->entry_tolerance_rad;
  for (int i = 0; i < joint_count_; ++i) {
    const Joint& joint = joints_[static_cast<std::size_t>(i)];
    const float start = joint.motion->position.control_points()[0];
    const float error = Magnitude(joint.measured.position_rad - start);
    // Also when it is not a number.
    if (!(error <= tolerance)) return Latch(Fault::kEntryMissed, i, error, tolerance);
  }
  Enter(ExecutorState::kRunning);
}

void Executor::Tick(const TickInput& input, TickOutput& output) noexcept TUMBLER_NONBLOCKING {
  const std::int64_t elapsed = ticked_ ? input.tick - tick_ : 1;
  tick_ = input.tick;
  ticked_ = true;
  refusal_ = {};

  // However much time has passed, the plan goes on by no more than what is made up for.
  const std::int64_t most = 1 + static_cast<std::int64_t>(config_.late_ticks_max);
  const auto advance = static_cast<int>(std::clamp<std::int64_t>(elapsed, 1, most));
  ticks_in_state_ += advance;

  TakeReplies(input, advance);
  if (state_ != ExecutorState::kDisarmed) DetectFaults(input, elapsed);
  Obey(input);

  TickRecord& record = output.record;
  const int node_played = node_;
  Plan(advance, record);
  record.state = state_;
  Send(advance, output);
  Advance(record);

  record.tick = tick_;
  record.primitive_time_s = primitive_time_s_;
  record.faults = faults_;
  record.reaction = reaction_;
  record.command = input.command;
  record.joint_count = static_cast<std::uint8_t>(joint_count_);
  record.node = static_cast<std::int8_t>(node_played);
  record.cycles = cycles_done_;
  record.first_fault = first_fault_;
  record.refusal = refusal_;
}

void Executor::TakeReplies(const TickInput& input, int elapsed) noexcept {
  // Drives mostly answer in their order: after one the next is asked first.
  int first = 0;
  for (const ReceivedFrame& received : input.received) {
    for (int n = 0, i = first; n < joint_count_; ++n) {
      Joint& joint = joints_[static_cast<std::size_t>(i)];
      const int next = i + 1 < joint_count_ ? i + 1 : 0;
      if (joint.drive->Decode(received.frame)) {
        ++joint.replies;
        first = next;
        break;
      }
      i = next;
    }
  }
  for (Joint& joint : joints()) {
    if (joint.replies != 0) {
      joint.reply_age_ticks = 0;
      joint.measured = joint.drive->feedback();
    } else if (joint.reply_age_ticks >= 0) {
      joint.reply_age_ticks = std::min<std::int32_t>(joint.reply_age_ticks + elapsed, 1 << 30);
    }
    joint.drive_state = joint.drive->state();
    if (joint.replies != 1 || (joint.unanswered | joint.sequence_errors) != 0) {
      JudgeReplies(joint, elapsed);
    } else {
      joint.reply_status = ReplyStatus::kOk;
    }
    joint.replies = 0;
  }
}

void Executor::JudgeReplies(Joint& joint, int elapsed) const noexcept {
  constexpr int kMost = 1000;
  const ReplyStatus before = joint.reply_status;
  const int replies = joint.replies;
  ReplyStatus status = ReplyStatus::kOk;
  if (replies == 0) {
    status = ReplyStatus::kNoNewData;
    joint.in_order = 0;
    joint.unanswered = std::min(joint.unanswered + 1, kMost);
  } else if (!joint.rhythm.answers) {
    if (replies > joint.rhythm.per_tick_max * elapsed) {
      status = ReplyStatus::kRepeated;
    } else if (before == ReplyStatus::kNoNewData) {
      status = ReplyStatus::kOkSomeLost;
    }
    joint.unanswered = 0;
  } else if (replies == 1) {
    if (before == ReplyStatus::kNoNewData) status = ReplyStatus::kOkSomeLost;
    // What has not come by now is lost.
    if (++joint.in_order > config_.stale_ticks_max) joint.unanswered = joint.in_order = 0;
  } else {
    const int surplus = replies - 1;
    status = surplus > joint.unanswered ? ReplyStatus::kRepeated : ReplyStatus::kWrongSequence;
    joint.in_order = 0;
    joint.unanswered = std::max(joint.unanswered - surplus, 0);
  }
  if (status == ReplyStatus::kRepeated || status == ReplyStatus::kWrongSequence) {
    joint.sequence_errors = std::min(joint.sequence_errors + 2, kMost);
  } else if (replies != 0 && joint.sequence_errors > 0) {
    --joint.sequence_errors;
  }
  joint.reply_status = status;
}

void Executor::DetectFaults(const TickInput& input, std::int64_t elapsed) noexcept {
  if (elapsed < 1 || elapsed > 1 + static_cast<std::int64_t>(config_.late_ticks_max)) {
    Latch(Fault::kLateTick, -1, static_cast<float>(elapsed - 1),
          static_cast<float>(config_.late_ticks_max));
  }
  if (input.send_status != Status::kOk || !IsLinkUp(input.receive_status) ||
      input.controller >= CanControllerState::kErrorPassive) {
    DetectLinkFaults(input);
  }
  // One reaction per tick: what the first fault of this tick changes counts from the next one on.
  const bool follows = state_ != ExecutorState::kArming && reaction_ <= Reaction::kHold;
  const float following_tolerance_rad = primitive_->following_tolerance_rad;
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    Joint& joint = joints_[index];
    if (joint.measured.error != 0 || joint.drive_state != DriveState::kEnabled) {
      DetectDriveFaults(i);
    } else {
      joint.was_enabled = true;
    }
    if (joint.sequence_errors > config_.sequence_errors_max) {
      Latch(Fault::kWrongSequence, i, static_cast<float>(joint.sequence_errors),
            static_cast<float>(config_.sequence_errors_max));
    }
    if (joint.reply_age_ticks != 0) {
      if (joint.reply_age_ticks > config_.stale_ticks_max) {
        Latch(Fault::kStaleReply, i, static_cast<float>(joint.reply_age_ticks),
              static_cast<float>(config_.stale_ticks_max));
      }
      continue;
    }
    if (!AllFinite(joint.measured)) {
      Latch(Fault::kNonFinite, i, joint.measured.position_rad, 0);
      continue;
    }
    const float temperature_max_c = config_.joints[index].temperature_max_c;
    if (joint.measured.has_temperature && joint.measured.temperature_c > temperature_max_c) {
      Latch(Fault::kOverTemperature, i, joint.measured.temperature_c, temperature_max_c);
    }
    // `commanded` still is the setpoint of the tick before: the one that this reply answers.
    const float error = Magnitude(joint.measured.position_rad - joint.commanded.position_rad);
    if (follows && error > following_tolerance_rad) {
      Latch(Fault::kFollowingError, i, error, following_tolerance_rad);
    }
  }
}

void Executor::DetectLinkFaults(const TickInput& input) noexcept {
  const auto latch = [this](Status status) {
    Fault fault = Fault::kLinkFailed;
    if (status == Status::kBusOff) fault = Fault::kBusOff;
    if (status == Status::kLinkDown) fault = Fault::kInterfaceDown;
    if (status == Status::kLinkGone) fault = Fault::kInterfaceGone;
    if (status == Status::kWouldBlock) fault = Fault::kTransmitQueueFull;
    Latch(fault, -1, static_cast<float>(status), 0);
  };
  // Sending failed first, in the tick before; a link that was lost since may be its consequence.
  if (input.send_status != Status::kOk) latch(input.send_status);
  if (!IsLinkUp(input.receive_status)) latch(input.receive_status);
  if (input.controller == CanControllerState::kBusOff) latch(Status::kBusOff);
  if (input.controller == CanControllerState::kErrorPassive) {
    Latch(Fault::kErrorPassive, -1, static_cast<float>(input.controller),
          static_cast<float>(CanControllerState::kErrorWarning));
  }
}

void Executor::DetectDriveFaults(int index) noexcept {
  const Joint& joint = joints_[static_cast<std::size_t>(index)];
  if (joint.drive_state == DriveState::kLost) {
    const HeartbeatAge age = joint.drive->heartbeat();
    Latch(Fault::kHeartbeatLost, index, static_cast<float>(age.ticks),
          static_cast<float>(age.limit_ticks));
  }
  const bool stays =
      joint.drive_state == DriveState::kEnabled || joint.drive_state == DriveState::kLost;
  const bool driven = reaction_ != Reaction::kDisable;
  if (joint.measured.error != 0 || joint.drive_state == DriveState::kFault ||
      (driven && joint.was_enabled && !stays)) {
    Latch(Fault::kDriveError, index, static_cast<float>(joint.measured.error), 0);
  }
}

void Executor::Latch(Fault fault, int joint, float value, float limit) noexcept {
  const std::uint32_t bit = 1U << static_cast<unsigned>(fault);
  if ((faults_ & bit) != 0)
    return;  // Already answered; what it escalates to is another fault's matter.
  const Reaction reaction = config_.reactions(fault, state_);
  if (reaction == Reaction::kIgnore) return;
  faults_ |= bit;
  if (first_fault_.fault == Fault::kNone) {
    first_fault_ = {tick_, value, limit, fault, static_cast<std::int8_t>(joint), state_, reaction};
  }
  reaction_ = std::max(reaction_, reaction);
  if (state_ != ExecutorState::kFault) Enter(ExecutorState::kFault);
}

void Executor::Obey(const TickInput& input) noexcept {
  const auto refuse = [this](Refusal refusal) { refusal_.refusal = refusal; };
  switch (input.command) {
    case OperatorCommand::kNone:
      return;
    case OperatorCommand::kArm:
      if (state_ == ExecutorState::kDisarmed && joint_count_ > 0) SetNode(graph_.start);
      refusal_ = CheckArm();
      if (refusal_.refusal == Refusal::kNone) Enter(ExecutorState::kArming);
      return;
    case OperatorCommand::kMoveToStart:
      refusal_ = CheckMove();
      if (refusal_.refusal != Refusal::kNone) return;
      SetNode(graph_.start);
      StartMove();
      return;
    case OperatorCommand::kRun:
      refusal_ = CheckRun();
      if (refusal_.refusal != Refusal::kNone) return;
      SetNode(graph_.start);
      cycles_done_ = 0;
      wanted_branch_ = -1;
      branched_ = finish_ = false;
      Enter(ExecutorState::kRunning);
      return;
    case OperatorCommand::kStop: {
      if (state_ == ExecutorState::kDisarmed || state_ == ExecutorState::kHolding ||
          state_ == ExecutorState::kStopping) {
        return;  // Nothing moves; a stop is never refused.
      }
      const Reaction reaction = config_.reactions(Fault::kOperatorStop, state_);
      const bool plain = reaction == Reaction::kHold && state_ != ExecutorState::kFault;
      if (plain) {
        Enter(ExecutorState::kStopping);
      } else {
        Latch(Fault::kOperatorStop, -1, 0, 0);
      }
      return;
    }
    case OperatorCommand::kDisarm:
      Enter(ExecutorState::kDisarmed);
      return;
    case OperatorCommand::kClearFaults:
      if (state_ != ExecutorState::kDisarmed) return refuse(Refusal::kWrongState);
      faults_ = 0;
      first_fault_ = {};
      unarmed_request_ = DriveRequest::kClearErrors;
      return;
    case OperatorCommand::kFinish:
      finish_ = finish_ || InSequence();
      return;  // Where nothing is played there is nothing to finish; a stop is never refused.
    case OperatorCommand::kBranch:
      if (!InSequence()) return refuse(Refusal::kWrongState);
      if (graph_.BranchName(input.branch).empty()) {
        refusal_ = {static_cast<float>(input.branch), 0, Refusal::kNoSuchBranch, -1};
        return;
      }
      wanted_branch_ = input.branch;
      return;
  }
  refuse(Refusal::kWrongState);  // Not one of the enumerators.
}

RefusalDetail Executor::CheckArm() const noexcept {
  if (joint_count_ == 0) return {0, 0, Refusal::kNotConfigured, -1};
  if (state_ != ExecutorState::kDisarmed) return {0, 0, Refusal::kWrongState, -1};
  if (faults_ != 0) return {0, 0, Refusal::kFaultLatched, -1};
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const Joint& joint = joints_[index];
    const auto name = static_cast<std::int8_t>(i);
    const float position = joint.measured.position_rad;
    if (joint.reply_age_ticks < 0 || joint.reply_age_ticks > config_.stale_ticks_max) {
      return {static_cast<float>(joint.reply_age_ticks),
              static_cast<float>(config_.stale_ticks_max), Refusal::kNoReply, name};
    }
    if (joint.measured.error != 0 || joint.drive_state == DriveState::kFault) {
      return {static_cast<float>(joint.measured.error), 0, Refusal::kDriveError, name};
    }
    if (joint.drive_state == DriveState::kLost) {
      const HeartbeatAge age = joint.drive->heartbeat();
      return {static_cast<float>(age.ticks), static_cast<float>(age.limit_ticks),
              Refusal::kNoHeartbeat, name};
    }
    const float temperature_max_c = config_.joints[index].temperature_max_c;
    if (joint.measured.has_temperature && !(joint.measured.temperature_c <= temperature_max_c)) {
      return {joint.measured.temperature_c, temperature_max_c, Refusal::kTooHot, name};
    }
    if (!AllFinite(joint.measured) ||
        !InRange(position, joint.limits.position_min_rad, joint.limits.position_max_rad)) {
      const bool below = position < joint.limits.position_min_rad;
      return {position, below ? joint.limits.position_min_rad : joint.limits.position_max_rad,
              Refusal::kOutsideLimits, name};
    }
  }
  return {};
}

const JointMotion<float>& Executor::FirstMotion(int joint) const noexcept {
  const SequenceNode& node = graph_.node(graph_.start);
  const auto role = static_cast<std::size_t>(graph_.RoleOf(graph_.start, joint));
  return primitives_[static_cast<std::size_t>(node.primitive)].joints[role];
}

RefusalDetail Executor::CheckMove() const noexcept {
  if (state_ != ExecutorState::kHolding) return {0, 0, Refusal::kWrongState, -1};
  for (int i = 0; i < joint_count_; ++i) {
    // The gate would pull the command inside the limits at once, however far that is.
    const JointLimits<float>& limits = FirstMotion(i).limits;
    const float position = joints_[static_cast<std::size_t>(i)].commanded.position_rad;
    if (!InRange(position, limits.position_min_rad, limits.position_max_rad)) {
      const bool below = position < limits.position_min_rad;
      return {position, below ? limits.position_min_rad : limits.position_max_rad,
              Refusal::kOutsideLimits, static_cast<std::int8_t>(i)};
    }
  }
  return {};
}

RefusalDetail Executor::CheckRun() const noexcept {
  if (state_ != ExecutorState::kHolding) return {0, 0, Refusal::kWrongState, -1};
  const float tolerance = primitives_[static_cast<std::size_t>(graph_.node(graph_.start).primitive)]
                              .entry_tolerance_rad;
  for (int i = 0; i < joint_count_; ++i) {
    const Joint& joint = joints_[static_cast<std::size_t>(i)];
    const auto name = static_cast<std::int8_t>(i);
    const float start = FirstMotion(i).position.control_points()[0];
    const float commanded_error = Magnitude(joint.commanded.position_rad - start);
    if (!(commanded_error <= kAtStart_rad))
      return {commanded_error, kAtStart_rad, Refusal::kNotAtStart, name};
    const float measured_error = Magnitude(joint.measured.position_rad - start);
    if (!(measured_error <= tolerance))
      return {measured_error, tolerance, Refusal::kOutsideStartSet, name};
  }
  return {};
}

void Executor::StartMove() noexcept {
  // The quintic s(x) = 10 x^3 - 15 x^4 + 6 x^5 has peak s' = 15/8 and peak s'' = 10 / sqrt(3).
  constexpr float kPeakVelocity = 1.875F;
  constexpr float kPeakAcceleration = 5.7735027F;
  float duration_s = 0;
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    Joint& joint = joints_[index];
    joint.move_from_rad = joint.commanded.position_rad;
    const float way =
        Magnitude(joints_[index].motion->position.control_points()[0] - joint.move_from_rad);
    const float velocity = config_.move_fraction * joint.limits.velocity_max_rad_s;
    const float acceleration = config_.move_fraction * joint.acceleration_max_rad_s2;
    duration_s = std::max({duration_s, kPeakVelocity * way / velocity,
                           std::sqrt(kPeakAcceleration * way / acceleration)});
  }
  const float ticks = std::min(duration_s / time_per_tick_s_, 1e9F);
  move_ticks_ = std::max<std::int64_t>(1, CeilTicks(ticks));
  Enter(ExecutorState::kMovingToStart);
}

void Executor::Enter(ExecutorState state) noexcept {
  // The feed-forward that a motion ends with carries the robot there; one from mid-motion carries
  // it nowhere.
  const bool moving = state_ == ExecutorState::kMovingToStart || state_ == ExecutorState::kRunning;
  if (state == ExecutorState::kSettling) {
    keep_torque_ = true;
  } else if (moving || state == ExecutorState::kMovingToStart || state == ExecutorState::kArming) {
    keep_torque_ = false;
  }
  if (state == ExecutorState::kRunning || state == ExecutorState::kArming) primitive_time_s_ = 0;
  if (state == ExecutorState::kDisarmed) reaction_ = Reaction::kIgnore;
  if (state == ExecutorState::kArming) {
    for (Joint& joint : joints()) {
      joint.was_enabled = false;
      joint.sequence_errors = 0;
    }
  }
  state_ = state;
  ticks_in_state_ = 0;
}

void Executor::Plan(int elapsed, TickRecord& record) noexcept {
  switch (state_) {
    case ExecutorState::kDisarmed:
    case ExecutorState::kArming:
      return PlanArming(record);
    case ExecutorState::kMovingToStart:
      return PlanMove(record);
    case ExecutorState::kRunning:
      return PlanRun(record);
    case ExecutorState::kHolding:
    case ExecutorState::kSettling:
    case ExecutorState::kStopping:
      return PlanBrake(elapsed, record);
    case ExecutorState::kFault:
      PlanBrake(elapsed, record);
      if (reaction_ == Reaction::kCollapse) PlanCollapse(elapsed, record);
      return;
  }
}

void Executor::PlanArming(TickRecord& record) noexcept {
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    Joint& joint = joints_[index];
    const bool follow =
        state_ == ExecutorState::kDisarmed || joint.drive_state != DriveState::kEnabled;
    if (follow && joint.reply_age_ticks >= 0 && AllFinite(joint.measured)) {
      // Not an order yet: the joint may still be moved by hand, and the limits' step must not hold
      // it back.
      const float position = std::clamp(joint.measured.position_rad, joint.limits.position_min_rad,
                                        joint.limits.position_max_rad);
      joint.commanded = {position, 0, 0};
    }
    record.joints[index].planned = joint.commanded;
    record.joints[index].planned_acceleration_rad_s2 = 0;
  }
}

void Executor::PlanMove(TickRecord& record) noexcept {
  const bool at_end = ticks_in_state_ >= move_ticks_;
  const float duration_s = static_cast<float>(move_ticks_) * config_.period_s;
  const float x = static_cast<float>(ticks_in_state_) / static_cast<float>(move_ticks_);
  const float share = x * x * x * (10.0F + x * (6.0F * x - 15.0F));
  const float rate = 30.0F * x * x * (1.0F + x * (x - 2.0F)) / duration_s;
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const float from = joints_[index].move_from_rad;
    const float to = joints_[index].motion->position.control_points()[0];
    JointSetpoint& planned = record.joints[index].planned;
    record.joints[index].planned_acceleration_rad_s2 = 0;
    planned = at_end ? JointSetpoint{to, 0, 0}
                     : JointSetpoint{from + (to - from) * share, (to - from) * rate, 0};
  }
}

void Executor::PlanRun(TickRecord& record) noexcept {
  // Every time is one product of an integer, so that rounding does not add up; the last one is the
  // end itself.
  primitive_time_s_ = ticks_in_state_ >= run_ticks_
                          ? primitive_->duration_s
                          : static_cast<float>(ticks_in_state_) * time_per_tick_s_;
  const float time_s = primitive_time_s_;
  const float speed = config_.speed;
  const float speed_2 = speed * speed;
  Joint& first = joints_[0];
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    Joint& joint = joints_[index];
    const JointMotion<float>& motion = *joint.motion;
    Basis& position_basis =
        joint.shares_position_knots ? first.position_basis : joint.position_basis;
    Basis& torque_basis = joint.shares_torque_knots ? first.torque_basis : joint.torque_basis;
    if (i == 0 || !joint.shares_position_knots)
      motion.position.EvaluateBasis(time_s, position_basis);
    if (i == 0 || !joint.shares_torque_knots) motion.torque.EvaluateBasis(time_s, torque_basis);
    const auto sample = motion.position.Evaluate(position_basis);
    const float torque = motion.torque.Value(torque_basis);
    JointRecord& out = record.joints[index];
    out.planned = {sample.value, speed * sample.first, speed_2 * torque};
    out.planned_acceleration_rad_s2 = speed_2 * sample.second;
  }
}

void Executor::PlanBrake(int elapsed, TickRecord& record) noexcept {
  const float time_s = static_cast<float>(elapsed) * config_.period_s;
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const Joint& joint = joints_[index];
    const JointSetpoint& last = joint.commanded;
    const float most = joint.acceleration_max_rad_s2 * time_s;
    float velocity = 0;
    if (last.velocity_rad_s > most) velocity = last.velocity_rad_s - most;
    if (last.velocity_rad_s < -most) velocity = last.velocity_rad_s + most;
    record.joints[index].planned = {
        last.position_rad + 0.5F * (last.velocity_rad_s + velocity) * time_s, velocity,
        keep_torque_ ? last.torque_nm : 0.0F};
    record.joints[index].planned_acceleration_rad_s2 = 0;
  }
}

// From any position and velocity: towards the pose at no more than the velocity from which gentle
// braking still ends there. Braking itself is as hard as it has to be.
void Executor::PlanCollapse(int elapsed, TickRecord& record) noexcept {
  constexpr float kArrived_rad = 1e-5F;
  const float time_s = static_cast<float>(elapsed) * config_.period_s;
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const Joint& joint = joints_[index];
    JointSetpoint& planned = record.joints[index].planned;
    planned.torque_nm = 0;
    // A drive that is not driven would jump to wherever the plan has got to.
    if (joint.drive_state != DriveState::kEnabled) continue;
    const auto role = static_cast<std::size_t>(graph_.RoleOf(node_, i));
    const float target = config_.collapse.position_rad[role];
    const JointSetpoint& last = joint.commanded;
    const float way = target - last.position_rad;
    const float gentle = config_.move_fraction * joint.acceleration_max_rad_s2;
    const float fastest =
        std::min({config_.move_fraction * joint.limits.velocity_max_rad_s,
                  std::sqrt(2 * gentle * Magnitude(way)), Magnitude(way) / time_s});
    const float wanted = way < 0 ? -fastest : fastest;
    const float change = wanted - last.velocity_rad_s;
    const bool brakes = change * last.velocity_rad_s < 0;
    const float most = (brakes ? joint.acceleration_max_rad_s2 : gentle) * time_s;
    const float velocity = last.velocity_rad_s + std::clamp(change, -most, most);
    planned.position_rad = last.position_rad + 0.5F * (last.velocity_rad_s + velocity) * time_s;
    planned.velocity_rad_s = velocity;
    if (Magnitude(way) <= kArrived_rad && Magnitude(last.velocity_rad_s) * time_s <= kArrived_rad) {
      planned.position_rad = target;
      planned.velocity_rad_s = 0;
    }
  }
}

void Executor::Send(int elapsed, TickOutput& output) noexcept {
  const bool armed = state_ != ExecutorState::kDisarmed && reaction_ != Reaction::kDisable;
  const bool damped = reaction_ == Reaction::kDamp;
  DriveRequest request = DriveRequest::kEnable;
  if (!armed) {
    request = unarmed_request_;
    unarmed_request_ = DriveRequest::kDisable;
  }
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    Joint& joint = joints_[index];
    const JointConfig& config = config_.joints[index];
    JointRecord& record = output.record.joints[index];
    const LimitedSetpoint limited =
        LimitSetpoint(joint.limits, record.planned, joint.commanded, elapsed);
    joint.commanded = limited.setpoint;
    DriveSetpoint setpoint{joint.commanded.position_rad, joint.commanded.velocity_rad_s,
                           joint.commanded.torque_nm, config.kp_nm_per_rad, config.kd_nm_s_per_rad};
    if (reaction_ == Reaction::kCollapse) {
      setpoint.kp_nm_per_rad *= config_.collapse.stiffness;
    } else if (damped || !armed) {
      setpoint.velocity_rad_s = 0;
      setpoint.torque_nm = 0;
      setpoint.kp_nm_per_rad = 0;
      setpoint.kd_nm_s_per_rad = damped ? config.damping_nm_s_per_rad : 0.0F;
    }
    FrameBatch& batch = output.frames[index];
    batch.Clear();
    const Status status = joint.drive->Encode(request, setpoint, batch);
    if (limited.non_finite || status != Status::kOk)
      Latch(Fault::kNonFinite, i, record.planned.position_rad, 0);

    const DriveSetpoint encoded = joint.drive->encoded_setpoint();
    if (state_ == ExecutorState::kArming && joint.drive_state != DriveState::kEnabled &&
        IsFinite(encoded.position_rad)) {
      // A drive may be told to begin where it was a moment ago: that is where it will be held.
      joint.commanded.position_rad = std::clamp(encoded.position_rad, joint.limits.position_min_rad,
                                                joint.limits.position_max_rad);
    }
    record.limited = joint.commanded;
    record.encoded = {encoded.position_rad, encoded.velocity_rad_s, encoded.torque_nm};
    record.measured = {joint.measured.position_rad, joint.measured.velocity_rad_s,
                       joint.measured.torque_nm};
    record.temperature_c = joint.measured.temperature_c;
    record.reply_age_ticks = joint.reply_age_ticks;
    record.drive_state = joint.drive_state;
    record.reply_status = joint.reply_status;
    record.drive_error = joint.measured.error;
    record.limit_active = limited.changed;
  }
}

void Executor::Advance(const TickRecord& record) noexcept {
  const auto reached = [&] {
    for (int i = 0; i < joint_count_; ++i) {
      const JointRecord& joint = record.joints[static_cast<std::size_t>(i)];
      if (Magnitude(joint.limited.position_rad - joint.planned.position_rad) > kFinished_rad)
        return false;
    }
    return true;
  };
  const auto at_rest = [&] {
    return std::ranges::all_of(
        joints(), [](const Joint& joint) { return joint.commanded.velocity_rad_s == 0; });
  };
  switch (state_) {
    case ExecutorState::kArming: {
      int waiting = -1;
      for (int i = 0; i < joint_count_ && waiting < 0; ++i) {
        if (joints_[static_cast<std::size_t>(i)].drive_state != DriveState::kEnabled) waiting = i;
      }
      if (waiting < 0) {
        Enter(ExecutorState::kHolding);
      } else if (ticks_in_state_ >= config_.arming_ticks_max) {
        Latch(Fault::kArmingTimeout, waiting, static_cast<float>(ticks_in_state_),
              static_cast<float>(config_.arming_ticks_max));
      }
      break;
    }
    case ExecutorState::kMovingToStart:
      if (ticks_in_state_ >= move_ticks_ && reached()) Enter(ExecutorState::kHolding);
      break;
    case ExecutorState::kRunning:
      if (ticks_in_state_ >= run_ticks_ && reached()) {
        cycles_done_ += graph_.node(node_).ends_cycle ? 1 : 0;
        Enter(ExecutorState::kSettling);
      }
      break;
    case ExecutorState::kSettling: {
      // Asked in every tick: until it is taken, the operator may still choose.
      const int edge = NextEdgeHere();
      const float settle_s = edge < 0 ? primitive_->settle_s : graph_.edge(edge).settle_s;
      if (ticks_in_state_ < CeilTicks(settle_s / config_.period_s) || !at_rest()) break;
      if (edge < 0) {
        Enter(ExecutorState::kHolding);
      } else {
        FollowEdge(edge);
      }
      break;
    }
    case ExecutorState::kStopping:
      if (at_rest()) Enter(ExecutorState::kHolding);
      break;
    case ExecutorState::kDisarmed:
    case ExecutorState::kHolding:
    case ExecutorState::kFault:
      break;
  }
}

}  // namespace tumbler
