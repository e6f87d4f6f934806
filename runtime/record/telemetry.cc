#include "runtime/record/telemetry.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <utility>
#include <vector>

#include <lcm/lcm-cpp.hpp>

#include "runtime/record/channels.h"
#include "runtime/record/lcm_link.h"
#include "runtime/record/run_exports.h"

namespace tumbler {
namespace {

class LiveExport final : public RunExport, private LcmStream {
 public:
  LiveExport(const std::string& url, const RunExportConfig& config)
      : RunExport(""), LcmStream(config), live_(url) {
    RequireUsable(live_, url);
  }

  void Take(const TickEntry& /*entry*/, const TimedRecord& timed) override { TakeTick(timed); }
  void TakeTruth(std::span<const std::uint8_t> truth) override {
    // A true state that LCM does not take is lost.
    static_cast<void>(
        live_.publish(kTruthChannel, truth.data(), static_cast<unsigned>(truth.size())));
  }
  void Idle() override {
    const auto now = std::chrono::steady_clock::now();
    if (ticked() || now < next_check_) return;
    {
      const std::lock_guard lock(figures().mutex);
      if (!figures().checking) return;
    }
    next_check_ = now + std::chrono::nanoseconds(kRunPeriod_ns);
    EmitRun(0);
  }
  void Finish() override {
    EmitLast();
    {
      const std::lock_guard lock(figures().mutex);
      if (figures().check_request == 0) return;
    }
    constexpr int kTimes = 3;  // A datagram may get lost, and who asked waits for this one.
    for (int i = 0; i < kTimes; ++i) EmitRun(0);
  }

 private:
  void Emit(const char* channel, std::span<const std::uint8_t> bytes,
            std::int64_t /*time_ns*/) override {
    if (live_.publish(channel, bytes.data(), static_cast<unsigned>(bytes.size())) != 0)
      ++figures().unpublished;
  }

  lcm::LCM live_;
  std::chrono::steady_clock::time_point next_check_;
};

/// Hands an export what a feed has encoded. An export that throws gets nothing more: in a thread of
/// its own, nobody else would catch it, and the process that controls the robot would end.
class ExportWriter final : public TickWriter {
 public:
  /// @param figures  get ticks that cannot be read.
  ExportWriter(std::unique_ptr<RunExport> out, const SampleTimes& replies,
               std::shared_ptr<LiveFigures> figures)
      : out_(std::move(out)), records_(replies), figures_(std::move(figures)) {}

  void Take(std::span<const std::uint8_t> message) override {
    Try([&] { Hand(message); });
  }
  void Idle() override {
    Try([this] { out_->Idle(); });
  }
  void Finish() override {
    Try([this] { out_->Finish(); });
  }
  [[nodiscard]] std::int64_t progress() const noexcept override {
    return written_ + out_->progress();
  }
  [[nodiscard]] RunExport& out() const { return *out_; }
  [[nodiscard]] std::int64_t written() const noexcept { return written_; }
  /// What the export has thrown; empty: nothing. To be asked once the writer has ended.
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

 private:
  void Hand(std::span<const std::uint8_t> message) {
    if (KindOf(message) == BlockKind::kTruth) return out_->TakeTruth(ContentOf(message));
    if (!DecodeTick(ContentOf(message), entry_)) {
      figures_->lost.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    out_->Take(entry_, records_.Next(entry_));
    written_.fetch_add(1, std::memory_order_relaxed);
  }
  template <typename Step>
  void Try(const Step& step) {
    if (!problem_.empty()) return;
    try {
      step();
    } catch (const std::exception& error) {
      problem_ = error.what();
      if (problem_.empty()) problem_ = "an error without a name";
    }
  }

  std::unique_ptr<RunExport> out_;
  TimedRecords records_;
  std::shared_ptr<LiveFigures> figures_;
  TickEntry entry_;
  std::string problem_;
  std::atomic<std::int64_t> written_{0};
};

}  // namespace

struct Telemetry::Implementation {
  explicit Implementation(const TelemetryConfig& config)
      : replies(config.replies),
        ring_bytes(RingBytes(config.run.joints.size(), config.run.rate_hz)) {
    RunExportConfig exports;
    exports.run = config.run;
    exports.utime_at_zero_us = config.utime_at_zero_us;
    exports.figures = figures;
    figures->scheduling = config.run.scheduling;
    if (!config.log_file.empty()) Add(std::make_unique<LogExport>(config.log_file, exports));
    if (!config.trace_file.empty()) Add(std::make_unique<CsvExport>(config.trace_file, exports));
    if (!config.truth_file.empty())
      Add(std::make_unique<TruthLogExport>(config.truth_file, exports));
    if (!config.candump_file.empty())
      Add(std::make_unique<CandumpExport>(config.candump_file, exports));
    if (config.another) Add(config.another(exports));
    if (!config.lcm_url.empty()) Add(std::make_unique<LiveExport>(config.lcm_url, exports));
  }

