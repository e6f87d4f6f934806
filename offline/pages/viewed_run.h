#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include <tumbler/event_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>
#include <tumbler/truth_t.hpp>

#include "common/files/json.h"
#include "offline/pages/viewed_robot.h"
#include "runtime/record/live_view.h"

namespace tumbler {

/// A run as the page shows it at one instant, made of the messages of its telemetry. What it keeps
/// does not grow with the run.
class ViewedRun {
 public:
  /// @param robot  null: without a picture. It must outlive this object.
  explicit ViewedRun(ViewedRobot* robot) : robot_(robot) {}

  void Take(const state_t& state);
  void Take(const event_t& event);
  void Take(const run_t& run);
  void Take(const truth_t& truth);
  /// Forgets everything: another run begins.
  void Forget();

  [[nodiscard]] const std::optional<state_t>& state() const { return view_.state(); }
  [[nodiscard]] const std::optional<run_t>& run() const { return view_.run(); }

  /// What `tumbler ctl status --json` says, with the following error of each joint (measured less
  /// the setpoint that it answers; null where that is not known), wake-up and tick of this instant,
  /// the figures of the run, and the `poses` of the links. Null before the first state.
  [[nodiscard]] Json Frame();
  /// The last events, oldest first: `time_s`, `text`.
  [[nodiscard]] Json Events() const;

  static Json EventToJson(const event_t& event);

 private:
  [[nodiscard]] Json Figures() const;
  [[nodiscard]] Json Poses();
  [[nodiscard]] std::optional<double> FollowingError(std::size_t joint) const;

  static constexpr std::size_t kEventsKept = 40;
  static constexpr std::size_t kSetpointsKept = 64;
  struct Setpoints {
    std::int64_t tick = -1;
    bool controlled = false;
    std::vector<float> position_rad;
  };

  ViewedRobot* robot_;
  LiveView view_;
  std::deque<event_t> events_;
  std::array<Setpoints, kSetpointsKept> setpoints_;  ///< That of a tick at its number modulo.
};

}  // namespace tumbler
