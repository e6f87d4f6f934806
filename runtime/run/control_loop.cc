#include "runtime/run/control_loop.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tumbler {
namespace {

/// The command of a request that goes straight to the executor; kNone for a request about which the
/// run procedure decides.
OperatorCommand DirectCommand(OperatorRequest request) noexcept {
  if (request == OperatorRequest::kBranch) return OperatorCommand::kBranch;
  if (request == OperatorRequest::kClearFaults) return OperatorCommand::kClearFaults;
  return OperatorCommand::kNone;
}

bool IsDirect(OperatorRequest request) noexcept {
  return DirectCommand(request) != OperatorCommand::kNone;
}

}  // namespace

ControlLoop::ControlLoop(const Parts& parts, std::int64_t period_ns, std::int64_t start_ns) noexcept
    : parts_(parts),
      period_ns_(period_ns),
      start_ns_(start_ns),
      suspended_ns_(parts.clock.suspended_ns()),
      last_send_ns_(start_ns) {}

// No computer is suspended and back within less. A reading of the clock may be off by as much as
// the loop's thread had to wait between its two halves.
constexpr std::int64_t kShortestSuspension_ns = 100'000'000;

// More than any socket holds. Somebody may send without end.
constexpr std::int64_t kDropMax = 100'000;

bool ControlLoop::Step() noexcept {
  const std::int64_t deadline_ns = start_ns_ + next_tick_ * period_ns_;
  parts_.clock.SleepUntil(deadline_ns);
  return Tick(deadline_ns, parts_.clock.now_ns());
}

bool ControlLoop::Tick(std::int64_t deadline_ns,
                       std::int64_t awake_ns) noexcept TUMBLER_NONBLOCKING {
  const std::int64_t late_ns = awake_ns - deadline_ns;
  // While the computer was suspended, the clock stood still and the drives went on.
  const std::int64_t suspended_ns = parts_.clock.suspended_ns() - suspended_ns_;
  std::int64_t slept = 0;
  if (suspended_ns >= kShortestSuspension_ns) {
    // Nobody knows what drives and adapters did meanwhile: it is always a pause.
    slept = std::max<std::int64_t>(suspended_ns / period_ns_, parts_.executor.pause_ticks_max());
    suspended_ns_ += suspended_ns;
    start_ns_ -= slept * period_ns_;
  }
  const std::int64_t missed = std::max<std::int64_t>(late_ns / period_ns_, 0) + slept;
  const std::int64_t tick = next_tick_ + missed;
  next_tick_ = tick + 1;
  statistics_.missed_ticks += missed;
  if (late_ns > period_ns_ / 2) ++statistics_.late_ticks;
  statistics_.wake_up.Add(late_ns);

  // What has waited for longer than drives wait for a setpoint tells of another robot.
  const bool paused = missed >= parts_.executor.pause_ticks_max();
  const std::size_t count =
      Receive(awake_ns, paused ? awake_ns - period_ns_ : std::numeric_limits<std::int64_t>::min());
  OperatorWish wish = parts_.mailbox.Take();
  // When a request is sent again because its answer was lost, it counts once.
  // The wish to quit may have come with it, from somebody else.
  if (wish.id != 0 && wish.id == request_.id) {
    const bool quit = wish.quit;
    wish = {};
    wish.quit = quit;
  }
  const OperatorCommand command = Ask(wish);
  const TickInput input{tick,
                        start_ns_ + tick * period_ns_,
                        {received_.data(), count},
                        receive_status_,
                        send_status_,
                        command,
                        wish.branch,
                        parts_.bus.controller_state()};
  parts_.executor.Tick(input, output_);
  if (IsDirect(wish.request)) {  // The executor answers these itself.
    const bool asked = command == DirectCommand(wish.request);
    request_.refusal = asked ? output_.record.refusal.refusal : Refusal::kWrongState;
  }
  TickNotes notes;
  Send(notes);

  Count();
  const std::int64_t duration_ns = parts_.clock.now_ns() - awake_ns;
  statistics_.tick.Add(duration_ns);
  time_ns_ = start_ns_ + tick * period_ns_;
  if (parts_.feed != nullptr) {
    notes.deadline_ns = time_ns_;
    notes.due_ns = deadline_ns;
    notes.awake_ns = awake_ns;
    notes.done_ns = awake_ns + duration_ns;
    notes.request_id = request_.id;
    notes.request = static_cast<std::uint8_t>(request_.request);
    notes.request_refusal = request_.refusal;
    parts_.feed->Push(notes, input, output_);
  }
  return !parts_.procedure.done();
}

std::size_t ControlLoop::Receive(std::int64_t awake_ns, std::int64_t oldest_ns) noexcept {
  std::size_t count = 0;
  std::int64_t dropped = 0;
  receive_status_ = Status::kOk;
  while (count < received_.size()) {
    ReceivedFrame& received = received_[count];
    receive_status_ = parts_.bus.Receive(received);
    if (receive_status_ != Status::kOk) break;
    if (received.time_ns < oldest_ns && dropped < kDropMax) {
      ++dropped;
      continue;
    }
    statistics_.frame_age.Add(awake_ns - received.time_ns);
    ++count;
  }
  statistics_.frames_received += static_cast<std::int64_t>(count) + dropped;
  statistics_.frames_dropped += dropped;
  return count;
}

