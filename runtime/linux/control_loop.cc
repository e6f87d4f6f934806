#include "runtime/linux/control_loop.h"

#include <algorithm>
#include <cmath>

namespace tumbler {

ControlLoop::ControlLoop(const Parts& parts, std::int64_t period_ns, std::int64_t start_ns) noexcept
    : parts_(parts), period_ns_(period_ns), start_ns_(start_ns) {}

bool ControlLoop::Step() noexcept {
  const std::int64_t deadline_ns = start_ns_ + next_tick_ * period_ns_;
  parts_.clock.SleepUntil(deadline_ns);
  const std::int64_t awake_ns = parts_.clock.now_ns();
  const std::int64_t missed = std::max<std::int64_t>((awake_ns - deadline_ns) / period_ns_, 0);
  const std::int64_t tick = next_tick_ + missed;
  next_tick_ = tick + 1;
  time_ns_ = start_ns_ + tick * period_ns_;
  statistics_.missed_ticks += missed;
  if (awake_ns - deadline_ns > period_ns_ / 2) ++statistics_.late_ticks;
  statistics_.wake_up.Add(awake_ns - deadline_ns);

  std::size_t count = 0;
  Status receive_status = Status::kOk;
  while (count < received_.size()) {
    receive_status = parts_.bus.Receive(received_[count]);
    if (receive_status != Status::kOk) break;
    ++count;
  }
  statistics_.frames_received += static_cast<std::int64_t>(count);

  const OperatorWish wish = parts_.mailbox.Take();
  if (wish.command == OperatorCommand::kFinish) parts_.sequence.RequestFinish();
  if (wish.command == OperatorCommand::kStop) parts_.sequence.RequestStop();
  if (wish.command == OperatorCommand::kDisarm) parts_.sequence.RequestDisarm();
  OperatorCommand command = parts_.sequence.Next(output_.record);
  const bool direct =
      wish.command == OperatorCommand::kClearFaults || wish.command == OperatorCommand::kBranch;
  if (command == OperatorCommand::kNone && direct) command = wish.command;

  const TickInput input{
      tick, {received_.data(), count}, receive_status, send_status_, command, wish.branch};
  parts_.executor.Tick(input, output_);

  std::size_t frame_count = 0;
  for (const FrameBatch& batch : output_.frames) {
    for (const CanFrame& frame : batch.frames()) to_send_[frame_count++] = frame;
  }
  const std::int64_t send_ns = parts_.clock.now_ns();
  std::size_t sent = 0;
  send_status_ = parts_.bus.SendAll({to_send_.data(), frame_count}, sent);
  statistics_.frames_sent += static_cast<std::int64_t>(sent);
  statistics_.send_failures += static_cast<std::int64_t>(frame_count - sent);
  statistics_.tick.Add(parts_.clock.now_ns() - awake_ns);
  Count();
  if (parts_.telemetry != nullptr) parts_.telemetry->Push({time_ns_, output_.record});
  if (parts_.recorder != nullptr) {
    parts_.recorder->Push({time_ns_, awake_ns, send_ns}, input, send_status_, sent, output_);
  }
  return !parts_.sequence.done();
}

void ControlLoop::Count() noexcept {
  const TickRecord& record = output_.record;
  ++statistics_.ticks;
  const bool running = record.state == ExecutorState::kRunning;
  if (running) ++statistics_.run_ticks;
  bool limited = false;
  for (std::size_t i = 0; i < record.joint_count; ++i) {
    const JointRecord& joint = record.joints[i];
    limited = limited || joint.limit_active;
    if ((running || record.state == ExecutorState::kSettling) && joint.reply_age_ticks == 0) {
      float& torque = statistics_.peak_torque_nm[i];
      torque = std::max(torque, std::abs(joint.measured.torque_nm));
      float& error = statistics_.following_error_max_rad[i];
      error = std::max(error, std::abs(joint.measured.position_rad - last_position_rad_[i]));
    }
    last_position_rad_[i] = joint.limited.position_rad;
  }
  if (limited) ++statistics_.limited_ticks;
}

}  // namespace tumbler
