#include "runtime/record/telemetry.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include <lcm/lcm-cpp.hpp>

#include "common/core/ring_buffer.h"
#include "common/files/result_file.h"
#include "runtime/record/channels.h"
#include "runtime/record/messages.h"
#include "runtime/record/output_file.h"
#include "runtime/record/state_csv.h"

namespace tumbler {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::int64_t kRunPeriod_ns = 250'000'000;

/// What the outputs of a run share. A thread that was left behind still has it.
struct SharedFigures {
  std::atomic<std::int64_t> lost{0};
  std::atomic<std::int64_t> unpublished{0};
  std::mutex mutex;  // guards the rest; the loop never asks for it
  std::string scheduling;
  bool checking = false;
  std::int64_t check_request = 0;
};

/// One output: takes the records out of its ring. The base counts them alone.
class Outlet {
 public:
  Outlet() = default;
  Outlet(const Outlet&) = delete;
  Outlet& operator=(const Outlet&) = delete;
  virtual ~Outlet() = default;

  /// From the loop. @returns false when there is no room.
  [[nodiscard]] bool Push(const TimedRecord& record) noexcept { return ring_.Push(record); }
  /// Writes the records in the ring.
  void Drain() {
    TimedRecord timed;
    while (ring_.Pop(timed)) {
      Take(timed);
      written_.fetch_add(1, std::memory_order_relaxed);
    }
  }
  /// Called when the ring was found empty, in a thread.
  virtual void Idle() {}
  /// Writes what comes after the last record.
  virtual void Finish() {}
  /// Puts a whole file in place, after Finish.
  virtual void Commit() {}
  [[nodiscard]] virtual bool failed() const { return false; }
  /// The file; empty: it is none.
  [[nodiscard]] virtual const std::string& file() const { return file_; }
  [[nodiscard]] std::int64_t written() const noexcept { return written_; }
  /// Grows as long as the output takes something.
  [[nodiscard]] virtual std::int64_t progress() const noexcept { return written_; }

 protected:
  std::string file_;

 private:
  /// Four seconds at 1 kHz. No stall of a disk was seen that lasted longer.
  static constexpr std::size_t kRingCapacity = 4096;

  virtual void Take(const TimedRecord& /*timed*/) {}

  RingBuffer<TimedRecord, kRingCapacity> ring_;
  std::atomic<std::int64_t> written_{0};
};

/// An outlet, and the thread that empties it.
class OutletThread {
 public:
  explicit OutletThread(std::shared_ptr<Outlet> outlet) : outlet_(std::move(outlet)) {}
  ~OutletThread() {
    static_cast<void>(Stop([] { return std::chrono::seconds(1); }));
  }
  OutletThread(const OutletThread&) = delete;
  OutletThread& operator=(const OutletThread&) = delete;

  [[nodiscard]] Outlet& outlet() const { return *outlet_; }

  void Start() {
    if (thread_.joinable()) return;
    work_ = std::make_shared<Work>();
    thread_ = std::thread([outlet = outlet_, work = work_] {
      while (!work->stop) {
        outlet->Drain();
        outlet->Idle();
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
      outlet->Drain();
      outlet->Finish();
      const std::lock_guard lock(work->mutex);
      work->done = true;
      work->ended.notify_all();
    });
  }

  /// Ends the thread; without one, writes the rest here.
  /// @returns false when it was left behind, since its output took nothing for so long.
  [[nodiscard]] bool Stop(const std::function<std::chrono::milliseconds()>& patience) {
    if (stopped_) return true;
    stopped_ = true;
    if (!thread_.joinable()) {
      outlet_->Drain();
      outlet_->Finish();
      return true;
    }
    work_->stop = true;
    std::unique_lock lock(work_->mutex);
    constexpr std::chrono::milliseconds kGlance(50);
    std::int64_t progress = -1;
    auto progressed = SteadyClock::now();
    while (!work_->ended.wait_for(lock, kGlance, [this] { return work_->done; })) {
      const std::int64_t now = outlet_->progress();
      if (now != progress) progressed = SteadyClock::now();
      progress = now;
      if (SteadyClock::now() - progressed < patience()) continue;
      thread_.detach();
      return false;
    }
    lock.unlock();
    thread_.join();
    return true;
  }

 private:
  struct Work {
    std::atomic<bool> stop{false};
    std::mutex mutex;
    std::condition_variable ended;
    bool done = false;
  };

  std::shared_ptr<Outlet> outlet_;
  std::shared_ptr<Work> work_;
  std::thread thread_;
  bool stopped_ = false;
};

/// An outlet that makes messages of the records.
class MessageOutlet : public Outlet {
 public:
  MessageOutlet(const TelemetryConfig& config, std::shared_ptr<SharedFigures> shared)
      : number_(config.run.number),
        shared_(std::move(shared)),
        events_(config.run),
        run_(config.run) {
    message_.joints.reserve(kMaxJoints);
  }

