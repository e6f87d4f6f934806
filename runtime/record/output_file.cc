#include "runtime/record/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace tumbler {

OutputFile::OutputFile(const std::string& path, const std::string& name)
    : descriptor_(open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)) {
  if (descriptor_ < 0) {
    throw std::runtime_error(
        fmt::format("{}: cannot be written: {}", name, std::generic_category().message(errno)));
  }
}

OutputFile::~OutputFile() { close(descriptor_); }

void OutputFile::Append(std::string_view bytes) {
  if (failed_) return;
  buffer_ += bytes;
  if (buffer_.size() >= kChunkBytes) Flush();
}

void OutputFile::Flush() {
  constexpr int kInterruptionsMax = 3;
  int interruptions = 0;
  std::size_t written = 0;
  while (!failed_ && written < buffer_.size()) {
    const ssize_t count = write(descriptor_, buffer_.data() + written, buffer_.size() - written);
    if (count > 0) {
      written += static_cast<std::size_t>(count);
      taken_.fetch_add(count, std::memory_order_relaxed);
      interruptions = 0;
    } else if (count == 0 || errno != EINTR || ++interruptions == kInterruptionsMax) {
      failed_ = true;
    }
  }
  buffer_.clear();
}

}  // namespace tumbler
