// The operator's commands, and their refusals.

#include "runtime/executor/executor.h"
#include "runtime/executor/numbers.h"

namespace tumbler {
namespace {

/// A run may start when the commanded position is this near to the primitive's first one. A move to
/// the start ends there, but for the rounding of floats and limits.
constexpr float kAtStart_rad = 1e-4F;

/// A limp joint leans on its stop, which gives way. Arming takes it this far outside its limits;
/// its setpoints begin at the limit.
constexpr float kAtStop_rad = 0.02F;

/// A robot that turns faster than this does not lie yet. Its sensor's noise is a tenth of it.
constexpr float kLying_rad_s = 0.2F;

}  // namespace

void Executor::Obey(const TickInput& input) noexcept {
  const auto refuse = [this](Refusal refusal) { refusal_.refusal = refusal; };
  switch (input.command) {
    case OperatorCommand::kNone:
      return;
    case OperatorCommand::kArm:
      if (phase_ == Phase::kDisarmed && joint_count_ > 0) SetNode(graph().start);
      refusal_ = CheckArm();
      if (refusal_.refusal == Refusal::kNone) BeginArming();
      return;
    case OperatorCommand::kMoveToStart:
      refusal_ = CheckMove();
      if (refusal_.refusal == Refusal::kNone) StartMove(Phase::kMovingToStart);
      return;
    case OperatorCommand::kRun: {
      int node = graph().start;
      refusal_ = CheckRun(node);
      if (refusal_.refusal != Refusal::kNone) return;
      sequencer_.BeginRun();
      Play(node, Phase::kRunning);
      return;
    }
    case OperatorCommand::kStop: {
      if (const ExecutorState now = state(); now == ExecutorState::kDisarmed ||
                                             now == ExecutorState::kHolding ||
                                             now == ExecutorState::kStopping) {
        return;  // Nothing moves, but a stop is never refused.
      }
      const Reaction reaction = ReactionTo(Fault::kOperatorStop);
      if (reaction == Reaction::kHold && !IsFault(phase_)) {
        BreakOff();
        Enter(Phase::kStopping);
      } else {
        Latch(Fault::kOperatorStop, -1, {}, {});
      }
      return;
    }
    case OperatorCommand::kDisarm:
      Disarm();
      return;
    case OperatorCommand::kClearFaults:
      if (phase_ != Phase::kDisarmed) return refuse(Refusal::kWrongState);
      faults_ = earlier_faults_ = 0;
      first_fault_ = {};
      unarmed_request_ = DriveRequest::kClearErrors;
      return;
    case OperatorCommand::kFinish:
      if (IsInSequence(phase_)) sequencer_.Finish();
      return;  // Nothing is played, but a request to end is never refused.
    case OperatorCommand::kBranch:
      if (!IsInSequence(phase_)) return refuse(Refusal::kWrongState);
      if (graph().BranchName(input.branch).empty()) {
        refusal_ = {DetailNumber::Integer(input.branch), {}, Refusal::kNoSuchBranch, -1};
        return;
      }
      sequencer_.Want(input.branch);
      return;
    case OperatorCommand::kLower:
      if (state() != ExecutorState::kHolding && !IsFault(phase_))
        return refuse(Refusal::kWrongState);
      return Lower();
    case OperatorCommand::kGoHome:
      refusal_ = CheckGoHome();
      if (refusal_.refusal != Refusal::kNone) return;
      earlier_faults_ |= faults_;
      faults_ = 0;
      answer_ = {};
      for (Joint& joint : joints()) joint.replies.ForgetSequenceErrors();
      Settle(Phase::kSettlingHome);
      return;
  }
  refuse(Refusal::kWrongState);  // The command is none of the enumerators.
}

RefusalDetail Executor::CheckArm() const noexcept {
  if (joint_count_ == 0) return {{}, {}, Refusal::kNotConfigured, -1};
  if (phase_ != Phase::kDisarmed) return {{}, {}, Refusal::kWrongState, -1};
  if ((faults_ | earlier_faults_) != 0) return {{}, {}, Refusal::kFaultLatched, -1};
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const Joint& joint = joints_[index];
    const auto name = static_cast<std::int8_t>(i);
    const float position = joint.measured.position_rad;
    // A drive that has refused its set-up reports no position, and is not silent for all that.
    const std::uint32_t error = joint.drive->feedback().error;
    const bool never_heard = joint.replies.age_ticks() < 0;
    if (joint.measured.error != 0 || (never_heard && error != 0) ||
        joint.drive_state == DriveState::kFault) {
      return {DetailNumber::Code(error), {}, Refusal::kDriveError, name};
    }
    if (joint.replies.age_ticks() < 0 || joint.replies.age_ticks() > config_.stale_ticks_max) {
      return {DetailNumber::Integer(joint.replies.age_ticks()),
              DetailNumber::Integer(config_.stale_ticks_max), Refusal::kNoReply, name};
    }
    if (joint.drive_state == DriveState::kLost) {
      const HeartbeatAge age = joint.drive->heartbeat();
      return {DetailNumber::Integer(age.ticks), DetailNumber::Integer(age.limit_ticks),
              Refusal::kNoHeartbeat, name};
    }
    const float temperature_max_c = config_.joints[index].temperature_max_c;
    if (joint.measured.has_temperature && !(joint.measured.temperature_c <= temperature_max_c)) {
      return {DetailNumber::Real(joint.measured.temperature_c),
              DetailNumber::Real(temperature_max_c), Refusal::kTooHot, name};
    }
    if (const RefusalDetail moved = CheckKnown(i); moved.refusal != Refusal::kNone) return moved;
    if (!joint.IsMeasuredFinite() || !InRange(position, joint.limits.position_min_rad - kAtStop_rad,
                                              joint.limits.position_max_rad + kAtStop_rad)) {
      const bool below = position < joint.limits.position_min_rad;
      return {
          DetailNumber::Real(position),
          DetailNumber::Real(below ? joint.limits.position_min_rad : joint.limits.position_max_rad),
          Refusal::kOutsideLimits, name};
    }
    const float way = Magnitude(position - FirstMotion(i).position.control_points()[0]);
    // Where a run has left the joint, nobody has exchanged joints or lost a zero since.
    const bool left_here =
        joint.was_left && Magnitude(position - joint.left_rad) <= config_.start_way_max_rad;
    if (!(way <= config_.start_way_max_rad) && !left_here) {
      return {DetailNumber::Real(way), DetailNumber::Real(config_.start_way_max_rad),
              Refusal::kFarFromStart, name};
    }
  }
  return {};
}

