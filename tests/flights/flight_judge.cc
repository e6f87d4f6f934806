#include "tests/flights/flight_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace tumbler::testing {
namespace {

int StrengthOf(Reaction reaction) {
  for (std::size_t i = 0; i < kReactionTable.size(); ++i) {
    if (kReactionTable[i].reaction == reaction) return static_cast<int>(i);
  }
  return -1;
}

/// The least that an entry of the table stands for.
int LeastStrengthOf(Reaction reaction) {
  return StrengthOf(reaction == Reaction::kAbort ? Reaction::kHold : reaction);
}

/// The place of a transition in the table; -1: there is none.
int TransitionOf(ExecutorState from, ExecutorState to) {
  for (std::size_t i = 0; i < kTransitionTable.size(); ++i) {
    if (kTransitionTable[i].from == from && kTransitionTable[i].to == to)
      return static_cast<int>(i);
  }
  return -1;
}

Fault FaultOf(Status status) {
  switch (status) {
    case Status::kBusOff:
      return Fault::kBusOff;
    case Status::kLinkDown:
      return Fault::kInterfaceDown;
    case Status::kLinkGone:
      return Fault::kInterfaceGone;
    case Status::kWouldBlock:
      return Fault::kTransmitQueueFull;
    default:
      return Fault::kLinkFailed;
  }
}

template <typename Array>
void AddTo(Array& sum, const Array& more) {
  for (std::size_t i = 0; i < sum.size(); ++i) {
    if constexpr (std::is_arithmetic_v<typename Array::value_type>) {
      sum[i] += more[i];
    } else {
      AddTo(sum[i], more[i]);
    }
  }
}

}  // namespace

const std::array<std::string_view, kInvariantCount> kInvariantNames = {
    "written",     "finite",      "forbidden",  "limits",     "steps",      "brake",
    "wire",        "gains",       "torque-off", "transition", "obeyed",     "stops-in-time",
    "latched",     "reaction",    "detected",   "stale",      "arming",     "fresh",
    "arming-pose", "pause-stiff", "pause-snap", "time",       "correction", "replay"};

void FlightCounts::Add(const FlightCounts& other) {
  flights += other.flights;
  ticks += other.ticks;
  frames += other.frames;
  runs += other.runs;
  events += other.events;
  AddTo(first_faults, other.first_faults);
  AddTo(transitions, other.transitions);
  AddTo(disarmed_from, other.disarmed_from);
  AddTo(fault_from, other.fault_from);
  AddTo(latched_in, other.latched_in);
  AddTo(reactions, other.reactions);
  AddTo(abort_reactions, other.abort_reactions);
  AddTo(refusals, other.refusals);
  AddTo(sensor_ticks, other.sensor_ticks);
  AddTo(state_ticks, other.state_ticks);
  AddTo(pauses, other.pauses);
  AddTo(let_go, other.let_go);
  stiff_after_pause_ticks += other.stiff_after_pause_ticks;
  snap_max_rad = std::max(snap_max_rad, other.snap_max_rad);
  hash ^= other.hash;
}

