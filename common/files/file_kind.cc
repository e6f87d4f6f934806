#include "common/files/file_kind.h"

#include <algorithm>

namespace tumbler {
namespace {

template <std::size_t kSize>
bool BeginsWith(std::string_view bytes, const std::array<std::uint8_t, kSize>& begin) {
  return bytes.size() >= kSize && std::ranges::equal(bytes.substr(0, kSize), begin, {}, [](char c) {
           return static_cast<std::uint8_t>(c);
         });
}

/// Whether it begins as a line of candump does: a time in parentheses.
bool IsCandump(std::string_view bytes) {
  return bytes.size() >= 2 && bytes[0] == '(' && bytes[1] >= '0' && bytes[1] <= '9';
}

}  // namespace

std::string_view KindOfRunFile(std::string_view bytes) {
  constexpr std::array<std::uint8_t, 5> kMcap = {0x89, 'M', 'C', 'A', 'P'};
  if (BeginsWith(bytes, kFlightRecordBegin))
    return "a flight record, which tumbler record, replay and view take";
  if (BeginsWith(bytes, kLcmEventBegin)) return "an LCM log, which tumbler record takes";
  if (BeginsWith(bytes, kMcap)) return "an MCAP file, which Foxglove and PlotJuggler show";
  if (IsCandump(bytes)) return "a candump log, which tumbler replay takes";
  return {};
}

}  // namespace tumbler
