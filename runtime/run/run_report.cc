#include "runtime/run/run_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
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

using Json = nlohmann::ordered_json;

double Microseconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-3; }

constexpr std::array<double, 4> kShares{0.5, 0.99, 0.999, 0.9999};

std::array<std::pair<const char*, const DurationHistogram*>, 3> Durations(
    const LoopStatistics& statistics) {
  return {{{"wake-up", &statistics.wake_up},
           {"tick", &statistics.tick},
           {"frame age", &statistics.frame_age}}};
}

/// Measurements of two ticks and more.
std::int64_t Older(const ReplyAgeHistogram& age) {
  std::int64_t older = 0;
  for (std::size_t i = 2; i <= ReplyAgeHistogram::kBins; ++i) older += age.count(i);
  return older;
}

}  // namespace

std::optional<bool> PassageReport::standing() const {
  if (!pitch_later_rad || !pitch_rate_later_rad_s) return std::nullopt;
  return std::abs(*pitch_later_rad - expected_pitch_rad) <= tolerance_rad &&
         std::abs(*pitch_rate_later_rad_s) <= kRateTolerance_rad_s;
}

namespace {

void AppendPassages(const RunReport& report, std::string& text) {
  if (report.passages.empty()) return;
  if (report.passages.size() > 1) {
    const auto missed = std::count_if(
        report.passages.begin(), report.passages.end(),
        [](const PassageReport& passage) { return !passage.standing().value_or(true); });
    text +=
        fmt::format("  {} motions, {} complete cycles; {}\n", report.passages.size(), report.cycles,
                    missed == 0 ? "the robot where it should be after each"
                                : fmt::format("NOT where it should be after {}", missed));
  }
  const PassageReport& last = report.passages.back();
  text += report.passages.size() > 1 ? fmt::format("  last, {}: ", last.node) : std::string("  ");
  text += fmt::format("root pitch: {:.4f} rad at the end", last.pitch_at_end_rad);
  if (last.pitch_later_rad) {
    text += fmt::format(", {:.4f} rad {:.0f} s later (planned {:.4f}): {}", *last.pitch_later_rad,
                        PassageReport::kLater_s, last.expected_pitch_rad,
                        *last.standing() ? "still standing" : "NOT where it should be");
  }
  text += '\n';
}

}  // namespace