FlightJudge::FlightJudge(const FlightSetting& setting, std::uint32_t ignored)
    : setting_(setting), ignored_(ignored) {
  const ExecutorConfig& config = setting.executor;
  double stop_s = 0;
  for (int node = 0; node < setting.graph.node_count; ++node) {
    const Primitive<float>& primitive =
        setting.primitives[static_cast<std::size_t>(setting.graph.node(node).primitive)];
    following_max_rad_ = std::max(following_max_rad_, primitive.following_tolerance_rad);
    std::array<Bounds, kMaxJoints> of_node;
    for (const JointFeedback<float>& joint : primitive.feedback.joints) {
      correction_max_rad_ = std::max(correction_max_rad_, joint.correction_max_rad);
      correction_rate_max_rad_s_ =
          std::max(correction_rate_max_rad_s_, joint.correction_rate_max_rad_s);
    }
    for (int i = 0; i < primitive.joint_count; ++i) {
      Bounds& bounds = of_node[static_cast<std::size_t>(i)];
      const auto role = static_cast<std::size_t>(setting.graph.RoleOf(node, i));
      bounds.limits = primitive.joints[role].limits;
      bounds.position_step_rad = bounds.limits.velocity_max_rad_s * config.period_s * 1.001F;
      bounds.torque_step_nm =
          bounds.limits.torque_max_nm * (config.period_s / config.torque_rise_s);
      stop_s = std::max(stop_s, Wide(bounds.limits.velocity_max_rad_s) /
                                    Wide(bounds.limits.acceleration_max_rad_s2));
    }
    bounds_.push_back(of_node);
  }
  // A node may have been left with the velocity of another.
  stop_ticks_max_ = static_cast<std::int64_t>(stop_s / Wide(config.period_s) * 100) + 3;
  double unattended_s = 0.2;
  for (const DriveEntry& entry : setting.drives.drives) {
    wires_.emplace_back(entry.config);
    if (entry.watchdog_s > 0) unattended_s = std::min(unattended_s, entry.watchdog_s);
  }
  unattended_ns_ = static_cast<std::int64_t>(unattended_s * 1e9);
}

bool FlightJudge::Take(const WorldTick& tick) {
  tick_ = tick;
  now_ = &tick.output->record;
  elapsed_ = has_last_ ? tick.input->tick - last_.tick : 1;
  advance_ = static_cast<int>(std::clamp<std::int64_t>(
      elapsed_, 1, 1 + static_cast<std::int64_t>(setting_.executor.late_ticks_max)));
  lowered_before_ = lowering_;
  if (now_->command == OperatorCommand::kLower && now_->refusal.refusal == Refusal::kNone &&
      !lowering_) {
    lowering_ = true;
    kp_left_.fill(1e9);
  }
  if (now_->state == ExecutorState::kDisarmed) lowering_ = false;
  if (tick.before == ExecutorState::kDisarmed) was_enabled_.fill(false);

  JudgeReplies();
  JudgeStates();
  JudgeFaults();
  if (tick.before != ExecutorState::kDisarmed) JudgeDetection();
  if (now_->state == ExecutorState::kArming && tick.before != ExecutorState::kArming) JudgeArming();
  JudgePause();
  for (std::size_t i = 0; i < wires_.size(); ++i) JudgeJoint(i);
  JudgeTime();
  Count();
  last_ = *now_;
  has_last_ = true;
  return violations_.empty();
}

void FlightJudge::JudgeReplies() {
  for (const ReceivedFrame& received : tick_.input->received) {
    if (received.frame.id == setting_.sensor_ids.rate_id && !received.frame.extended)
      sensor_stamp_ns_ = std::max(sensor_stamp_ns_, received.time_ns);
    for (std::size_t i = 0; i < wires_.size(); ++i) {
      if (wires_[i].IsPosition(received.frame))
        stamp_ns_[i] = std::max(stamp_ns_[i], received.time_ns);
    }
  }
  // A tick number that has not grown tells nobody how much time has passed.
  if (elapsed_ < 1) {
    const std::int64_t untold_ns = std::max<std::int64_t>(tick_.gap_ns - setting_.period_ns, 0);
    const auto forgive = [&](std::int64_t& stamp_ns) {
      stamp_ns = std::min(stamp_ns + untold_ns, tick_.now_ns);
    };
    forgive(sensor_stamp_ns_);
    for (std::int64_t& stamp_ns : stamp_ns_) forgive(stamp_ns);
  }
  // While no tick asked it, a drive owed nothing.
  for (std::size_t i = 0; i < wires_.size(); ++i) {
    const bool fresh = tick_.now_ns - stamp_ns_[i] <= setting_.period_ns;
    silent_ticks_[i] = fresh ? 0 : silent_ticks_[i] + 1;
  }
}

