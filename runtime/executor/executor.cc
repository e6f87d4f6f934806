#include "runtime/executor/executor.h"

#include <algorithm>
#include <limits>

#include "common/core/feedback.h"
#include "runtime/executor/numbers.h"

namespace tumbler {
namespace {

/// A motion counts as finished when the limited setpoint is this near to the planned one.
constexpr float kFinished_rad = 1e-4F;

/// The torque of a drive that has reported none.
constexpr float kNotMeasured = std::numeric_limits<float>::quiet_NaN();

/// The time in which a robot is lowered.
constexpr float kLower_s = 2;

/// The time in which a robot that gets up has to lie still, its joints at the start; and in which a
/// sensor has to tell where a robot is.
constexpr float kLieStill_s = 1;

/// What is older, in ticks, is no older than this.
constexpr int kLongest = 1 << 20;

}  // namespace

// Cold: called once.
[[gnu::cold]] Status Executor::Configure(const ExecutorConfig& config,
                                         const SequenceGraph<float>& graph,
                                         std::span<const Primitive<float>> primitives,
                                         std::span<Drive* const> drives,
                                         const ExecutorSensor& sensor) noexcept {
  if (state_ != ExecutorState::kDisarmed) return Status::kWouldBlock;
  const auto count = static_cast<int>(drives.size());
  if (!IsPlayable(config, graph, primitives, count) ||
      std::ranges::find(drives, nullptr) != drives.end() ||
      (sensor.device != nullptr && !sensor.settings.IsValid())) {
    return Status::kInvalidArgument;
  }

  config_ = config;
  graph_ = graph;
  primitives_ = primitives;
  joint_count_ = count;
  time_per_tick_s_ = config.period_s * config.speed;
  primitive_time_s_ = 0;
  keep_torque_ = false;
  cycles_done_ = get_ups_ = 0;
  fell_in_ = 0;
  cycle_unchecked_ = false;
  for (int i = 0; i < count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    joints_[index] = Joint{};
    joints_[index].drive = drives[index];
    joints_[index].replies = ReplyWatch(drives[index]->reply_rhythm());
  }
  sensor_ = sensor.device;
  sensor_watch_.Configure(sensor.settings, config.period_s);
  corrects_ = false;
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
  if (sensor_ != nullptr) SetFeedback();
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
  const int node = InPlaceOf(graph_.edge(edge).to);
  const Primitive<float>& next = primitives_[static_cast<std::size_t>(graph_.node(node).primitive)];
  const float tolerance = next.entry_tolerance_rad;
  for (int i = 0; i < joint_count_; ++i) {
    const Joint& joint = joints_[static_cast<std::size_t>(i)];
    const auto role = static_cast<std::size_t>(graph_.RoleOf(node, i));
    const float start = next.joints[role].position.control_points()[0];
    // A correction is meant to be there.
    const float error = Magnitude(joint.measured.position_rad - joint.correction_rad - start);
    // Negated, so that an error that is not a number is a fault too. The robot then still is at the
    // end of its node.
    if (!(error <= tolerance)) {
      return Latch(Fault::kEntryMissed, i, DetailNumber::Real(error),
                   DetailNumber::Real(tolerance));
    }
  }
  SetNode(node);
  Enter(ExecutorState::kRunning);
}

bool Executor::AtRest() const noexcept {
  for (int i = 0; i < joint_count_; ++i) {
    if (joints_[static_cast<std::size_t>(i)].commanded.velocity_rad_s != 0) return false;
  }
  return true;
}

float Executor::FarFromEnd() const noexcept {
  if (sensor_ == nullptr || graph_.beginning_count == 0 ||
      sensor_watch_.status() != SensorStatus::kOk) {
    return 0;
  }
  const float planned = graph_.last_pitch_rad[static_cast<std::size_t>(node_)];
  return Magnitude(WithoutTurns(sensor_watch_.pitch_rad() - planned));
}

// At the end of a node: the next one begins, or the sequence ends. The edge is chosen anew in every
// tick: until it is taken, the operator may still decide.
void Executor::EndNode() noexcept {
  const int edge = NextEdgeHere();
  const float settle_s = edge < 0 ? primitive_->settle_s : graph_.edge(edge).settle_s;
  const std::int64_t settle_ticks = CeilTicks(settle_s / config_.period_s);
  if (ticks_in_state_ < settle_ticks || !AtRest()) return;
  if (sensor_ != nullptr && graph_.beginning_count > 0) {
    if (sensor_watch_.status() != SensorStatus::kOk) {
      if (AnswerUnclear(ticks_in_state_ - settle_ticks)) return;
      // Negated, so that a pitch that is not a number is a fall, too.
    } else if (!(FarFromEnd() <= graph_.beginning_within_rad) && AnswerFall()) {
      return;
    }
  }
  cycle_unchecked_ = false;
  if (edge < 0) {
    Enter(ExecutorState::kHolding);
  } else {
    FollowEdge(edge);
  }
}

// Gets up, or ends in a fault. Returns whether either is done: the fault may be one to ignore.
bool Executor::AnswerFall() noexcept {
  fall_rad_ = FarFromEnd();
  // After a fault the robot is on its way to where it can stay, and whoever wants the run to end
  // does not expect that it begins anew.
  if (get_ups_ < config_.get_ups_max && earlier_faults_ == 0 && !finish_ &&
      CheckFirstLimits().refusal == Refusal::kNone) {
    TakeCycleBack();
    NoteFall();
    ++get_ups_;
    SetNode(graph_.start);
    StartMove();
    gets_up_ = true;
    return true;
  }
  LatchFall();
  return state_ == ExecutorState::kFault;
}

// The sensor is not ok, and nothing else tells whether the robot has fallen. A robot on its side
// shows as a tilt out of its plane, and does not get up. Returns whether the node's end has to
// wait, or has ended in a fault: that may be one to ignore.
bool Executor::AnswerUnclear(std::int64_t waited_ticks) noexcept {
  const SensorStatus status = sensor_watch_.status();
  const float tilt_rad = sensor_watch_.tilt_rad();
  const bool may_clear = status < SensorStatus::kFrozen;
  const bool may_come_to_rest = tilt_rad > 0 && !sensor_watch_.tilt_rests();
  if ((may_clear || may_come_to_rest) && waited_ticks < CeilTicks(kLieStill_s / config_.period_s))
    return true;
  const std::uint32_t known = 1U << static_cast<unsigned>(Fault::kPitchUnknown);
  if (tilt_rad > 0) {
    fall_rad_ = tilt_rad;
    TakeCycleBack();
    LatchFall();
  } else if ((earlier_faults_ & known) == 0) {  // On the way home it has been answered.
    Latch(Fault::kPitchUnknown, -1, DetailNumber::Integer(static_cast<std::int64_t>(status)), {});
  }
  return state_ == ExecutorState::kFault;
}

// What a robot falls in is not tried again and again where there is another way: that is taken
// until it falls there, too.
void Executor::NoteFall() noexcept {
  static_assert(kMaxSequenceNodes <= 32);
  for (int i = 0; i < graph_.node_count; ++i) {
    if (graph_.node(i).after_fall == node_) fell_in_ &= ~(1U << static_cast<unsigned>(i));
  }
  if (graph_.node(node_).after_fall >= 0) fell_in_ |= 1U << static_cast<unsigned>(node_);
}

int Executor::InPlaceOf(int node) const noexcept {
  return (fell_in_ >> static_cast<unsigned>(node) & 1U) != 0 ? graph_.node(node).after_fall : node;
}

void Executor::CountCycle() noexcept {
  if (!graph_.node(node_).ends_cycle) return;
  ++cycles_done_;
  cycle_unchecked_ = true;
}

// A cycle that ended in a fall was not complete.
void Executor::TakeCycleBack() noexcept {
  if (cycle_unchecked_) --cycles_done_;
  cycle_unchecked_ = false;
}

void Executor::LatchFall() noexcept {
  Latch(Fault::kFallen, -1, DetailNumber::Real(fall_rad_),
        DetailNumber::Real(graph_.beginning_within_rad));
}

// Goes on with the beginning in whose pose the robot lies, its joints at the start.
void Executor::BeginAnew() noexcept {
  int node = graph_.start;
  if (CheckBeginning(node).refusal == Refusal::kNone) {
    SetNode(node);
    Enter(ExecutorState::kRunning);
  } else if (ticks_in_state_ >= move_ticks_ + CeilTicks(kLieStill_s / config_.period_s)) {
    LatchFall();
  }
}

void Executor::Tick(const TickInput& input, TickOutput& output) noexcept TUMBLER_NONBLOCKING {
  const std::int64_t elapsed = ticked_ ? input.tick - tick_ : 1;
  int passed = 1, advance = 1;
  fresh_ns_ = time_ns_;  // What came since the tick before is new.
  if (elapsed != 1) {
    passed = static_cast<int>(std::clamp<std::int64_t>(elapsed, 1, kLongest));
    // However much time has passed, the plan goes on by at most the ticks that are made up for.
    const std::int64_t most = 1 + static_cast<std::int64_t>(config_.late_ticks_max);
    advance = static_cast<int>(std::clamp<std::int64_t>(elapsed, 1, most));
    fresh_ns_ = input.time_ns - (input.time_ns - time_ns_) / passed;  // in the last of the periods
  }
  tick_ = input.tick;
  time_ns_ = input.time_ns;
  ticked_ = true;
  refusal_ = {};

  ticks_in_state_ += advance;

  TakeReplies(input, passed);
  if (state_ != ExecutorState::kDisarmed) DetectFaults(input, elapsed);
  Obey(input);

  TickRecord& record = output.record;
  const int node_played = node_;
  Plan(advance, record);
  if (sensor_ != nullptr) Correct(advance, record);
  record.state = state_;
  Send(advance, output);
  Advance(record);

  record.tick = tick_;
  record.primitive_time_s = primitive_time_s_;
  record.faults = faults_ | earlier_faults_;
  record.reaction = reaction_;
  record.command = input.command;
  record.joint_count = static_cast<std::uint8_t>(joint_count_);
  record.node = static_cast<std::int8_t>(node_played);
  record.cycles = cycles_done_;
  record.first_fault = first_fault_;
  record.refusal = refusal_;
}

void Executor::TakeReplies(const TickInput& input, int elapsed) noexcept {
  // Drives mostly answer in their order. So the drive after the one that took a frame is asked
  // first.
  int first = 0;
  foreign_joint_ = -1;
  for (const ReceivedFrame& received : input.received) {
    if (sensor_ != nullptr && sensor_->Owns(received.frame)) {
      const InertialPart part = sensor_->Decode(received.frame);
      if (part != InertialPart::kNone) {
        sensor_watch_.Count(part, sensor_->reading(), AgeOf(received));
        continue;
      }
    }
    int asked = 0;
    for (int i = first; asked < joint_count_; ++asked) {
      Joint& joint = joints_[static_cast<std::size_t>(i)];
      const int next = i + 1 < joint_count_ ? i + 1 : 0;
      if (joint.drive->Decode(received.frame)) {
        joint.replies.Count(AgeOf(received));
        first = next;
        break;
      }
      i = next;
    }
    if (asked == joint_count_ && foreign_joint_ < 0) NoteForeignCommand(received.frame);
  }
  for (Joint& joint : joints()) {
    if (joint.replies.EndTick(elapsed, config_.stale_ticks_max)) {
      joint.Measure(joint.drive->feedback());
    }
    joint.drive_state = joint.drive->state();
  }
  if (sensor_ != nullptr) sensor_watch_.EndTick(elapsed, sensor_->reading());
}

inline std::int32_t Executor::AgeOf(const ReceivedFrame& received) const noexcept {
  return received.time_ns >= fresh_ns_ ? 0 : AgeOfOld(received.time_ns);
}

// How many ticks ago a frame was new.
std::int32_t Executor::AgeOfOld(std::int64_t frame_ns) const noexcept {
  const std::int64_t period_ns = time_ns_ - fresh_ns_;
  if (period_ns <= 0) return kLongest;
  const std::int64_t age = (fresh_ns_ - frame_ns + period_ns - 1) / period_ns;
  return static_cast<std::int32_t>(std::min<std::int64_t>(age, kLongest));
}

void Executor::Enter(ExecutorState state) noexcept {
  // Here nobody waits for the end of the node to look where the robot is.
  const bool broken_off = state == ExecutorState::kStopping || state == ExecutorState::kFault ||
                          state == ExecutorState::kDisarmed;
  if (broken_off && !(FarFromEnd() <= graph_.beginning_within_rad)) TakeCycleBack();
  // The feed-forward at the end of a motion carries the robot in its last pose, so a hold keeps it.
  // A feed-forward from the middle of a motion would not fit the pose that is held.
  const bool moving = state_ == ExecutorState::kMovingToStart || state_ == ExecutorState::kRunning;
  if (state == ExecutorState::kSettling) {
    keep_torque_ = true;
  } else if (moving || state == ExecutorState::kMovingToStart || state == ExecutorState::kArming) {
    keep_torque_ = false;
  }
  if (state == ExecutorState::kRunning || state == ExecutorState::kArming) primitive_time_s_ = 0;
  starts_ = state == ExecutorState::kRunning;
  if (state == ExecutorState::kDisarmed) {
    lowering_ = false;
    lowering_ticks_ = 0;
    React(Reaction::kIgnore);
    for (Joint& joint : joints()) {
      if (!joint.was_enabled) continue;
      joint.left_rad = joint.commanded.position_rad;
      joint.was_left = true;
      joint.was_enabled = false;
    }
  }
  if (state == ExecutorState::kArming) {
    sensor_watch_.Trust();
    for (Joint& joint : joints()) {
      joint.was_off = joint.was_enabled = false;
      joint.replies.ForgetSequenceErrors();
    }
  }
  gets_up_ = false;
  state_ = state;
  ticks_in_state_ = 0;
}

void Executor::Send(int elapsed, TickOutput& output) noexcept {
  const bool armed = state_ != ExecutorState::kDisarmed && reaction_ != Reaction::kDisable;
  const bool damped = reaction_ == Reaction::kDamp;
  float lowered = 1;  // share of stiffness and feed-forward that is left
  if (lowering_) {
    lowering_ticks_ += elapsed;
    lowered = std::max(0.0F, 1 - static_cast<float>(lowering_ticks_) * config_.period_s / kLower_s);
  }
  // Whether gains and feed-forward are others than those of the configuration and the plan.
  // A fault of a joint may change the reaction for the next tick, and not for the joints after it.
  const bool folds_softly = reaction_ == Reaction::kCollapse;
  const bool changed = lowering_ || damped || !armed || folds_softly;
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
    if (changed) {
      if (folds_softly) {
        setpoint.kp_nm_per_rad *= config_.collapse.stiffness;
      } else if (damped || !armed) {
        setpoint.velocity_rad_s = 0;
        setpoint.torque_nm = 0;
        setpoint.kp_nm_per_rad = 0;
        setpoint.kd_nm_s_per_rad = damped ? config.damping_nm_s_per_rad : 0.0F;
      }
      setpoint.kp_nm_per_rad *= lowered;
      setpoint.torque_nm *= lowered;
    }
    FrameBatch& batch = output.frames[index];
    batch.Clear();
    const Status status = joint.drive->Encode(request, setpoint, batch);
    if (limited.non_finite || status != Status::kOk)
      Latch(Fault::kNonFinite, i, DetailNumber::Real(record.planned.position_rad), {});

    const DriveSetpoint encoded = joint.drive->encoded_setpoint();
    if (state_ == ExecutorState::kArming && joint.drive_state != DriveState::kEnabled &&
        IsFinite(encoded.position_rad)) {
      // While arming, a drive may be sent the position of a moment ago. It will be held there.
      joint.commanded.position_rad = std::clamp(encoded.position_rad, joint.limits.position_min_rad,
                                                joint.limits.position_max_rad);
    }
    record.limited = joint.commanded;
    record.encoded = {encoded.position_rad, encoded.velocity_rad_s, encoded.torque_nm};
    record.measured = {joint.measured.position_rad, joint.measured.velocity_rad_s,
                       joint.measured.has_torque ? joint.measured.torque_nm : kNotMeasured};
    record.temperature_c = joint.measured.temperature_c;
    record.reply_age_ticks = joint.replies.age_ticks();
    record.drive_state = joint.drive_state;
    record.reply_status = joint.replies.status();
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
  switch (state_) {
    case ExecutorState::kArming: {
      int waiting = -1;
      for (int i = joint_count_ - 1; i >= 0; --i) {
        // A drive that has been let go may say that it is enabled until it says something new. So
        // only a drive that was seen off has been enabled by this arming.
        Joint& joint = joints_[static_cast<std::size_t>(i)];
        joint.was_off = joint.was_off || joint.drive_state == DriveState::kDisabled ||
                        joint.drive_state == DriveState::kEnabling;
        if (joint.drive_state != DriveState::kEnabled || !joint.was_off) waiting = i;
      }
      if (waiting < 0) {
        Enter(ExecutorState::kHolding);
      } else if (ticks_in_state_ >= config_.arming_ticks_max) {
        Latch(Fault::kArmingTimeout, waiting, DetailNumber::Integer(ticks_in_state_),
              DetailNumber::Integer(config_.arming_ticks_max));
      }
      break;
    }
    case ExecutorState::kMovingToStart:
      if (ticks_in_state_ < move_ticks_ || !reached()) break;
      if (gets_up_ && !finish_) {
        BeginAnew();
      } else {
        Enter(ExecutorState::kHolding);
      }
      break;
    case ExecutorState::kRunning:
      if (ticks_in_state_ >= run_ticks_ && reached()) {
        CountCycle();
        Enter(ExecutorState::kSettling);
      }
      break;
    case ExecutorState::kSettling:
      EndNode();
      break;
    case ExecutorState::kStopping:
      if (AtRest()) Enter(ExecutorState::kHolding);
      break;
    case ExecutorState::kFault:
      // A motion that was rolled out is held like one that has settled.
      if (reaction_ == Reaction::kRollOut && ticks_in_state_ >= run_ticks_ && reached()) {
        CountCycle();
        keep_torque_ = true;
        React(Reaction::kHold);
      }
      break;
    case ExecutorState::kDisarmed:
    case ExecutorState::kHolding:
      break;
  }
}

}  // namespace tumbler
