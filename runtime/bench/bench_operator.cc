#include "runtime/bench/bench_operator.h"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <deque>
#include <numbers>
#include <optional>
#include <sstream>

#include "common/files/program.h"
#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

void Print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

/// The lines that somebody types, or has written down.
class Lines {
 public:
  /// @param patience_ms  the longest time from one call of `meanwhile` to the next.
  Lines(const std::string& file, int patience_ms)
      : from_file_(!file.empty()), name_(file), patience_ms_(patience_ms) {
    if (!from_file_) return;
    std::istringstream text(ReadTextFile(file));
    for (std::string line; std::getline(text, line);) {
      const std::string answer = Trimmed(line.substr(0, line.find('#')));
      if (!answer.empty()) lines_.push_back(answer);
    }
  }
  /// The next line. @throws Refused  when there is none any more.
  std::string Next(const std::function<void()>& meanwhile) {
    while (lines_.empty()) {
      if (from_file_) throw Refused(name_ + ": has no answer to this; write one more line");
      Read(meanwhile);
    }
    std::string line = lines_.front();
    lines_.pop_front();
    // On a terminal it stands there already.
    if (from_file_ || isatty(STDIN_FILENO) == 0) Print(line + '\n');
    return line;
  }

 private:
  static std::string Trimmed(const std::string& text) {
    const auto begin = text.find_first_not_of(" \t\r");
    if (begin == std::string::npos) return "";
    return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
  }
  void Read(const std::function<void()>& meanwhile) {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    if (poll(&input, 1, patience_ms_) <= 0) {
      meanwhile();
      return;
    }
    std::array<char, 256> buffer;
    const ssize_t count = read(STDIN_FILENO, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) return meanwhile();
    if (count <= 0) throw Refused("nobody answers: standard input has ended");
    partial_.append(buffer.data(), static_cast<std::size_t>(count));
    for (std::size_t end = 0; (end = partial_.find('\n')) != std::string::npos;) {
      lines_.push_back(Trimmed(partial_.substr(0, end)));
      partial_.erase(0, end + 1);
    }
  }

  bool from_file_;
  std::string name_;
  int patience_ms_;
  std::deque<std::string> lines_;
  std::string partial_;
};

/// What happens beside a simulated robot.
class Bystander {
 public:
  explicit Bystander(SimulatedHands& hands) : hands_(hands) {}

  void NoteBefore() { before_rad_ = farthest_rad_ = Angles(); }
  void NoteFarthest() { farthest_rad_ = Angles(); }
  /// The joint that turned most; empty when none was seen to turn.
  [[nodiscard]] std::string Turned() const {
    constexpr double kVisible_rad = 0.01;
    std::string turned;
    double most_rad = kVisible_rad;
    for (std::size_t i = 0; i < before_rad_.size(); ++i) {
      const double way_rad = std::abs(farthest_rad_[i] - before_rad_[i]);
      if (way_rad <= most_rad) continue;
      most_rad = way_rad;
      turned = hands_.joints()[i];
    }
    return turned;
  }
  [[nodiscard]] double WayOf(const std::string& joint) const {
    const std::size_t i = IndexOf(joint);
    return farthest_rad_[i] - before_rad_[i];
  }
  /// Turns a joint to an angle in so many steps.
  void Turn(const std::string& joint, double angle_rad, int steps,
            const std::function<void()>& meanwhile) {
    const std::size_t i = IndexOf(joint);
    const double from_rad = hands_.AngleOf(i);
    for (int step = 1; step <= steps; ++step) {
      hands_.Turn(i, from_rad + (angle_rad - from_rad) * step / steps);
      meanwhile();
    }
    hands_.Turn(i, angle_rad);
  }
  void Place(const std::string& joint, double angle_rad, const std::function<void()>& meanwhile) {
    constexpr int kSteps = 200;
    Turn(joint, angle_rad, kSteps, meanwhile);
  }
  void TurnThrough(const std::string& joint, double lower_rad, double upper_rad,
                   const std::function<void()>& meanwhile) {
    constexpr int kSteps = 1000;
    const double from_rad = hands_.AngleOf(IndexOf(joint));
    for (const double to_rad : {upper_rad, lower_rad, from_rad})
      Turn(joint, to_rad, kSteps, meanwhile);
  }

 private:
  [[nodiscard]] std::vector<double> Angles() const {
    std::vector<double> angles;
    for (std::size_t i = 0; i < hands_.joints().size(); ++i) angles.push_back(hands_.AngleOf(i));
    return angles;
  }
  [[nodiscard]] std::size_t IndexOf(const std::string& joint) const {
    const auto& joints = hands_.joints();
    const auto found = std::find(joints.begin(), joints.end(), joint);
    if (found == joints.end())
      throw Refused(fmt::format("the simulated robot has no joint '{}'", joint));
    return static_cast<std::size_t>(found - joints.begin());
  }

  SimulatedHands& hands_;
  std::vector<double> before_rad_;
  std::vector<double> farthest_rad_;
};

class AskedOperator final : public BenchOperator {
 public:
  explicit AskedOperator(const OperatorScript& script)
      : lines_(script.answers, script.hands == nullptr ? 0 : kVirtual_ms), yes_(script.yes) {
    if (script.hands != nullptr) bystander_.emplace(*script.hands);
  }