void FlightJudge::JudgeStates() {
  const ExecutorState before = tick_.before, now = now_->state, after = tick_.after;
  const OperatorCommand command = now_->command;
  const bool new_faults = now_->faults != last_.faults;
  if (before == ExecutorState::kDisarmed) went_home_ = false;
  if (command == OperatorCommand::kGoHome && now_->refusal.refusal == Refusal::kNone)
    went_home_ = true;
  const auto follows = [&](ExecutorState from, ExecutorState to) {
    if (from == to) return true;
    if (to == ExecutorState::kDisarmed) return command == OperatorCommand::kDisarm;
    // On the way home faults may come again that are latched already.
    if (to == ExecutorState::kFault)
      return from != ExecutorState::kDisarmed && (new_faults || went_home_);
    return TransitionOf(from, to) >= 0;
  };
  // A fault may come in the tick of a command that leads on from it.
  const bool direct = follows(before, now);
  const bool by_fault = follows(before, ExecutorState::kFault) &&
                        (now == ExecutorState::kDisarmed || now == ExecutorState::kSettling) &&
                        follows(ExecutorState::kFault, now);
  if (!(direct || by_fault)) Fail(Invariant::kTransition, "no transition leads there at once");
  if (!follows(now, after)) Fail(Invariant::kTransition, "no transition leads there in the end");
  const auto needs = [&](ExecutorState from, ExecutorState to, OperatorCommand cause) {
    if (now == to && before == from && command != cause)
      Fail(Invariant::kTransition, "a transition without its command");
  };
  needs(ExecutorState::kDisarmed, ExecutorState::kArming, OperatorCommand::kArm);
  needs(ExecutorState::kHolding, ExecutorState::kMovingToStart, OperatorCommand::kMoveToStart);
  needs(ExecutorState::kHolding, ExecutorState::kRunning, OperatorCommand::kRun);
  needs(ExecutorState::kFault, ExecutorState::kSettling, OperatorCommand::kGoHome);

  if (now == ExecutorState::kRunning && command == OperatorCommand::kRun) get_ups_ = 0;
  const bool gets_up = now == ExecutorState::kSettling && after == ExecutorState::kMovingToStart;
  if (gets_up && ++get_ups_ > setting_.executor.get_ups_max)
    Fail(Invariant::kTransition, "it gets up for the {}th time", get_ups_);
  if (now == ExecutorState::kArming && after == ExecutorState::kHolding) {
    for (std::size_t i = 0; i < wires_.size(); ++i) {
      if (now_->joints[i].drive_state != DriveState::kEnabled)
        Fail(Invariant::kTransition, "armed, and drive {} is not enabled", i);
    }
  }
  if (tick_.disarms && now != ExecutorState::kDisarmed)
    Fail(Invariant::kObeyed, "a request for torque off is not obeyed");
  if (command == OperatorCommand::kDisarm && now != ExecutorState::kDisarmed)
    Fail(Invariant::kObeyed, "disarm is not obeyed");
  const bool moves = before == ExecutorState::kMovingToStart || before == ExecutorState::kRunning ||
                     before == ExecutorState::kSettling;
  if (command == OperatorCommand::kStop && moves && now != ExecutorState::kStopping &&
      now != ExecutorState::kFault) {
    Fail(Invariant::kObeyed, "stop is not obeyed");
  }
  if (now_->refusal.refusal != Refusal::kNone && now != before &&
      !(now == ExecutorState::kFault && (new_faults || went_home_))) {
    Fail(Invariant::kObeyed, "a command is refused and changes the state");
  }
  stopping_ticks_ = now == ExecutorState::kStopping ? stopping_ticks_ + 1 : 0;
  if (stopping_ticks_ > stop_ticks_max_)
    Fail(Invariant::kStopsInTime, "stopping for {} ticks", stopping_ticks_);
}

