#include "runtime/executor/executor.h"

#include <algorithm>
#include <limits>

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
                                         PitchEstimate* pitch) noexcept {
  if (phase_ != Phase::kDisarmed) return Status::kWouldBlock;
  const auto count = static_cast<int>(drives.size());
  if (!IsPlayable(config, graph, primitives, count) ||
      std::ranges::find(drives, nullptr) != drives.end() ||
      (pitch != nullptr && !pitch->IsValid())) {
    return Status::kInvalidArgument;
  }

  config_ = config;
  sequencer_.Configure(graph, {config.cycles, config.branch, config.get_ups_max});
  primitives_ = primitives;
  joint_count_ = count;
  time_per_tick_s_ = config.period_s * config.speed;
  primitive_time_s_ = 0;
  hold_ = {};
  for (int i = 0; i < count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    joints_[index] = Joint{};
    joints_[index].drive = drives[index];
    joints_[index].replies = ReplyWatch(drives[index]->reply_rhythm());
  }
  pitch_ = pitch;
  if (pitch != nullptr) pitch->Start(config.period_s);
  feedback_ = FeedbackController(config.speed);
  SetNode(graph.start);
  return Status::kOk;
}

void Executor::SetNode(int node) noexcept {
  const SequenceGraph<float>& graph = sequencer_.graph();
  sequencer_.EnterNode(node);
  primitive_ = &primitives_[static_cast<std::size_t>(graph.node(node).primitive)];
  run_ticks_ = CeilTicks(primitive_->duration_s / time_per_tick_s_);
  for (int i = 0; i < joint_count_; ++i) {
    Joint& joint = joints_[static_cast<std::size_t>(i)];
    const auto role = static_cast<std::size_t>(graph.RoleOf(node, i));
    joint.motion = &primitive_->joints[role];
    joint.limits = MakeSafetyLimits(joint.motion->limits, config_.period_s, config_.torque_rise_s);
    joint.acceleration_max_rad_s2 = joint.motion->limits.acceleration_max_rad_s2;
    const JointMotion<float>& first = *joints_[0].motion;
    joint.shares_position_knots = joint.motion->position.HasKnotsOf(first.position);
    joint.shares_torque_knots = joint.motion->torque.HasKnotsOf(first.torque);
  }
  if (pitch_ != nullptr)
    feedback_.SetMotion(*primitive_, graph, node, pitch_->chain(), joint_count_);
}

bool Executor::AtRest() const noexcept {
  for (int i = 0; i < joint_count_; ++i) {
    if (joints_[static_cast<std::size_t>(i)].commanded.velocity_rad_s != 0) return false;
  }
  return true;
}

// Of the robot from where its node leaves it; 0 where nothing tells.
float Executor::FarFromEnd() const noexcept {
  if (!TellsFalls() || pitch_->status() != SensorStatus::kOk) return 0;
  return sequencer_.FarFromEnd(pitch_->pitch_rad());
}

// At the end of a node: the next one begins, or the sequence ends. The edge is chosen anew in every
// tick: until it is taken, the operator may still decide.
void Executor::EndNode() noexcept {
  const int edge = sequencer_.NextEdge(IsGoingHome(phase_));
  const float settle_s = edge < 0 ? primitive_->settle_s : graph().edge(edge).settle_s;
  const std::int64_t settle_ticks = CeilTicks(settle_s / config_.period_s);
  if (ticks_in_phase_ < settle_ticks || !AtRest()) return;
  if (TellsFalls()) {
    if (pitch_->status() != SensorStatus::kOk) {
      if (AnswerUnclear(ticks_in_phase_ - settle_ticks)) return;
      // Negated, so that a pitch that is not a number is a fall, too.
    } else if (!(FarFromEnd() <= graph().beginning_within_rad) && AnswerFall()) {
      return;
    }
  }
  sequencer_.ConfirmCycle();
  if (edge < 0) {
    Enter(Phase::kHolding);  // It keeps the feed-forward.
  } else {
    FollowEdge(edge);
  }
}

void Executor::FollowEdge(int edge) noexcept {
  const int node = sequencer_.Follow(edge);
  const Primitive<float>& next =
      primitives_[static_cast<std::size_t>(graph().node(node).primitive)];
  const float tolerance = next.entry_tolerance_rad;
  for (int i = 0; i < joint_count_; ++i) {
    const Joint& joint = joints_[static_cast<std::size_t>(i)];
    const auto role = static_cast<std::size_t>(graph().RoleOf(node, i));
    const float start = next.joints[role].position.control_points()[0];
    // A correction is meant to be there.
    const float error =
        Magnitude(joint.measured.position_rad - feedback_.correction_rad(i) - start);
    // Negated, so that an error that is not a number is a fault too. The robot then still is at the
    // end of its node.
    if (!(error <= tolerance)) {
      return Latch(Fault::kEntryMissed, i, DetailNumber::Real(error),
                   DetailNumber::Real(tolerance));
    }
  }
  Play(node, IsGoingHome(phase_) ? Phase::kRunningHome : Phase::kRunning);
}

