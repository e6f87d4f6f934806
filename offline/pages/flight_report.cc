#include "offline/pages/flight_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <stdexcept>

#include "offline/pages/report_checks.h"
#include "offline/pages/report_page.h"

namespace tumbler {
namespace {

/// Bins in a decade of the logarithmic axis of durations, which begins at 1 us.
constexpr int kBinsPerDecade = 20;

/// The double whose shortest text reads back as this float; null for NaN and infinities.
Json Number(float value) {
  if (!std::isfinite(value)) return nullptr;
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  double number = 0;
  std::from_chars(text.data(), end, number);
  return number;
}

Json Number(const std::optional<double>& value) {
  return value ? Number(static_cast<float>(*value)) : Json(nullptr);
}

/// The indices of the ticks that the page shows, in order.
std::vector<std::size_t> ShownTicks(const RunData& run, const FlightReportOptions& options) {
  const auto tick_at = [&run](double time_s) {
    const auto before = [](const RunTick& tick, double t) { return tick.time_s < t; };
    return static_cast<std::size_t>(
        std::lower_bound(run.ticks.begin(), run.ticks.end(), time_s, before) - run.ticks.begin());
  };
  const std::size_t from = tick_at(options.from_s);
  std::size_t count = tick_at(options.to_s);
  if (count < run.ticks.size() && options.Shows(run.ticks[count].time_s)) ++count;
  const std::size_t step =
      std::max<std::size_t>(1, (count - from + options.ticks_max - 1) / options.ticks_max);
  std::set<std::size_t> shown;
  for (std::size_t begin = from; begin < count; begin += step) {
    shown.insert(begin);
    const std::size_t end = std::min(begin + step, count);
    for (std::size_t j = 0; j < run.joint_count(); ++j) {
      std::size_t worst = begin, oldest = begin;
      for (std::size_t i = begin; i < end; ++i) {
        const auto error = [&run, j](std::size_t k) {
          return std::abs(run.FollowingError(k, j).value_or(0));
        };
        if (error(i) > error(worst)) worst = i;
        if (run.joint(i, j).reply_age_ticks > run.joint(oldest, j).reply_age_ticks) oldest = i;
      }
      shown.insert({worst, oldest});
    }
  }
  for (std::size_t i = from + 1; i < count; ++i) {
    if (run.ticks[i].state == run.ticks[i - 1].state) continue;
    shown.insert({i - 1, i});
  }
  if (count > from) shown.insert(count - 1);
  return {shown.begin(), shown.end()};
}

using Read = float (*)(const JointRecord&);

Json TicksToJson(const RunData& run, const std::vector<std::size_t>& shown) {
  Json json = {{"times_s", Json::Array()}, {"states", Json::Array()}, {"joints", Json::Array()}};
  for (const std::size_t i : shown) {
    json["times_s"].Append(run.ticks[i].time_s);
    json["states"].Append(ToString(run.ticks[i].state));
  }
  for (std::size_t j = 0; j < run.joint_count(); ++j) {
    // With the torque off nothing is planned or commanded, although the record carries setpoints.
    const auto column = [&](Read read) {
      Json values = Json::Array();
      for (const std::size_t i : shown) {
        const bool off = run.ticks[i].state == ExecutorState::kDisarmed;
        values.Append(off ? Json(nullptr) : Number(read(run.joint(i, j))));
      }
      return values;
    };
    // Nothing was measured before the first reply.
    const auto measured = [&](Read read) {
      Json values = Json::Array();
      for (const std::size_t i : shown) {
        const JointRecord& joint = run.joint(i, j);
        values.Append(joint.reply_age_ticks < 0 ? Json(nullptr) : Number(read(joint)));
      }
      return values;
    };
    Json joint;
    joint["plan"] = {
        {"position_rad", column([](const auto& r) { return r.planned.position_rad; })},
        {"velocity_rad_s", column([](const auto& r) { return r.planned.velocity_rad_s; })},
        {"torque_nm", column([](const auto& r) { return r.planned.torque_nm; })}};
    joint["command"] = {
        {"position_rad", column([](const auto& r) { return r.encoded.position_rad; })},
        {"velocity_rad_s", column([](const auto& r) { return r.encoded.velocity_rad_s; })},
        {"torque_nm", column([](const auto& r) { return r.encoded.torque_nm; })}};
    joint["measured"] = {
        {"position_rad", measured([](const auto& r) { return r.measured.position_rad; })},
        {"velocity_rad_s", measured([](const auto& r) { return r.measured.velocity_rad_s; })},
        {"torque_nm", measured([](const auto& r) { return r.measured.torque_nm; })}};
    joint["following_error_rad"] = Json::Array();
    joint["reply_age_ticks"] = Json::Array();
    for (const std::size_t i : shown) {
      joint["following_error_rad"].Append(Number(run.FollowingError(i, j)));
      const std::int32_t age = run.joint(i, j).reply_age_ticks;
      joint["reply_age_ticks"].Append(age < 0 ? Json(nullptr) : Json(age));
    }
    json["joints"].Append(joint);
  }
  return json;
}

/// A robot's motion in the form that the page's scripts draw.
Json RobotToJson(const RunData& run, const std::vector<ReportSample>& all,
                 const FlightReportOptions& options) {
  std::vector<ReportSample> samples;
  std::copy_if(all.begin(), all.end(), std::back_inserter(samples),
               [&options](const ReportSample& sample) { return options.Shows(sample.time_s); });
  if (samples.size() < 2) return nullptr;
  const std::size_t step = (samples.size() + options.ticks_max - 1) / options.ticks_max;
  std::vector<ReportSample> shown;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (i % step == 0 || i + 1 == samples.size()) shown.push_back(samples[i]);
  }
  for (std::size_t i = 0; i < shown.size(); ++i) CheckSample(run.scene, shown, i);
  const auto rounded = [](double value) { return Number(static_cast<float>(value)); };
  Json json = {{"times_s", Json::Array()},
               {"root_pitch_rad", Json::Array()},
               {"links", Json::Array()},
               {"joints", Json::Array()}};
  for (const ReportSample& sample : shown) {
    json["times_s"].Append(sample.time_s);
    json["root_pitch_rad"].Append(rounded(sample.root_pitch_rad));
  }
  for (std::size_t k = 0; k < run.scene.links.size(); ++k) {
    Json path = LinkPath(shown, k);
    for (const char* const name : {"x_m", "z_m", "pitch_rad"}) {
      Json& column = path[name];
      for (std::size_t i = 0; i < column.size(); ++i) column[i] = rounded(column[i].number());
    }
    json["links"].Append(path);
  }
  for (std::size_t j = 0; j < run.joint_count(); ++j) {
    Json position = Json::Array(), velocity = Json::Array(), torque = Json::Array();
    for (const ReportSample& sample : shown) {
      position.Append(rounded(sample.joint_positions_rad[j]));
      velocity.Append(rounded(sample.joint_velocities_rad_s[j]));
      torque.Append(rounded(sample.joint_torques_nm[j]));
    }
    json["joints"].Append(
        {{"position_rad", position}, {"velocity_rad_s", velocity}, {"torque_nm", torque}});
  }
  for (std::size_t i = 0; i < run.passive_names.size(); ++i) {
    // A truth that was made before there were such joints in it does not tell.
    const auto tells = [](const ReportSample& s) { return !s.passive_positions_rad.empty(); };
    if (!std::ranges::all_of(shown, tells)) break;
    Json position = Json::Array();
    for (const ReportSample& sample : shown)
      position.Append(rounded(sample.passive_positions_rad[i]));
    json["passive"].Append({{"name", run.passive_names[i]}, {"position_rad", position}});
  }
  return json;
}

/// Counts of latencies on a logarithmic axis. Bin b begins at 10^(b / 20) us, and bin 0 also has
/// the latencies below 1 us.
Json LatencyToJson(const RunLatency& latency) {
  std::map<int, std::int64_t> bins;
  for (const std::int64_t value_ns : latency.values_ns) {
    const double us = static_cast<double>(std::max<std::int64_t>(value_ns, 1)) / 1000;
    ++bins[std::max(0, static_cast<int>(std::floor(kBinsPerDecade * std::log10(us) + 1e-9)))];
  }
  Json json = {{"name", latency.name},
               {"meaning", latency.meaning},
               {"count", latency.values_ns.size()},
               {"bins_per_decade", kBinsPerDecade},
               {"bins", Json::Array()},
               {"percentiles_us", Json::Array()}};
  for (const auto& [bin, count] : bins) json["bins"].Append({bin, count});
  for (const auto& [name, share] : {std::pair("p50", 0.5), std::pair("p99", 0.99),
                                    std::pair("p99.9", 0.999), std::pair("max", 1.0)}) {
    json["percentiles_us"].Append({name, static_cast<double>(latency.PercentileNs(share)) / 1000});
  }
  return json;
}

Json RunToJson(const RunData& run, const FlightReportOptions& options) {
  Json json = {{"name", run.name},
               {"recorded", run.recorded},
               {"period_s", run.period_s},
               {"facts", Json::Array()},
               {"ticks", nullptr},
               {"plan", RobotToJson(run, run.plan, options)},
               {"truth", RobotToJson(run, run.truth, options)},
               {"bands", Json::Array()},
               {"events", Json::Array()},
               {"latencies", Json::Array()}};
  for (const auto& [name, value] : run.facts) json["facts"].Append({name, value});
  const std::vector<std::size_t> shown = ShownTicks(run, options);
  if (run.recorded && shown.size() < 2) {
    throw std::runtime_error(fmt::format(
        "{}: has {} ticks from {} s to {} s; it goes from {:.3f} s to {:.3f} s, where 0 "
        "is the beginning of its motion",
        run.name, shown.size(), options.from_s, options.to_s, run.ticks.front().time_s,
        run.ticks.back().time_s));
  }
  if (run.recorded) json["ticks"] = TicksToJson(run, shown);
  if (!run.recorded && json["plan"].is_null()) {
    throw std::runtime_error(
        fmt::format("{}: has nothing from {} s to {} s", run.name, options.from_s, options.to_s));
  }
  json["tick_count"] = run.ticks.size();
  for (const RunBand& band : run.bands) {
    if (band.to_s < options.from_s || band.from_s > options.to_s) continue;
    json["bands"].Append(
        {{"from_s", band.from_s}, {"to_s", band.to_s}, {"node", band.node}, {"name", band.name}});
  }
  for (const RunEvent& event : run.events) {
    if (!options.Shows(event.time_s)) continue;
    json["events"].Append(
        {{"time_s", event.time_s}, {"kind", ToString(event.kind)}, {"text", event.text}});
  }
  for (const RunLatency& latency : run.latencies) {
    if (!latency.values_ns.empty()) json["latencies"].Append(LatencyToJson(latency));
  }
  return json;
}

void RequireSameRobot(const std::vector<RunData>& runs) {
  for (const RunData& run : runs) {
    if (run.robot_hash != runs.front().robot_hash ||
        run.scene.joint_names != runs.front().scene.joint_names) {
      throw std::runtime_error(fmt::format(
          "{}: is of another robot than {}; a page shows one robot", run.name, runs.front().name));
    }
  }
}

}  // namespace

