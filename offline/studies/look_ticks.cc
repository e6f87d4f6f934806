#include "offline/studies/look_ticks.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "offline/problem/purpose_gauge.h"

namespace tumbler {
namespace {

/// What the judges have to see at a tick.
struct Due {
  bool state = false;  ///< Something is judged there, or may be.
  bool speed = false;  ///< The largest speed of the last kRestWatched_s is.
};

/// Knows, tick by tick, when the judges have something to judge.
class DueWatch {
 public:
  explicit DueWatch(const SequenceFile& file) : file_(file) {}

  /// To be called in every tick, in order.
  Due Observe(const ScriptTick& tick, std::int64_t time_ns) {
    Due due;
    due.state = tick.state != state_ || tick.node != node_ || tick.held != held_;
    // What is asked of the settled robot waits for the end of that time.
    due.speed = due.state && state_ == ExecutorState::kSettling;
    if (tick.state == ExecutorState::kSettling && state_ == ExecutorState::kRunning)
      EndMotion(tick.node, time_ns);
    if (tick.state == ExecutorState::kRunning) due.state = IsUnderWay(tick) || due.state;
    const double since_s = 1e-9 * static_cast<double>(time_ns - end_ns_);
    std::erase_if(after_, [&](const Target& target) {
      if (since_s < target.at_s) return false;
      due.state = true;
      due.speed = due.speed || target.speed;
      return true;
    });
    state_ = tick.state;
    node_ = tick.node;
    held_ = tick.held;
    return due;
  }

 private:
  struct Target {
    double at_s;  // since the motion's end
    bool speed;
  };

  /// Whether a target at a time in the motion falls due. The judge allows for the rounding of that
  /// time, too.
  bool IsUnderWay(const ScriptTick& tick) {
    constexpr double kRounding_s = 1e-6;
    const auto time_s = static_cast<double>(tick.primitive_time_s);
    if (state_ != ExecutorState::kRunning || tick.node != node_) last_s_ = -1;
    bool due = false;
    for (const PurposeFigure& figure : file_.PrimitiveOf(tick.node).purpose) {
      const double at_s = figure.time_s - kRounding_s;
      due = due || (figure.at_time() && time_s >= at_s && last_s_ < at_s);
    }
    last_s_ = time_s;
    return due;
  }

  void EndMotion(int node, std::int64_t time_ns) {
    const PrimitiveFile& file = file_.PrimitiveOf(node);
    const Primitive<double>& primitive = file.primitive;
    end_ns_ = time_ns;
    after_ = {{Passage::kLater_s, false}};
    for (const PurposeFigure& figure : file.purpose) {
      after_.push_back(
          {DueTime(figure, primitive.duration_s, primitive.settle_s) - primitive.duration_s,
           figure.of == PurposeTarget::Of::kSpeed});
    }
  }

  const SequenceFile& file_;
  ExecutorState state_ = ExecutorState::kDisarmed;
  int node_ = -1;
  bool held_ = true;
  double last_s_ = -1;  // in the motion
  std::int64_t end_ns_ = 0;
  std::vector<Target> after_;  // what falls due after the last motion
};

}  // namespace

std::vector<std::size_t> LookTicks(const Script& script, const SequenceFile& file,
                                   std::size_t every) {
  const auto watched = static_cast<std::size_t>(std::ceil(kRestWatched_s / script.tick_s));
  DueWatch watch(file);
  std::vector<bool> looks(script.ticks.size());
  for (std::size_t k = 0; k < script.ticks.size(); ++k) {
    const std::int64_t time_ns = std::llround(1e9 * script.tick_s * static_cast<double>(k));
    const Due due = watch.Observe(script.ticks[k], time_ns);
    looks[k] = due.state || k % every == 0;
    if (!due.speed) continue;
    for (std::size_t back = 0; back <= std::min(k, watched); ++back) looks[k - back] = true;
  }
  std::vector<std::size_t> ticks;
  for (std::size_t k = 0; k < looks.size(); ++k)
    if (looks[k]) ticks.push_back(k);
  ticks.push_back(looks.size());
  return ticks;
}

}  // namespace tumbler
