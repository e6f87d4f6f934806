#include "runtime/record/run_exports.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "runtime/assembly/candump.h"
#include "runtime/record/channels.h"
#include "runtime/record/state_csv.h"

namespace tumbler {
namespace {

/// Both types of true states begin with their time, behind the fingerprint.
std::int64_t TimeOfTruth(std::span<const std::uint8_t> truth) {
  constexpr std::size_t kFingerprintBytes = 8, kTimeBytes = 8;
  if (truth.size() < kFingerprintBytes + kTimeBytes) return 0;
  std::uint64_t time_ns = 0;
  for (const std::uint8_t byte : truth.subspan(kFingerprintBytes, kTimeBytes))
    time_ns = time_ns << 8U | byte;
  return static_cast<std::int64_t>(time_ns);
}

}  // namespace

FileExport::FileExport(const std::string& path, bool whole)
    : RunExport(path), out_(NameToOpen(path, whole), path) {}

std::string FileExport::NameToOpen(const std::string& path, bool whole) {
  if (whole) return pending_.emplace(path).to_open();
  lock_.emplace(path);
  return path;
}

MessageStream::MessageStream(const RunExportConfig& config)
    : number_(config.run.number), figures_(config.figures), events_(config.run), run_(config.run) {
  message_.joints.reserve(kMaxJoints);
}

void MessageStream::EmitRun(std::int64_t time_ns) {
  {
    const std::lock_guard lock(figures_->mutex);
    run_.SetScheduling(figures_->scheduling);
    run_.SetCheck(figures_->checking && !ticked_, figures_->check_request);
  }
  const std::int64_t lost = std::max(figures_->lost.load(), missing_);
  Put(run_.At(time_ns, lost, figures_->unpublished), time_ns);
}

void MessageStream::TakeTick(const TimedRecord& timed) {
  FillState(timed, message_);
  message_.run = number_;
  run_.Count(timed);
  missing_ += timed.number - next_number_;
  next_number_ = timed.number + 1;
  last_time_ns_ = timed.time_ns;
  Put(message_, timed.time_ns);
  if (auto event = events_.Next(timed)) {
    event->run = number_;
    Put(*event, timed.time_ns);
  }
  if (timed.time_ns >= next_run_ns_) {
    EmitRun(timed.time_ns);
    next_run_ns_ = timed.time_ns + kRunPeriod_ns;
  }
  ticked_ = true;
}

void LcmStream::Put(const state_t& message, std::int64_t time_ns) {
  Encode(kStateChannel, message, time_ns);
}
void LcmStream::Put(const event_t& message, std::int64_t time_ns) {
  Encode(kEventChannel, message, time_ns);
}
void LcmStream::Put(const run_t& message, std::int64_t time_ns) {
  Encode(kRunChannel, message, time_ns);
}

template <typename Message>
void LcmStream::Encode(const char* channel, const Message& message, std::int64_t time_ns) {
  const int size = message.getEncodedSize();
  buffer_.resize(static_cast<std::size_t>(size));
  if (message.encode(buffer_.data(), 0, size) != size) {
    ++figures().unpublished;
    return;
  }
  Emit(channel, buffer_, time_ns);
}

void LcmEvents::Append(std::string_view channel, std::span<const std::uint8_t> bytes,
                       std::int64_t time_ns, OutputFile& out) {
  constexpr std::uint32_t kSyncWord = 0xEDA1DA01;
  event_.clear();
  AppendNumber(kSyncWord, 4);
  AppendNumber(static_cast<std::uint64_t>(count_++), 8);
  AppendNumber(static_cast<std::uint64_t>(utime_at_zero_us_ + time_ns / 1000), 8);
  AppendNumber(channel.size(), 4);
  AppendNumber(bytes.size(), 4);
  event_ += channel;
  event_.append(bytes.begin(), bytes.end());
  out.Append(event_);
}

void LcmEvents::AppendNumber(std::uint64_t number, int size) {
  for (int i = size; i-- > 0;)
    event_ += static_cast<char>(number >> (8U * static_cast<unsigned>(i)) & 0xffU);
}

LogExport::LogExport(const std::string& path, const RunExportConfig& config)
    : FileExport(path, config.whole_files), LcmStream(config), events_(config.utime_at_zero_us) {}

void LogExport::Take(const TickEntry& /*entry*/, const TimedRecord& timed) { TakeTick(timed); }

void LogExport::Finish() {
  EmitLast();
  FileExport::Finish();
}

CsvExport::CsvExport(const std::string& path, const RunExportConfig& config)
    : FileExport(path, config.whole_files), number_(config.run.number) {
  message_.joints.reserve(kMaxJoints);
  out().Append(StateCsvHeader(config.run.joints) + '\n');
}

void CsvExport::Take(const TickEntry& /*entry*/, const TimedRecord& timed) {
  FillState(timed, message_);
  message_.run = number_;
  row_.clear();
  AppendStateCsvRow(message_, row_);
  out().Append(row_);
}

TruthLogExport::TruthLogExport(const std::string& path, const RunExportConfig& config)
    : FileExport(path, config.whole_files), events_(config.utime_at_zero_us) {}

void TruthLogExport::TakeTruth(std::span<const std::uint8_t> truth) {
  events_.Append(kTruthChannel, truth, TimeOfTruth(truth), out());
}

CandumpExport::CandumpExport(const std::string& path, const RunExportConfig& config)
    : FileExport(path, config.whole_files),
      bus_(config.run.bus),
      utime_at_zero_us_(config.utime_at_zero_us),
      awake_before_ns_(std::numeric_limits<std::int64_t>::min()) {}

// A frame that arrives while a tick's frames are sent belongs to the next tick. So frames are kept
// until no older one can come.
void CandumpExport::Take(const TickEntry& entry, const TimedRecord& /*timed*/) {
  const std::span<const ReceivedFrame> received = entry.input().received;
  frames_.insert(frames_.end(), received.begin(), received.end());
  for (const CanFrame& frame : SentFrames(entry)) frames_.push_back({frame, entry.notes.send_ns});
  WriteBefore(awake_before_ns_);
  awake_before_ns_ = entry.notes.awake_ns;
}

void CandumpExport::Finish() {
  WriteBefore(std::numeric_limits<std::int64_t>::max());
  FileExport::Finish();
}

void CandumpExport::WriteBefore(std::int64_t time_ns) {
  std::stable_sort(frames_.begin(), frames_.end(),
                   [](const auto& a, const auto& b) { return a.time_ns < b.time_ns; });
  auto next = frames_.begin();
  for (; next != frames_.end() && next->time_ns < time_ns; ++next) {
    out().Append(CandumpLine(std::max<std::int64_t>(next->time_ns + utime_at_zero_us_ * 1000, 0),
                             bus_, next->frame) +
                 '\n');
    ++count_;
  }
  frames_.erase(frames_.begin(), next);
}

}  // namespace tumbler
