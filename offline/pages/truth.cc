#include "offline/pages/truth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include <lcm/lcm-cpp.hpp>

#include "runtime/record/channels.h"
#include "runtime/record/lcm_log.h"
#include "runtime/record/message_readers.h"

namespace tumbler {

std::vector<double> PassiveOf(const truth_t& truth, const std::vector<std::string>& names) {
  std::vector<double> positions;
  for (const std::string& name : names) {
    const auto joint = std::ranges::find(truth.joints, name, &joint_truth_t::name);
    if (joint == truth.joints.end()) return {};
    positions.push_back(joint->position_rad);
  }
  return positions;
}

std::vector<LoggedTruth> ReadTruthLog(const std::string& path) {
  const auto fail = [&path](const std::string& problem) {
    throw std::runtime_error(fmt::format("{}: {}", path, problem));
  };
  errno = 0;
  std::ifstream probe(path, std::ios::binary);
  if (!probe || probe.peek() == std::ifstream::traits_type::eof()) {
    const int error = errno;
    fail(error != 0 ? fmt::format("cannot be read: {}", std::generic_category().message(error))
                    : "is empty");
  }
  std::vector<LoggedTruth> truths;
  const LogReading reading = ForEachLogEvent(path, [&](const lcm::LogEvent& event) {
    if (event.channel != kTruthChannel) return;
    LoggedTruth logged;
    logged.utime_us = event.timestamp;
    const auto* bytes = static_cast<const std::uint8_t*>(event.data);
    if (!ReadMessage({bytes, static_cast<std::size_t>(event.datalen)}, logged.truth)) {
      fail(fmt::format("event {} is no message truth_t or space_truth_t of this version",
                       event.eventnum));
    }
    truths.push_back(std::move(logged));
  });
  if (reading.lost_bytes > 0 && !truths.empty()) {
    fail(fmt::format(
        "{} bytes are in no whole event, the first at byte {}; head -c {} of it is whole",
        reading.lost_bytes, reading.first_lost, reading.first_lost));
  }
  if (truths.empty()) fail(fmt::format("is no LCM log with messages on channel {}", kTruthChannel));
  return truths;
}

}  // namespace tumbler
