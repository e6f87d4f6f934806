#include "runtime/linux/telemetry.h"

#include <fmt/format.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <thread>

#include <lcm/lcm-cpp.hpp>
#include <tumbler/event_t.hpp>
#include <tumbler/state_t.hpp>

#include "common/ring_buffer.h"

namespace tumbler {
namespace {

std::string JointName(int joint, const std::vector<std::string>& names) {
  const auto index = static_cast<std::size_t>(joint);
  return index < names.size() ? fmt::format("joint {}", names[index])
                              : fmt::format("joint {}", joint);
}

const char* UnitOf(Fault fault) {
  switch (fault) {
    case Fault::kStaleReply:
    case Fault::kHeartbeatLost:
    case Fault::kLateTick:
    case Fault::kArmingTimeout:
      return " ticks";
    case Fault::kFollowingError:
    case Fault::kEntryMissed:
      return " rad";
    case Fault::kOverTemperature:
      return " C";
    default:
      return "";
  }
}

const char* UnitOf(Refusal refusal) {
  switch (refusal) {
    case Refusal::kNoReply:
    case Refusal::kNoHeartbeat:
      return " ticks";
    case Refusal::kTooHot:
      return " C";
    case Refusal::kOutsideLimits:
    case Refusal::kNotAtStart:
    case Refusal::kOutsideStartSet:
      return " rad";
    default:
      return "";
  }
}

}  // namespace

std::string Describe(const FaultReport& report, const std::vector<std::string>& joint_names) {
  std::string text = ToString(report.fault);
  if (report.joint >= 0) text += fmt::format(" of {}", JointName(report.joint, joint_names));
  switch (report.fault) {
    case Fault::kNone:
      return text;
    case Fault::kOperatorStop:
    case Fault::kNonFinite:
      break;
    case Fault::kErrorPassive:
      break;
    case Fault::kBusOff:
    case Fault::kInterfaceDown:
    case Fault::kInterfaceGone:
    case Fault::kLinkFailed:
    case Fault::kTransmitQueueFull:
      text += fmt::format(": {}", ToString(static_cast<Status>(report.value)));
      break;
    case Fault::kDriveError:
      text += report.value == 0 ? ": it is not enabled any more"
                                : fmt::format(": code {}", report.value);
      break;
    default:
      text +=
          fmt::format(": {:.4g}{}, limit {:.4g}", report.value, UnitOf(report.fault), report.limit);
  }
  return text + fmt::format(" at tick {} ({}); reaction: {}", report.tick, ToString(report.state),
                            ToString(report.reaction));
}

std::string Describe(const RefusalReport& report, const std::vector<std::string>& joint_names) {
  std::string text = ToString(report.refusal);
  if (report.refusal == Refusal::kNoSuchBranch)
    return text + fmt::format(" (number {})", report.value);
  if (report.joint < 0) return text;
  text += fmt::format(" ({}", JointName(report.joint, joint_names));
  if (report.refusal == Refusal::kNoReply && report.value < 0) return text + ": never)";
  if (report.refusal == Refusal::kDriveError) return text + fmt::format(": code {})", report.value);
  return text + fmt::format(": {:.4g}{}, limit {:.4g})", report.value, UnitOf(report.refusal),
                            report.limit);
}

struct Telemetry::Implementation {
  /// Four seconds at 1 kHz: longer than any stall of a disk that was seen.
  static constexpr std::size_t kRingCapacity = 4096;

  explicit Implementation(const TelemetryConfig& config_in) : config(config_in) {
    if (!config.log_file.empty()) {
      log.emplace(config.log_file, "w");
      if (!log->good()) {
        throw std::runtime_error(fmt::format("{}: cannot be written: {}", config.log_file,
                                             std::generic_category().message(errno)));
      }
    }
    if (!config.trace_file.empty()) {
      trace.reset(std::fopen(config.trace_file.c_str(), "w"));
      if (trace == nullptr) {
        throw std::runtime_error(fmt::format("{}: cannot be written: {}", config.trace_file,
                                             std::generic_category().message(errno)));
      }
      WriteTraceHeader();
    }
    if (!config.lcm_url.empty()) {
      live = std::make_unique<lcm::LCM>(config.lcm_url);
      if (!live->good()) {
        throw std::runtime_error(
            fmt::format("{}: LCM cannot use this URL (udpm needs a multicast route: `ip route add "
                        "224.0.0.0/4 dev IFACE`)",
                        config.lcm_url));
      }
    }
    message.joints.reserve(kMaxJoints);
  }