Json FlightReportJson(const std::vector<RunData>& runs, const FlightReportOptions& options) {
  if (runs.empty()) throw std::invalid_argument("report: runs: is empty, must have at least one");
  RequireSameRobot(runs);
  Json json = {{"scene", SceneToJson(runs.front().scene)},
               {"runs", Json::Array()},
               {"differences", Json::Array()}};
  for (const RunData& run : runs) json["runs"].Append(RunToJson(run, options));
  for (std::size_t k = 1; k < runs.size(); ++k) {
    for (const RunDifference& difference : Compare(runs.front(), runs[k])) {
      json["differences"].Append({{"run", k},
                                  {"joint", difference.joint},
                                  {"quantity", difference.quantity},
                                  {"unit", difference.unit},
                                  {"ticks", difference.ticks},
                                  {"max", difference.max},
                                  {"max_at_s", difference.max_at_s},
                                  {"rms", difference.rms}});
    }
  }
  return json;
}

std::string WriteFlightReport(const std::vector<RunData>& runs, const std::string& directory,
                              const FlightReportOptions& options) {
  const Json json = FlightReportJson(runs, options);
  std::string title;
  for (const RunData& run : runs) title += (title.empty() ? "" : ", ") + run.name;
  return WritePage(FillPage(FlightReportPage(), title + " - run report", json), directory);
}

}  // namespace tumbler
