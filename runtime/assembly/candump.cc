#include "runtime/assembly/candump.h"

#include <fmt/format.h>

#include <charconv>
#include <map>
#include <stdexcept>

namespace tumbler {
namespace {

constexpr std::uint32_t kErrorFlag = 1U << 29;  // CAN_ERR_FLAG, which candump prints in its ids

/// The number that is the whole of `text`.
template <typename T>
bool ToNumber(std::string_view text, int base, T& value) {
  const char* const end = text.data() + text.size();
  // `end` says where it ends. NOLINTNEXTLINE(bugprone-suspicious-stringview-data-usage)
  const auto result = std::from_chars(text.data(), end, value, base);
  return !text.empty() && result.ec == std::errc() && result.ptr == end;
}

enum class LineKind { kFrame, kSkipped, kWrong };

LineKind ParseLine(std::string_view line, CandumpFrame& frame) {
  // (1436509052.249713) vcan0 044#2A366C2BBA
  const std::size_t dot = line.find('.');
  const std::size_t after_time = line.find(") ");
  if (!line.starts_with('(') || dot == std::string_view::npos ||
      after_time == std::string_view::npos || after_time < dot || after_time - dot != 7) {
    return LineKind::kWrong;
  }
  std::int64_t seconds = 0, microseconds = 0;
  if (!ToNumber(line.substr(1, dot - 1), 10, seconds) ||
      !ToNumber(line.substr(dot + 1, 6), 10, microseconds) || seconds < 0 ||
      seconds > 9'000'000'000 || microseconds < 0) {
    return LineKind::kWrong;
  }
  frame.received.time_ns = seconds * 1'000'000'000 + microseconds * 1000;
  line.remove_prefix(after_time + 2);
  while (line.starts_with(' ')) line.remove_prefix(1);  // Names are right-aligned.
  const std::size_t space = line.find(' ');
  if (space == std::string_view::npos || space == 0) return LineKind::kWrong;
  frame.interface = std::string(line.substr(0, space));
  line.remove_prefix(space + 1);
  while (line.ends_with('\r') || line.ends_with(' ')) line.remove_suffix(1);
  // A direction may follow (candump -x).
  if (line.ends_with(" T") || line.ends_with(" R")) line.remove_suffix(2);

  const std::size_t hash = line.find('#');
  if (hash != 3 && hash != 8) return LineKind::kWrong;
  CanFrame& can = frame.received.frame;
  can = {};
  can.extended = hash == 8;
  if (!ToNumber(line.substr(0, hash), 16, can.id)) return LineKind::kWrong;
  if (can.extended && (can.id & kErrorFlag) != 0) return LineKind::kSkipped;
  if (can.id > (can.extended ? 0x1fffffffU : 0x7ffU)) return LineKind::kWrong;
  line.remove_prefix(hash + 1);
  if (line.starts_with('#')) return LineKind::kSkipped;  // CAN FD
  if (line.starts_with('R')) {
    can.remote = true;
    line.remove_prefix(1);
    if (!line.empty() && (line.size() > 1 || !ToNumber(line, 16, can.size) || can.size > 8)) {
      return LineKind::kWrong;
    }
    return LineKind::kFrame;
  }
  if (line.size() % 2 != 0 || line.size() > 16) return LineKind::kWrong;
  can.size = static_cast<std::uint8_t>(line.size() / 2);
  for (std::size_t i = 0; i < can.size; ++i) {
    if (!ToNumber(line.substr(2 * i, 2), 16, can.data[i])) return LineKind::kWrong;
  }
  return LineKind::kFrame;
}

}  // namespace

std::string CandumpLine(std::int64_t time_ns, std::string_view interface, const CanFrame& frame) {
  std::string line = fmt::format("({:010}.{:06}) {} ", time_ns / 1'000'000'000,
                                 time_ns / 1000 % 1'000'000, interface);
  line += frame.extended ? fmt::format("{:08X}#", frame.id) : fmt::format("{:03X}#", frame.id);
  if (frame.remote) return line + 'R' + (frame.size > 0 ? fmt::format("{:X}", frame.size) : "");
  for (std::size_t i = 0; i < frame.size; ++i) line += fmt::format("{:02X}", frame.data[i]);
  return line;
}

std::vector<CandumpFrame> ParseCandump(std::string_view text, const std::string& name,
                                       std::int64_t& skipped) {
  std::vector<CandumpFrame> frames;
  skipped = 0;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty()) continue;
    CandumpFrame frame;
    switch (ParseLine(line, frame)) {
      case LineKind::kFrame:
        frames.push_back(frame);
        break;
      case LineKind::kSkipped:
        ++skipped;
        break;
      case LineKind::kWrong:
        throw std::runtime_error(
            fmt::format("{}:{}: is not a line of `candump -l`, such as `(1436509052.249713) vcan0 "
                        "044#2A366C2BBA`: '{}'",
                        name, number, line.substr(0, 80)));
    }
  }
  return frames;
}

std::vector<CandumpFrame> FramesOfInterface(std::vector<CandumpFrame> frames,
                                            const std::string& name, const std::string& interface) {
  std::map<std::string, int> counts;
  for (const CandumpFrame& frame : frames) ++counts[frame.interface];
  std::string known;
  for (const auto& [other, count] : counts)
    known += fmt::format("{}{} ({})", known.empty() ? "" : ", ", other, count);
  if (interface.empty() && counts.size() > 1) {
    throw std::runtime_error(fmt::format(
        "{}: has frames of several interfaces: {}; say with --interface on which the drives are",
        name, known));
  }
  if (interface.empty()) return frames;
  if (!counts.contains(interface)) {
    throw std::runtime_error(
        fmt::format("{}: --interface: has no frame of '{}'; it has those of {}", name, interface,
                    known.empty() ? "none" : known));
  }
  std::erase_if(frames,
                [&interface](const CandumpFrame& frame) { return frame.interface != interface; });
  return frames;
}

}  // namespace tumbler