  void WriteTraceHeader() {
    std::string header = "tick,time_s,state,node,cycles,primitive_time_s,faults";
    for (const std::string& joint : config.joint_names) {
      for (const char* kind : {"planned", "limited", "encoded", "measured"}) {
        header += fmt::format(",{0}_{1}_position_rad,{0}_{1}_velocity_rad_s,{0}_{1}_torque_nm",
                              joint, kind);
      }
      header += fmt::format(",{0}_temperature_c,{0}_reply_age_ticks", joint);
    }
    header += '\n';
    Write(header);
  }

  void Write(const std::string& text) {
    if (std::fwrite(text.data(), 1, text.size(), trace.get()) != text.size()) trace_failed = true;
  }

  void Trace(const TimedRecord& timed) {
    const TickRecord& record = timed.record;
    row.clear();
    auto out = std::back_inserter(row);
    fmt::format_to(out, "{},{:.6f},{},{},{},{},{}", record.tick,
                   static_cast<double>(timed.time_ns) * 1e-9, ToString(record.state), record.node,
                   record.cycles, record.primitive_time_s, record.faults);
    for (std::size_t i = 0; i < record.joint_count; ++i) {
      const JointRecord& joint = record.joints[i];
      for (const JointSetpoint& s : {joint.planned, joint.limited, joint.encoded, joint.measured}) {
        fmt::format_to(out, ",{},{},{}", s.position_rad, s.velocity_rad_s, s.torque_nm);
      }
      fmt::format_to(out, ",{},{}", joint.temperature_c, joint.reply_age_ticks);
    }
    row += '\n';
    Write(row);
  }

  void Fill(const TimedRecord& timed) {
    const TickRecord& record = timed.record;
    message.tick = record.tick;
    message.time_ns = timed.time_ns;
    message.primitive_time_s = record.primitive_time_s;
    message.node = record.node;
    message.cycles = record.cycles;
    message.state = static_cast<std::int8_t>(record.state);
    message.reaction = static_cast<std::int8_t>(record.reaction);
    message.command = static_cast<std::int8_t>(record.command);
    message.refusal = static_cast<std::int8_t>(record.refusal.refusal);
    message.faults = static_cast<std::int32_t>(record.faults);
    message.fault = static_cast<std::int8_t>(record.first_fault.fault);
    message.fault_joint = record.first_fault.joint;
    message.fault_tick = record.first_fault.tick;
    message.fault_value = record.first_fault.value;
    message.fault_limit = record.first_fault.limit;
    message.joint_count = record.joint_count;
    message.joints.resize(record.joint_count);
    for (std::size_t i = 0; i < record.joint_count; ++i) {
      const JointRecord& joint = record.joints[i];
      joint_state_t& out = message.joints[i];
      out.planned_position_rad = joint.planned.position_rad;
      out.planned_velocity_rad_s = joint.planned.velocity_rad_s;
      out.planned_torque_nm = joint.planned.torque_nm;
      out.planned_acceleration_rad_s2 = joint.planned_acceleration_rad_s2;
      out.limited_position_rad = joint.limited.position_rad;
      out.limited_velocity_rad_s = joint.limited.velocity_rad_s;
      out.limited_torque_nm = joint.limited.torque_nm;
      out.encoded_position_rad = joint.encoded.position_rad;
      out.encoded_velocity_rad_s = joint.encoded.velocity_rad_s;
      out.encoded_torque_nm = joint.encoded.torque_nm;
      out.measured_position_rad = joint.measured.position_rad;
      out.measured_velocity_rad_s = joint.measured.velocity_rad_s;
      out.measured_torque_nm = joint.measured.torque_nm;
      out.temperature_c = joint.temperature_c;
      out.reply_age_ticks = joint.reply_age_ticks;
      out.drive_state = static_cast<std::int8_t>(joint.drive_state);
      out.reply_status = static_cast<std::int8_t>(joint.reply_status);
      out.drive_error = joint.drive_error;
      out.limit_active = joint.limit_active ? 1 : 0;
    }
  }

  template <typename Message>
  void Emit(const char* channel, const Message& m, std::int64_t time_ns) {
    const int size = m.getEncodedSize();
    buffer.resize(static_cast<std::size_t>(size));
    if (m.encode(buffer.data(), 0, size) != size) {
      ++unpublished;
      return;
    }
    if (log) {
      lcm::LogEvent event{};
      event.timestamp = config.utime_at_zero_us + time_ns / 1000;
      event.channel = channel;
      event.datalen = size;
      event.data = buffer.data();
      if (log->writeEvent(&event) != 0) log_failed = true;
    }
    if (live && live->publish(channel, buffer.data(), static_cast<unsigned>(size)) != 0)
      ++unpublished;
  }