// Gets up, or ends in a fault. Returns whether either is done: the fault may be one to ignore.
bool Executor::AnswerFall() noexcept {
  const float fall_rad = FarFromEnd();
  // After a fault the robot is on its way to where it can stay, and whoever wants the run to end
  // does not expect that it begins anew.
  if (sequencer_.MayGetUp() && earlier_faults_ == 0 &&
      CheckFirstLimits().refusal == Refusal::kNone) {
    sequencer_.GetUp();
    StartMove(Phase::kGettingUp);
    move_.fall_rad = fall_rad;
    return true;
  }
  LatchFall(fall_rad);
  return IsFault(phase_);
}

// The sensor is not ok, and nothing else tells whether the robot has fallen. A robot on its side
// shows as a tilt out of its plane, and does not get up. Returns whether the node's end has to
// wait, or has ended in a fault: that may be one to ignore.
bool Executor::AnswerUnclear(std::int64_t waited_ticks) noexcept {
  const SensorStatus status = pitch_->status();
  const float tilt_rad = pitch_->tilt_rad();
  const bool may_clear = status < SensorStatus::kFrozen;
  const bool may_come_to_rest = tilt_rad > 0 && !pitch_->tilt_rests();
  if ((may_clear || may_come_to_rest) && waited_ticks < CeilTicks(kLieStill_s / config_.period_s))
    return true;
  const std::uint32_t known = 1U << static_cast<unsigned>(Fault::kPitchUnknown);
  if (tilt_rad > 0) {
    sequencer_.TakeCycleBack();
    LatchFall(tilt_rad);
  } else if ((earlier_faults_ & known) == 0) {  // On the way home it has been answered.
    Latch(Fault::kPitchUnknown, -1, DetailNumber::Integer(static_cast<std::int64_t>(status)), {});
  }
  return IsFault(phase_);
}

void Executor::LatchFall(float fall_rad) noexcept {
  Latch(Fault::kFallen, -1, DetailNumber::Real(fall_rad),
        DetailNumber::Real(graph().beginning_within_rad));
}

// Goes on with the beginning in whose pose the robot lies, its joints at the start.
void Executor::BeginAnew() noexcept {
  int node = graph().start;
  if (CheckBeginning(node).refusal == Refusal::kNone) {
    Play(node, Phase::kRunning);
  } else if (ticks_in_phase_ >= move_.ticks + CeilTicks(kLieStill_s / config_.period_s)) {
    LatchFall(move_.fall_rad);
  }
}

void Executor::Enter(Phase phase) noexcept {
  phase_ = phase;
  ticks_in_phase_ = 0;
}

void Executor::BeginArming() noexcept {
  hold_.keeps_torque = false;
  primitive_time_s_ = 0;
  if (pitch_ != nullptr) pitch_->Trust();
  for (Joint& joint : joints()) {
    joint.was_off = joint.was_enabled = false;
    joint.replies.ForgetSequenceErrors();
  }
  Enter(Phase::kArming);
}

// To where the sequence begins.
void Executor::StartMove(Phase phase) noexcept {
  SetNode(graph().start);
  hold_.keeps_torque = false;
  move_ = {MoveTicks(), 0};
  Enter(phase);
}

void Executor::Play(int node, Phase phase) noexcept {
  SetNode(node);
  primitive_time_s_ = 0;
  feedback_.Begin();
  Enter(phase);
}

// The feed-forward at the end of a motion carries the robot in its last pose, so a hold keeps it. A
// feed-forward from the middle of a motion would not fit the pose that is held.
void Executor::Settle(Phase phase) noexcept {
  hold_.keeps_torque = true;
  Enter(phase);
}

// Of a motion, and of a cycle: nobody waits for the end of the node to look where the robot is.
void Executor::BreakOff() noexcept {
  if (!(FarFromEnd() <= graph().beginning_within_rad)) sequencer_.TakeCycleBack();
  if (IsOnTheWay(phase_)) hold_.keeps_torque = false;
}

// A hold, or the answer to a fault, goes on while the robot is lowered, and so does its time.
void Executor::Lower() noexcept {
  if (IsLowering(phase_)) return;
  lowering_ = {};
  phase_ = IsFault(phase_) ? Phase::kLoweringInFault : Phase::kLowering;
}

void Executor::Disarm() noexcept {
  BreakOff();
  answer_ = {};
  for (Joint& joint : joints()) {
    if (!joint.was_enabled) continue;
    joint.left_rad = joint.commanded.position_rad;
    joint.was_left = true;
    joint.was_enabled = false;
  }
  Enter(Phase::kDisarmed);
}

