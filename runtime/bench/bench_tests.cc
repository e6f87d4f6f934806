#include "runtime/bench/bench_tests.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace tumbler {
namespace {

constexpr double kNsOfSecond = 1e9;

std::int64_t BenchNs(double seconds) { return std::llround(seconds * kNsOfSecond); }

/// The latest question that each answer can belong to, in order, each used once. So an answer that
/// comes after the next question counts as late, and one that never comes as lost.
std::vector<double> Latencies(const ReplyTimes& times) {
  std::vector<double> latencies_ms;
  std::size_t ask = times.asked_ns.size();
  for (std::size_t i = times.arrived_ns.size(); i-- > 0;) {
    const auto before = std::lower_bound(times.asked_ns.begin(),
                                         times.asked_ns.begin() + static_cast<std::ptrdiff_t>(ask),
                                         times.arrived_ns[i]);
    if (before == times.asked_ns.begin()) break;  // It answers what was asked earlier.
    ask = static_cast<std::size_t>(before - times.asked_ns.begin()) - 1;
    latencies_ms.push_back(static_cast<double>(times.arrived_ns[i] - times.asked_ns[ask]) * 1e-6);
  }
  return latencies_ms;
}

std::vector<double> Intervals(const ReplyTimes& times) {
  std::vector<double> intervals_ms;
  for (std::size_t i = 1; i < times.arrived_ns.size(); ++i) {
    intervals_ms.push_back(static_cast<double>(times.arrived_ns[i] - times.arrived_ns[i - 1]) *
                           1e-6);
  }
  return intervals_ms;
}

/// The value below which a share of sorted values lies.
double Percentile(const std::vector<double>& sorted, double share) {
  if (sorted.empty()) return 0;
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(sorted.size())));
  return sorted[std::min(std::max<std::size_t>(rank, 1), sorted.size()) - 1];
}

}  // namespace

JogResult Jog(BenchSession& session, std::size_t drive, const JogConfig& config,
              BenchOperator* watcher) {
  JogResult result;
  std::vector<double> before;
  for (std::size_t i = 0; i < session.size(); ++i) before.push_back(session.position_rad(i));
  if (watcher != nullptr) watcher->NoteBefore();
  session.Enable(drive);
  const double origin = session.position_rad(drive);
  // Half a cosine of this duration is nowhere faster than the bound.
  const double half_s =
      0.5 * std::numbers::pi * std::abs(config.way_rad) / session.bounds().speed_rad_s;
  const auto play = [&](double from_rad, double to_rad) {
    const std::int64_t start_ns = session.now_ns();
    for (double t = 0; t < half_s;) {
      t = std::min(static_cast<double>(session.now_ns() - start_ns) / kNsOfSecond, half_s);
      const double phase = std::numbers::pi * t / half_s;
      session.Follow(from_rad + (to_rad - from_rad) * 0.5 * (1 - std::cos(phase)),
                     (to_rad - from_rad) * 0.5 * std::numbers::pi / half_s * std::sin(phase));
      result.peak_speed_rad_s =
          std::max(result.peak_speed_rad_s,
                   std::abs(double{session.drive(drive).feedback().velocity_rad_s}));
    }
  };
  const auto stay = [&](double at_rad) {
    constexpr double kStay_s = 0.3;
    const std::int64_t end_ns = session.now_ns() + BenchNs(kStay_s);
    while (session.now_ns() < end_ns) session.Follow(at_rad, 0);
  };
  play(origin, origin + config.way_rad);
  stay(origin + config.way_rad);
  for (std::size_t i = 0; i < session.size(); ++i)
    result.ways_rad.push_back(session.position_rad(i) - before[i]);
  if (watcher != nullptr) watcher->NoteFarthest();
  if (!config.one_way) {
    play(origin + config.way_rad, origin);
    stay(origin);
  }
  session.TorqueOff();
  return result;
}

