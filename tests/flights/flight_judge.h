#pragma once

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/executor/executor.h"
#include "tests/flights/flight_setting.h"
#include "tests/flights/flight_wire.h"

namespace tumbler::testing {

constexpr std::uint32_t BitOf(Fault fault) { return 1U << static_cast<unsigned>(fault); }

/// Whether drives may be without torque.
constexpr bool IsLoose(ExecutorState state) {
  return state == ExecutorState::kDisarmed || state == ExecutorState::kArming;
}

/// What has to hold at every tick of every flight.
enum class Invariant : std::uint8_t {
  kWritten,      ///< Every drive is written in every tick.
  kFinite,       ///< Every setpoint is a number.
  kForbidden,    ///< Nothing is sent that no host may send.
  kLimits,       ///< Setpoints are within the limits of the node that is played.
  kSteps,        ///< Positions and feed-forward change by no more than the ticks passed allow.
  kBrake,        ///< What comes to rest does so at the acceleration limit.
  kWire,         ///< The drive reads the setpoint to half a step of its protocol.
  kGains,        ///< Gains are the configured ones, or those of the reaction.
  kTorqueOff,    ///< No torque is asked for while disarmed, and under the reaction disable.
  kTransition,   ///< States change along kTransitionTable, by kDisarm or by a fault, for a reason.
  kObeyed,       ///< Disarm and stop are obeyed in their tick; a refusal changes nothing.
  kStopsInTime,  ///< A stop takes no longer than braking at the acceleration limit.
  kLatched,      ///< Faults stay until they are cleared, and the first is the first.
  kReaction,     ///< The reaction is at least what the table says of each fault.
  kDetected,     ///< What is a fault is found in its tick.
  kStale,        ///< A reply is as old as its time stamp says.
  kArming,       ///< Arming begins from measurements within the limits, without errors.
  kFresh,        ///< Arming begins from measurements that are fresh by their time stamps.
  kArmingPose,   ///< A drive is enabled where its joint is.
  kPauseStiff,   ///< After the drives may have let go, no stiffness until armed anew.
  kPauseSnap,    ///< As kPauseStiff, and the setpoint is far from the joint.
  kTime,         ///< A primitive's time grows with the ticks, up to its end.
  kCorrection,   ///< Corrections by the sensor are within their limits, and so are their changes.
  kReplay,       ///< The same inputs give the same bytes.
};
inline constexpr int kInvariantCount = 24;
extern const std::array<std::string_view, kInvariantCount> kInvariantNames;

/// How an invariant was broken.
struct Violation {
  Invariant invariant = Invariant::kWritten;
  std::int32_t tick = 0;  ///< Of the flight.
  std::string what;
};

/// What has happened in a flight, or in many.
struct FlightCounts {
  std::int64_t flights = 0, ticks = 0, frames = 0, runs = 0, events = 0;
  std::array<std::array<std::int64_t, kFaultCount>, DriveProtocols::kCount> first_faults{};
  std::array<std::int64_t, kTransitionTable.size()> transitions{};
  std::array<std::int64_t, kExecutorStateCount> disarmed_from{}, fault_from{};
  std::array<std::array<std::int64_t, kExecutorStateCount>, kFaultCount> latched_in{};
  std::array<std::int64_t, kReactionCount> reactions{};
  std::array<std::int64_t, kReactionCount> abort_reactions{};
  std::array<std::int64_t, 32> refusals{};
  std::array<std::int64_t, kSensorStatusCount> sensor_ticks{};
  std::array<std::int64_t, kExecutorStateCount> state_ticks{};
  /// Pauses by protocol and the state before, and those after which a drive had let go.
  std::array<std::array<std::int64_t, kExecutorStateCount>, DriveProtocols::kCount> pauses{};
  std::array<std::array<std::int64_t, kExecutorStateCount>, DriveProtocols::kCount> let_go{};
  /// Of stiff setpoints after the drives had let go: how many ticks, and the farthest from the
  /// joint.
  std::int64_t stiff_after_pause_ticks = 0;
  double snap_max_rad = 0;
  std::uint64_t hash = 14695981039346656037ULL;  ///< Of all frames; of many flights, their xor.

