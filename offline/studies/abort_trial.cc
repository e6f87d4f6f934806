#include "offline/studies/abort_trial.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "common/core/index.h"
#include "common/files/primitive_rounding.h"
#include "firmware_interface/can/bus_faults.h"
#include "runtime/assembly/run_checks.h"

namespace tumbler {
namespace {

/// For how long a robot is watched after its abort, how slow it is at rest [m/s, rad/s] and for how
/// long, and when its torque would be taken off after a fault, at the earliest.
constexpr double kWatched_s = 2.45, kSlow = 0.03, kRest_s = 0.35, kHeld_s = 1.2;
/// How long replies are repeated.
constexpr double kRepeated_s = 0.03;

double Seconds(std::int64_t ns) { return 1e-9 * static_cast<double>(ns); }
std::int64_t Nanoseconds(double s) { return std::llround(1e9 * s); }

/// Counts the setpoints of a tick that are outside a limit, or farther from the last ones than
/// theirs allow.
class LimitWatch {
 public:
  explicit LimitWatch(const Primitive<float>& primitive) : primitive_(primitive) {}

  void Observe(const TickRecord& record, double period_s) {
    const double ticks =
        static_cast<double>(std::min<std::int64_t>(record.tick - last_tick_, 3)) * kRounding;
    for (std::size_t j = 0; j < record.joint_count; ++j) {
      const JointSetpoint& now = record.joints[j].limited;
      const JointLimits<float>& limits = primitive_.joints[j].limits;
      const bool inside =
          now.position_rad >= limits.position_min_rad &&
          now.position_rad <= limits.position_max_rad &&
          std::abs(now.velocity_rad_s) <= limits.velocity_max_rad_s &&
          std::abs(now.torque_nm) <= limits.torque_max_nm &&
          std::abs(Step(now.position_rad, last_[j])) <=
              ticks * period_s * static_cast<double>(limits.velocity_max_rad_s) + kFloat_rad;
      if (known_ && !inside) ++outside_;
      last_[j] = now.position_rad;
    }
    last_tick_ = record.tick;
    known_ = true;
  }
  [[nodiscard]] std::int64_t outside() const { return outside_; }

 private:
  /// What the last gate adds for rounding, and the rounding of positions themselves.
  static constexpr double kRounding = 1.0011, kFloat_rad = 1e-6;
  static double Step(float now, float last) {
    return static_cast<double>(now) - static_cast<double>(last);
  }
  const Primitive<float>& primitive_;
  std::array<float, kMaxJoints> last_{};
  std::int64_t last_tick_ = 0;
  bool known_ = false;
  std::int64_t outside_ = 0;
};

/// Lets the cause happen now.
void Begin(const AbortTrial& trial, VariedRun& run) {
  BusFault fault;
  fault.node = static_cast<int>(run.robot().joint_count()) + (run.drives().sensor ? 1 : 0);
  fault.start_ns = run.loop().time_ns();
  switch (trial.cause) {
    case AbortCause::kOperatorStop:
      run.mailbox().Put({.request = OperatorRequest::kStop});
      return;
    case AbortCause::kLateTick:
      run.Pause(Nanoseconds(trial.late_s));
      return;
    case AbortCause::kSilence:
      fault.kind = BusFaultKind::kLoss;
      fault.end_ns = fault.start_ns + Nanoseconds(trial.silent_s);
      fault.ids = trial.silent_ids;
      break;
    case AbortCause::kRepeatedReplies:
      fault.kind = BusFaultKind::kDuplicate;
      fault.end_ns = fault.start_ns + Nanoseconds(kRepeated_s);
      break;
  }
  run.robot().bus().SetFaults({1, {fault}});
}

/// The largest of the robot's speeds [m/s, rad/s].
double SpeedOf(const TwinState& truth) {
  double speed = std::max({std::abs(truth.root_vx_m_s), std::abs(truth.root_vy_m_s),
                           std::abs(truth.root_vz_m_s), std::abs(truth.root_pitch_rate_rad_s)});
  for (const double rate : truth.root_angular_velocity_rad_s)
    speed = std::max(speed, std::abs(rate));
  for (const double rate : truth.joint_velocities_rad_s) speed = std::max(speed, std::abs(rate));
  return speed;
}

}  // namespace

const char* ToString(AbortCause cause) {
  switch (cause) {
    case AbortCause::kOperatorStop:
      return "operator stop";
    case AbortCause::kLateTick:
      return "late tick";
    case AbortCause::kSilence:
      return "silence";
    case AbortCause::kRepeatedReplies:
      return "repeated replies";
  }
  return "?";
}

AbortTrials::AbortTrials(SimulatedMotion motion, SharedRobot shared)
    : motion_(std::move(motion)), shared_(std::move(shared)) {}

const Primitive<double>& AbortTrials::primitive() const {
  return motion_.file().PrimitiveOf(motion_.file().graph.start).primitive;
}

AbortOutcome AbortTrials::Play(const AbortTrial& trial,
                               const std::function<void(VariedRun&)>& observe) const {
  SequenceFile file = motion_.file();
  file.primitives.front().primitive.aborts = trial.table;
  auto sequence = std::make_unique<const Sequence<float>>(ToRuntime(file));
  LimitWatch limits(sequence->primitives.front());
  RunSettings settings;
  settings.end = RunEnd::kHold;
  VariedRun run({motion_, std::move(sequence), settings}, shared_, trial.variation);
  const double tick_s = 1 / shared_.drives.rate_hz;
  const std::int64_t at = std::llround(trial.time_s / tick_s);
  AbortOutcome outcome;
  std::int64_t ticks = -1;  // since the motion began
  std::int64_t begun_ns = -1, moved_ns = -1;
  if (observe) observe(run);
  while (run.Step()) {
    if (observe) observe(run);
    const TickRecord& record = run.record();
    if (record.state == ExecutorState::kRunning && ticks < 0) run.DisplaceAtStart();
    if (ticks >= 0 || record.state == ExecutorState::kRunning) ++ticks;
    if (record.state != ExecutorState::kDisarmed && record.state != ExecutorState::kArming)
      limits.Observe(record, tick_s);
    const std::int64_t now_ns = run.loop().time_ns();
    if (ticks == at && begun_ns < 0) {
      Begin(trial, run);
      run.robot().ForgetImpacts();
      begun_ns = now_ns;
    }
    if (begun_ns < 0) continue;
    const TwinState& truth = run.robot().state();
    for (const double torque : truth.joint_torques_nm)
      outcome.torque_nm = std::max(outcome.torque_nm, std::abs(torque));
    outcome.overlaps = outcome.overlaps || truth.self_overlap_m > 0;
    if (SpeedOf(truth) > kSlow) moved_ns = now_ns;
    if (record.reaction == Reaction::kRollOut) begun_ns = now_ns;  // It is still going on.
    const double since_s = Seconds(now_ns - begun_ns);
    const bool rests = since_s > kHeld_s && Seconds(now_ns - moved_ns) > kRest_s;
    if (since_s > kWatched_s || rests) break;
  }
  if (begun_ns < 0)
    throw Refused(motion_.file().path + ": its run ends before it could be aborted");
  const TwinState& truth = run.robot().state();
  outcome.impact_m_s = truth.impact_m_s;
  outcome.link = truth.impact_link;
  outcome.pitch_rad = truth.root_pitch_rad;
  outcome.rests_as = run.robot().posture().resting_as();
  outcome.fault = run.record().first_fault.fault;
  outcome.reaction = run.record().first_fault.reaction;
  outcome.setpoints_outside_limits = limits.outside();
  return outcome;
}

}  // namespace tumbler