void FlightJudge::JudgeFaults() {
  const std::uint32_t before = last_.faults, now = now_->faults;
  const FaultDetail& first = now_->first_fault;
  const bool cleared =
      now_->command == OperatorCommand::kClearFaults && tick_.before == ExecutorState::kDisarmed;
  if (cleared ? now != 0 : (before & ~now) != 0)
    Fail(Invariant::kLatched, "faults {:x} became {:x}", before, now);
  if (tick_.before == ExecutorState::kDisarmed && (now & ~before) != 0)
    Fail(Invariant::kLatched, "faults {:x} became {:x} while disarmed", before, now);
  if ((now == 0) != (first.fault == Fault::kNone) || (now & 1U) != 0)
    Fail(Invariant::kLatched, "faults {:x}, and the first is {}", now, ToString(first.fault));
  const bool in_fault =
      now_->state == ExecutorState::kFault || tick_.after == ExecutorState::kFault;
  if (in_fault && now == 0) Fail(Invariant::kLatched, "in fault without a fault");
  if (before != 0 && !cleared) {
    const FaultDetail& old = last_.first_fault;
    if (first.fault != old.fault || first.tick != old.tick || first.state != old.state ||
        first.reaction != old.reaction || first.joint != old.joint) {
      Fail(Invariant::kLatched, "the first fault has changed");
    }
  } else if (now != 0) {
    const bool here = first.state == tick_.before || first.state == now_->state;
    if ((now & BitOf(first.fault)) == 0 || first.tick != tick_.input->tick || !here)
      Fail(Invariant::kLatched, "the first fault {} is not of now", ToString(first.fault));
    const Reaction asked = setting_.executor.reactions(first.fault, first.state);
    const bool aborts = asked == Reaction::kAbort;
    const bool falls = first.fault == Fault::kFallen && asked == Reaction::kIgnore;
    const bool fits = aborts
                          ? MayAbortBy(first.fault, first.reaction)
                          : (falls ? first.reaction == Reaction::kHold : first.reaction == asked);
    if (!fits) {
      Fail(Invariant::kReaction, "{} in {} is answered by {}", ToString(first.fault),
           ToString(first.state), ToString(first.reaction));
    }
  }
  // What is new.
  std::uint32_t left = now & ~before;
  const bool acts = tick_.after == ExecutorState::kFault;
  while (left != 0) {
    const int number = std::countr_zero(left);
    left &= left - 1;
    const auto fault = static_cast<Fault>(number);
    ++counts_.latched_in[static_cast<std::size_t>(number)][static_cast<std::size_t>(tick_.before)];
    if (!acts) continue;
    int least = 100;
    for (const ExecutorState state : {tick_.before, now_->state, ExecutorState::kFault}) {
      const Reaction asked = setting_.executor.reactions(fault, state);
      if (asked != Reaction::kIgnore) least = std::min(least, LeastStrengthOf(asked));
      // From where a robot lies that could not get up nothing goes on.
      if (fault == Fault::kFallen) least = std::min(least, StrengthOf(Reaction::kHold));
    }
    if (least < 100 && StrengthOf(now_->reaction) < least)
      Fail(Invariant::kReaction, "{} is answered by {}", ToString(fault), ToString(now_->reaction));
  }
  if (now_->state == ExecutorState::kFault && tick_.before == ExecutorState::kFault &&
      last_.state == ExecutorState::kFault &&
      StrengthOf(now_->reaction) < StrengthOf(last_.reaction) &&
      last_.reaction != Reaction::kRollOut) {
    Fail(Invariant::kReaction, "the reaction {} became weaker", ToString(last_.reaction));
  }
}