std::vector<ReplyResult> MeasureReplies(BenchSession& session, double time_s) {
  session.ResetReplies();
  session.Wait(time_s);
  std::vector<ReplyResult> results;
  for (std::size_t i = 0; i < session.size(); ++i) {
    const ReplyTimes& times = session.replies(i);
    ReplyResult result;
    result.answers = session.drive(i).reply_rhythm().answers;
    std::vector<double> sorted = result.answers ? Latencies(times) : Intervals(times);
    std::sort(sorted.begin(), sorted.end());
    result.median_ms = Percentile(sorted, 0.5);
    result.p99_ms = Percentile(sorted, 0.99);
    result.max_ms = sorted.empty() ? 0 : sorted.back();
    if (result.answers) {
      // The answer to the last question may be under way.
      result.asked = static_cast<std::int64_t>(times.asked_ns.size());
      const auto answered = static_cast<std::int64_t>(sorted.size());
      result.lost = std::max<std::int64_t>(result.asked - answered - 1, 0);
    } else {
      // A gap of several intervals is several reports that are missing.
      for (const double interval_ms : sorted) {
        const auto due =
            std::max<std::int64_t>(std::llround(interval_ms / std::max(result.median_ms, 1e-6)), 1);
        result.asked += due;
        result.lost += due - 1;
      }
    }
    results.push_back(result);
  }
  return results;
}

Json ToJson(const ReplyResult& result) {
  return {{"measured", result.answers ? "answers" : "intervals"},
          {"asked", result.asked},
          {"lost", result.lost},
          {"median_ms", result.median_ms},
          {"p99_ms", result.p99_ms},
          {"max_ms", result.max_ms}};
}

namespace {

/// One silence of a drive that only answers.
struct Silence {
  double length_s = 0;
  std::optional<bool> pushed;  ///< Nothing: the reply was lost.
};

Silence PushAndStaySilent(BenchSession& session, std::size_t drive, double torque_nm,
                          double length_s) {
  constexpr int kPushes = 3;
  session.Enable(drive);
  for (int i = 0; i < kPushes; ++i) session.Push(torque_nm);
  session.ResetReplies();
  session.Push(torque_nm);
  const std::int64_t last_ns = session.replies(drive).asked_ns.back();
  static_cast<void>(session.StaySilentUntil(last_ns + BenchNs(length_s)));
  session.AskOffOnce();
  Silence silence;
  const ReplyTimes& times = session.replies(drive);
  silence.length_s = static_cast<double>(times.asked_ns.front() - last_ns) / kNsOfSecond;
  if (!times.torques_nm.empty())
    silence.pushed = std::abs(times.torques_nm.front()) > 0.5 * std::abs(torque_nm);
  session.TorqueOff();
  // Some firmware latches that its host was silent.
  if (session.drive(drive).state() == DriveState::kFault) session.ClearErrors();
  return silence;
}

/// A silence whose reply came, and which was not much longer than it was to be. Nothing after a few
/// in vain.
std::optional<Silence> TrySilence(BenchSession& session, std::size_t drive, double torque_nm,
                                  double length_s, WatchdogResult& result) {
  constexpr int kTries = 5;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    ++result.silences;
    const Silence silence = PushAndStaySilent(session, drive, torque_nm, length_s);
    if (silence.pushed) return silence;
  }
  return std::nullopt;
}

/// Finds by halving when a drive that only answers lets go.
WatchdogResult ProveByPushing(BenchSession& session, std::size_t drive, double longest_s) {
  constexpr double kPush_nm = 0.2;
  constexpr double kFine_s = 0.002;
  constexpr int kHalvings = 8;
  WatchdogResult result;
  double torque_nm = std::min(kPush_nm, session.bounds().torque_nm);
  const std::optional<Silence> longest = TrySilence(session, drive, torque_nm, longest_s, result);
  if (!longest) throw BenchFault(session.NameOf(drive) + " does not reply after a silence");
  if (*longest->pushed) {
    result.pushed_after_s = longest->length_s;
    return result;
  }
  result.let_go = true;
  result.limp_after_s = longest->length_s;
  const double fine_s = std::max(kFine_s, session.period_s());
  for (int i = 0; i < kHalvings && result.limp_after_s - result.pushed_after_s > fine_s; ++i) {
    torque_nm = -torque_nm;  // so that the joint stays where it is by and large
    const double half_s = 0.5 * (result.pushed_after_s + result.limp_after_s);
    const std::optional<Silence> silence = TrySilence(session, drive, torque_nm, half_s, result);
    if (!silence) break;
    if (*silence->pushed) {
      result.pushed_after_s = std::max(result.pushed_after_s, silence->length_s);
    } else {
      result.limp_after_s = std::min(result.limp_after_s, silence->length_s);
    }
  }
  return result;
}