RefusalDetail Executor::CheckKnown(int joint) const noexcept {
  const auto index = static_cast<std::size_t>(joint);
  const KnownPosition& last = config_.last_known[index];
  const Joint& now = joints_[index];
  // Once this executor has moved the joint, it knows better.
  if (!last.known || now.was_left || !IsFinite(now.measured.position_rad)) return {};
  const float off = now.measured.position_rad - last.position_rad;
  if (Magnitude(off) <= config_.moved_max_rad) return {};
  constexpr float kShareOfTurn = 0.1F;  // as near to whole turns as this tells turns from a move
  const float turns = off / last.turn_rad;
  const auto whole = static_cast<float>(
      static_cast<std::int32_t>(ClampOrLow(turns, -1e6F, 1e6F) + (turns < 0 ? -0.5F : 0.5F)));
  const bool lost = whole != 0 && Magnitude(turns - whole) <= kShareOfTurn;
  return {DetailNumber::Real(off), DetailNumber::Real(config_.moved_max_rad),
          lost ? Refusal::kTurnsLost : Refusal::kMoved, static_cast<std::int8_t>(joint)};
}

const JointMotion<float>& Executor::FirstMotion(int joint) const noexcept {
  const SequenceNode& node = graph().node(graph().start);
  const auto role = static_cast<std::size_t>(graph().RoleOf(graph().start, joint));
  return primitives_[static_cast<std::size_t>(node.primitive)].joints[role];
}

RefusalDetail Executor::CheckMove() const noexcept {
  if (phase_ != Phase::kHolding) return {{}, {}, Refusal::kWrongState, -1};
  return CheckFirstLimits();
}

RefusalDetail Executor::CheckFirstLimits() const noexcept {
  for (int i = 0; i < joint_count_; ++i) {
    // The gate would lead the command inside the limits at full speed, however far outside it is.
    const JointLimits<float>& limits = FirstMotion(i).limits;
    const float position = joints_[static_cast<std::size_t>(i)].commanded.position_rad;
    if (!InRange(position, limits.position_min_rad, limits.position_max_rad)) {
      const bool below = position < limits.position_min_rad;
      return {DetailNumber::Real(position),
              DetailNumber::Real(below ? limits.position_min_rad : limits.position_max_rad),
              Refusal::kOutsideLimits, static_cast<std::int8_t>(i)};
    }
  }
  return {};
}

