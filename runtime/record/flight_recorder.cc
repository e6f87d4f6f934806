#include "runtime/record/flight_recorder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "common/files/result_file.h"

namespace tumbler {
namespace {

constexpr std::size_t kChunkBytes = 64U << 10U;  // of one write to the file

std::string LastError() { return std::generic_category().message(errno); }

std::int64_t IndexOf(std::span<const std::uint8_t> tick) {
  std::uint64_t index = 0;
  for (std::size_t i = 0; i < 8; ++i) index |= std::uint64_t{tick[i]} << (8 * i);
  return static_cast<std::int64_t>(index);
}

}  // namespace

struct FlightRecorder::Writer final : TickWriter {
  explicit Writer(const FlightRecorderConfig& config_in) : config(config_in) {
    chunk.reserve(kChunkBytes + kTickEntryBytesMax + 4 * kBlockHeaderBytes);
    MakeFolderOf(config.file);
    descriptor =
        open(config.file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
    if (descriptor < 0) {
      const std::string error = LastError();
      RequireNewRecord(config.file);
      throw std::runtime_error(fmt::format("{}: cannot be written: {}", config.file, error));
    }
    AppendRecordHeader(chunk);
    chunk.insert(chunk.end(), config.configuration.begin(), config.configuration.end());
    BlockReader reader(chunk);
    for (Block block; reader.Next(block);) ++blocks;
    ends.push_back({chunk.size(), 0});
    WriteChunk();
    if (!problem.empty()) {
      close(descriptor);
      unlink(config.file.c_str());
      throw std::runtime_error(problem);
    }
  }
  ~Writer() override {
    if (descriptor < 0) return;
    close(descriptor);
    if (pushed == 0) unlink(config.file.c_str());
  }

  void Take(std::span<const std::uint8_t> message) override {
    if (!problem.empty()) return;  // Recording has stopped: messages are thrown away.
    if (KindOf(message) == BlockKind::kTick) {
      const std::int64_t index = IndexOf(ContentOf(message));
      if (index > next_index) AddLost(index - next_index);
      last_index = index;
      next_index = index + 1;
    }
    Add(KindOf(message), ContentOf(message));
    if (chunk.size() >= kChunkBytes) WriteChunk();
  }
  void Drained() override { WriteChunk(); }
  void Idle() override {
    constexpr int kRounds = 200;
    if (++rounds % kRounds == 0) Sync();
  }
  void Finish() override {
    if (outcome) Complete(*outcome);
  }
  [[nodiscard]] std::int64_t progress() const noexcept override { return taken; }

  void AddLost(std::int64_t count) {
    Add(BlockKind::kLost, EncodeLost({next_index, count}));
    next_index += count;
    Say(
        fmt::format("{}: {} ticks could not be recorded, the disk was too slow; the record says "
                    "which",
                    config.file, count));
  }

  void Add(BlockKind kind, std::span<const std::uint8_t> content) {
    AppendBlock(kind, blocks++, content, chunk);
    ends.push_back({chunk.size(), kind == BlockKind::kTick ? 1 : 0});
  }

  void WriteChunk() {
    if (chunk.empty() || !problem.empty()) return;
    std::size_t written = 0;
    while (written < chunk.size()) {
      const ssize_t count = write(descriptor, chunk.data() + written, chunk.size() - written);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) {
        const int error = count < 0 ? errno : EIO;
        Fail(error, written);
        break;
      }
      written += static_cast<std::size_t>(count);
      taken += count;
    }
    if (problem.empty()) {
      crc = Crc32(chunk, crc);
      file_bytes += chunk.size();
      for (const BlockEnd& end : ends) recorded += end.ticks;
    }
    chunk.clear();
    ends.clear();
  }

  /// Cuts the file back to its last whole block, and stops recording.
  void Fail(int error, std::size_t written) {
    std::size_t whole = 0;
    std::int64_t lost_here = 0;
    for (const BlockEnd& end : ends) {
      if (end.offset <= written) {
        whole = end.offset;
        recorded += end.ticks;
      } else {
        lost_here += end.ticks;
      }
    }
    const bool cut = ftruncate(descriptor, static_cast<off_t>(file_bytes + whole)) == 0;
    const std::string reason = std::generic_category().message(error);
    problem = recorded == 0 && file_bytes == 0
                  ? fmt::format("{}: cannot be written: {}", config.file, reason)
                  : fmt::format(
                        "{}: recording stopped after {} ticks (at the {}th of this run): "
                        "{}; the {} bytes written before are {}",
                        config.file, recorded, last_index + 1 - lost_here, reason,
                        file_bytes + whole, cut ? "whole" : "kept, and some beyond them");
    if (file_bytes > 0) Say(problem);
  }