/// Watches what a drive that sends by itself says while the host is silent.
WatchdogResult ProveByWatching(BenchSession& session, std::size_t drive, double longest_s) {
  constexpr int kHolds = 20;
  WatchdogResult result;
  result.silences = 1;
  session.Enable(drive);
  const double at_rad = session.position_rad(drive);
  for (int i = 0; i < kHolds; ++i) session.Follow(at_rad, 0);
  const std::int64_t last_ns = session.replies(drive).asked_ns.back();
  const std::int64_t off_ns = session.StaySilentUntil(last_ns + BenchNs(longest_s));
  result.let_go = off_ns >= 0;
  const std::int64_t end_ns = result.let_go ? off_ns : session.now_ns();
  (result.let_go ? result.limp_after_s : result.pushed_after_s) =
      static_cast<double>(end_ns - last_ns) / kNsOfSecond;
  session.TorqueOff();
  session.ClearErrors();  // Such drives latch that their host was silent.
  return result;
}

}  // namespace

WatchdogResult ProveWatchdog(BenchSession& session, std::size_t drive, double expected_s) {
  constexpr double kShortest_s = 0.1;
  constexpr double kLongest_s = 1;
  const double longest_s = std::clamp(4 * expected_s, kShortest_s, kLongest_s);
  const bool only_answers = session.drive(drive).reply_rhythm().answers &&
                            session.drive(drive).heartbeat().limit_ticks == 0;
  return only_answers ? ProveByPushing(session, drive, longest_s)
                      : ProveByWatching(session, drive, longest_s);
}

StepResult MeasureStep(BenchSession& session, std::size_t drive, const StepConfig& config) {
  constexpr double kBefore_s = 0.1;
  StepResult result;
  session.SetGains(config.kp_nm_per_rad, config.kd_nm_s_per_rad);
  session.Enable(drive);
  const double origin_rad = session.position_rad(drive);
  const std::int64_t hold_ns = session.now_ns() + BenchNs(kBefore_s);
  while (session.now_ns() < hold_ns) session.Follow(origin_rad, 0);
  session.AllowStep(std::abs(config.size_rad));
  const std::int64_t step_ns = session.now_ns();
  while (session.now_ns() < step_ns + BenchNs(config.time_s)) {
    session.Follow(origin_rad + config.size_rad, 0);
    result.times_s.push_back(static_cast<double>(session.now_ns() - step_ns) / kNsOfSecond);
    result.positions_rad.push_back(session.position_rad(drive) - origin_rad);
  }
  session.AllowStep(0);
  const std::int64_t back_ns = session.now_ns() + BenchNs(config.time_s);
  while (session.now_ns() < back_ns) session.Follow(origin_rad, 0);
  session.TorqueOff();

  const std::vector<double>& q = result.positions_rad;
  const std::size_t last = std::max<std::size_t>(q.size() / 10, 1);
  double end_rad = 0;
  for (std::size_t i = q.size() - last; i < q.size(); ++i)
    end_rad += q[i] / static_cast<double>(last);
  result.remaining_rad = config.size_rad - end_rad;
  std::optional<double> tenth_s;
  std::optional<double> nine_tenths_s;
  for (std::size_t i = 0; i < q.size(); ++i) {
    const double share = q[i] / config.size_rad;
    if (share >= 0.1 && !tenth_s) tenth_s = result.times_s[i];
    if (share >= 0.9 && !nine_tenths_s) nine_tenths_s = result.times_s[i];
    result.overshoot = std::max(result.overshoot, share - 1);
    if (std::abs(q[i] - end_rad) > 0.05 * std::abs(config.size_rad))
      result.settling_s = result.times_s[i];
  }
  if (nine_tenths_s) result.rise_s = *nine_tenths_s - *tenth_s;
  return result;
}

Json ToJson(const StepResult& result) {
  return {{"rise_s", result.rise_s},         {"overshoot", result.overshoot},
          {"settling_s", result.settling_s}, {"remaining_rad", result.remaining_rad},
          {"times_s", result.times_s},       {"positions_rad", result.positions_rad}};
}

TurnedResult WatchTurning(BenchSession& session, BenchOperator& somebody, std::size_t drive,
                          const std::string& joint, double lower_rad, double upper_rad) {
  TurnedResult result;
  result.lower_rad = result.upper_rad = session.position_rad(drive);
  result.turned = somebody.TurnThrough(joint, lower_rad, upper_rad, [&] {
    session.Tick();
    result.lower_rad = std::min(result.lower_rad, session.position_rad(drive));
    result.upper_rad = std::max(result.upper_rad, session.position_rad(drive));
  });
  return result;
}

double RestingPosition(BenchSession& session, std::size_t drive) {
  constexpr int kTicks = 20;
  double sum_rad = 0;
  for (int i = 0; i < kTicks; ++i) {
    session.Tick();
    sum_rad += session.position_rad(drive);
  }
  return sum_rad / kTicks;
}

}  // namespace tumbler