RefusalDetail Executor::CheckGoHome() const noexcept {
  // The feed-forward at the end of a node is kept in its pose, and in no other.
  const bool at_end = hold_.keeps_torque && answer_.reaction == Reaction::kHold;
  if (phase_ != Phase::kFault || !at_end) return {{}, {}, Refusal::kWrongState, -1};
  // From where a robot has fallen to no motion leads on.
  const std::uint32_t fallen = 1U << static_cast<unsigned>(Fault::kFallen);
  if (((faults_ | earlier_faults_) & fallen) != 0) return {{}, {}, Refusal::kFaultLatched, -1};
  for (int i = 0; i < joint_count_; ++i) {
    const Joint& joint = joints_[static_cast<std::size_t>(i)];
    const auto name = static_cast<std::int8_t>(i);
    if (joint.drive_state != DriveState::kEnabled || joint.measured.error != 0)
      return {DetailNumber::Code(joint.drive->feedback().error), {}, Refusal::kDriveError, name};
    if (joint.replies.age_ticks() > config_.stale_ticks_max) {
      return {DetailNumber::Integer(joint.replies.age_ticks()),
              DetailNumber::Integer(config_.stale_ticks_max), Refusal::kNoReply, name};
    }
  }
  return {};
}

/// Finds the node with which a run begins, by how the robot lies.
RefusalDetail Executor::FindBeginning(int& node) const noexcept {
  // What was said before the fall is over.
  const bool told = config_.begin >= 0 && phase_ != Phase::kGettingUp;
  node = told ? config_.begin : graph().start;
  if (!TellsFalls()) return {};
  const SensorStatus status = pitch_->status();
  if (status != SensorStatus::kOk) {
    if (told) return {};  // Where the sensor is silent, somebody else has looked.
    return {DetailNumber::Integer(static_cast<std::int64_t>(status)),
            DetailNumber::Integer(static_cast<std::int64_t>(SensorStatus::kOk)),
            Refusal::kPitchUnknown, -1};
  }
  const float rate = Magnitude(pitch_->rate_rad_s());
  if (!(rate <= kLying_rad_s))
    return {DetailNumber::Real(rate), DetailNumber::Real(kLying_rad_s), Refusal::kNotAtRest, -1};
  const float nearest =
      sequencer_.NearestBeginning(pitch_->pitch_rad(), told ? config_.begin : -1, node);
  if (nearest <= graph().beginning_within_rad) return {};
  return {DetailNumber::Real(nearest), DetailNumber::Real(graph().beginning_within_rad),
          Refusal::kLiesOtherwise, -1};
}

RefusalDetail Executor::CheckRun(int& node) const noexcept {
  if (phase_ != Phase::kHolding) return {{}, {}, Refusal::kWrongState, -1};
  return CheckBeginning(node);
}

RefusalDetail Executor::CheckBeginning(int& node) const noexcept {
  if (const RefusalDetail lies = FindBeginning(node); lies.refusal != Refusal::kNone) return lies;
  if (phase_ == Phase::kGettingUp) node = sequencer_.InPlaceOf(node);
  const float tolerance =
      primitives_[static_cast<std::size_t>(graph().node(node).primitive)].entry_tolerance_rad;
  for (int i = 0; i < joint_count_; ++i) {
    const Joint& joint = joints_[static_cast<std::size_t>(i)];
    const auto name = static_cast<std::int8_t>(i);
    const float start = FirstMotion(i).position.control_points()[0];
    const float commanded_error = Magnitude(joint.commanded.position_rad - start);
    if (!(commanded_error <= kAtStart_rad)) {
      return {DetailNumber::Real(commanded_error), DetailNumber::Real(kAtStart_rad),
              Refusal::kNotAtStart, name};
    }
    const float measured_error = Magnitude(joint.measured.position_rad - start);
    if (!(measured_error <= tolerance)) {
      return {DetailNumber::Real(measured_error), DetailNumber::Real(tolerance),
              Refusal::kOutsideStartSet, name};
    }
  }
  return {};
}

}  // namespace tumbler