  void NoteBefore() override {
    if (bystander_) bystander_->NoteBefore();
  }
  void NoteFarthest() override {
    if (bystander_) bystander_->NoteFarthest();
  }

  bool Confirm(const std::string& what, const std::function<void()>& meanwhile) override {
    Print(what + " [yes/no] ");
    if (yes_) {
      Print("yes\n");
      return true;
    }
    return YesOrNo(meanwhile);
  }
  std::string WhichTurned(const std::vector<std::string>& joints,
                          const std::function<void()>& meanwhile) override {
    if (bystander_) {
      const std::string turned = bystander_->Turned();
      Print(turned.empty() ? "(You see nothing turn.)\n"
                           : fmt::format("(You see {} turn by {:+.3f} rad, and back.)\n", turned,
                                         bystander_->WayOf(turned)));
    }
    std::vector<std::string> names = joints;
    names.emplace_back("none");
    for (;;) {
      Print(fmt::format("Which joint turned? [{}] ", fmt::join(names, "/")));
      std::string answer = lines_.Next(meanwhile);
      if (answer == "none") return "";
      if (std::find(joints.begin(), joints.end(), answer) != joints.end()) return answer;
    }
  }
  bool Grew(const std::string& joint, const std::function<void()>& meanwhile) override {
    Print(
        fmt::format("Did the angle of {} grow, as its axis in the URDF has it? [yes/no] ", joint));
    return YesOrNo(meanwhile);
  }
  bool Place(const std::string& joint, double angle_rad,
             const std::function<void()>& meanwhile) override {
    if (bystander_) bystander_->Place(joint, angle_rad, meanwhile);
    Print(fmt::format("Put {} to {:.4f} rad ({:.1f} degrees) by hand. Is it there? [yes/no] ",
                      joint, angle_rad, angle_rad * 180 / std::numbers::pi));
    return YesOrNo(meanwhile);
  }
  bool TurnThrough(const std::string& joint, double lower_rad, double upper_rad,
                   const std::function<void()>& meanwhile) override {
    if (bystander_) bystander_->TurnThrough(joint, lower_rad, upper_rad, meanwhile);
    Print(
        fmt::format("Turn {} by hand to both ends of its way, {:.3f} and {:.3f} rad. Has it been "
                    "at both? [yes/no] ",
                    joint, lower_rad, upper_rad));
    return YesOrNo(meanwhile);
  }

 private:
  bool YesOrNo(const std::function<void()>& meanwhile) {
    for (;;) {
      const std::string answer = lines_.Next(meanwhile);
      if (answer == "yes" || answer == "y") return true;
      if (answer == "no" || answer == "n") return false;
      Print("yes or no? ");
    }
  }

  // On hardware, `meanwhile` waits for the next tick. Virtual time need not race.
  static constexpr int kVirtual_ms = 20;

  Lines lines_;
  bool yes_;
  std::optional<Bystander> bystander_;
};

class SimulatedOperator final : public BenchOperator {
 public:
  explicit SimulatedOperator(SimulatedHands& hands) : bystander_(hands) {}

  void NoteBefore() override { bystander_.NoteBefore(); }
  void NoteFarthest() override { bystander_.NoteFarthest(); }

  bool Confirm(const std::string& what, const std::function<void()>& /*meanwhile*/) override {
    Print(what + " [yes/no] yes\n");
    return true;
  }
  std::string WhichTurned(const std::vector<std::string>& joints,
                          const std::function<void()>& /*meanwhile*/) override {
    std::string turned = bystander_.Turned();
    if (std::find(joints.begin(), joints.end(), turned) == joints.end()) turned.clear();
    Print(fmt::format("Which joint turned? [{}/none] {}\n", fmt::join(joints, "/"),
                      turned.empty() ? "none" : turned));
    return turned;
  }
  bool Grew(const std::string& joint, const std::function<void()>& /*meanwhile*/) override {
    const bool grew = bystander_.WayOf(joint) > 0;
    Print(fmt::format("Did the angle of {} grow, as its axis in the URDF has it? [yes/no] {}\n",
                      joint, grew ? "yes" : "no"));
    return grew;
  }
  bool Place(const std::string& joint, double angle_rad,
             const std::function<void()>& meanwhile) override {
    bystander_.Place(joint, angle_rad, meanwhile);
    Print(
        fmt::format("Put {} to {:.4f} rad by hand. Is it there? [yes/no] yes\n", joint, angle_rad));
    return true;
  }
  bool TurnThrough(const std::string& joint, double lower_rad, double upper_rad,
                   const std::function<void()>& meanwhile) override {
    bystander_.TurnThrough(joint, lower_rad, upper_rad, meanwhile);
    Print(
        fmt::format("Turn {} by hand to both ends of its way, {:.3f} and {:.3f} rad. Has it "
                    "been at both? [yes/no] yes\n",
                    joint, lower_rad, upper_rad));
    return true;
  }

 private:
  Bystander bystander_;
};

}  // namespace

std::unique_ptr<BenchOperator> MakeAskedOperator(const OperatorScript& script) {
  return std::make_unique<AskedOperator>(script);
}

std::unique_ptr<BenchOperator> MakeSimulatedOperator(SimulatedHands& hands) {
  return std::make_unique<SimulatedOperator>(hands);
}

}  // namespace tumbler
