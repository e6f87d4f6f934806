#include "runtime/telemetry/telemetry.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <thread>

#include <lcm/lcm-cpp.hpp>
#include <tumbler/event_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>

#include "common/ring_buffer.h"
#include "runtime/linux/histogram.h"
#include "runtime/telemetry/sentences.h"
#include "runtime/telemetry/state_csv.h"

namespace tumbler {
struct Telemetry::Implementation {
  /// Four seconds at 1 kHz. No stall of a disk was seen that lasted longer.
  static constexpr std::size_t kRingCapacity = 4096;
  static constexpr std::int64_t kRunPeriod_ns = 250'000'000;

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
      Write(StateCsvHeader(config.run.joints) + '\n');
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
    DescribeRun();
  }

  void Write(const std::string& text) {
    if (std::fwrite(text.data(), 1, text.size(), trace.get()) != text.size()) trace_failed = true;
  }

  void Fill(const TimedRecord& timed) {
    const TickRecord& record = timed.record;
    message.tick = record.tick;
    message.time_ns = timed.time_ns;
    message.number = timed.number;
    message.request_id = timed.request.id;
    message.request = static_cast<std::int8_t>(timed.request.request);
    message.request_refusal = static_cast<std::int8_t>(timed.request.refusal);
    message.wake_up_us = timed.wake_up_ns * 1e-3F;
    message.tick_us = timed.tick_ns * 1e-3F;
    message.bus_bits = timed.bus_bits;
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
    message.fault_state = static_cast<std::int8_t>(record.first_fault.state);
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
      text = Describe(record.first_fault, config.run.joints);
    } else if (record.faults != last_faults) {
      text = record.faults == 0 ? "faults cleared" : "further fault";
    } else if (record.refusal.refusal != last_refusal && record.refusal.refusal != Refusal::kNone) {
      text = fmt::format("{} refused: {}", ToString(record.command),
                         Describe(record.refusal, config.run.joints));
    } else if (timed.request.id != last_request_id && timed.request.refusal != Refusal::kNone) {
      text = fmt::format("{} refused: {}", ToString(timed.request.request),
                         ToString(timed.request.refusal));
    } else if (record.node != last_node && record.state == ExecutorState::kRunning) {
      const auto node = static_cast<std::size_t>(record.node);
      text = node < config.run.nodes.size() ? config.run.nodes[node]
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
    last_request_id = timed.request.id;
    last_refusal = record.refusal.refusal;
  }

  void Drain() {
    TimedRecord timed;
    while (ring.Pop(timed)) {
      ++written;
      Fill(timed);
      Count(timed);
      if (log || live) {
        Emit(kStateChannel, message, timed.time_ns);
        EmitEvents(timed);
        if (timed.time_ns >= next_run_ns) {
          EmitRun(timed.time_ns);
          next_run_ns = timed.time_ns + kRunPeriod_ns;
        }
      }
      if (trace != nullptr) {
        row.clear();
        AppendStateCsvRow(message, row);
        Write(row);
      }
    }
  }

  void Count(const TimedRecord& timed) {
    const auto period_ns = static_cast<float>(1e9 / std::max(config.run.rate_hz, 1e-3));
    run.ticks = timed.number + 1;
    run.missed_ticks = timed.record.tick - timed.number;
    if (timed.wake_up_ns > period_ns / 2) ++run.late_ticks;
    wake_up.Add(static_cast<std::int64_t>(timed.wake_up_ns));
    tick.Add(static_cast<std::int64_t>(timed.tick_ns));
    bits += timed.bus_bits;
    for (std::size_t i = 0; i < timed.record.joint_count; ++i) {
      run.reply_age_max_ticks =
          std::max(run.reply_age_max_ticks, timed.record.joints[i].reply_age_ticks);
    }
    last_time_ns = timed.time_ns;
  }

  void DescribeRun() {
    const RunDescription& about = config.run;
    run.version = TUMBLER_VERSION;
    run.motion = about.motion;
    run.bus = about.bus;
    run.mode = about.mode;
    run.attended = about.attended ? 1 : 0;
    run.rate_hz = about.rate_hz;
    run.speed = about.speed;
    run.joints = about.joints;
    run.joint_count = static_cast<std::int32_t>(about.joints.size());
    run.nodes = about.nodes;
    run.node_count = static_cast<std::int32_t>(about.nodes.size());
    run.branches = about.branches;
    run.branch_count = static_cast<std::int32_t>(about.branches.size());
    run.kernel = about.machine.kernel;
    run.cpu = about.machine.cpu;
    run.adapter = about.machine.adapter;
    run.scheduling = about.scheduling;
    run.reply_age_max_ticks = -1;
  }

  void EmitRun(std::int64_t time_ns) {
    const auto us = [](const DurationHistogram& durations, double share) {
      return static_cast<float>(durations.PercentileNs(share)) * 1e-3F;
    };
    const double elapsed_s = static_cast<double>(time_ns - run.time_ns) * 1e-9;
    const double capacity = elapsed_s * config.run.bit_rate;
    run.bus_load = capacity > 0 ? static_cast<float>(static_cast<double>(bits) / capacity) : 0;
    bits = 0;
    run.time_ns = time_ns;
    run.wake_up_p50_us = us(wake_up, 0.5);
    run.wake_up_p99_us = us(wake_up, 0.99);
    run.wake_up_p99_9_us = us(wake_up, 0.999);
    run.wake_up_p99_99_us = us(wake_up, 0.9999);
    run.wake_up_max_us = static_cast<float>(wake_up.max_ns()) * 1e-3F;
    run.tick_p50_us = us(tick, 0.5);
    run.tick_p99_us = us(tick, 0.99);
    run.tick_p99_9_us = us(tick, 0.999);
    run.tick_p99_99_us = us(tick, 0.9999);
    run.tick_max_us = static_cast<float>(tick.max_ns()) * 1e-3F;
    run.lost_records = lost;
    run.unpublished = unpublished;
    Emit(kRunChannel, run, time_ns);
  }

  struct CloseFile {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };

  TelemetryConfig config;
  RingBuffer<TimedRecord, kRingCapacity> ring;
  std::atomic<std::int64_t> lost{0};
  std::atomic<bool> stop{false};
  std::thread thread;

  // Used by the draining side only.
  std::optional<lcm::LogFile> log;
  std::unique_ptr<lcm::LCM> live;
  std::unique_ptr<std::FILE, CloseFile> trace;
  state_t message;
  run_t run{};
  DurationHistogram wake_up;
  DurationHistogram tick;
  std::int64_t bits = 0;         // on the bus since the last run_t
  std::int64_t next_run_ns = 0;  // time of the next run_t on the loop's clock
  std::int64_t last_time_ns = 0;
  std::vector<std::uint8_t> buffer;
  std::string row;
  ExecutorState last_state = ExecutorState::kDisarmed;
  std::uint32_t last_faults = 0;
  std::uint32_t last_request_id = 0;
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

void Telemetry::SetScheduling(const std::string& scheduling) {
  implementation_->run.scheduling = scheduling;
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
  if (implementation_->written > 0 && (implementation_->log || implementation_->live))
    implementation_->EmitRun(implementation_->last_time_ns);
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