OperatorCommand ControlLoop::Ask(const OperatorWish& wish) noexcept {
  RunProcedure& procedure = parts_.procedure;
  Refusal refusal = Refusal::kNone;
  if (wish.quit) procedure.RequestQuit();
  switch (wish.request) {
    case OperatorRequest::kStart:
      refusal = procedure.RequestStart(output_.record);
      break;
    case OperatorRequest::kFinish:
      procedure.RequestFinish();
      break;
    case OperatorRequest::kStop:
      procedure.RequestStop();
      break;
    case OperatorRequest::kDisarm:
      procedure.RequestDisarm();
      break;
    case OperatorRequest::kNone:
    case OperatorRequest::kBranch:
    case OperatorRequest::kClearFaults:
      break;
  }
  if (wish.request != OperatorRequest::kNone) request_ = {wish.id, wish.request, refusal};
  const OperatorCommand command = procedure.Next(output_.record);
  return command == OperatorCommand::kNone ? DirectCommand(wish.request) : command;
}

void ControlLoop::Send(TickNotes& notes) noexcept {
  std::size_t frame_count = 0;
  for (const FrameBatch& batch : output_.frames) {
    for (const CanFrame& frame : batch.frames()) to_send_[frame_count++] = frame;
  }
  notes.send_ns = parts_.clock.now_ns();
  std::size_t sent = 0;
  // A pause may have come since this tick began. Its setpoints are of before it then; the next tick
  // knows.
  const std::int64_t gap_ns = notes.send_ns - last_send_ns_;
  const bool drives = output_.record.state != ExecutorState::kDisarmed &&
                      output_.record.reaction != Reaction::kDisable;
  if (drives && gap_ns > (parts_.executor.pause_ticks_max() + 1) * period_ns_) {
    send_status_ = Status::kWouldBlock;
  } else {
    send_status_ = parts_.bus.SendAll({to_send_.data(), frame_count}, sent);
    last_send_ns_ = notes.send_ns;
  }
  notes.sent_status = send_status_;
  notes.sent_count = static_cast<std::uint8_t>(sent);
  statistics_.frames_sent += static_cast<std::int64_t>(sent);
  statistics_.send_failures += static_cast<std::int64_t>(frame_count - sent);
}

void ControlLoop::Count() noexcept {
  const TickRecord& record = output_.record;
  ++statistics_.ticks;
  const bool running = record.state == ExecutorState::kRunning;
  if (running) ++statistics_.run_ticks;
  if (settled_ && record.state == ExecutorState::kMovingToStart) ++statistics_.get_ups;
  settled_ = record.state == ExecutorState::kSettling;
  // What is measured in the tick of a fault still follows the setpoint before it.
  const bool moves = running || record.state == ExecutorState::kSettling;
  const bool follows = moves || (moved_ && record.faults != 0);
  moved_ = moves;
  bool limited = false;
  for (std::size_t i = 0; i < record.joint_count; ++i) {
    const JointRecord& joint = record.joints[i];
    statistics_.reply_age_ticks.Add(joint.reply_age_ticks);
    limited = limited || joint.limit_active;
    if (follows && joint.reply_age_ticks == 0) {
      const auto note = [](float& largest, float measured) {
        if (std::isnan(largest) || measured > largest) largest = measured;
      };
      note(statistics_.peak_torque_nm[i], std::abs(joint.measured.torque_nm));
      note(statistics_.following_error_max_rad[i],
           std::abs(joint.measured.position_rad - last_position_rad_[i]));
    }
    last_position_rad_[i] = joint.limited.position_rad;
  }
  if (limited) ++statistics_.limited_ticks;
  statistics_.sensor = record.sensor.status;
  ++statistics_.sensor_ticks[static_cast<std::size_t>(record.sensor.status)];
  if (record.sensor.share > 0) ++statistics_.feedback_ticks;
}

LoopStatistics MeasureWakeUps(Clock& clock, OperatorMailbox& mailbox, std::int64_t period_ns,
                              std::int64_t ticks) noexcept {
  LoopStatistics statistics;
  const std::int64_t start_ns = clock.now_ns() + period_ns;
  for (std::int64_t next = 0; next < ticks && mailbox.Take() == OperatorWish{}; ++next) {
    const std::int64_t deadline_ns = start_ns + next * period_ns;
    clock.SleepUntil(deadline_ns);
    const std::int64_t late_ns = clock.now_ns() - deadline_ns;
    const std::int64_t missed = std::max<std::int64_t>(late_ns / period_ns, 0);
    next += missed;
    statistics.missed_ticks += missed;
    if (late_ns > period_ns / 2) ++statistics.late_ticks;
    statistics.wake_up.Add(late_ns);
    ++statistics.ticks;
  }
  return statistics;
}

}  // namespace tumbler
