#include "runtime/record/heard_runs.h"

#include <algorithm>

namespace tumbler {

HeardRuns::Run* HeardRuns::Hear(std::int64_t number, Clock::time_point now) {
  if (runs_.size() >= kMost && !runs_.contains(number)) return nullptr;
  Run& run = runs_[number];
  run.at = now;
  return &run;
}

void HeardRuns::ForgetSilent(Clock::time_point now, Clock::duration patience) {
  std::erase_if(runs_, [&](const auto& entry) { return now - entry.second.at > patience; });
}

bool HeardRuns::Named() const {
  return std::all_of(runs_.begin(), runs_.end(),
                     [](const auto& entry) { return entry.second.robot.has_value(); });
}

std::vector<std::string> HeardRuns::Robots() const {
  std::vector<std::string> names;
  for (const auto& [number, run] : runs_) {
    if (run.robot && std::find(names.begin(), names.end(), *run.robot) == names.end())
      names.push_back(*run.robot);
  }
  return names;
}

std::vector<std::int64_t> HeardRuns::Of(const std::string& robot) const {
  std::vector<std::int64_t> numbers;
  if (robot.empty() && Robots().size() > 1) return numbers;
  for (const auto& [number, run] : runs_) {
    if (number != 0 && (robot.empty() || run.robot == robot)) numbers.push_back(number);
  }
  return numbers;
}

}  // namespace tumbler
