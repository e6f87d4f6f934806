#include "runtime/bench/bench_tests.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <utility>

#include "common/files/program.h"

namespace tumbler {
namespace {

constexpr double kNsOfSecond = 1e9;

std::int64_t BenchNs(double seconds) { return std::llround(seconds * kNsOfSecond); }

/// What single questions tell of a drive's answers.
struct SingleAnswers {
  std::vector<double> times_ms;  ///< Of the first answer to each question, sorted.
  std::int64_t repeated = 0;     ///< Answers beyond the first.
  bool still_under_way = false;  ///< Whether answers take longer than the silences.
  double silence_ms = 0;         ///< The longest after a question.
};

/// Asks all drives a few times with a silence after each question.
std::vector<SingleAnswers> AskSingly(BenchSession& session) {
  constexpr int kQuestions = 24, kInVain = 3, kTicksBetween = 12;
  constexpr double kLongest_s = 0.2, kShare = 0.15;
  // Drives that are off bear any silence, but for the host's heartbeat.
  double silence_s = kLongest_s;
  bool heartbeat = false;
  for (std::size_t i = 0; i < session.size(); ++i) {
    const DriveEntry& drive = session.entry(i);
    if (!std::holds_alternative<Cia402Config>(drive.config) || drive.watchdog_s <= 0) continue;
    heartbeat = true;
    silence_s = std::min(silence_s, kShare * drive.watchdog_s);
  }
  silence_s = std::max(silence_s, 3 * session.period_s());
  std::vector<SingleAnswers> all(session.size());
  std::vector<bool> awaited;
  std::vector<int> in_vain(session.size());
  for (std::size_t i = 0; i < session.size(); ++i)
    awaited.push_back(session.drive(i).reply_rhythm().answers);
  if (std::ranges::none_of(awaited, std::identity{})) return all;
  bool quiet = true;
  for (int k = 0; k < kQuestions && quiet; ++k) {
    if (heartbeat) session.Wait(kTicksBetween * session.period_s());
    if (heartbeat || k == 0) {
      const double quiet_s = heartbeat ? silence_s : 2 * silence_s;
      quiet = session.ListenUntilQuiet(quiet_s, 2.5 * quiet_s);
    }
    session.AskAllOnce(awaited, 2 * session.period_s(), silence_s);
    bool unanswered = false;
    for (std::size_t i = 0; i < session.size(); ++i)
      unanswered = unanswered || (awaited[i] && session.replies(i).arrived_ns.empty());
    // An answer that comes unasked later was not lost.
    if (unanswered && !heartbeat)
      static_cast<void>(session.ListenUntilQuiet(2 * silence_s, 4 * silence_s));
    for (std::size_t i = 0; i < session.size(); ++i) {
      const ReplyTimes& times = session.replies(i);
      if (times.arrived_ns.empty()) {
        if (++in_vain[i] == kInVain) awaited[i] = false;
        continue;
      }
      if (static_cast<double>(times.arrived_ns.front() - times.asked_ns.front()) >
          kNsOfSecond * silence_s) {
        quiet = false;
        continue;
      }
      all[i].times_ms.push_back(
          static_cast<double>(times.arrived_ns.front() - times.asked_ns.front()) * 1e-6);
      all[i].repeated += static_cast<std::int64_t>(times.arrived_ns.size()) - 1;
    }
  }
  for (SingleAnswers& answers : all) {
    std::sort(answers.times_ms.begin(), answers.times_ms.end());
    answers.silence_ms = 1e3 * silence_s;
    answers.still_under_way = !quiet || answers.times_ms.empty();
  }
  return all;
}

/// The latest question that each answer can belong to, in order, each used once. So an answer that
/// comes after the next question counts as late, and one that never comes as lost.
/// @param least_ns  what every answer takes at least.
std::vector<double> Latencies(const ReplyTimes& times, std::int64_t least_ns) {
  std::vector<double> latencies_ms;
  std::size_t ask = times.asked_ns.size();
  for (std::size_t i = times.arrived_ns.size(); i-- > 0;) {
    const auto before = std::lower_bound(times.asked_ns.begin(),
                                         times.asked_ns.begin() + static_cast<std::ptrdiff_t>(ask),
                                         times.arrived_ns[i] - least_ns);
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

/// Holds the joint that is driven at this position until it rests there, since one with little
/// friction would roll on without torque; at most for 3 s.
void ComeToRest(BenchSession& session, std::size_t drive, double at_rad) {
  constexpr double kLongest_s = 3, kWindow_s = 0.3, kWithin_rad = 0.0015;
  const std::int64_t end_ns = session.now_ns() + BenchNs(kLongest_s);
  double lower_rad = 0, upper_rad = 0;
  for (std::int64_t since_ns = end_ns; session.now_ns() < end_ns;) {
    session.Follow(at_rad, 0);
    const double here_rad = session.position_rad(drive);
    lower_rad = std::min(lower_rad, here_rad);
    upper_rad = std::max(upper_rad, here_rad);
    if (since_ns == end_ns || upper_rad - lower_rad > kWithin_rad) {
      since_ns = session.now_ns();
      lower_rad = upper_rad = here_rad;
    } else if (session.now_ns() - since_ns >= BenchNs(kWindow_s)) {
      return;
    }
  }
}

}  // namespace

JogResult Jog(BenchSession& session, std::size_t drive, const JogConfig& config,
              BenchOperator* watcher) {
  JogResult result;
  std::vector<double> before;
  for (std::size_t i = 0; i < session.size(); ++i) before.push_back(session.position_rad(i));
  if (watcher != nullptr) watcher->NoteBefore();
  session.Enable(drive);
  session.Record();
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
  for (std::size_t i = 0; i < session.size(); ++i) {
    session.RequireHeard(i);
    result.ways_rad.push_back(session.position_rad(i) - before[i]);
  }
  if (watcher != nullptr) watcher->NoteFarthest();
  if (!config.one_way) {
    play(origin + config.way_rad, origin);
    ComeToRest(session, drive, origin);
  }
  result.recording = session.TakeRecording();
  session.TorqueOff();
  return result;
}

DriveIdentity IdentifyDrive(BenchSession& session, BenchOperator& somebody, std::size_t drive,
                            const std::vector<std::string>& joints) {
  const std::string name = session.NameOf(drive);
  const double amplitude_rad = session.bounds().amplitude_rad;
  const auto meanwhile = [&session] { session.Tick(); };
  if (!somebody.Confirm(fmt::format("{} will turn its joint by {} rad and back. Is the way clear?",
                                    name, amplitude_rad),
                        meanwhile)) {
    throw Refused(name + " was not to move");
  }
  JogResult jog = Jog(session, drive, {amplitude_rad, false}, &somebody);
  constexpr double kMovedShare = 0.3;
  const double moved_rad = kMovedShare * amplitude_rad;
  for (std::size_t i = 0; i < jog.ways_rad.size(); ++i) {
    if ((std::abs(jog.ways_rad[i]) > moved_rad) == (i == drive)) continue;
    throw Refused(
        i == drive
            ? fmt::format("{} moved by {:.4f} rad of {}: is its joint free, and is --kp enough?",
                          name, jog.ways_rad[i], amplitude_rad)
            : fmt::format("{} moved by {:.4f} rad, too, when {} was to move", session.NameOf(i),
                          jog.ways_rad[i], name));
  }
  DriveIdentity identity{somebody.WhichTurned(joints, meanwhile), 1, std::move(jog.recording)};
  if (identity.joint.empty())
    throw Refused(name + " reports a motion, and no joint turned: is its motor mounted?");
  identity.direction = somebody.Grew(identity.joint, meanwhile) ? 1 : -1;
  return identity;
}

std::vector<ReplyResult> MeasureReplies(BenchSession& session, double time_s) {
  const std::vector<SingleAnswers> single = AskSingly(session);
  session.Wait(4 * session.period_s());  // Drives that were left alone for a while are heard again.
  session.ResetReplies();
  const std::int64_t start_ns = session.now_ns();
  session.Wait(time_s);
  const double elapsed_s = static_cast<double>(session.now_ns() - start_ns) / kNsOfSecond;
  std::vector<ReplyResult> results;
  for (std::size_t i = 0; i < session.size(); ++i) {
    const ReplyTimes& times = session.replies(i);
    ReplyResult result;
    result.answers = session.drive(i).reply_rhythm().answers;
    const double period_ms = 1e3 * session.period_s();
    const double single_ms = Percentile(single[i].times_ms, 0.5);
    // Single answers differ by less than a period from those that share the bus with others.
    const double least_ms = result.answers && !single[i].still_under_way
                                ? std::max(single_ms - 0.5 * period_ms, 0.0)
                                : 0;
    std::vector<double> sorted =
        result.answers ? Latencies(times, BenchNs(1e-3 * least_ms)) : Intervals(times);
    std::sort(sorted.begin(), sorted.end());
    const auto came = static_cast<std::int64_t>(times.arrived_ns.size());
    result.median_ms = Percentile(sorted, 0.5);
    result.p99_ms = Percentile(sorted, 0.99);
    result.max_ms = sorted.empty() ? 0 : sorted.back();
    if (result.answers) {
      // Answers to the last questions may be under way.
      result.asked = static_cast<std::int64_t>(times.asked_ns.size());
      const auto answered = static_cast<std::int64_t>(sorted.size());
      const auto under_way = 1 + static_cast<std::int64_t>(least_ms / period_ms);
      result.lost = std::max<std::int64_t>(result.asked - answered - under_way, 0);
      result.at_least = came > 0 && single[i].still_under_way;
      // As many answers as were under way when the time began may be too many.
      result.repeated = std::max<std::int64_t>(came - result.asked - under_way, 0);
      if (single[i].repeated > 0) result.repeated = std::max<std::int64_t>(result.repeated, 1);
      if (result.repeated > 0 && !single[i].still_under_way) {
        result.median_ms = single_ms;
        result.p99_ms = Percentile(single[i].times_ms, 0.99);
        result.max_ms = single[i].times_ms.back();
        result.lost = 0;
      }
      if (result.at_least) {
        for (double* const time_ms : {&result.median_ms, &result.p99_ms, &result.max_ms})
          *time_ms = std::max(*time_ms, single[i].silence_ms);
      }
    } else {
      // What came is no yardstick: of a drive that is silent, or that loses every other report, it
      // shows nothing amiss. One report may be under way at each end.
      const DriveConfig& drive = session.entry(i).config;
      const auto* can = std::get_if<CanSimpleConfig>(&drive);
      const auto* ak = std::get_if<AkV3Config>(&drive);
      const double every_s = can != nullptr  ? can->messages.estimates_s
                             : ak != nullptr ? ak->status_s
                                             : session.period_s();
      result.asked = std::max<std::int64_t>(std::llround(elapsed_s / every_s), 1);
      result.lost = came == 0 ? result.asked : std::max<std::int64_t>(result.asked - came - 1, 0);
      // A drive's own clock may be faster than the host's by some per cent.
      constexpr double kFaster = 0.03;
      const std::int64_t most =
          result.asked + 1 + std::llround(kFaster * static_cast<double>(result.asked));
      if (came > most) result.repeated = came - result.asked;
    }
    results.push_back(result);
  }
  return results;
}

Json ToJson(const ReplyResult& result) {
  return {{"measured", result.answers ? "answers" : "intervals"},
          {"asked", result.asked},
          {"lost", result.lost},
          {"repeated", result.repeated},
          {"at_least", result.at_least},
          {"median_ms", result.median_ms},
          {"p99_ms", result.p99_ms},
          {"max_ms", result.max_ms}};
}

namespace {

/// One silence of a drive that does not say when it has let go.
struct Silence {
  double length_s = 0;
  double way_rad = 0;          ///< How far the joint was seen to go while it was pushed.
  std::optional<bool> pushed;  ///< Nothing: the reply was lost.
};

Silence PushAndStaySilent(BenchSession& session, std::size_t drive, double torque_nm,
                          double length_s) {
  constexpr int kPushes = 3;
  session.Enable(drive);
  const double from_rad = session.position_rad(drive);
  for (int i = 0; i < kPushes; ++i) session.Push(torque_nm);
  session.ResetReplies();
  session.Push(torque_nm);
  const std::int64_t last_ns = session.replies(drive).asked_ns.back();
  static_cast<void>(session.StaySilentUntil(last_ns + BenchNs(length_s)));
  const ReplyTimes in_silence = session.replies(drive);
  session.AskOffOnce();
  const ReplyTimes& after = session.replies(drive);
  Silence silence;
  silence.way_rad = std::abs(session.position_rad(drive) - from_rad);
  // The answer to the first frame after the silence tells of its end, or else the last report in
  // it.
  const bool answers = session.drive(drive).reply_rhythm().answers;
  const std::vector<double>& told_nm = answers ? after.torques_nm : in_silence.torques_nm;
  if (!told_nm.empty()) {
    const std::int64_t end_ns = answers ? after.asked_ns.front() : in_silence.arrived_ns.back();
    silence.length_s = static_cast<double>(end_ns - last_ns) / kNsOfSecond;
    silence.pushed =
        std::abs(answers ? told_nm.front() : told_nm.back()) > 0.5 * std::abs(torque_nm);
  }
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
    constexpr double kLate_s = 0.005;  // of a computer that is busy
    const double longest_s = 1.2 * length_s + 2 * session.period_s() + kLate_s;
    if (silence.pushed && silence.length_s <= longest_s) return silence;
  }
  return std::nullopt;
}

constexpr double kLongestSilence_s = 1;

/// Finds by doubling and halving when a drive that does not say so lets go.
WatchdogResult ProveByPushing(BenchSession& session, std::size_t drive) {
  constexpr double kPush_nm = 0.2;
  constexpr double kFirst_s = 0.01;
  constexpr double kFine_s = 0.002;
  constexpr int kHalvings = 12;
  WatchdogResult result;
  const double amplitude_rad = session.bounds().amplitude_rad;
  const double start_rad = session.position_rad(drive);
  double torque_nm = std::min(kPush_nm, session.bounds().torque_nm);
  const auto strayed_rad = [&] { return std::abs(session.position_rad(drive) - start_rad); };
  for (double length_s = std::max(kFirst_s, session.period_s()); !result.let_go;) {
    const std::optional<Silence> silence = TrySilence(session, drive, torque_nm, length_s, result);
    if (!silence) {
      throw BenchFault(session.NameOf(drive) +
                       " does not reply after a silence, or this computer was late with it");
    }
    torque_nm = -torque_nm;  // so that the joint stays where it is by and large
    if (!*silence->pushed) {
      result.let_go = true;
      result.limp_after_s = silence->length_s;
      break;
    }
    result.pushed_after_s = std::max(result.pushed_after_s, silence->length_s);
    result.longest = length_s >= kLongestSilence_s;
    const double next_s = std::min(2 * length_s, kLongestSilence_s);
    // The way grows with the square of the time.
    const double growth = (next_s / length_s) * (next_s / length_s);
    if (result.longest || growth * silence->way_rad + strayed_rad() > amplitude_rad) return result;
    length_s = next_s;
  }
  const double fine_s = std::max(kFine_s, session.period_s());
  for (int i = 0; i < kHalvings && result.limp_after_s - result.pushed_after_s > fine_s &&
                  strayed_rad() <= amplitude_rad;
       ++i) {
    const double half_s = 0.5 * (result.pushed_after_s + result.limp_after_s);
    const std::optional<Silence> silence = TrySilence(session, drive, torque_nm, half_s, result);
    if (!silence) break;
    torque_nm = -torque_nm;
    if (*silence->pushed) {
      result.pushed_after_s = std::max(result.pushed_after_s, silence->length_s);
    } else {
      result.limp_after_s = std::min(result.limp_after_s, silence->length_s);
    }
  }
  return result;
}

/// Watches what a drive that sends by itself says while the host is silent.
WatchdogResult ProveByWatching(BenchSession& session, std::size_t drive) {
  constexpr int kHolds = 20;
  WatchdogResult result;
  result.silences = 1;
  session.Enable(drive);
  const double at_rad = session.position_rad(drive);
  for (int i = 0; i < kHolds; ++i) session.Follow(at_rad, 0);
  const std::int64_t last_ns = session.replies(drive).asked_ns.back();
  const std::int64_t off_ns = session.StaySilentUntil(last_ns + BenchNs(kLongestSilence_s));
  result.let_go = off_ns >= 0;
  result.longest = !result.let_go && !session.Strayed();
  const std::int64_t end_ns = result.let_go ? off_ns : session.now_ns();
  (result.let_go ? result.limp_after_s : result.pushed_after_s) =
      static_cast<double>(end_ns - last_ns) / kNsOfSecond;
  session.TorqueOff();
  session.ClearErrors();  // Such drives latch that their host was silent.
  return result;
}

}  // namespace

WatchdogResult ProveWatchdog(BenchSession& session, std::size_t drive) {
  // Drives with a heartbeat tell their state in it.
  if (session.drive(drive).heartbeat().limit_ticks != 0) return ProveByWatching(session, drive);
  const auto* ak = std::get_if<AkV3Config>(&session.entry(drive).config);
  if (ak != nullptr && ak->torque_constant_nm_per_a == 0) {
    throw Refused(session.NameOf(drive) +
                  ": only the torque tells whether it has let go, and torque_constant_nm_per_a is "
                  "0; give it first");
  }
  return ProveByPushing(session, drive);
}

std::string Describe(const WatchdogResult& result) {
  if (!result.let_go) {
    return fmt::format("still drives after {:.0f} ms of silence{}", 1e3 * result.pushed_after_s,
                       result.longest
                           ? ""
                           : ", and --amplitude allows no longer one: raise it where the joint may "
                             "turn farther");
  }
  return fmt::format(
      "limp {:.1f} ms after the last setpoint; it still pushed at {:.1f} ms ({} silences)",
      1e3 * result.limp_after_s, 1e3 * result.pushed_after_s, result.silences);
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
  return {{"rise_s", result.rise_s ? Json(*result.rise_s) : Json()},
          {"overshoot", result.overshoot},
          {"settling_s", result.settling_s},
          {"remaining_rad", result.remaining_rad},
          {"times_s", result.times_s},
          {"positions_rad", result.positions_rad}};
}

std::string Describe(const StepResult& result) {
  const std::string rise = result.rise_s ? fmt::format("rise {:.1f} ms", 1e3 * *result.rise_s)
                                         : std::string("nine tenths not reached");
  return fmt::format("{}, overshoot {:.0f} %, settled after {:.0f} ms, {:.4f} rad remain", rise,
                     100 * result.overshoot, 1e3 * result.settling_s, result.remaining_rad);
}

TurnedResult WatchTurning(BenchSession& session, BenchOperator& somebody, std::size_t drive,
                          const std::string& joint, double lower_rad, double upper_rad) {
  TurnedResult result;
  result.lower_rad = result.upper_rad = session.position_rad(drive);
  result.turned = somebody.TurnThrough(joint, lower_rad, upper_rad, [&] {
    session.Tick();
    session.RequireHeard(drive);
    result.lower_rad = std::min(result.lower_rad, session.position_rad(drive));
    result.upper_rad = std::max(result.upper_rad, session.position_rad(drive));
  });
  return result;
}

double RestingPosition(BenchSession& session, std::size_t drive) {
  constexpr int kTicks = 20;
  double sum_rad = 0;
  // After this, what is no older than the limit was measured at rest.
  session.Wait(session.SilenceLimit_s(drive));
  for (int i = 0; i < kTicks; ++i) {
    session.Tick();
    session.RequireHeard(drive);
    sum_rad += session.position_rad(drive);
  }
  return sum_rad / kTicks;
}

}  // namespace tumbler