  void Finish() override {
    if (written() > 0) EmitRun(last_time_ns_);
  }

 protected:
  [[nodiscard]] SharedFigures& shared() const { return *shared_; }

  void EmitRun(std::int64_t time_ns) {
    {
      const std::lock_guard lock(shared_->mutex);
      run_.SetScheduling(shared_->scheduling);
      run_.SetCheck(shared_->checking && written() == 0, shared_->check_request);
    }
    Encode(kRunChannel, run_.At(time_ns, shared_->lost, shared_->unpublished), time_ns);
  }

 private:
  void Take(const TimedRecord& timed) override {
    FillState(timed, message_);
    message_.run = number_;
    run_.Count(timed);
    last_time_ns_ = timed.time_ns;
    Encode(kStateChannel, message_, timed.time_ns);
    if (auto event = events_.Next(timed)) {
      event->run = number_;
      Encode(kEventChannel, *event, timed.time_ns);
    }
    if (timed.time_ns >= next_run_ns_) {
      EmitRun(timed.time_ns);
      next_run_ns_ = timed.time_ns + kRunPeriod_ns;
    }
  }

  template <typename Message>
  void Encode(const char* channel, const Message& m, std::int64_t time_ns) {
    const int size = m.getEncodedSize();
    buffer_.resize(static_cast<std::size_t>(size));
    if (m.encode(buffer_.data(), 0, size) != size) {
      ++shared_->unpublished;
      return;
    }
    Emit(channel, buffer_, time_ns);
  }
  virtual void Emit(const char* channel, const std::vector<std::uint8_t>& bytes,
                    std::int64_t time_ns) = 0;

  std::int64_t number_;
  std::shared_ptr<SharedFigures> shared_;
  state_t message_;
  EventWatch events_;
  RunMessage run_;
  std::int64_t next_run_ns_ = 0;  // time of the next run_t, on the loop's clock
  std::int64_t last_time_ns_ = 0;
  std::vector<std::uint8_t> buffer_;
};

/// A file of a run, under its own name or under another one until it is whole.
class NamedFile {
 public:
  NamedFile(const std::string& path, bool whole)
      : file_(NameToOpen(path, whole, pending_, lock_), path) {}

  [[nodiscard]] OutputFile& operator*() { return file_; }
  [[nodiscard]] const OutputFile& operator*() const { return file_; }
  void Commit() {
    if (pending_) pending_->Commit();
  }

 private:
  static std::string NameToOpen(const std::string& path, bool whole,
                                std::optional<PendingName>& pending,
                                std::optional<WriterLock>& lock) {
    if (whole) return pending.emplace(path).to_open();
    lock.emplace(path);
    return path;
  }