  struct Output {
    std::shared_ptr<ExportWriter> writer;
    std::unique_ptr<TickOutlet> outlet;
  };

  void Add(std::unique_ptr<RunExport> out) {
    auto writer = std::make_shared<ExportWriter>(std::move(out), replies, figures);
    outputs.push_back({writer, std::make_unique<TickOutlet>(writer, ring_bytes)});
  }

  SampleTimes replies;
  std::size_t ring_bytes;  // of each output
  std::shared_ptr<LiveFigures> figures = std::make_shared<LiveFigures>();
  std::vector<Output> outputs;
};

Telemetry::Telemetry(const TelemetryConfig& config)
    : implementation_(std::make_unique<Implementation>(config)) {}

Telemetry::~Telemetry() = default;

void Telemetry::Push(std::span<const std::uint8_t> message) noexcept {
  bool taken = !ContentOf(message).empty();
  if (taken) {
    for (const Implementation::Output& output : implementation_->outputs)
      taken = output.outlet->Push(message) && taken;
  }
  if (!taken && KindOf(message) == BlockKind::kTick)
    implementation_->figures->lost.fetch_add(1, std::memory_order_relaxed);
}

void Telemetry::SetScheduling(const std::string& scheduling) {
  const std::lock_guard lock(implementation_->figures->mutex);
  implementation_->figures->scheduling = scheduling;
}

void Telemetry::NoteChecking() {
  const std::lock_guard lock(implementation_->figures->mutex);
  implementation_->figures->checking = true;
}

void Telemetry::NoteCheckEnded(std::uint32_t request_id) {
  const std::lock_guard lock(implementation_->figures->mutex);
  implementation_->figures->checking = false;
  implementation_->figures->check_request = request_id;
}

void Telemetry::Drain() {
  for (const Implementation::Output& output : implementation_->outputs) output.outlet->Drain();
}

void Telemetry::Start() {
  for (const Implementation::Output& output : implementation_->outputs) output.outlet->Start();
}

void Telemetry::Stop(const Patience& patience) {
  std::vector<std::string> failed, stalled;
  std::string problems;
  for (const Implementation::Output& output : implementation_->outputs) {
    const bool ended = output.outlet->Stop(patience);
    const RunExport& out = output.writer->out();
    const std::string name = out.file().empty() ? "live LCM" : out.file();
    const bool broke = ended && !output.writer->problem().empty();
    if (broke) problems += fmt::format("; {}: {}", name, output.writer->problem());
    if (out.file().empty() && !broke) continue;
    if (!ended) stalled.push_back(name);
    if (!ended || broke || out.failed()) failed.push_back(name);
  }
  if (failed.empty()) return;
  throw std::runtime_error(fmt::format(
      "{}: could not be written whole{}{}", fmt::join(failed, ", "),
      stalled.empty() ? "" : fmt::format("; {} took nothing any more", fmt::join(stalled, ", ")),
      problems));
}

std::int64_t Telemetry::lost() const noexcept { return implementation_->figures->lost; }
std::int64_t Telemetry::unpublished() const noexcept {
  return implementation_->figures->unpublished;
}
std::int64_t Telemetry::written() const noexcept {
  const auto& outputs = implementation_->outputs;
  if (outputs.empty()) return 0;
  return std::ranges::min_element(
             outputs, {},
             [](const Implementation::Output& output) { return output.writer->written(); })
      ->writer->written();
}

}  // namespace tumbler