  void Say(const std::string& text) const {
    if (config.say) config.say(text);
  }

  void Sync() const {
    if (problem.empty()) static_cast<void>(fdatasync(descriptor));
  }

  /// Writes the rest, and the block that says that the record is complete.
  void Complete(const std::string& how) {
    if (problem.empty()) {
      if (pushed > next_index) AddLost(pushed - next_index);
      WriteChunk();
      Add(BlockKind::kEnd, EncodeEnd({recorded, lost, crc, how}));
      WriteChunk();
    }
    Sync();
    close(descriptor);
    descriptor = -1;
  }

  struct BlockEnd {
    std::size_t offset = 0;  // of the block's end in the chunk
    std::int64_t ticks = 0;  // 1 if the block is a tick
  };

  FlightRecorderConfig config;
  std::optional<std::string> outcome;  // of the run, where the record is to be completed

  // Counted by the loop.
  std::atomic<std::int64_t> pushed{0};
  std::atomic<std::int64_t> lost{0};

  // Used by the thread that writes the file.
  int descriptor = -1;
  RecordBytes chunk;  // blocks that are still to be written
  std::vector<BlockEnd> ends;
  std::uint32_t blocks = 0;
  std::uint32_t crc = 0;
  std::uint64_t file_bytes = 0;
  std::int64_t next_index = 0;
  std::int64_t last_index = -1;
  std::atomic<std::int64_t> recorded{0};
  std::string problem;
  int rounds = 0;
  std::atomic<std::int64_t> taken{0};  // grows as long as the file takes something
};

void RequireNewRecord(const std::string& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return;
  throw std::runtime_error(fmt::format(
      "{}: exists, and a record is never overwritten: name another file, or remove it", file));
}

void KeepRecords(std::span<const std::string> files) {
  for (const std::string& file : files) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) continue;
    std::vector<std::uint8_t> begin;
    std::ifstream stream(file, std::ios::binary);
    for (std::istreambuf_iterator<char> at(stream), end;
         at != end && begin.size() < kRecordHeaderBytes; ++at) {
      begin.push_back(static_cast<std::uint8_t>(*at));
    }
    const RecordStart start = StartOf(begin);
    if (start == RecordStart::kNotARecord || start == RecordStart::kTooShort) continue;
    throw std::runtime_error(fmt::format(
        "{}: is a flight record, which is never overwritten: name another file, or remove it",
        file));
  }
}

FlightRecorder::FlightRecorder(const FlightRecorderConfig& config)
    : writer_(std::make_shared<Writer>(config)), outlet_(writer_, config.ring_bytes) {}

FlightRecorder::~FlightRecorder() = default;

void FlightRecorder::Push(std::span<const std::uint8_t> message) noexcept {
  const bool taken = !ContentOf(message).empty() && outlet_.Push(message);
  if (KindOf(message) != BlockKind::kTick) return;
  writer_->pushed.fetch_add(1, std::memory_order_relaxed);
  if (!taken) writer_->lost.fetch_add(1, std::memory_order_relaxed);
}

void FlightRecorder::Drain() { outlet_.Drain(); }
void FlightRecorder::Start() { outlet_.Start(); }

void FlightRecorder::Stop(const std::string& outcome, const Patience& patience) {
  if (!writer_->outcome) writer_->outcome = outcome;
  if (outlet_.Stop(patience)) return;
  left_behind_ =
      fmt::format("{}: could not be written whole: after {} ticks it took nothing any more",
                  writer_->config.file, writer_->recorded.load());
}

std::int64_t FlightRecorder::pushed() const noexcept { return writer_->pushed; }
std::int64_t FlightRecorder::recorded() const noexcept { return writer_->recorded; }
std::int64_t FlightRecorder::lost() const noexcept { return writer_->lost; }
const std::string& FlightRecorder::problem() const noexcept {
  return left_behind_.empty() ? writer_->problem : left_behind_;
}

}  // namespace tumbler
