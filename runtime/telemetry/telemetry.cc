#include "runtime/telemetry/telemetry.h"

#include <fmt/format.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <thread>

#include <lcm/lcm-cpp.hpp>

#include "common/result_file.h"
#include "common/ring_buffer.h"
#include "runtime/telemetry/channels.h"
#include "runtime/telemetry/messages.h"
#include "runtime/telemetry/state_csv.h"

namespace tumbler {
struct Telemetry::Implementation {
  /// Four seconds at 1 kHz. No stall of a disk was seen that lasted longer.
  static constexpr std::size_t kRingCapacity = 4096;
  static constexpr std::int64_t kRunPeriod_ns = 250'000'000;

  explicit Implementation(const TelemetryConfig& config_in)
      : config(config_in), events(config.run), run(config.run) {
    if (!config.log_file.empty()) {
      log.emplace(NameToOpen(config.log_file, pending_log, log_lock), "w");
      if (!log->good()) {
        throw std::runtime_error(fmt::format("{}: cannot be written: {}", config.log_file,
                                             std::generic_category().message(errno)));
      }
    }
    if (!config.trace_file.empty()) {
      trace.reset(
          std::fopen(NameToOpen(config.trace_file, pending_trace, trace_lock).c_str(), "w"));
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
  }

  /// Of one of the files, whose folder is made.
  [[nodiscard]] std::string NameToOpen(const std::string& path, std::optional<PendingName>& pending,
                                       std::optional<WriterLock>& lock) const {
    if (config.whole_files) return pending.emplace(path).to_open();
    lock.emplace(path);
    return path;
  }

  void Write(const std::string& text) {
    if (std::fwrite(text.data(), 1, text.size(), trace.get()) != text.size()) trace_failed = true;
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

  void Drain() {
    TimedRecord timed;
    while (ring.Pop(timed)) {
      ++written;
      FillState(timed, message);
      message.run = config.run.number;
      run.Count(timed);
      last_time_ns = timed.time_ns;
      if (log || live) {
        Emit(kStateChannel, message, timed.time_ns);
        if (auto event = events.Next(timed)) {
          event->run = config.run.number;
          Emit(kEventChannel, *event, timed.time_ns);
        }
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

  void EmitRun(std::int64_t time_ns) {
    Emit(kRunChannel, run.At(time_ns, lost, unpublished), time_ns);
  }

  struct CloseFile {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };

  RingBuffer<TimedRecord, kRingCapacity> ring;
  TelemetryConfig config;
  std::atomic<std::int64_t> lost{0};
  std::atomic<bool> stop{false};
  std::thread thread;

  // Only the draining side uses these.
  std::optional<PendingName> pending_log, pending_trace;
  std::optional<WriterLock> log_lock, trace_lock;
  std::optional<lcm::LogFile> log;
  std::unique_ptr<lcm::LCM> live;
  std::unique_ptr<std::FILE, CloseFile> trace;
  state_t message;
  EventWatch events;
  RunMessage run;
  std::int64_t next_run_ns = 0;  // time of the next run_t, on the loop's clock
  std::int64_t last_time_ns = 0;
  std::vector<std::uint8_t> buffer;
  std::string row;
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
  implementation_->run.SetScheduling(scheduling);
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
  const std::string& log = implementation_->config.log_file;
  const std::string& trace = implementation_->config.trace_file;
  if (implementation_->log_failed && implementation_->trace_failed)
    throw std::runtime_error(fmt::format("{}, {}: could not be written whole", log, trace));
  if (implementation_->log_failed || implementation_->trace_failed) {
    throw std::runtime_error(
        fmt::format("{}: could not be written whole", implementation_->log_failed ? log : trace));
  }
  if (implementation_->pending_log) implementation_->pending_log->Commit();
  if (implementation_->pending_trace) implementation_->pending_trace->Commit();
}

std::int64_t Telemetry::lost() const noexcept { return implementation_->lost; }
std::int64_t Telemetry::unpublished() const noexcept { return implementation_->unpublished; }
std::int64_t Telemetry::written() const noexcept { return implementation_->written; }

}  // namespace tumbler
