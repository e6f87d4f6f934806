#include "runtime/run/run_summary.h"
#include "common/files/json.h"
#include "runtime/run/run_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

namespace tumbler {
const char* ToString(RunOutcome outcome) noexcept {
  switch (outcome) {
    case RunOutcome::kPending:
      return "unfinished";
    case RunOutcome::kCompleted:
      return "completed";
    case RunOutcome::kRefused:
      return "refused";
    case RunOutcome::kFault:
      return "fault";
    case RunOutcome::kStopped:
      return "stopped";
  }
  return "unknown";
}

namespace {

double Microseconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-3; }

constexpr std::array<double, 4> kShares{0.5, 0.99, 0.999, 0.9999};

std::array<std::pair<const char*, const DurationHistogram*>, 3> Durations(
    const LoopStatistics& statistics) {
  return {{{"wake-up", &statistics.wake_up},
           {"tick", &statistics.tick},
           {"frame age", &statistics.frame_age}}};
}

/// How many measurements were two ticks old or older.
std::int64_t Older(const ReplyAgeHistogram& age) {
  std::int64_t older = 0;
  for (std::size_t i = 2; i <= ReplyAgeHistogram::kBins; ++i) older += age.count(i);
  return older;
}

}  // namespace

std::optional<bool> Passage::as_planned() const {
  if (!pitch_later_rad || swings_on || !free_root) return std::nullopt;
  return std::abs(*pitch_later_rad - expected_pitch_rad) <= tolerance_rad;
}

bool Passage::is_to_rest() const {
  const auto asks_for = [this](PurposeTarget::Of of) {
    return std::any_of(purpose.begin(), purpose.end(),
                       [of](const JudgedTarget& judged) { return judged.target.of == of; });
  };
  return !hinged && asks_for(PurposeTarget::Of::kPitch) && asks_for(PurposeTarget::Of::kSpeed);
}

std::optional<bool> Passage::as_asked() const {
  if (purpose_met() == false || as_planned() == false) return false;
  return purpose.empty() ? as_planned() : purpose_met();
}