  void EmitEvents(const TimedRecord& timed) {
    const TickRecord& record = timed.record;
    std::string text;
    if (record.faults != last_faults && record.first_fault.fault != Fault::kNone &&
        last_faults == 0) {
      text = Describe(record.first_fault, config.joint_names);
    } else if (record.faults != last_faults) {
      text = record.faults == 0 ? "faults cleared" : "further fault";
    } else if (record.refusal.refusal != last_refusal && record.refusal.refusal != Refusal::kNone) {
      text = fmt::format("{} refused: {}", ToString(record.command),
                         Describe(record.refusal, config.joint_names));
    } else if (record.node != last_node && record.state == ExecutorState::kRunning) {
      const auto node = static_cast<std::size_t>(record.node);
      text = node < config.node_names.size() ? config.node_names[node]
                                             : fmt::format("node {}", record.node);
    }
    if (record.state == ExecutorState::kRunning) last_node = record.node;
    if (record.state != last_state || !text.empty()) {
      event_t event;
      event.tick = record.tick;
      event.time_ns = timed.time_ns;
      event.from_state = ToString(last_state);
      event.to_state = ToString(record.state);
      event.text = text;
      Emit(kEventChannel, event, timed.time_ns);
    }
    last_state = record.state;
    last_faults = record.faults;
    last_refusal = record.refusal.refusal;
  }

  void Drain() {
    TimedRecord timed;
    while (ring.Pop(timed)) {
      ++written;
      if (log || live) {
        Fill(timed);
        Emit(kStateChannel, message, timed.time_ns);
        EmitEvents(timed);
      }
      if (trace != nullptr) Trace(timed);
    }
  }

  struct CloseFile {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };

  TelemetryConfig config;
  RingBuffer<TimedRecord, kRingCapacity> ring;
  std::atomic<std::int64_t> lost{0};
  std::atomic<bool> stop{false};
  std::thread thread;

  // Of the draining side only.
  std::optional<lcm::LogFile> log;
  std::unique_ptr<lcm::LCM> live;
  std::unique_ptr<std::FILE, CloseFile> trace;
  state_t message;
  std::vector<std::uint8_t> buffer;
  std::string row;
  ExecutorState last_state = ExecutorState::kDisarmed;
  std::uint32_t last_faults = 0;
  Refusal last_refusal = Refusal::kNone;
  std::int8_t last_node = -1;
  bool log_failed = false;
  bool trace_failed = false;
  std::atomic<std::int64_t> unpublished{0};
  std::atomic<std::int64_t> written{0};
};

Telemetry::Telemetry(const TelemetryConfig& config)
    : implementation_(std::make_unique<Implementation>(config)) {}

Telemetry::~Telemetry() {
  implementation_->stop = true;
  if (implementation_->thread.joinable()) implementation_->thread.join();
}

void Telemetry::Push(const TimedRecord& record) noexcept {
  if (!implementation_->ring.Push(record))
    implementation_->lost.fetch_add(1, std::memory_order_relaxed);
}

void Telemetry::Drain() { implementation_->Drain(); }

void Telemetry::Start() {
  implementation_->stop = false;
  implementation_->thread = std::thread([this] {
    while (!implementation_->stop) {
      implementation_->Drain();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
}

void Telemetry::Stop() {
  implementation_->stop = true;
  if (implementation_->thread.joinable()) implementation_->thread.join();
  implementation_->Drain();
  if (implementation_->log && std::fflush(implementation_->log->getFilePtr()) != 0)
    implementation_->log_failed = true;
  if (implementation_->trace != nullptr && std::fflush(implementation_->trace.get()) != 0) {
    implementation_->trace_failed = true;
  }
  if (implementation_->log_failed) {
    throw std::runtime_error(
        fmt::format("{}: could not be written whole", implementation_->config.log_file));
  }
  if (implementation_->trace_failed) {
    throw std::runtime_error(
        fmt::format("{}: could not be written whole", implementation_->config.trace_file));
  }
}

std::int64_t Telemetry::lost() const noexcept { return implementation_->lost; }
std::int64_t Telemetry::unpublished() const noexcept { return implementation_->unpublished; }
std::int64_t Telemetry::written() const noexcept { return implementation_->written; }

}  // namespace tumbler
