#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "common/core/primitive.h"
#include "common/core/realtime.h"
#include "firmware_interface/can/bus.h"
#include "runtime/assembly/clock.h"
#include "runtime/assembly/histogram.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/executor/executor.h"
#include "runtime/executor/run_procedure.h"
#include "runtime/record/tick_feed.h"
#include "runtime/record/timed_record.h"

namespace tumbler {

/// Figures of a loop. Keeping them allocates nothing.
struct LoopStatistics {
  std::int64_t ticks = 0;         ///< Executed ticks.
  std::int64_t missed_ticks = 0;  ///< Periods that passed without a tick.
  std::int64_t late_ticks = 0;    ///< Ticks that began more than half a period after the deadline.
  std::int64_t run_ticks = 0;     ///< Of `ticks`, those in state running.
  std::int64_t frames_sent = 0;
  std::int64_t frames_received = 0;
  std::int64_t frames_dropped =
      0;                           ///< Of these, those that had waited through a pause of the loop.
  std::int64_t send_failures = 0;  ///< Frames that the bus did not take; they are dropped.
  DurationHistogram wake_up;       ///< From the deadline to running.
  DurationHistogram tick;          ///< From running until all is done but handing over the record.
  DurationHistogram frame_age;     ///< From a received frame's end on the wire to its use.
  ReplyAgeHistogram reply_age_ticks;  ///< Of the joints' measurements, in every tick.

  /// Figures of the joints while the primitive runs and settles.
  /// Largest |measured torque|; NaN: none was measured.
  std::array<float, kMaxJoints> peak_torque_nm = NoneMeasured();
  /// Largest |measured position less setpoint|; NaN: none was measured.
  std::array<float, kMaxJoints> following_error_max_rad = NoneMeasured();
  std::int64_t limited_ticks = 0;  ///< Ticks in which the last gate changed any joint's setpoint.
  /// Ticks by what was thought of the inertial sensor (`SensorStatus`), and what is thought of it.
  std::array<std::int64_t, kSensorStatusCount> sensor_ticks{};
  SensorStatus sensor = SensorStatus::kNone;
  std::int64_t feedback_ticks = 0;  ///< Ticks with any feedback in force.
  /// How often a motion was left for the start because the robot had fallen.
  std::int64_t get_ups = 0;

 private:
  static constexpr std::array<float, kMaxJoints> NoneMeasured() noexcept {
    std::array<float, kMaxJoints> none{};
    for (float& value : none) value = std::numeric_limits<float>::quiet_NaN();
    return none;
  }
};

/// The periodic part of the runtime. At each deadline it takes the frames that have come, ticks the
/// executor, sends its frames and hands the tick to a feed. Deadlines are absolute: start +
/// tick * period.
///
/// When the loop wakes a whole period or more after the deadline, it skips the missed tick numbers,
/// and the executor decides what that means (`ExecutorConfig::late_ticks_max`, `pause_ticks_max`).
/// The periods for which the computer was suspended count as missed, and always as a pause. Frames
/// that have waited through a pause are dropped: they tell of drives as they were before it. Step
/// does not allocate, lock, or block except in the clock's sleep.
class ControlLoop {
 public:
  struct Parts {
    Executor& executor;
    CanBus& bus;
    Clock& clock;
    RunProcedure& procedure;
    OperatorMailbox& mailbox;
    TickFeed* feed = nullptr;  ///< Gets every tick; may be null.
  };
  /// @param start_ns  time of tick 0 on the clock.
  ControlLoop(const Parts& parts, std::int64_t period_ns, std::int64_t start_ns) noexcept;

  /// Sleeps until the next deadline and does its tick. @returns false once the procedure is done.
  bool Step() noexcept;

  [[nodiscard]] const TickRecord& record() const noexcept { return output_.record; }
  /// The operator's last request and what became of it.
  [[nodiscard]] const RequestAnswer& request() const noexcept { return request_; }
  /// Deadline of the last tick.
  [[nodiscard]] std::int64_t time_ns() const noexcept { return time_ns_; }
  [[nodiscard]] const LoopStatistics& statistics() const noexcept { return statistics_; }

 private:
  /// A bus carries no more frames in one period of the slowest loop. If more have come, they wait
  /// for the next tick.
  static constexpr std::size_t kReceiveCapacity = TickEntry::kReceivedMax;

  bool Tick(std::int64_t deadline_ns, std::int64_t awake_ns) noexcept TUMBLER_NONBLOCKING;
  std::size_t Receive(std::int64_t awake_ns, std::int64_t oldest_ns) noexcept;
  OperatorCommand Ask(const OperatorWish& wish) noexcept;
  void Send(TickNotes& notes) noexcept;
  void Count() noexcept;

  Parts parts_;
  std::int64_t period_ns_;
  std::int64_t start_ns_;
  std::int64_t suspended_ns_;  // of the clock when last seen
  std::int64_t last_send_ns_;
  std::int64_t next_tick_ = 0;
  Status receive_status_ = Status::kOk;
  Status send_status_ = Status::kOk;
  std::array<ReceivedFrame, kReceiveCapacity> received_;
  std::array<CanFrame, std::size_t{kMaxJoints} * FrameBatch::kCapacity> to_send_;
  TickOutput output_;
  RequestAnswer request_;
  std::int64_t time_ns_ = 0;
  bool settled_ = false;                               // settling in the tick before
  bool moved_ = false;                                 // running or settling in the tick before
  std::array<float, kMaxJoints> last_position_rad_{};  // limited positions of the tick before
  LoopStatistics statistics_;
};

/// Runs a loop that only sleeps and wakes like a ControlLoop. Its latencies are those that the
/// machine adds to any tick.
/// @param mailbox  any wish put there ends the loop.
[[nodiscard]] LoopStatistics MeasureWakeUps(Clock& clock, OperatorMailbox& mailbox,
                                            std::int64_t period_ns, std::int64_t ticks) noexcept;

}  // namespace tumbler
