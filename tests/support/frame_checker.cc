#include "tests/support/frame_checker.h"

#include <fmt/format.h>

#include <cstdlib>
#include <stdexcept>

#include "tests/support/joint_judge.h"
#include "tests/support/protocol_side.h"

namespace tumbler::testing {

class FrameJudge::Checker {
 public:
  explicit Checker(const FrameRules& rules) : bus_(rules) {
    const std::vector<DriveEntry>& drives = rules.drives.drives;
    joints_.reserve(drives.size());  // References to them must stay valid.
    for (std::size_t i = 0; i < drives.size(); ++i) {
      const DriveConfig& drive = drives[i].config;
      const ProtocolSide& side = SideOf(drive);
      joints_.emplace_back(bus_, i, JointOf(drive), side.StepsOf(drive));
      watches_.push_back(side.Watch(drive, joints_[i]));
    }
  }

  void Take(const LoggedFrame& logged) {
    bus_.NextLine();
    const CanFrame& frame = logged.frame;
    if (!frame.remote) {
      if (!frame.extended && watches_[0]->TakeCommon(logged)) return;
      for (const std::unique_ptr<DriveWatch>& watch : watches_) {
        if (watch->extended() == frame.extended && watch->Take(logged)) return;
      }
    }
    bus_.Fail(fmt::format("identifier {:X} is none of the drives'", frame.id));
  }

  const FrameReport& report() { return bus_.report(); }
  [[nodiscard]] const DriveOrder& order(std::size_t joint) const { return joints_[joint].order(); }

 private:
  BusJudge bus_;
  std::vector<JointJudge> joints_;
  std::vector<std::unique_ptr<DriveWatch>> watches_;
};

FrameJudge::FrameJudge(const FrameRules& rules) : checker_(std::make_unique<Checker>(rules)) {}
FrameJudge::~FrameJudge() = default;
void FrameJudge::Take(const LoggedFrame& logged) { checker_->Take(logged); }
const FrameReport& FrameJudge::report() { return checker_->report(); }
const DriveOrder& FrameJudge::last_order(std::size_t joint) const { return checker_->order(joint); }

std::vector<LoggedFrame> ParseCandumpLog(std::string_view text) {
  std::vector<LoggedFrame> log;
  int number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = text.find('\n');
    const std::string line(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    const auto require = [&](bool condition) {
      if (!condition) {
        throw std::runtime_error(
            fmt::format("line {} is not one of candump -L: '{}'", number, line));
      }
    };
    // (1795259017.651121) vcan0 123#DEADBEEF
    const std::size_t after_time = line.find(") ");
    const std::size_t hash = line.find('#');
    require(line.size() > 2 && line[0] == '(' && after_time != std::string::npos &&
            hash != std::string::npos);
    LoggedFrame logged;
    char* rest = nullptr;
    logged.time_s = std::strtod(line.c_str() + 1, &rest);
    require(rest == line.c_str() + after_time);
    const std::size_t space = line.rfind(' ', hash);
    require(space != std::string::npos && space > after_time);
    const std::string id = line.substr(space + 1, hash - space - 1);
    require(id.size() == 3 || id.size() == 8);
    logged.frame.extended = id.size() == 8;
    logged.frame.id = static_cast<std::uint32_t>(std::strtoul(id.c_str(), &rest, 16));
    require(*rest == '\0');
    std::string data = line.substr(hash + 1);
    if (!data.empty() && data[0] == 'R') {
      logged.frame.remote = true;
      data.clear();
    }
    require(data.size() % 2 == 0 && data.size() <= 16);
    logged.frame.size = static_cast<std::uint8_t>(data.size() / 2);
    for (std::size_t i = 0; i < logged.frame.size; ++i) {
      const std::string byte = data.substr(2 * i, 2);
      logged.frame.data[i] = static_cast<std::uint8_t>(std::strtoul(byte.c_str(), &rest, 16));
      require(*rest == '\0');
    }
    log.push_back(logged);
  }
  return log;
}

FrameReport CheckFrames(const std::vector<LoggedFrame>& log, const FrameRules& rules) {
  FrameJudge judge(rules);
  for (const LoggedFrame& logged : log) judge.Take(logged);
  return judge.report();
}

}  // namespace tumbler::testing
