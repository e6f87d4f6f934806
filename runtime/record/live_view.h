#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include <tumbler/event_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>

#include "common/files/json.h"

namespace tumbler {

/// The last messages of a run, and texts that show them to people. Counts the messages that did not
/// arrive.
class LiveView {
 public:
  void Take(const state_t& state);
  void Take(const event_t& event);
  void Take(const run_t& run);

  [[nodiscard]] const std::optional<state_t>& state() const noexcept { return state_; }
  [[nodiscard]] const std::optional<run_t>& run() const noexcept { return run_; }
  /// Number of states that did not arrive, of those sent between the first and the last that did.
  [[nodiscard]] std::int64_t lost() const noexcept { return lost_; }

  /// Several lines of at most 100 columns: state, motion, joints, faults, bus, latency and the last
  /// events. On fewer `columns` the table of joints has fewer figures.
  [[nodiscard]] std::string Screen(int columns = 100) const;
  /// The same in one line, for logs.
  [[nodiscard]] std::string Line() const;
  /// The same as one JSON object, with units in the keys; null before the first state.
  [[nodiscard]] Json Value() const;
  /// The same as text.
  [[nodiscard]] std::string ToJson() const;

 private:
  [[nodiscard]] std::string JointTable(bool narrow) const;
  [[nodiscard]] std::string JointName(std::size_t joint) const;
  [[nodiscard]] std::string FaultText() const;
  [[nodiscard]] std::string SensorText() const;
  [[nodiscard]] std::string ErrorText(std::size_t joint) const;
  [[nodiscard]] std::string NodeName() const;

  static constexpr std::size_t kEvents = 6;
  std::optional<state_t> state_;
  std::optional<run_t> run_;
  std::deque<event_t> events_;
  std::int64_t lost_ = 0;
};

/// A screen's text for a terminal of this size, so that nothing of it scrolls away: the first
/// lines, up to an empty one, are broken where they are too long, and the others cut. What is last
/// has to go where there are too few rows.
std::string Fitted(const std::string& text, int columns, int rows);

}  // namespace tumbler