namespace {

/// What was measured of a joint while it ran; NaN where nothing was. The replies of a dry run are
/// imagined.
struct JointFigures {
  float peak_torque_nm, following_error_max_rad;
};

JointFigures FiguresOf(const RunSummary& summary, std::size_t joint) {
  constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();
  if (summary.dry_run) return {kNothing, kNothing};
  return {summary.statistics.peak_torque_nm[joint],
          summary.statistics.following_error_max_rad[joint]};
}

/// A line about each joint.
void AppendJoints(const RunSummary& summary, std::string& text) {
  if (summary.dry_run) return;
  for (std::size_t i = 0; i < summary.joints.size(); ++i) {
    const auto [torque_nm, error_rad] = FiguresOf(summary, i);
    text += fmt::format("  {}: {}, {}\n", summary.joints[i],
                        std::isnan(torque_nm) ? "torque not measured"
                                              : fmt::format("peak torque {:.3f} N m", torque_nm),
                        std::isnan(error_rad)
                            ? "following error not measured"
                            : fmt::format("following error at most {:.4f} rad", error_rad));
  }
}

bool SpeaksOfPitch(const Passage& passage) {
  return std::any_of(
      passage.purpose.begin(), passage.purpose.end(),
      [](const JudgedTarget& judged) { return judged.target.of == PurposeTarget::Of::kPitch; });
}

/// Where the last motion left the robot, in words.
const char* Verdict(const Passage& passage) {
  if (passage.purpose_met() == false)
    return passage.is_to_rest() ? "NOT at rest as asked" : "NOT as asked";
  if (!*passage.as_planned()) return "NOT where it should be";
  if (!passage.purpose_met()) return passage.purpose.empty() ? "as planned" : "NOT JUDGED";
  return passage.is_to_rest() ? "at rest as asked" : "as planned";
}

/// Whether the robot fell, by the simulation or by its sensor.
bool Fell(const RunSummary& summary) {
  return !summary.falls.empty() || summary.statistics.get_ups > 0;
}

/// The first motions after which the robot is not where it should be, and what followed each.
std::string AmissIn(const RunSummary& summary) {
  constexpr int kMost = 3;
  std::string text;
  int named = 0;
  for (std::size_t i = 0; i < summary.passages.size(); ++i) {
    if (!summary.passages[i].amiss()) continue;
    if (named++ == kMost) return text + ", ...)";
    text += fmt::format("{}'{}'", text.empty() ? " (" : ", ", summary.passages[i].node);
    if (i + 1 < summary.passages.size())
      text += fmt::format(" before '{}'", summary.passages[i + 1].node);
  }
  return text + ")";
}

/// How many motions the simulated robot has played to their ends.
std::int64_t MotionsOf(const RunSummary& summary) {
  return static_cast<std::int64_t>(summary.passages.size()) + summary.left_out.motions;
}

/// Of several motions, whether the robot was where it should be after them.
std::string CountText(const RunSummary& summary) {
  const auto count = [&summary](bool (Passage::*is)() const) {
    return std::count_if(summary.passages.begin(), summary.passages.end(), std::mem_fn(is));
  };
  const auto amiss = count(&Passage::amiss) + summary.left_out.amiss;
  const auto unjudged = count(&Passage::unjudged) + summary.left_out.unjudged;
  return fmt::format(
      "{} motions, {} complete cycles; {}{}", MotionsOf(summary), summary.cycles,
      amiss != 0 ? fmt::format("NOT where it should be after {}{}", amiss, AmissIn(summary))
      : unjudged == MotionsOf(summary) ? "NOT JUDGED"
      : Fell(summary) ? "the robot where it should be when each was judged, but it FELL"
                      : "the robot where it should be after each",
      unjudged == 0 || unjudged == MotionsOf(summary)
          ? ""
          : fmt::format(" but {}, NOT JUDGED", unjudged));
}

void AppendPassages(const RunSummary& summary, std::string& text) {
  if (!summary.broken_off.empty()) text += fmt::format("  {}: broken off\n", summary.broken_off);
  if (summary.passages.empty()) return;
  if (summary.passages.size() > 1) text += fmt::format("  {}\n", CountText(summary));
  const Passage& last = summary.passages.back();
  if (!summary.broken_off.empty()) {
    text += fmt::format("  before, {}: ", last.node);
  } else {
    text += summary.passages.size() > 1 ? fmt::format("  last, {}: ", last.node) : "  ";
  }
  if (!last.free_root) {
    text += fmt::format("root fixed: {}", !last.as_asked()   ? "NOT JUDGED"
                                          : *last.as_asked() ? "as asked"
                                                             : "NOT as asked");
  } else if (last.swings_on) {
    text += fmt::format("root pitch: {:.4f} rad at the end", last.pitch_at_end_rad);
    text += !last.purpose_met()   ? ", NOT JUDGED"
            : *last.purpose_met() ? ", as asked"
                                  : ", NOT as asked";
    if (last.pitch_later_rad) {
      text += fmt::format("; {:.4f} rad {:.2g} s later, swinging on", *last.pitch_later_rad,
                          last.later_s);
    }
  } else if (SpeaksOfPitch(last)) {
    text += fmt::format("root pitch: {:.4f} rad at the end", last.pitch_at_end_rad);
    if (last.pitch_later_rad) {
      text += fmt::format(", {:.4f} rad {:.2g} s later (planned {:.4f}): {}", *last.pitch_later_rad,
                          last.later_s, last.expected_pitch_rad, Verdict(last));
    }
  } else if (last.pitch_later_rad) {
    // What it misses may be something else, which is told below.
    const bool as_planned = last.as_planned().value_or(false);
    text += fmt::format(
        "root {} {:.4f} rad off its plan {:.2g} s later (within {:.3g}): {}",
        last.in_space ? "tilted" : "turned", *last.pitch_later_rad - last.expected_pitch_rad,
        last.later_s, last.tolerance_rad,
        as_planned && last.purpose_met() == false ? fmt::format("as planned, but {}", Verdict(last))
                                                  : Verdict(last));
  } else {
    text += "ended before it could come to rest";
  }
  text += '\n';
  if (last.purpose.empty() && (last.swings_on || !last.free_root))
    text += "    its task asks for nothing that a run could meet or miss\n";
  for (const JudgedTarget& judged : last.purpose)
    text += fmt::format("    {}: {}\n", judged.name(), judged.Verdict());
}

/// What happened to a simulated robot that should not, a text each.
std::vector<std::string> MishapsOf(const RunSummary& summary) {
  std::vector<std::string> texts;
  for (const std::vector<Mishap>* mishaps : {&summary.falls, &summary.overlaps}) {
    for (const Mishap& mishap : *mishaps)
      texts.push_back(fmt::format("at {:.3f} s the robot {}", mishap.time_s, mishap.what));
  }
  return texts;
}

/// What a motion was not found to do, a text each.
std::vector<std::string> Shortcomings(const Passage& passage) {
  std::vector<std::string> texts;
  if (passage.as_planned() == false) texts.emplace_back("NOT where it should be");
  for (const JudgedTarget& judged : passage.purpose) {
    if (judged.met() != true)
      texts.push_back(fmt::format("{}: {}", judged.name(), judged.Verdict()));
  }
  return texts;
}

}  // namespace

