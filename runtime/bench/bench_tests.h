#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "runtime/bench/bench_operator.h"
#include "runtime/bench/bench_session.h"

namespace tumbler {

/// What a bench measures of drives. All of these leave the torque off, and throw what
/// BenchSession::Tick throws.

/// A small motion of one drive: there and back, as half a turn of a cosine each, and held until it
/// rests.
struct JogConfig {
  double way_rad = 0.1;  ///< With its sign; at most the amplitude of the bounds.
  /// Whether to stay where it leads, and not to come back.
  bool one_way = false;
};
struct JogResult {
  /// How far each drive's joint was from where it began when the motion was farthest [rad].
  std::vector<double> ways_rad;
  double peak_speed_rad_s = 0;  ///< Of the driven joint, as its drive reports it.
  DriveRecording recording;     ///< Of the whole motion.
};
/// @param watcher  is told before the motion and at its farthest; null: nobody watches.
JogResult Jog(BenchSession& session, std::size_t drive, const JogConfig& config,
              BenchOperator* watcher);

/// Which joint a drive turns, and whether its angle grows with the drive's.
struct DriveIdentity {
  std::string joint;
  int direction = 1;         ///< 1 or -1: as the drives file says, or the other way.
  DriveRecording recording;  ///< Of the motion.
};
/// Turns a drive's joint by the amplitude of the bounds and back, compares all encoders, and asks
/// which of the joints turned, and how.
/// @throws Refused  when the way is not clear, the drive's encoder shows no such motion, another
/// one
///                  shows one, or no joint turned.
DriveIdentity IdentifyDrive(BenchSession& session, BenchOperator& somebody, std::size_t drive,
                            const std::vector<std::string>& joints);

/// Replies of one drive.
struct ReplyResult {
  /// Whether the drive answers, so that times are from question to answer. Otherwise it sends by
  /// its own clock, and times are from one report to the next.
  bool answers = true;
  /// Questions; of a drive that sends by itself, the reports that were due in the whole time by the
  /// period in its drives file.
  std::int64_t asked = 0;
  std::int64_t lost = 0;
  /// How many more came than were asked for: somebody on the bus repeats frames. Then losses cannot
  /// be told from what came, and times are those of single questions.
  std::int64_t repeated = 0;
  /// Whether answers were still under way after every silence that was tried, so that nobody knows
  /// to which question one belongs: the times are the least that they can be.
  bool at_least = false;
  double median_ms = 0;
  double p99_ms = 0;
  double max_ms = 0;
  [[nodiscard]] double lost_share() const {
    return asked == 0 ? 0 : static_cast<double>(lost) / static_cast<double>(asked);
  }
};
/// Replies of all drives for a time, with the torque off.
///
/// An answer does not say which question it belongs to. So each drive is asked a few times with a
/// silence after each question first, which tells how many periods its answers take; then it is
/// asked in every period for the time.
std::vector<ReplyResult> MeasureReplies(BenchSession& session, double time_s);
Json ToJson(const ReplyResult& result);

/// The reaction of a drive to the host's silence.
struct WatchdogResult {
  bool let_go = false;
  /// The silence after which the drive still pushed, and after which it was limp [s]. A drive that
  /// never let go pushed after `pushed_after_s`.
  double pushed_after_s = 0;
  double limp_after_s = 0;
  int silences = 0;  ///< How often the bench was silent.
  /// Whether a drive that did not let go was proved for the longest silence, a second. Otherwise
  /// its joint's way within the amplitude allowed no longer one, and it may let go later.
  bool longest = false;
};
/// Enables a drive and stays silent.
///
/// A drive that only answers pushes with a small torque meanwhile, and tells in the reply that ends
/// the silence whether it still does. Silences of 10 ms and on, each twice as long as the one
/// before, find one after which it is limp; halving finds when it let go. It says nothing of its
/// position meanwhile. So a silence is tried only when its joint, at the same acceleration, stays
/// within the amplitude. A drive that sends by itself says itself that it let go; when its joint
/// leaves the amplitude, the silence ends. No silence is longer than a second.
/// @throws BenchFault  when a drive does not reply after a silence.
WatchdogResult ProveWatchdog(BenchSession& session, std::size_t drive);
/// The result in words, without the drive.
std::string Describe(const WatchdogResult& result);

/// The response of a joint to a step of its position.
struct StepConfig {
  double size_rad = 0.05;
  double time_s = 0.6;  ///< How long it is watched.
  double kp_nm_per_rad = 5;
  double kd_nm_s_per_rad = 0.2;
};
struct StepResult {
  std::vector<double> times_s;        ///< Since the step.
  std::vector<double> positions_rad;  ///< Of the joint, from where it was.
  std::optional<double> rise_s;       ///< From a tenth to nine tenths; none: it did not get there.
  double overshoot = 0;               ///< Share of the step.
  double settling_s = 0;     ///< Until it stays within a twentieth of the step of where it ends.
  double remaining_rad = 0;  ///< Step less where it ends.
};
StepResult MeasureStep(BenchSession& session, std::size_t drive, const StepConfig& config);
Json ToJson(const StepResult& result);
/// The result in words, without the drive.
std::string Describe(const StepResult& result);

/// A joint that is turned by hand while its drive is off.
struct TurnedResult {
  bool turned = false;  ///< Whether the operator says so.
  double lower_rad = 0;
  double upper_rad = 0;
};
TurnedResult WatchTurning(BenchSession& session, BenchOperator& somebody, std::size_t drive,
                          const std::string& joint, double lower_rad, double upper_rad);

/// The mean of a joint's position over a moment, with the torque off [rad]. Every drive that is
/// looked at, here and in WatchTurning and Jog, has to be heard meanwhile.
double RestingPosition(BenchSession& session, std::size_t drive);

}  // namespace tumbler