  std::optional<PendingName> pending_;
  std::optional<WriterLock> lock_;
  OutputFile file_;
};

class LogOutlet final : public MessageOutlet {
 public:
  LogOutlet(const TelemetryConfig& config, std::shared_ptr<SharedFigures> shared)
      : MessageOutlet(config, std::move(shared)),
        log_(config.log_file, config.whole_files),
        utime_at_zero_us_(config.utime_at_zero_us) {
    file_ = config.log_file;
  }

  void Idle() override { (*log_).Flush(); }
  void Finish() override {
    MessageOutlet::Finish();
    (*log_).Flush();
  }
  void Commit() override { log_.Commit(); }
  [[nodiscard]] bool failed() const override { return (*log_).failed(); }
  [[nodiscard]] std::int64_t progress() const noexcept override {
    return Outlet::progress() + (*log_).taken();
  }

 private:
  /// An event as lcm_eventlog_write_event writes it. That one needs a stream of the C library.
  void Emit(const char* channel, const std::vector<std::uint8_t>& bytes,
            std::int64_t time_ns) override {
    constexpr std::uint32_t kSyncWord = 0xEDA1DA01;
    const std::string_view name = channel;
    event_.clear();
    AppendNumber(kSyncWord, 4);
    AppendNumber(static_cast<std::uint64_t>(event_count_++), 8);
    AppendNumber(static_cast<std::uint64_t>(utime_at_zero_us_ + time_ns / 1000), 8);
    AppendNumber(name.size(), 4);
    AppendNumber(bytes.size(), 4);
    event_ += name;
    event_.append(bytes.begin(), bytes.end());
    (*log_).Append(event_);
  }
  void AppendNumber(std::uint64_t number, int size) {
    for (int i = size; i-- > 0;)
      event_ += static_cast<char>(number >> (8U * static_cast<unsigned>(i)) & 0xffU);
  }

  NamedFile log_;
  std::int64_t utime_at_zero_us_;
  std::int64_t event_count_ = 0;
  std::string event_;
};

class LiveOutlet final : public MessageOutlet {
 public:
  LiveOutlet(const TelemetryConfig& config, std::shared_ptr<SharedFigures> shared)
      : MessageOutlet(config, std::move(shared)), live_(config.lcm_url) {
    if (!live_.good()) {
      throw std::runtime_error(
          fmt::format("{}: LCM cannot use this URL (udpm needs a multicast route: `ip route add "
                      "224.0.0.0/4 dev IFACE`)",
                      config.lcm_url));
    }
  }

  void Idle() override {
    const auto now = SteadyClock::now();
    if (written() > 0 || now < next_check_) return;
    {
      const std::lock_guard lock(shared().mutex);
      if (!shared().checking) return;
    }
    next_check_ = now + std::chrono::nanoseconds(kRunPeriod_ns);
    EmitRun(0);
  }
  void Finish() override {
    MessageOutlet::Finish();
    {
      const std::lock_guard lock(shared().mutex);
      if (shared().check_request == 0) return;
    }
    constexpr int kTimes = 3;  // A datagram may get lost, and who asked waits for this one.
    for (int i = 0; i < kTimes; ++i) EmitRun(0);
  }

 private:
  void Emit(const char* channel, const std::vector<std::uint8_t>& bytes,
            std::int64_t /*time_ns*/) override {
    if (live_.publish(channel, bytes.data(), static_cast<unsigned>(bytes.size())) != 0)
      ++shared().unpublished;
  }

  lcm::LCM live_;
  SteadyClock::time_point next_check_;
};

class TraceOutlet final : public Outlet {
 public:
  explicit TraceOutlet(const TelemetryConfig& config)
      : trace_(config.trace_file, config.whole_files), number_(config.run.number) {
    file_ = config.trace_file;
    message_.joints.reserve(kMaxJoints);
    (*trace_).Append(StateCsvHeader(config.run.joints) + '\n');
  }

  void Idle() override { (*trace_).Flush(); }
  void Finish() override { (*trace_).Flush(); }
  void Commit() override { trace_.Commit(); }
  [[nodiscard]] bool failed() const override { return (*trace_).failed(); }
  [[nodiscard]] std::int64_t progress() const noexcept override {
    return Outlet::progress() + (*trace_).taken();
  }