namespace {

template <class T>
Json Maybe(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json JsonOf(const Passage& passage) {
  auto purpose = Json::Array();
  for (const JudgedTarget& judged : passage.purpose) {
    purpose.Append(ToJson(judged));
  }
  Json json = {{"node", passage.node},
               {"purpose", purpose},
               {"purpose_met", Maybe(passage.purpose_met())},
               {"as_asked", Maybe(passage.as_asked())},
               {"as_planned_later", Maybe(passage.as_planned())},
               {"later_s", passage.pitch_later_rad ? Json(passage.later_s) : Json()}};
  if (passage.in_space) json["root_tilt_later_rad"] = Maybe(passage.pitch_later_rad);
  if (SpeaksOfPitch(passage)) {
    json["root_pitch_planned_rad"] = passage.expected_pitch_rad;
    json["root_pitch_at_end_rad"] = passage.pitch_at_end_rad;
    json["root_pitch_later_rad"] = Maybe(passage.pitch_later_rad);
  }
  return json;
}

Json TimingJson(const LoopStatistics& statistics, const Machine& machine,
                const std::string& scheduling) {
  Json json;
  for (const auto& [name, durations] : Durations(statistics)) {
    std::string key(name);
    std::replace(key.begin(), key.end(), ' ', '_');
    std::replace(key.begin(), key.end(), '-', '_');
    Json& entry = json[key];
    entry["count"] = durations->count();
    entry["p50_us"] = Microseconds(durations->PercentileNs(0.5));
    entry["p99_us"] = Microseconds(durations->PercentileNs(0.99));
    entry["p99_9_us"] = Microseconds(durations->PercentileNs(0.999));
    entry["p99_99_us"] = Microseconds(durations->PercentileNs(0.9999));
    entry["max_us"] = Microseconds(durations->max_ns());
    entry["histogram_us_count"] = Json::Array();  // [lower end of a bin of 1 us, how many]
    for (std::size_t bin = 0; bin < durations->bins().size(); ++bin) {
      if (durations->bins()[bin] > 0)
        entry["histogram_us_count"].Append({bin, durations->bins()[bin]});
    }
  }
  const ReplyAgeHistogram& age = statistics.reply_age_ticks;
  json["reply_age_ticks"] = {{"fresh", age.count(0)},
                             {"one", age.count(1)},
                             {"older", Older(age)},
                             {"never", age.never()},
                             {"max", age.max()}};
  json["kernel"] = machine.kernel;
  json["cpu"] = machine.cpu;
  json["adapter"] = machine.adapter;
  json["scheduling"] = scheduling;
  return json;
}

}  // namespace

std::string DescribeTiming(const LoopStatistics& statistics, const Machine& machine,
                           const std::string& scheduling) {
  std::string text = fmt::format("  {:16} {:>8} {:>8} {:>8} {:>8} {:>9} {:>10}\n", "time, us",
                                 "p50", "p99", "p99.9", "p99.99", "max", "over 1 ms");
  for (const auto& [name, durations] : Durations(statistics)) {
    if (durations->count() == 0) continue;
    text += fmt::format("  {:16}", name);
    for (const double share : kShares)
      text += fmt::format(" {:8.0f}", Microseconds(durations->PercentileNs(share)));
    text += fmt::format(" {:9.0f} {:10}\n", Microseconds(durations->max_ns()), durations->beyond());
  }
  const ReplyAgeHistogram& age = statistics.reply_age_ticks;
  if (age.max() >= 0) {
    text += fmt::format("  {:16} {} fresh, {} one tick old, {} older (at most {})\n",
                        "measurements", age.count(0), age.count(1), Older(age), age.max());
  }
  return text + fmt::format("  on {}, {}; adapter {}; {}\n", machine.kernel, machine.cpu,
                            machine.adapter, scheduling);
}

std::string TimingToJson(const LoopStatistics& statistics, const Machine& machine,
                         const std::string& scheduling) {
  Json json = TimingJson(statistics, machine, scheduling);
  json["ticks"] = statistics.ticks;
  json["missed_ticks"] = statistics.missed_ticks;
  json["late_ticks"] = statistics.late_ticks;
  return json.Dump(2) + '\n';
}

std::string ToOutcome(const RunSummary& summary) {
  constexpr int kMost = 3;  // motions of which what is amiss is told
  std::string text = ToString(summary.outcome);
  if (!summary.reason.empty()) text += ": " + summary.reason;
  if (!summary.broken_off.empty()) text += fmt::format("; {}: broken off", summary.broken_off);
  if (summary.passages.size() > 1) {
    text += "; " + CountText(summary);
  } else if (!summary.passages.empty()) {
    const std::optional<bool> as_asked = summary.passages.front().as_asked();
    text += !as_asked ? "; NOT JUDGED" : *as_asked ? "; as asked" : "; NOT as asked";
  }
  int told = 0;
  for (const Passage& passage : summary.passages) {
    if (passage.as_asked() == true || told++ >= kMost) continue;
    for (const std::string& what : Shortcomings(passage))
      text += fmt::format("; {}: {}", passage.node, what);
  }
  for (const std::string& what : MishapsOf(summary)) text += "; " + what;
  return text;
}

std::string ToText(const RunSummary& summary) {
  const LoopStatistics& s = summary.statistics;
  std::string text = fmt::format(
      "{}: {} on {}{}, speed {:.3g}, {:.6g} Hz\n", ToString(summary.outcome), summary.primitive,
      summary.bus, summary.dry_run ? " (dry run)" : "", summary.speed, summary.rate_hz);
  if (summary.attended) text += fmt::format("  {} runs\n", summary.runs);
  if (!summary.reason.empty()) text += fmt::format("  {}\n", summary.reason);
  AppendPassages(summary, text);
  if (!summary.after_torque_off.empty())
    text += fmt::format("  without torque, 3 s later: the robot {}\n", summary.after_torque_off);
  for (const std::string& what : MishapsOf(summary)) text += fmt::format("  {}\n", what);
  AppendJoints(summary, text);
  text += fmt::format("  ticks: {} ({} running), {} missed, {} late, {} with a limit active\n",
                      s.ticks, s.run_ticks, s.missed_ticks, s.late_ticks, s.limited_ticks);
  if (s.sensor != SensorStatus::kNone) {
    const std::int64_t known = s.sensor_ticks[static_cast<std::size_t>(SensorStatus::kOk)];
    text += fmt::format("  sensor: {} at last, ok in {} ticks; feedback in {}\n",
                        ToString(s.sensor), known, s.feedback_ticks);
  }
  if (s.get_ups > 0) {
    text += fmt::format("  by its sensor the robot fell, and began to get up: {} time{}\n",
                        s.get_ups, s.get_ups == 1 ? "" : "s");
  }
  if ((!summary.simulated && !summary.dry_run) || summary.realtime) {
    text += DescribeTiming(s, summary.machine,
                           summary.realtime ? summary.realtime->scheduling : "time-shared");
  }
  if (summary.realtime && !summary.realtime->in_force())
    text += fmt::format("  NOT in real time: {}\n", summary.realtime->problems);
  text += summary.dry_run
              ? fmt::format("  bus: {} frames would be sent, and none was", s.frames_sent)
              : fmt::format("  bus: {} frames sent, {} received, {} not sent", s.frames_sent,
                            s.frames_received, s.send_failures);
  text += fmt::format("; worst case {} bits a tick, {:.1f} %", summary.worst_case_tick_bits,
                      100 * summary.worst_case_load);
  if (summary.measured_load)
    text += fmt::format("; measured {:.1f} %", 100 * *summary.measured_load);
  if (summary.interface) {
    const SocketCanStatistics& i = summary.interface->statistics;
    text += fmt::format(
        "\n  interface: {} frames confirmed, the slowest after {:.0f} us, {} discarded, {} stalls; "
        "{} received frames lost, {} overflows of the controller, {} commands of others; {}, {} "
        "error frames, {} unacknowledged, "
        "{} times bus-off",
        i.confirmed, Microseconds(i.confirm_time_max_ns), i.discarded, i.stalls, i.dropped,
        i.overflows, i.foreign_commands, ToString(summary.interface->controller), i.error_frames,
        i.unacknowledged, i.bus_offs);
    if (summary.interface->in_flight > 0) {
      text += fmt::format(
          "\n  WARNING: {} frames wait for the bus to come back; discard them before the motors "
          "have power: ip link set {} down; ip link set {} up",
          summary.interface->in_flight, summary.bus, summary.bus);
    }
  }
  text += fmt::format("\n  telemetry: {} records lost, {} messages not published\n",
                      summary.lost_records, summary.unpublished_messages);
  if (summary.refused_messages > 0) {
    text += fmt::format("  {} requests to another run, or too old, were refused\n",
                        summary.refused_messages);
  }
  if (summary.unreadable_messages > 0) {
    text += fmt::format("  {} received messages were no requests of an operator\n",
                        summary.unreadable_messages);
  }
  if (summary.recorded_ticks + summary.unrecorded_ticks > 0) {
    text += fmt::format("  flight record: {} ticks, {} not recorded{}{}\n", summary.recorded_ticks,
                        summary.unrecorded_ticks, summary.record_problem.empty() ? "" : ": ",
                        summary.record_problem);
  }
  for (const std::string& file : summary.files) text += fmt::format("  wrote {}\n", file);
  for (const std::string& problem : summary.unwritten)
    text += fmt::format("  NOT whole: {}\n", problem);
  return text;
}

namespace {

Json JsonOf(const InterfaceSummary& interface) {
  const SocketCanStatistics& i = interface.statistics;
  return {{"frames_confirmed", i.confirmed},
          {"confirm_max_us", Microseconds(i.confirm_time_max_ns)},
          {"frames_discarded", i.discarded},
          {"frames_in_flight", interface.in_flight},
          {"stalls", i.stalls},
          {"received_frames_lost", i.dropped},
          {"controller_overflows", i.overflows},
          {"commands_of_others", i.foreign_commands},
          {"controller_state", ToString(interface.controller)},
          {"error_frames", i.error_frames},
          {"unacknowledged", i.unacknowledged},
          {"bus_offs", i.bus_offs}};
}

/// Adds the counts of a group.
void AppendFigures(const RunSummary& summary, RunFigure::Group group, Json& json) {
  ForEachRow(kRunFigures, [&](const auto& row) {
    if (row.field.group == group) json[row.field.key] = row.value(summary);
  });
}

Json SensorJson(const LoopStatistics& s) {
  Json json = {
      {"status", ToString(s.sensor)}, {"feedback_ticks", s.feedback_ticks}, {"get_ups", s.get_ups}};
  Json& ticks = json["ticks"];
  for (std::size_t i = 0; i < kSensorStatusCount; ++i) {
    if (s.sensor_ticks[i] != 0) ticks[ToString(static_cast<SensorStatus>(i))] = s.sensor_ticks[i];
  }
  return json;
}

}  // namespace

std::string ToJson(const RunSummary& summary) {
  const LoopStatistics& s = summary.statistics;
  Json json;
  json["outcome"] = ToString(summary.outcome);
  json["exit_code"] = static_cast<int>(StatusOf(summary));
  json["reason"] = summary.reason;
  json["bus"] = summary.bus;
  json["primitive"] = summary.primitive;
  json["speed"] = summary.speed;
  json["rate_hz"] = summary.rate_hz;
  json["dry_run"] = summary.dry_run;
  if (summary.simulated || !summary.passages.empty()) {
    // Nothing is known of a last motion that was broken off, or never began.
    const bool ended = !summary.passages.empty() && summary.broken_off.empty();
    const Passage last = ended ? summary.passages.back() : Passage();
    json["as_asked"] = Maybe(AsAsked(summary));
    json["purpose_met"] = Maybe(last.purpose_met());
    json["as_planned_2_s_later"] = Maybe(last.as_planned());
    if (SpeaksOfPitch(last)) {
      json["root_pitch_planned_rad"] = last.expected_pitch_rad;
      json["root_pitch_at_end_rad"] = last.pitch_at_end_rad;
      json["root_pitch_2_s_later_rad"] = Maybe(last.pitch_later_rad);
    }
    json["broken_off"] = summary.broken_off.empty() ? Json() : Json(summary.broken_off);
    json["cycles"] = summary.cycles;
    json["motions"] = MotionsOf(summary);
    json["passages"] = Json::Array();
    for (const Passage& passage : summary.passages) json["passages"].Append(JsonOf(passage));
  }
  if (summary.simulated) {
    const auto list = [&json](const char* key, const std::vector<Mishap>& mishaps) {
      json[key] = Json::Array();
      for (const Mishap& mishap : mishaps)
        json[key].Append({{"time_s", mishap.time_s}, {"what", mishap.what}});
    };
    list("falls", summary.falls);
    json["after_torque_off"] = summary.after_torque_off;
    list("overlaps", summary.overlaps);
  }
  json["joints"] = Json::Array();
  for (std::size_t i = 0; i < summary.joints.size(); ++i) {
    const JointFigures figures = FiguresOf(summary, i);
    json["joints"].Append({{"name", summary.joints[i]},
                           {"peak_torque_nm", figures.peak_torque_nm},
                           {"following_error_max_rad", figures.following_error_max_rad}});
  }
  AppendFigures(summary, RunFigure::Group::kTicks, json);
  if (s.sensor != SensorStatus::kNone) json["sensor"] = SensorJson(s);
  json["timing"] = TimingJson(s, summary.machine,
                              summary.realtime ? summary.realtime->scheduling : "time-shared");
  if (summary.attended) json["runs"] = summary.runs;
  json["realtime_in_force"] = summary.realtime && summary.realtime->in_force();
  AppendFigures(summary, RunFigure::Group::kFrames, json);
  json["worst_case_bits_per_tick"] = summary.worst_case_tick_bits;
  json["worst_case_bus_load"] = summary.worst_case_load;
  json["measured_bus_load"] = Maybe(summary.measured_load);
  if (summary.interface) json["interface"] = JsonOf(*summary.interface);
  AppendFigures(summary, RunFigure::Group::kOutputs, json);
  json["record_problem"] = summary.record_problem;
  json["files"] = summary.files;
  json["unwritten"] = summary.unwritten;
  return json.Dump(2) + '\n';
}

std::optional<bool> AsAsked(const RunSummary& summary) {
  const auto any = [&summary](bool (Passage::*is)() const) {
    return std::any_of(summary.passages.begin(), summary.passages.end(), std::mem_fn(is));
  };
  if (summary.outcome != RunOutcome::kCompleted || Fell(summary) || !summary.overlaps.empty() ||
      any(&Passage::amiss)) {
    return false;
  }
  // One that was not judged is left out only where others like it are kept.
  if (summary.passages.empty() || any(&Passage::unjudged)) return std::nullopt;
  return true;
}

namespace {

/// Whether the robot was not as asked, or something was asked of it that nobody judged.
bool NotFoundAsAsked(const Passage& passage) {
  return passage.amiss() || (passage.unjudged() && !passage.purpose.empty());
}

}  // namespace

ExitStatus StatusOf(const RunSummary& summary) {
  switch (summary.outcome) {
    case RunOutcome::kCompleted:
      return Fell(summary) || !summary.overlaps.empty() || !summary.unwritten.empty() ||
                     !summary.record_problem.empty() ||
                     std::any_of(summary.passages.begin(), summary.passages.end(), NotFoundAsAsked)
                 ? ExitStatus::kAmiss
                 : ExitStatus::kDone;
    case RunOutcome::kRefused:
      return ExitStatus::kRefused;
    case RunOutcome::kPending:
    case RunOutcome::kFault:
      return ExitStatus::kFault;
    case RunOutcome::kStopped:
      return ExitStatus::kInterrupted;
  }
  return ExitStatus::kFault;
}

}  // namespace tumbler