// Whether the table of aborts of the node that was played says so of the time in it.
bool FlightJudge::MayAbortBy(Fault fault, Reaction reaction) const {
  const SequenceNode& node = setting_.graph.node(now_->node);
  const Primitive<float>& primitive = setting_.primitives[static_cast<std::size_t>(node.primitive)];
  if (!primitive.aborts.present() || setting_.executor.speed != 1)
    return reaction == (fault == Fault::kOperatorStop ? Reaction::kHold : Reaction::kDamp);
  // It was found before this tick's plan was made, or after; and a motion may have just begun.
  for (const float time_s : {last_.primitive_time_s, now_->primitive_time_s, 0.0F}) {
    const AbortSpan<float>* span = primitive.aborts.spans().data();
    while (span->until_s <= time_s && span != &primitive.aborts.spans().back()) ++span;
    const double late_s = fault == Fault::kLateTick
                              ? static_cast<double>(elapsed_ - 1) * Wide(setting_.executor.period_s)
                              : 0;
    const double slack_s = Wide(setting_.executor.period_s);
    switch (span->way) {
      case AbortWay::kCatch:
        if (reaction == Reaction::kHold) return true;
        break;
      case AbortWay::kFold:
        if (reaction == Reaction::kFold) return true;
        break;
      case AbortWay::kRollOut:
        if (reaction == Reaction::kRollOut && late_s <= Wide(span->late_max_s) + slack_s)
          return true;
        if (reaction == Reaction::kDamp && late_s > Wide(span->late_max_s) - slack_s) return true;
        break;
      case AbortWay::kDamp:
        if (reaction == Reaction::kDamp) return true;
        break;
    }
  }
  return false;
}

void FlightJudge::NeedFault(Fault fault, const char* why, Invariant invariant) {
  if ((now_->faults & BitOf(fault)) != 0) return;
  // A fault that came before in this tick may have changed the state.
  const FaultTable& table = setting_.executor.reactions;
  if (table(fault, tick_.before) == Reaction::kIgnore) return;
  const bool may_have_changed = now_->faults != last_.faults || went_home_;
  if (may_have_changed && table(fault, ExecutorState::kFault) == Reaction::kIgnore) return;
  Fail(invariant, "{} is not found: {}", ToString(fault), why);
}

// Whether drives need not be enabled any more, because of this tick or the one before. A disarm
// leaves nothing of the reaction of a fault that came in its tick.
bool FlightJudge::LetsGo() const {
  if (last_.reaction == Reaction::kDisable || now_->reaction == Reaction::kDisable) return true;
  if (now_->state != ExecutorState::kDisarmed) return false;
  for (std::uint32_t left = now_->faults & ~last_.faults; left != 0; left &= left - 1) {
    const auto fault = static_cast<Fault>(std::countr_zero(left));
    for (const ExecutorState state : {tick_.before, ExecutorState::kFault})
      if (setting_.executor.reactions(fault, state) == Reaction::kDisable) return true;
  }
  return false;
}