 private:
  void Take(const TimedRecord& timed) override {
    FillState(timed, message_);
    message_.run = number_;
    row_.clear();
    AppendStateCsvRow(message_, row_);
    (*trace_).Append(row_);
  }

  NamedFile trace_;
  std::int64_t number_;
  state_t message_;
  std::string row_;
};

}  // namespace

struct Telemetry::Implementation {
  explicit Implementation(const TelemetryConfig& config) {
    shared->scheduling = config.run.scheduling;
    if (!config.log_file.empty()) Add(std::make_shared<LogOutlet>(config, shared));
    if (!config.trace_file.empty()) Add(std::make_shared<TraceOutlet>(config));
    if (!config.lcm_url.empty()) Add(std::make_shared<LiveOutlet>(config, shared));
    if (outlets.empty()) Add(std::make_shared<Outlet>());
  }

  void Add(std::shared_ptr<Outlet> outlet) {
    outlets.push_back(std::make_unique<OutletThread>(std::move(outlet)));
  }

  std::shared_ptr<SharedFigures> shared = std::make_shared<SharedFigures>();
  std::vector<std::unique_ptr<OutletThread>> outlets;
};

Telemetry::Telemetry(const TelemetryConfig& config)
    : implementation_(std::make_unique<Implementation>(config)) {}

Telemetry::~Telemetry() = default;

void Telemetry::Push(const TimedRecord& record) noexcept {
  bool taken = true;
  for (const auto& thread : implementation_->outlets)
    taken = thread->outlet().Push(record) && taken;
  if (!taken) implementation_->shared->lost.fetch_add(1, std::memory_order_relaxed);
}

void Telemetry::SetScheduling(const std::string& scheduling) {
  const std::lock_guard lock(implementation_->shared->mutex);
  implementation_->shared->scheduling = scheduling;
}

void Telemetry::NoteChecking() {
  const std::lock_guard lock(implementation_->shared->mutex);
  implementation_->shared->checking = true;
}

void Telemetry::NoteCheckEnded(std::uint32_t request_id) {
  const std::lock_guard lock(implementation_->shared->mutex);
  implementation_->shared->checking = false;
  implementation_->shared->check_request = request_id;
}

void Telemetry::Drain() {
  for (const auto& thread : implementation_->outlets) thread->outlet().Drain();
}

void Telemetry::Start() {
  for (const auto& thread : implementation_->outlets) thread->Start();
}

void Telemetry::Stop(const std::function<std::chrono::milliseconds()>& patience) {
  constexpr std::chrono::seconds kPatience(10);
  const std::function<std::chrono::milliseconds()> until =
      patience ? patience : [kPatience]() -> std::chrono::milliseconds { return kPatience; };
  std::string names;
  std::string stalled;
  for (const auto& thread : implementation_->outlets) {
    const bool ended = thread->Stop(until);
    const std::string& file = thread->outlet().file();
    if (file.empty()) continue;
    if (ended && !thread->outlet().failed()) {
      thread->outlet().Commit();
      continue;
    }
    names += (names.empty() ? "" : ", ") + file;
    if (!ended) stalled += (stalled.empty() ? "" : ", ") + file;
  }
  if (names.empty()) return;
  throw std::runtime_error(
      fmt::format("{}: could not be written whole{}", names,
                  stalled.empty() ? "" : fmt::format("; {} took nothing any more", stalled)));
}

std::int64_t Telemetry::lost() const noexcept { return implementation_->shared->lost; }
std::int64_t Telemetry::unpublished() const noexcept {
  return implementation_->shared->unpublished;
}
std::int64_t Telemetry::written() const noexcept {
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  for (const auto& thread : implementation_->outlets)
    least = std::min(least, thread->outlet().written());
  return least;
}

}  // namespace tumbler
