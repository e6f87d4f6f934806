#include "runtime/record/lcm_log.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "common/files/toml_reader.h"

namespace tumbler {

LogReading ForEachLogEvent(const std::string& path,
                           const std::function<void(const lcm::LogEvent& event)>& take) {
  std::error_code unknown;
  if (std::filesystem::is_directory(path, unknown))
    throw FileError(path, 0, "", "is a directory, not a file");
  if (std::filesystem::is_character_file(path, unknown))
    throw FileError(path, 0, "", "is a device, not a file");
  errno = 0;
  lcm::LogFile log(path, "r");
  if (!log.good()) {
    throw FileError(path, 0, "",
                    fmt::format("cannot be read: {}", std::generic_category().message(errno)));
  }
  std::FILE* const file = log.getFilePtr();
  // An event has a head of 28 bytes; of a pipe nobody knows the place.
  constexpr std::int64_t kHead = 28;
  LogReading reading;
  std::int64_t whole = 0;  // up to here events lie one behind the other
  while (true) {
    const lcm::LogEvent* event = log.readNextEvent();
    if (event == nullptr) {
      if (std::feof(file) != 0 || std::ferror(file) != 0) break;
      continue;  // This one is damaged. The library looks for the next one's first bytes.
    }
    const std::int64_t size =
        kHead + static_cast<std::int64_t>(event->channel.size()) + event->datalen;
    const std::int64_t end = ftello(file);
    if (end >= 0 && end - size > whole) {
      if (reading.lost_bytes == 0) reading.first_lost = whole;
      reading.lost_bytes += end - size - whole;
    }
    whole = end >= 0 ? end : whole + size;
    take(*event);
  }
  std::clearerr(file);
  if (std::fseek(file, 0, SEEK_END) == 0 && ftello(file) > whole) {
    if (reading.lost_bytes == 0) reading.first_lost = whole;
    reading.lost_bytes += ftello(file) - whole;
  }
  return reading;
}

}  // namespace tumbler