void FlightJudge::JudgeDetection() {
  const TickInput& input = *tick_.input;
  if (elapsed_ > setting_.executor.pause_ticks_max) {
    NeedFault(Fault::kPaused, "the drives may have let go");
  } else if (elapsed_ < 1 ||
             elapsed_ > 1 + static_cast<std::int64_t>(setting_.executor.late_ticks_max)) {
    NeedFault(Fault::kLateTick, "periods were missed");
  }
  if (input.send_status != Status::kOk) NeedFault(FaultOf(input.send_status), "sending failed");
  if (input.receive_status != Status::kOk && input.receive_status != Status::kWouldBlock)
    NeedFault(FaultOf(input.receive_status), "receiving failed");
  if (input.controller == CanControllerState::kBusOff)
    NeedFault(Fault::kBusOff, "the controller is off");
  if (input.controller == CanControllerState::kErrorPassive)
    NeedFault(Fault::kErrorPassive, "the controller is passive");
  if (tick_.foreign) NeedFault(Fault::kForeignCommand, "somebody else has sent a command");
  if (setting_.has_sensor && now_->sensor.status != SensorStatus::kOk)
    NeedFault(Fault::kSensorLost, "the sensor is not believed");
  const std::int64_t report = (tick_.now_ns - sensor_stamp_ns_) / setting_.period_ns;
  if (setting_.has_sensor && now_->sensor.status == SensorStatus::kOk &&
      report > setting_.sensor.age_ticks_max + 1) {
    Fail(Invariant::kStale, "a sensor is believed whose last report is {} ticks old", report);
  }
  const bool follows = !IsLoose(tick_.before) && !lowered_before_ &&
                       (tick_.before != ExecutorState::kFault || KeepsGains(last_.reaction));
  const bool lets_go = LetsGo();
  for (std::size_t i = 0; i < wires_.size(); ++i) {
    const JointRecord& joint = now_->joints[i];
    if (joint.drive_error != 0) NeedFault(Fault::kDriveError, "a drive has an error");
    if (joint.drive_state == DriveState::kLost)
      NeedFault(Fault::kHeartbeatLost, "a drive's heartbeat has stopped");
    const bool stays =
        joint.drive_state == DriveState::kEnabled || joint.drive_state == DriveState::kLost;
    if (was_enabled_[i] && !stays && !lets_go) {
      NeedFault(Fault::kDriveError, "a drive is not enabled any more");
    }
    if (joint.drive_state == DriveState::kEnabled) was_enabled_[i] = true;
    if (silent_ticks_[i] > setting_.executor.stale_ticks_max + 1)
      NeedFault(Fault::kStaleReply, "by its time stamp a reply is old", Invariant::kStale);
    if (joint.reply_age_ticks != 0) continue;
    const float values = joint.measured.position_rad + joint.measured.velocity_rad_s;
    if (!std::isfinite(values)) {
      NeedFault(Fault::kNonFinite, "a measurement is no number");
      continue;
    }
    if (joint.temperature_c > setting_.executor.joints[i].temperature_max_c)
      NeedFault(Fault::kOverTemperature, "a drive is hot");
    const float error =
        std::abs(joint.measured.position_rad - last_.joints[i].limited.position_rad);
    // A joint need not follow any more after what was found before in this tick.
    if (follows && (now_->reaction == last_.reaction || KeepsGains(now_->reaction)) &&
        error > following_max_rad_)
      NeedFault(Fault::kFollowingError, "it is far off");
  }
}

void FlightJudge::JudgeArming() {
  if (last_.faults != 0) Fail(Invariant::kArming, "armed with faults");
  const int stale = setting_.executor.stale_ticks_max;
  for (std::size_t i = 0; i < wires_.size(); ++i) {
    const JointRecord& joint = now_->joints[i];
    const JointLimits<float>& limits = BoundsOf(setting_.graph.start, i).limits;
    const float position = joint.measured.position_rad;
    constexpr float kAtStop_rad = 0.0201F;
    if (!(position >= limits.position_min_rad - kAtStop_rad &&
          position <= limits.position_max_rad + kAtStop_rad)) {
      Fail(Invariant::kArming, "joint {} is armed at {}", i, position);
    }
    if (joint.drive_error != 0 || joint.drive_state == DriveState::kFault ||
        joint.drive_state == DriveState::kLost) {
      Fail(Invariant::kArming, "joint {} is armed with an error of its drive", i);
    }
    if (joint.reply_age_ticks < 0 || joint.reply_age_ticks > stale)
      Fail(Invariant::kArming, "joint {} is armed without a reply", i);
    const std::int64_t age = (tick_.now_ns - stamp_ns_[i]) / setting_.period_ns;
    if (age > stale + 1)
      Fail(Invariant::kFresh, "joint {} is armed by a reply that is {} ticks old", i, age);
  }
}

void FlightJudge::JudgePause() {
  const auto protocol = static_cast<std::size_t>(setting_.protocol);
  const auto state = static_cast<std::size_t>(tick_.before);
  if (tick_.paused) {
    ++counts_.pauses[protocol][state];
    if (tick_.let_go || tick_.gap_ns > unattended_ns_) ++counts_.let_go[protocol][state];
  }
  // What the executor can know: by the tick numbers, too, time has passed.
  const bool told = elapsed_ * setting_.period_ns > unattended_ns_;
  if (tick_.before != ExecutorState::kDisarmed && tick_.gap_ns > unattended_ns_ && told)
    unattended_ = true;
  if (IsLoose(now_->state)) unattended_ = false;
}

