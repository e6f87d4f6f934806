#include "runtime/record/flight_recorder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <vector>

#include "common/core/message_ring.h"
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

// The ring is padded on purpose, and nothing else in here matters beside its size.
struct FlightRecorder::Implementation {  // NOLINT(clang-analyzer-optin.performance.Padding)
  explicit Implementation(const FlightRecorderConfig& config_in)
      : config(config_in), storage(config_in.ring_bytes), ring(storage) {
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
  ~Implementation() {
    if (descriptor >= 0) {
      Drain();
      close(descriptor);
      if (pushed == 0) unlink(config.file.c_str());
    }
  }

  void Drain() {
    std::size_t size = 0;
    while (ring.Pop(message, size)) {
      const auto kind = static_cast<BlockKind>(message[0]);
      const std::span<const std::uint8_t> tick = std::span(message).subspan(1, size - 1);
      if (!problem.empty()) continue;  // Recording has stopped: messages are thrown away.
      if (kind == BlockKind::kTruth) {
        Add(kind, tick);
        if (chunk.size() >= kChunkBytes) WriteChunk();
        continue;
      }
      const std::int64_t index = IndexOf(tick);
      if (index > next_index) AddLost(index - next_index);
      last_index = index;
      next_index = index + 1;
      Add(BlockKind::kTick, tick);
      if (chunk.size() >= kChunkBytes) WriteChunk();
    }
    WriteChunk();
  }

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
    if (descriptor < 0) return;
    Drain();
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

  /// Waits for the end of the thread.
  /// @returns false when it was left behind, since the file took nothing for so long.
  bool Await(std::thread& thread, const std::function<std::chrono::milliseconds()>& patience) {
    using SteadyClock = std::chrono::steady_clock;
    constexpr std::chrono::milliseconds kGlance(50);
    std::unique_lock lock(mutex);
    std::int64_t progress = -1;
    auto progressed = SteadyClock::now();
    while (!ended.wait_for(lock, kGlance, [this] { return done; })) {
      if (taken != progress) progressed = SteadyClock::now();
      progress = taken;
      if (SteadyClock::now() - progressed < patience()) continue;
      thread.detach();
      return false;
    }
    lock.unlock();
    thread.join();
    return true;
  }

  struct BlockEnd {
    std::size_t offset = 0;  // of the block's end in the chunk
    std::int64_t ticks = 0;  // 1 if the block is a tick
  };

  FlightRecorderConfig config;
  std::vector<std::uint8_t> storage;
  MessageRing ring;

  // Used by the loop. The first byte of a message in the ring is the kind of its block.
  std::array<std::uint8_t, 1 + kTickEntryBytesMax> scratch;
  std::atomic<std::int64_t> pushed{0};
  std::atomic<std::int64_t> lost{0};

  // Used by the thread that writes the file.
  int descriptor = -1;
  std::array<std::uint8_t, 1 + kTickEntryBytesMax> message;
  RecordBytes chunk;  // blocks that are still to be written
  std::vector<BlockEnd> ends;
  std::uint32_t blocks = 0;
  std::uint32_t crc = 0;
  std::uint64_t file_bytes = 0;
  std::int64_t next_index = 0;
  std::int64_t last_index = -1;
  std::atomic<std::int64_t> recorded{0};
  std::string problem;

  // Between the thread and whoever ends it.
  std::atomic<bool> stop{false};
  std::atomic<std::int64_t> taken{0};  // grows as long as the file takes something
  std::mutex mutex;
  std::condition_variable ended;
  std::optional<std::string> outcome;  // of the run, where the record is to be completed
  bool done = false;
};

void RequireNewRecord(const std::string& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return;
  throw std::runtime_error(fmt::format(
      "{}: exists, and a record is never overwritten: name another file, or remove it", file));
}

FlightRecorder::FlightRecorder(const FlightRecorderConfig& config)
    : implementation_(std::make_shared<Implementation>(config)) {}

FlightRecorder::~FlightRecorder() {
  if (!thread_.joinable()) return;
  implementation_->stop = true;
  static_cast<void>(implementation_->Await(thread_, [] { return std::chrono::seconds(1); }));
}

void FlightRecorder::Push(const TickNotes& notes, const TickInput& input,
                          const TickOutput& output) noexcept {
  Implementation& self = *implementation_;
  const std::int64_t index = self.pushed.load(std::memory_order_relaxed);
  self.pushed.store(index + 1, std::memory_order_relaxed);
  self.scratch[0] = static_cast<std::uint8_t>(BlockKind::kTick);
  const std::size_t size =
      EncodeTick(index, notes, input, output, std::span(self.scratch).subspan(1));
  if (size == 0 || !self.ring.Push(std::span(self.scratch).first(1 + size))) {
    self.lost.fetch_add(1, std::memory_order_relaxed);
  }
}

void FlightRecorder::PushTruth(std::span<const std::uint8_t> message) noexcept {
  Implementation& self = *implementation_;
  if (message.empty() || message.size() > kTickEntryBytesMax) return;
  self.scratch[0] = static_cast<std::uint8_t>(BlockKind::kTruth);
  std::memcpy(self.scratch.data() + 1, message.data(), message.size());
  static_cast<void>(self.ring.Push(std::span(self.scratch).first(1 + message.size())));
}

void FlightRecorder::Drain() { implementation_->Drain(); }

void FlightRecorder::Start() {
  implementation_->stop = false;
  thread_ = std::thread([self = implementation_] {
    int round = 0;
    while (!self->stop) {
      self->Drain();
      if (++round % 200 == 0) self->Sync();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    std::optional<std::string> outcome;
    {
      const std::lock_guard lock(self->mutex);
      outcome = self->outcome;
    }
    if (outcome) self->Complete(*outcome);
    const std::lock_guard lock(self->mutex);
    self->done = true;
    self->ended.notify_all();
  });
}

void FlightRecorder::Stop(const std::string& outcome,
                          const std::function<std::chrono::milliseconds()>& patience) {
  Implementation& self = *implementation_;
  if (!thread_.joinable()) {
    if (left_behind_.empty()) self.Complete(outcome);
    return;
  }
  {
    const std::lock_guard lock(self.mutex);
    self.outcome = outcome;
  }
  self.stop = true;
  constexpr std::chrono::seconds kPatience(10);
  const bool ended = self.Await(
      thread_,
      patience ? patience : [kPatience]() { return std::chrono::milliseconds(kPatience); });
  if (ended) return;
  left_behind_ =
      fmt::format("{}: could not be written whole: after {} ticks it took nothing any more",
                  self.config.file, self.recorded.load());
}

std::int64_t FlightRecorder::pushed() const noexcept { return implementation_->pushed; }
std::int64_t FlightRecorder::recorded() const noexcept { return implementation_->recorded; }
std::int64_t FlightRecorder::lost() const noexcept { return implementation_->lost; }
const std::string& FlightRecorder::problem() const noexcept {
  return left_behind_.empty() ? implementation_->problem : left_behind_;
}

}  // namespace tumbler