// With a pitch.
inline void Executor::Correct(int elapsed, TickRecord& record) noexcept {
  const bool moving = IsRunning(phase_) || answer_.reaction == Reaction::kRollOut;
  // A hold after a motion keeps its feedback as it keeps its feed-forward.
  const bool holds = feedback_.acts() && hold_.keeps_torque &&
                     answer_.reaction <= Reaction::kHold && !IsLowering(phase_) &&
                     phase_ != Phase::kDisarmed;
  if (moving || holds) {
    const float time_s = static_cast<float>(elapsed) * config_.period_s;
    feedback_.Correct(*pitch_, joints(), moving, primitive_time_s_, time_s, record);
  } else {
    feedback_.Rest(joint_count_, record);
  }
  SensorRecord& sensor = record.sensor;
  sensor.pitch_rad = pitch_->pitch_rad();
  sensor.rate_rad_s = pitch_->rate_rad_s();
  sensor.error_rad = feedback_.error_rad();
  sensor.rate_error_rad_s = feedback_.rate_error_rad_s();
  sensor.share = feedback_.share();
  sensor.age_ticks = pitch_->age_ticks();
  sensor.status = pitch_->status();
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

  ticks_in_phase_ += advance;

  TakeReplies(input, passed);
  if (phase_ != Phase::kDisarmed) DetectFaults(input, elapsed);
  Obey(input);

  TickRecord& record = output.record;
  const int node_played = sequencer_.node();
  Plan(advance, record);
  if (pitch_ != nullptr) Correct(advance, record);
  record.state = state();
  Send(advance, output);
  Advance(record);

  record.tick = tick_;
  record.primitive_time_s = primitive_time_s_;
  record.faults = faults_ | earlier_faults_;
  record.reaction = answer_.reaction;
  record.command = input.command;
  record.joint_count = static_cast<std::uint8_t>(joint_count_);
  record.node = static_cast<std::int8_t>(node_played);
  record.cycles = sequencer_.cycles_done();
  record.first_fault = first_fault_;
  record.refusal = refusal_;
}

void Executor::TakeReplies(const TickInput& input, int elapsed) noexcept {
  // Drives mostly answer in their order. So the drive after the one that took a frame is asked
  // first.
  int first = 0;
  foreign_joint_ = -1;
  for (const ReceivedFrame& received : input.received) {
    if (pitch_ != nullptr && pitch_->Owns(received.frame) &&
        pitch_->Take(received.frame, AgeOf(received))) {
      continue;
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
  if (pitch_ != nullptr) pitch_->EndTick(elapsed, joints());
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

void Executor::Send(int elapsed, TickOutput& output) noexcept {
  const bool armed = phase_ != Phase::kDisarmed && answer_.reaction != Reaction::kDisable;
  const bool damped = answer_.reaction == Reaction::kDamp;
  const bool lowers = IsLowering(phase_);
  float lowered = 1;  // share of stiffness and feed-forward that is left
  if (lowers) {
    lowering_.ticks += elapsed;
    lowered = std::max(0.0F, 1 - static_cast<float>(lowering_.ticks) * config_.period_s / kLower_s);
  }
  // Whether gains and feed-forward are others than those of the configuration and the plan.
  // A fault of a joint may change the reaction for the next tick, and not for the joints after it.
  const bool folds_softly = answer_.reaction == Reaction::kCollapse;
  const bool changed = lowers || damped || !armed || folds_softly;
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
    if (phase_ == Phase::kArming && joint.drive_state != DriveState::kEnabled &&
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
  switch (phase_) {
    case Phase::kArming: {
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
        Enter(Phase::kHolding);
      } else if (ticks_in_phase_ >= config_.arming_ticks_max) {
        Latch(Fault::kArmingTimeout, waiting, DetailNumber::Integer(ticks_in_phase_),
              DetailNumber::Integer(config_.arming_ticks_max));
      }
      break;
    }
    case Phase::kMovingToStart:
    case Phase::kGettingUp:
      if (ticks_in_phase_ < move_.ticks || !reached()) break;
      if (phase_ == Phase::kGettingUp && !sequencer_.finishes()) {
        BeginAnew();
      } else {
        Enter(Phase::kHolding);
      }
      break;
    case Phase::kRunning:
    case Phase::kRunningHome:
      if (ticks_in_phase_ >= run_ticks_ && reached()) {
        sequencer_.EndMotion();
        Settle(IsGoingHome(phase_) ? Phase::kSettlingHome : Phase::kSettling);
      }
      break;
    case Phase::kSettling:
    case Phase::kSettlingHome:
      EndNode();
      break;
    case Phase::kStopping:
      if (AtRest()) Enter(Phase::kHolding);
      break;
    case Phase::kFault:
    case Phase::kLoweringInFault:
      // A motion that was rolled out is held like one that has settled.
      if (answer_.reaction == Reaction::kRollOut && ticks_in_phase_ >= run_ticks_ && reached()) {
        sequencer_.EndMotion();
        hold_.keeps_torque = true;
        answer_.reaction = Reaction::kHold;
      }
      break;
    case Phase::kDisarmed:
    case Phase::kHolding:
    case Phase::kLowering:
      break;
  }
}

}  // namespace tumbler
