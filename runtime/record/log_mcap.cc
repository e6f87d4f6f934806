#include "runtime/record/log_mcap.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <lcm/lcm-cpp.hpp>
#include <optional>
#include <stdexcept>
#include <tumbler/event_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/space_truth_t.hpp>
#include <tumbler/state_t.hpp>

#include "common/files/result_file.h"
#include "runtime/record/channels.h"
#include "runtime/record/lcm_log.h"
#include "runtime/record/message_readers.h"
#include "runtime/record/run_mcap.h"

namespace tumbler {
namespace {

template <typename Message>
std::optional<Message> MessageIn(const lcm::LogEvent& event, const char* channel) {
  if (event.channel != channel) return std::nullopt;
  return ReadMessage<Message>(event.data, static_cast<std::size_t>(event.datalen));
}

/// What has to be known of a log before it is written.
struct LogFacts {
  std::optional<run_t> run;  ///< The first one.
  bool states = false;
  std::size_t joints = 0;  ///< Of the first state.
  bool truth = false;      ///< Whether there is any.
};

LogFacts FactsOf(const std::string& path) {
  LogFacts facts;
  ForEachLogEvent(path, [&facts](const lcm::LogEvent& event) {
    if (!facts.run) facts.run = MessageIn<run_t>(event, kRunChannel);
    if (!facts.states) {
      const auto state = MessageIn<state_t>(event, kStateChannel);
      facts.states = state.has_value();
      if (state) facts.joints = state->joints.size();
    }
    facts.truth = facts.truth || event.channel == kTruthChannel;
  });
  if (!facts.states) {
    throw std::runtime_error(fmt::format(
        "{}: no tick is in it when it is read again; MCAP needs a file, not a pipe", path));
  }
  return facts;
}

RunMcapConfig ConfigOf(const LogMcapConfig& log) {
  const LogFacts facts = FactsOf(log.log);
  RunMcapConfig config;
  if (facts.run) {
    config.joints = facts.run->joints;
    config.imagined_drives = facts.run->mode == "dry run";
    config.about = {{"logged_by", "tumbler run " + facts.run->version},
                    {"bus", facts.run->bus},
                    {"mode", facts.run->mode},
                    {"motion", facts.run->motion},
                    {"rate_hz", fmt::format("{}", facts.run->rate_hz)},
                    {"kernel", facts.run->kernel}};
  }
  for (std::size_t i = config.joints.size(); i < facts.joints; ++i)
    config.joints.push_back(fmt::format("joint{}", i + 1));
  if (log.robot_of) {
    config.robot = log.robot_of(config.joints);
    config.root = facts.truth ? RunMcapConfig::Root::kTrue : RunMcapConfig::Root::kUnknown;
  }
  return config;
}

}  // namespace

void ExportLogMcap(const LogMcapConfig& config) {
  PendingName pending(config.mcap);
  OutputFile file(pending.to_open(), config.mcap);
  RunMcap mcap(ConfigOf(config), file);
  ForEachLogEvent(config.log, [&mcap](const lcm::LogEvent& event) {
    const auto time_ns =
        static_cast<std::uint64_t>(std::max<std::int64_t>(event.timestamp, 0)) * 1000;
    if (const auto state = MessageIn<state_t>(event, kStateChannel)) mcap.Take(time_ns, *state);
    if (const auto happened = MessageIn<event_t>(event, kEventChannel))
      mcap.Take(time_ns, *happened);
    if (const auto run = MessageIn<run_t>(event, kRunChannel)) mcap.Take(time_ns, *run);
    if (const auto truth = MessageIn<space_truth_t>(event, kTruthChannel))
      mcap.Take(time_ns, *truth);
  });
  mcap.Finish();
  if (file.failed())
    throw std::runtime_error(fmt::format("{}: could not be written whole", config.mcap));
  pending.Commit();
}

}  // namespace tumbler