namespace {

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
    entry["histogram_us_count"] = Json::array();  // [lower end of a bin of 1 us, how many]
    for (std::size_t bin = 0; bin < durations->bins().size(); ++bin) {
      if (durations->bins()[bin] > 0)
        entry["histogram_us_count"].push_back({bin, durations->bins()[bin]});
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
  return json.dump(2) + '\n';
}

std::string ToText(const RunReport& report) {
  const LoopStatistics& s = report.statistics;
  std::string text = fmt::format("{}: {} on {}{}, speed {:.3g}, {:.6g} Hz\n",
                                 ToString(report.outcome), report.primitive, report.bus,
                                 report.dry_run ? " (dry run)" : "", report.speed, report.rate_hz);
  if (report.attended) text += fmt::format("  {} runs\n", report.runs);
  if (!report.reason.empty()) text += fmt::format("  {}\n", report.reason);
  AppendPassages(report, text);
  for (const FallReport& fall : report.falls)
    text += fmt::format("  at {:.3f} s the robot {}\n", fall.time_s, fall.what);
  for (std::size_t i = 0; i < report.joints.size(); ++i) {
    text += fmt::format("  {}: peak torque {:.3f} N m, following error at most {:.4f} rad\n",
                        report.joints[i], s.peak_torque_nm[i], s.following_error_max_rad[i]);
  }
  text += fmt::format("  ticks: {} ({} running), {} missed, {} late, {} with a limit active\n",
                      s.ticks, s.run_ticks, s.missed_ticks, s.late_ticks, s.limited_ticks);
  if (!report.simulated || report.realtime) {
    text += DescribeTiming(s, report.machine,
                           report.realtime ? report.realtime->scheduling : "time-shared");
  }
  if (report.realtime && !report.realtime->in_force())
    text += fmt::format("  NOT in real time: {}\n", report.realtime->problems);
  text += fmt::format(
      "  bus: {} frames sent, {} received, {} not sent; worst case {} bits a tick, {:.1f} %",
      s.frames_sent, s.frames_received, s.send_failures, report.worst_case_tick_bits,
      100 * report.worst_case_load);
  if (report.measured_load) text += fmt::format("; measured {:.1f} %", 100 * *report.measured_load);
  if (report.interface) {
    const SocketCanStatistics& i = report.interface->statistics;
    text += fmt::format(
        "\n  interface: {} frames confirmed, the slowest after {:.0f} us, {} discarded, {} stalls; "
        "{} received frames lost, {} commands of others; {}, {} error frames, {} unacknowledged, "
        "{} times bus-off",
        i.confirmed, Microseconds(i.confirm_time_max_ns), i.discarded, i.stalls, i.dropped,
        i.foreign_commands, ToString(report.interface->controller), i.error_frames,
        i.unacknowledged, i.bus_offs);
    if (report.interface->in_flight > 0) {
      text += fmt::format(
          "\n  WARNING: {} frames wait for the bus to come back; discard them before the motors "
          "have power: ip link set {} down; ip link set {} up",
          report.interface->in_flight, report.bus, report.bus);
    }
  }
  text += fmt::format("\n  telemetry: {} records lost, {} messages not published\n",
                      report.lost_records, report.unpublished_messages);
  if (report.recorded_ticks + report.unrecorded_ticks > 0) {
    text += fmt::format("  flight record: {} ticks, {} not recorded{}{}\n", report.recorded_ticks,
                        report.unrecorded_ticks, report.record_problem.empty() ? "" : ": ",
                        report.record_problem);
  }
  for (const std::string& file : report.files) text += fmt::format("  wrote {}\n", file);
  return text;
}

std::string ToJson(const RunReport& report) {
  const LoopStatistics& s = report.statistics;
  Json json;
  json["outcome"] = ToString(report.outcome);
  json["exit_code"] = ExitCode(report);
  json["reason"] = report.reason;
  json["bus"] = report.bus;
  json["primitive"] = report.primitive;
  json["speed"] = report.speed;
  json["rate_hz"] = report.rate_hz;
  json["dry_run"] = report.dry_run;
  const auto maybe = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json(nullptr);
  };
  if (!report.passages.empty()) {
    const PassageReport& last = report.passages.back();
    const std::optional<bool> stands = last.standing();
    json["root_pitch_planned_rad"] = last.expected_pitch_rad;
    json["root_pitch_at_end_rad"] = last.pitch_at_end_rad;
    json["root_pitch_2_s_later_rad"] = maybe(last.pitch_later_rad);
    json["standing_2_s_later"] = stands ? Json(*stands) : Json(nullptr);
    json["cycles"] = report.cycles;
    json["passages"] = Json::array();
    for (const PassageReport& passage : report.passages) {
      json["passages"].push_back(
          {{"node", passage.node},
           {"root_pitch_planned_rad", passage.expected_pitch_rad},
           {"root_pitch_at_end_rad", passage.pitch_at_end_rad},
           {"root_pitch_later_rad", maybe(passage.pitch_later_rad)},
           {"root_pitch_rate_later_rad_s", maybe(passage.pitch_rate_later_rad_s)}});
    }
  }
  if (report.simulated) {
    json["falls"] = Json::array();
    for (const FallReport& fall : report.falls)
      json["falls"].push_back({{"time_s", fall.time_s}, {"what", fall.what}});
  }
  json["joints"] = Json::array();
  for (std::size_t i = 0; i < report.joints.size(); ++i) {
    json["joints"].push_back({{"name", report.joints[i]},
                              {"peak_torque_nm", s.peak_torque_nm[i]},
                              {"following_error_max_rad", s.following_error_max_rad[i]}});
  }
  json["ticks"] = s.ticks;
  json["running_ticks"] = s.run_ticks;
  json["missed_ticks"] = s.missed_ticks;
  json["late_ticks"] = s.late_ticks;
  json["limited_ticks"] = s.limited_ticks;
  json["timing"] =
      TimingJson(s, report.machine, report.realtime ? report.realtime->scheduling : "time-shared");
  if (report.attended) json["runs"] = report.runs;
  json["realtime_in_force"] = report.realtime && report.realtime->in_force();
  json["frames_sent"] = s.frames_sent;
  json["frames_received"] = s.frames_received;
  json["send_failures"] = s.send_failures;
  json["worst_case_bits_per_tick"] = report.worst_case_tick_bits;
  json["worst_case_bus_load"] = report.worst_case_load;
  json["measured_bus_load"] = maybe(report.measured_load);
  if (report.interface) {
    const SocketCanStatistics& i = report.interface->statistics;
    json["interface"] = {{"frames_confirmed", i.confirmed},
                         {"confirm_max_us", Microseconds(i.confirm_time_max_ns)},
                         {"frames_discarded", i.discarded},
                         {"frames_in_flight", report.interface->in_flight},
                         {"stalls", i.stalls},
                         {"received_frames_lost", i.dropped},
                         {"commands_of_others", i.foreign_commands},
                         {"controller_state", ToString(report.interface->controller)},
                         {"error_frames", i.error_frames},
                         {"unacknowledged", i.unacknowledged},
                         {"bus_offs", i.bus_offs}};
  }
  json["lost_records"] = report.lost_records;
  json["unpublished_messages"] = report.unpublished_messages;
  json["recorded_ticks"] = report.recorded_ticks;
  json["unrecorded_ticks"] = report.unrecorded_ticks;
  json["record_problem"] = report.record_problem;
  json["files"] = report.files;
  return json.dump(2) + '\n';
}

int ExitCode(const RunReport& report) {
  switch (report.outcome) {
    case RunOutcome::kCompleted:
      return !report.falls.empty() || std::any_of(report.passages.begin(), report.passages.end(),
                                                  [](const PassageReport& p) {
                                                    return !p.standing().value_or(true);
                                                  })
                 ? 4
                 : 0;
    case RunOutcome::kRefused:
      return 2;
    case RunOutcome::kPending:
    case RunOutcome::kFault:
      return 3;
    case RunOutcome::kStopped:
      return 130;
  }
  return 3;
}

}  // namespace tumbler
