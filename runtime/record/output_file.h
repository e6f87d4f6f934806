#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace tumbler {

/// A file, device or pipe that a run writes bit by bit. It has no stream of the C library behind
/// it, which the end of the program would have to flush: a thread that is stuck in a write to it
/// can be left behind.
class OutputFile {
 public:
  /// @param name  the file's name in messages.
  /// @throws std::runtime_error  when it cannot be written.
  OutputFile(const std::string& path, const std::string& name);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Takes bytes, and writes some when many have come together. May block for as long as the file
  /// does. After a failure nothing more is written.
  void Append(std::string_view bytes);
  void Flush();

  /// Whether something could not be written, or three signals have interrupted one write: somebody
  /// wants the program to end, and the file takes nothing.
  [[nodiscard]] bool failed() const noexcept { return failed_; }
  /// Bytes that were taken from here. Any thread may ask.
  [[nodiscard]] std::int64_t taken() const noexcept {
    return taken_.load(std::memory_order_relaxed);
  }

 private:
  static constexpr std::size_t kChunkBytes = 32768;

  int descriptor_ = -1;
  std::string buffer_;
  bool failed_ = false;
  std::atomic<std::int64_t> taken_{0};
};

}  // namespace tumbler