  void Add(const FlightCounts& other);
};

/// What the world knows of a tick.
struct WorldTick {
  const TickInput* input = nullptr;
  const TickOutput* output = nullptr;
  ExecutorState before = ExecutorState::kDisarmed;  ///< After the tick before.
  ExecutorState after = ExecutorState::kDisarmed;
  std::int32_t number = 0;  ///< Of the flight.
  std::int64_t now_ns = 0;  ///< True time.
  std::int64_t gap_ns = 0;  ///< True time since the tick before.
  bool paused = false;      ///< Whether periods passed without a tick.
  bool let_go = false;      ///< Whether a drive's watchdog expired since the tick before.
  bool disarms = false;     ///< Whether the run procedure was asked for torque off before it.
  bool foreign = false;     ///< Whether a frame came that only this host may send.
  bool moved = false;       ///< Whether a joint was moved or pushed by somebody of late.
  bool spoilt = false;      ///< Whether frames may have been changed on their way of late.
  std::array<bool, kMaxJoints> enabled{};         ///< Whether the drives have torque.
  std::array<double, kMaxJoints> position_rad{};  ///< The joints' true positions.
};

/// Judges a flight tick by tick, from the outside: by what the executor is given, says and sends.
/// It allocates nothing until an invariant is broken.
class FlightJudge {
 public:
  /// @param ignored  bits of Invariant that are not judged.
  FlightJudge(const FlightSetting& setting, std::uint32_t ignored);

  /// @returns false once an invariant is broken.
  bool Take(const WorldTick& tick);
  [[nodiscard]] const std::vector<Violation>& violations() const { return violations_; }
  [[nodiscard]] const FlightCounts& counts() const { return counts_; }
  [[nodiscard]] FlightCounts& counts() { return counts_; }

 private:
  struct Bounds {
    JointLimits<float> limits;
    float position_step_rad = 0, torque_step_nm = 0;
  };

  template <typename... Args>
  void Fail(Invariant invariant, const char* format, const Args&... args);
  [[nodiscard]] bool Judges(Invariant invariant) const {
    return (ignored_ >> static_cast<unsigned>(invariant) & 1U) == 0;
  }
  [[nodiscard]] const Bounds& BoundsOf(int node, std::size_t joint) const {
    return bounds_[static_cast<std::size_t>(node)][joint];
  }
  void JudgeStates();
  void JudgeFaults();
  [[nodiscard]] bool LetsGo() const;
  void JudgeDetection();
  void NeedFault(Fault fault, const char* why, Invariant invariant = Invariant::kDetected);
  [[nodiscard]] bool MayAbortBy(Fault fault, Reaction reaction) const;
  void JudgeReplies();
  void JudgeArming();
  void JudgeJoint(std::size_t joint);
  void JudgeLimits(std::size_t joint);
  void JudgeOrder(std::size_t joint, const WireOrder& order);
  void JudgeGains(std::size_t joint, const WireOrder& order);
  void JudgePause();
  void JudgePausedOrder(std::size_t joint, const WireOrder& order);
  void JudgeCorrection(std::size_t joint);
  void JudgeTime();
  void Count();

  const FlightSetting& setting_;
  std::uint32_t ignored_;
  std::vector<std::array<Bounds, kMaxJoints>> bounds_;  ///< By node and joint.
  std::vector<WireReader> wires_;
  float following_max_rad_ = 0;
  float correction_max_rad_ = 0, correction_rate_max_rad_s_ = 1;  // the latter: where it vanishes
  std::int64_t stop_ticks_max_ = 0;
  std::int64_t unattended_ns_ = 0;
  std::vector<Violation> violations_;
  FlightCounts counts_;

  WorldTick tick_;                   // the present one
  const TickRecord* now_ = nullptr;  // its record
  bool has_last_ = false;
  TickRecord last_;           // of the tick before
  std::int64_t elapsed_ = 1;  // as the tick numbers say
  int advance_ = 1;           // the periods that are made up for
  bool lowering_ = false, lowered_before_ = false;
  std::array<bool, kMaxJoints> was_enabled_{};  // since the last arming
  bool went_home_ = false;                      // whether kGoHome was obeyed since the last arming
  std::array<double, kMaxJoints> arming_speed_rad_s_{};  ///< The largest since arming began.
  std::array<double, kMaxJoints> kp_left_{};             // the least since lowering began
  std::array<std::int64_t, kMaxJoints> stamp_ns_{};
  std::array<int, kMaxJoints> silent_ticks_{};  // in a row without a reply of the last period
  bool unattended_ = false;  // whether the drives may have let go since the last arming
  std::int64_t sensor_stamp_ns_ = 0;
  std::int64_t stopping_ticks_ = 0;
  int get_ups_ = 0;  // since the last command to run
};

template <typename... Args>
void FlightJudge::Fail(Invariant invariant, const char* format, const Args&... args) {
  if (!Judges(invariant) || violations_.size() >= 4) return;
  std::string what = fmt::format(fmt::runtime(format), args...);
  what += fmt::format(" [tick {}, {} -> {} -> {}, reaction {}, command {}, elapsed {}]",
                      tick_.input->tick, ToString(tick_.before), ToString(now_->state),
                      ToString(tick_.after), ToString(now_->reaction), ToString(now_->command),
                      elapsed_);
  violations_.push_back({invariant, tick_.number, what});
}

}  // namespace tumbler::testing