void FlightJudge::JudgePausedOrder(std::size_t joint, const WireOrder& order) {
  const bool carries = wires_[joint].carries_gains();
  if (!order.is_stiff(carries)) return;
  const double off = std::abs(order.position_rad - tick_.position_rad[joint]);
  ++counts_.stiff_after_pause_ticks;
  counts_.snap_max_rad = std::max(counts_.snap_max_rad, off);
  constexpr double kFar_rad = 0.1;
  if (off > kFar_rad)
    Fail(Invariant::kPauseSnap, "after a pause, joint {} is drawn over {:.3f} rad", joint, off);
  Fail(Invariant::kPauseStiff, "after a pause, joint {} is stiff {:.3f} rad from where it is",
       joint, off);
}

void FlightJudge::JudgeTime() {
  if (now_->state == ExecutorState::kFault && now_->reaction == Reaction::kRollOut) {
    const SequenceNode& rolled = setting_.graph.node(now_->node);
    bool over = now_->primitive_time_s >=
                setting_.primitives[static_cast<std::size_t>(rolled.primitive)].duration_s;
    for (std::size_t i = 0; i < wires_.size(); ++i) {
      const JointRecord& joint = now_->joints[i];
      over = over && std::abs(joint.limited.position_rad - joint.planned.position_rad) < 5e-5F;
    }
    // In the tick of its end it becomes a hold.
    if (over) Fail(Invariant::kTime, "a motion is rolled out beyond its end");
  }
  if (now_->state != ExecutorState::kRunning) return;
  const Primitive<float>& primitive =
      setting_.primitives[static_cast<std::size_t>(setting_.graph.node(now_->node).primitive)];
  const float time = now_->primitive_time_s;
  if (!(time >= 0 && time <= primitive.duration_s))
    Fail(Invariant::kTime, "{} s of {}", time, primitive.duration_s);
  const bool goes_on = last_.state == ExecutorState::kRunning &&
                       tick_.before == ExecutorState::kRunning && last_.node == now_->node &&
                       tick_.after == ExecutorState::kRunning && has_last_;
  const float most =
      static_cast<float>(advance_) * setting_.executor.period_s * setting_.executor.speed * 1.01F;
  if (goes_on && !(time >= last_.primitive_time_s && time - last_.primitive_time_s <= most + 1e-6F))
    Fail(Invariant::kTime, "from {} to {} s", last_.primitive_time_s, time);
}

void FlightJudge::Count() {
  ++counts_.ticks;
  ++counts_.state_ticks[static_cast<std::size_t>(now_->state)];
  const auto transition = [&](ExecutorState from, ExecutorState to) {
    if (from == to) return;
    const int place = TransitionOf(from, to);
    if (place >= 0) ++counts_.transitions[static_cast<std::size_t>(place)];
    if (to == ExecutorState::kDisarmed) ++counts_.disarmed_from[static_cast<std::size_t>(from)];
    if (to == ExecutorState::kFault) ++counts_.fault_from[static_cast<std::size_t>(from)];
    if (to == ExecutorState::kRunning) ++counts_.runs;
  };
  transition(tick_.before, now_->state);
  transition(now_->state, tick_.after);
  const FaultDetail& first = now_->first_fault;
  if (first.fault != Fault::kNone && last_.first_fault.fault == Fault::kNone) {
    ++counts_.first_faults[static_cast<std::size_t>(setting_.protocol)]
                          [static_cast<std::size_t>(first.fault)];
    ++counts_.reactions[static_cast<std::size_t>(first.reaction)];
    if (first.state == ExecutorState::kRunning)
      ++counts_.abort_reactions[static_cast<std::size_t>(first.reaction)];
  }
  if (now_->refusal.refusal != Refusal::kNone)
    ++counts_.refusals[static_cast<std::size_t>(now_->refusal.refusal)];
  if (setting_.has_sensor) ++counts_.sensor_ticks[static_cast<std::size_t>(now_->sensor.status)];
}

}  // namespace tumbler::testing
