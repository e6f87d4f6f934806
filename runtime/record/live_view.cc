#include "runtime/record/live_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <string_view>
#include <type_traits>

#include "common/files/json.h"
#include "common/files/printable.h"
#include "firmware_interface/devices/drive.h"
#include "firmware_interface/devices/error_texts.h"
#include "runtime/executor/faults.h"
#include "runtime/executor/joint_fields.h"
#include "runtime/executor/sensor_watch.h"
#include "runtime/record/sentences.h"

namespace tumbler {
namespace {

/// Columns of the table with all figures of a joint.
constexpr int kWideTable = 92;

constexpr double kDegrees = 57.29577951308232;

const char* DriveStateName(std::int8_t state) {
  constexpr std::array<const char*, 6> kNames{"unknown", "disabled", "enabling",
                                              "enabled", "fault",    "lost"};
  const auto index = static_cast<std::size_t>(state);
  return index < kNames.size() ? kNames[index] : "?";
}

const char* SensorStatusName(const state_t& state) {
  const auto index = static_cast<std::size_t>(state.sensor_status);
  return index < kSensorStatusCount ? ToString(static_cast<SensorStatus>(index)) : "?";
}

/// Whether anything that the joint's drive said is known. Before, its fields are 0 and mean
/// nothing.
bool HasReplied(const joint_state_t& joint) { return joint.reply_age_ticks >= 0; }

/// Likewise of the sensor.
bool HasReported(const state_t& state) { return state.sensor_age_ticks >= 0; }

FaultDetail FirstFault(const state_t& state) {
  FaultDetail fault;
  fault.fault = static_cast<Fault>(state.fault);
  fault.joint = state.fault_joint;
  fault.tick = state.fault_tick;
  fault.value = FromDouble(state.fault_value, UnitOf(fault.fault));
  fault.limit = FromDouble(state.fault_limit, UnitOf(fault.fault));
  fault.state = static_cast<ExecutorState>(state.fault_state);
  fault.reaction = static_cast<Reaction>(state.reaction);
  return fault;
}

}  // namespace

void LiveView::Take(const state_t& state) {
  if (state_ && state.number > state_->number) lost_ += state.number - state_->number - 1;
  if (state_ && state.number < state_->number) lost_ = 0;  // Another run has begun.
  state_ = state;
}

void LiveView::Take(const event_t& event) {
  events_.push_back(event);
  event_t& last = events_.back();
  for (std::string* text : {&last.from_state, &last.to_state, &last.text})
    *text = PrintableInLine(*text);
  if (events_.size() > kEvents) events_.pop_front();
}

void LiveView::Take(const run_t& run) {
  run_ = run;
  for (std::string* text : {&run_->motion, &run_->bus, &run_->mode, &run_->version, &run_->kernel,
                            &run_->cpu, &run_->adapter, &run_->scheduling})
    *text = PrintableInLine(*text);
  for (std::vector<std::string>* names : {&run_->joints, &run_->nodes}) {
    for (std::string& name : *names) name = PrintableInLine(name);
  }
}

std::string LiveView::JointName(std::size_t joint) const {
  return run_ && joint < run_->joints.size() ? run_->joints[joint] : fmt::format("joint {}", joint);
}

std::string LiveView::ErrorText(std::size_t joint) const {
  const bool named = run_ && joint < run_->error_codes.size();
  return DescribeDriveError(named ? run_->error_codes[joint] : "",
                            static_cast<std::uint32_t>(state_->joints[joint].drive_error));
}

std::string LiveView::NodeName() const {
  const auto node = static_cast<std::size_t>(state_->node);
  return run_ && node < run_->nodes.size() ? run_->nodes[node] : fmt::format("node {}", node);
}

std::string LiveView::FaultText() const {
  if (state_->faults == 0) return "none";
  // Messages have the reaction that is being carried out. Once it is over, there is none.
  const bool reacts = static_cast<ExecutorState>(state_->state) == ExecutorState::kFault;
  std::vector<std::string> joints, error_codes;
  if (run_) joints = run_->joints, error_codes = run_->error_codes;
  const FaultDetail fault = FirstFault(*state_);
  return reacts ? Describe(fault, joints, error_codes) : DescribeFault(fault, joints, error_codes);
}

std::string LiveView::SensorText() const {
  if (!HasReported(*state_)) return SensorStatusName(*state_);
  return fmt::format("{}, {:.4f} rad, {:.3f} rad/s, feedback {:.0f} %", SensorStatusName(*state_),
                     state_->sensor_pitch_rad, state_->sensor_rate_rad_s,
                     100 * static_cast<double>(state_->feedback_share));
}

std::string LiveView::Line() const {
  if (!state_) return "nothing received";
  std::string text = fmt::format("{:.3f} s, {}, {} at {:.3f} s, cycle {}",
                                 static_cast<double>(state_->time_ns) * 1e-9,
                                 ToString(static_cast<ExecutorState>(state_->state)), NodeName(),
                                 state_->primitive_time_s, state_->cycles);
  for (std::size_t i = 0; i < state_->joints.size(); ++i) {
    const joint_state_t& joint = state_->joints[i];
    if (!HasReplied(joint)) {
      text += fmt::format("; {} has not replied yet", JointName(i));
      continue;
    }
    text += fmt::format("; {} {:.4f} rad, {}, {}", JointName(i), joint.measured_position_rad,
                        std::isnan(joint.measured_torque_nm)
                            ? "torque not measured"
                            : fmt::format("{:.2f} N m", joint.measured_torque_nm),
                        DriveStateName(joint.drive_state));
  }
  if (state_->sensor_status != 0) text += fmt::format("; sensor {}", SensorText());
  return text + fmt::format("; faults: {}", FaultText());
}

std::string LiveView::JointTable(bool narrow) const {
  const state_t& s = *state_;
  std::string text;
  if (narrow) {
    text = fmt::format("{:10} {:>8} {:>9} {:>7} {:>9}\n", "joint", "measured", "error", "N m",
                       "drive");
    for (std::size_t i = 0; i < s.joints.size(); ++i) {
      const joint_state_t& j = s.joints[i];
      if (!HasReplied(j)) {
        text += fmt::format("{:10.10} {:>8} {:>9} {:>7} {:>9}\n", JointName(i), "-", "-", "-",
                            DriveStateName(j.drive_state));
        continue;
      }
      text += fmt::format(
          "{:10.10} {:7.1f}\u00b0 {:8.2f}\u00b0 {:>7} {:>9}\n", JointName(i),
          kDegrees * static_cast<double>(j.measured_position_rad),
          kDegrees * static_cast<double>(j.measured_position_rad - j.limited_position_rad),
          std::isnan(j.measured_torque_nm) ? "none" : fmt::format("{:.2f}", j.measured_torque_nm),
          DriveStateName(j.drive_state));
    }
    return text;
  }
  text += fmt::format("{:12} {:>10} {:>10} {:>9} {:>9} {:>8} {:>7} {:>6} {:>9}\n", "joint",
                      "setpoint", "measured", "error", "rad/s", "N m", "deg C", "age", "drive");
  for (std::size_t i = 0; i < s.joints.size(); ++i) {
    const joint_state_t& j = s.joints[i];
    if (!HasReplied(j)) {
      text += fmt::format("{:12.12} {:8.2f}\u00b0  {:>8}   {:>7}   {:>9} {:>8} {:>7} {:>6} {:>9}\n",
                          JointName(i), kDegrees * static_cast<double>(j.limited_position_rad), "-",
                          "-", "-", "-", "-", "never", DriveStateName(j.drive_state));
      continue;
    }
    text += fmt::format(
        "{:12.12} {:8.2f}\u00b0  {:8.2f}\u00b0  {:7.2f}\u00b0  {:9.3f} {:>8} {:7.1f} {:>6} "
        "{:>9}{}\n",
        JointName(i), kDegrees * static_cast<double>(j.limited_position_rad),
        kDegrees * static_cast<double>(j.measured_position_rad),
        kDegrees * static_cast<double>(j.measured_position_rad - j.limited_position_rad),
        j.measured_velocity_rad_s,
        std::isnan(j.measured_torque_nm) ? "none" : fmt::format("{:.3f}", j.measured_torque_nm),
        j.temperature_c, j.reply_age_ticks, DriveStateName(j.drive_state),
        j.drive_error != 0 ? " error " + ErrorText(i) : "");
  }
  return text;
}

std::string LiveView::Screen(int columns) const {
  if (!state_) return "nothing received\n";
  const state_t& s = *state_;
  std::string text;
  if (run_) {
    text += fmt::format("{} on {} ({}{}), {:.6g} Hz, speed {:.3g}; tumbler {}\n", run_->motion,
                        run_->bus, run_->mode, run_->attended ? ", attended" : "", run_->rate_hz,
                        run_->speed, run_->version);
  }
  text += fmt::format("state   {:16} {} at {:.3f} s, {} cycles, tick {}, {:.3f} s\n",
                      ToString(static_cast<ExecutorState>(s.state)), NodeName(), s.primitive_time_s,
                      s.cycles, s.tick, static_cast<double>(s.time_ns) * 1e-9);
  if (s.sensor_status != 0) text += fmt::format("sensor  {}\n", SensorText());
  text += fmt::format("faults  {}\n\n", FaultText());
  text += JointTable(columns < kWideTable);
  if (run_) {
    const auto bars = static_cast<std::size_t>(
        std::clamp(std::lround(20 * static_cast<double>(run_->bus_load)), 0L, 20L));
    text += fmt::format("\nbus     [{:20}] {:.1f} % at most; measurements at most {} ticks old\n",
                        std::string(bars, '#'), 100 * static_cast<double>(run_->bus_load),
                        run_->reply_age_max_ticks);
    text += fmt::format(
        "wake-up p50 {:.0f}, p99 {:.0f}, p99.9 {:.0f}, p99.99 {:.0f}, max {:.0f} us; now {:.0f}\n",
        run_->wake_up_p50_us, run_->wake_up_p99_us, run_->wake_up_p99_9_us, run_->wake_up_p99_99_us,
        run_->wake_up_max_us, s.wake_up_us);
    text += fmt::format(
        "tick    p50 {:.0f}, p99 {:.0f}, p99.9 {:.0f}, p99.99 {:.0f}, max {:.0f} us; now {:.0f}\n",
        run_->tick_p50_us, run_->tick_p99_us, run_->tick_p99_9_us, run_->tick_p99_99_us,
        run_->tick_max_us, s.tick_us);
    text += fmt::format(
        "ticks   {}, {} late, {} missed; not recorded {}, not published {}, not received {}\n",
        run_->ticks, run_->late_ticks, run_->missed_ticks, run_->lost_records, run_->unpublished,
        lost_);
    text += fmt::format("machine {}\n        {}; adapter {}\n        {}\n", run_->kernel, run_->cpu,
                        run_->adapter, run_->scheduling);
  }
  if (!events_.empty()) text += '\n';
  for (const event_t& event : events_) {
    text +=
        fmt::format("{:10.3f} s  {} -> {}{}{}\n", static_cast<double>(event.time_ns) * 1e-9,
                    event.from_state, event.to_state, event.text.empty() ? "" : ": ", event.text);
  }
  return text;
}

std::string LiveView::ToJson() const { return Value().Dump(2) + '\n'; }

Json LiveView::Value() const {
  Json json;
  if (!state_) return json;
  const state_t& s = *state_;
  if (run_) {
    json["motion"] = run_->motion;
    json["bus"] = run_->bus;
    json["mode"] = run_->mode;
    json["attended"] = run_->attended != 0;
    json["rate_hz"] = run_->rate_hz;
    json["bus_load_max"] = run_->bus_load;
    json["wake_up_p99_9_us"] = run_->wake_up_p99_9_us;
    json["wake_up_max_us"] = run_->wake_up_max_us;
    json["tick_max_us"] = run_->tick_max_us;
    json["missed_ticks"] = run_->missed_ticks;
    json["lost_records"] = run_->lost_records;
  }
  json["state"] = ToString(static_cast<ExecutorState>(s.state));
  json["tick"] = s.tick;
  json["time_s"] = static_cast<double>(s.time_ns) * 1e-9;
  json["node"] = NodeName();
  json["cycles"] = s.cycles;
  json["primitive_time_s"] = s.primitive_time_s;
  json["fault"] = s.faults == 0 ? Json(nullptr) : Json(FaultText());
  if (s.sensor_status != 0) {
    json["sensor"] = {{"status", SensorStatusName(s)},
                      {"age_ticks", s.sensor_age_ticks},
                      {"pitch_rad", nullptr},
                      {"rate_rad_s", nullptr},
                      {"feedback_error_rad", s.feedback_error_rad},
                      {"feedback_rate_error_rad_s", s.feedback_rate_error_rad_s},
                      {"feedback_share", s.feedback_share}};
    if (HasReported(s)) {
      json["sensor"]["pitch_rad"] = s.sensor_pitch_rad;
      json["sensor"]["rate_rad_s"] = s.sensor_rate_rad_s;
    }
  }
  json["joints"] = Json::Array();
  for (std::size_t i = 0; i < s.joints.size(); ++i) {
    Json joint = {{"name", JointName(i)}};
    ForEachJointField([&](const JointField& field, auto in_record, auto in_message) {
      if (field.status == nullptr) return;
      if constexpr (std::is_same_v<JointFieldType<decltype(in_record)>, DriveState>) {
        joint[field.status] = DriveStateName(in_message(s.joints[i]));
      } else {
        const bool known = field.origin != JointField::Origin::kDrive ||
                           !std::is_floating_point_v<JointFieldType<decltype(in_record)>> ||
                           HasReplied(s.joints[i]);
        joint[field.status] = known ? Json(in_message(s.joints[i])) : Json(nullptr);
      }
    });
    json["joints"].Append(joint);
  }
  return json;
}

namespace {

/// How many bytes of the text its first `columns` characters are, in UTF-8.
std::size_t BytesOf(std::string_view text, std::size_t columns) {
  std::size_t at = 0;
  for (; at < text.size(); ++at) {
    const bool begins = (static_cast<unsigned char>(text[at]) & 0xC0U) != 0x80U;
    if (begins && columns-- == 0) break;
  }
  return at;
}

}  // namespace

std::string Fitted(const std::string& text, int columns, int rows) {
  constexpr std::string_view kIndent = "        ";
  const auto width = static_cast<std::size_t>(std::max(columns, 20));
  std::string fitted;
  bool head = true;
  int row = 0;
  for (std::size_t at = 0; at < text.size() && row < rows;) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::string_view line = std::string_view(text).substr(at, end - at);
    at = end + 1;
    head = head && !line.empty();
    std::string_view indent;
    do {
      const std::size_t part = BytesOf(line, width - indent.size());
      // A line is broken between words where it has some.
      const std::size_t space =
          head && part < line.size() ? line.rfind(' ', part) : std::string_view::npos;
      const std::size_t taken = space == std::string_view::npos || space == 0 ? part : space;
      fitted += fmt::format("{}{}\n", indent, line.substr(0, taken));
      line.remove_prefix(std::min(line.size(), taken + (taken == space ? 1 : 0)));
      indent = kIndent;
    } while (head && !line.empty() && ++row < rows);
    ++row;
  }
  return fitted;
}

}  // namespace tumbler
