#include "offline/pages/run_events.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/core/functions.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/record/message_readers.h"
#include "runtime/record/sentences.h"

namespace tumbler {
namespace {

/// A force below this does not count as a push.
constexpr double kPush_n = 1e-9;

}  // namespace

bool InMotion(ExecutorState state) {
  return state == ExecutorState::kRunning || state == ExecutorState::kSettling;
}

bool BeginsNode(const RunTick& tick, const RunTick* before) {
  if (tick.state != ExecutorState::kRunning) return false;
  return before == nullptr || before->state != ExecutorState::kRunning ||
         tick.node != before->node || tick.primitive_time_s < before->primitive_time_s;
}

void RunEvents::Add(double time_s, RunEvent::Kind kind, std::string text) {
  events_.push_back({time_s, kind, std::move(text)});
}

void RunEvents::TakeTick(const TickEntry& entry, const RunTick& tick, const RunTick* before,
                         std::int64_t missing) {
  const double t = tick.time_s;
  if (missing > 0) {
    Add(t, RunEvent::Kind::kTiming, fmt::format("{} ticks were not recorded", missing));
  } else if (before != nullptr && tick.tick > before->tick + 1) {
    Add(t, RunEvent::Kind::kTiming,
        fmt::format("{} control periods missed", tick.tick - before->tick - 1));
  }
  AddRequests(entry, t);
  AddFaults(entry.record, t);
  if (before != nullptr && tick.state == before->state && !BeginsNode(tick, before)) return;
  std::string text = ToString(tick.state);
  if (InMotion(tick.state)) text += fmt::format(": {}", graph_.node(tick.node).name.view());
  if (tick.state == ExecutorState::kFault) text += fmt::format(": {}", ToString(tick.reaction));
  Add(t, RunEvent::Kind::kState, text);
}

void RunEvents::AddRequests(const TickEntry& entry, double t) {
  const TickNotes& notes = entry.notes;
  if (notes.request != 0 && (notes.request_id != request_id_ || notes.request != request_)) {
    std::string text =
        fmt::format("operator: {}", ToString(static_cast<OperatorRequest>(notes.request)));
    if (notes.request_refusal != Refusal::kNone) {
      text += fmt::format(", refused: {}", ToString(notes.request_refusal));
    }
    Add(t, RunEvent::Kind::kRequest, text);
  }
  request_id_ = notes.request_id;
  request_ = notes.request;
  const TickRecord& record = entry.record;
  if (record.command == OperatorCommand::kNone) return;
  std::string text = ToString(record.command);
  if (record.command == OperatorCommand::kBranch) {
    text += fmt::format(" {}", graph_.BranchName(entry.branch));
  }
  Add(t, RunEvent::Kind::kRequest, text);
  if (record.refusal.refusal != Refusal::kNone) {
    Add(t, RunEvent::Kind::kRefusal, Describe(record.refusal, joints_, error_codes_));
  }
}

void RunEvents::AddFaults(const TickRecord& record, double t) {
  if (record.first_fault.fault != Fault::kNone && (first_fault_.fault != record.first_fault.fault ||
                                                   first_fault_.tick != record.first_fault.tick)) {
    Add(t, RunEvent::Kind::kFault, Describe(record.first_fault, joints_, error_codes_));
  }
  first_fault_ = record.first_fault;
  for (std::size_t f = 1; f < kFaultCount; ++f) {
    const auto bit = std::uint32_t{1} << f;
    const auto fault = static_cast<Fault>(f);
    if ((record.faults & bit) != 0 && (faults_ & bit) == 0 && fault != record.first_fault.fault) {
      Add(t, RunEvent::Kind::kFault, fmt::format("also: {}", ToString(fault)));
    }
  }
  faults_ = record.faults;
}

void RunEvents::TakeTruth(double t, const space_truth_t& state) {
  const truth_t& truth = state.truth;
  if (truth.resting_as != resting_as_ && !truth.resting_as.empty()) {
    Add(t, RunEvent::Kind::kTruth, fmt::format("the robot rests {}", truth.resting_as));
  }
  if (truth.fallen != 0 && !fallen_) Add(t, RunEvent::Kind::kTruth, "the robot has fallen");
  const double in_plane_n = portable::Length(truth.push_x_n, truth.push_z_n);
  const bool pushes = portable::Length(in_plane_n, state.push_y_n) > kPush_n;
  if (pushes && !pushed_) {
    const std::string sideways =
        IsInSpace(state) ? fmt::format("{:.3g} N along y, ", state.push_y_n) : "";
    Add(t, RunEvent::Kind::kTruth,
        fmt::format("the robot is pushed: {:.3g} N along x, {}{:.3g} N along z", truth.push_x_n,
                    sideways, truth.push_z_n));
  }
  resting_as_ = truth.resting_as;
  fallen_ = truth.fallen != 0;
  pushed_ = pushes;
}

std::vector<RunEvent> RunEvents::Take() {
  std::stable_sort(events_.begin(), events_.end(),
                   [](const RunEvent& a, const RunEvent& b) { return a.time_s < b.time_s; });
  return std::move(events_);
}

}  // namespace tumbler
