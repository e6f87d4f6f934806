#include "offline/pages/viewed_run.h"

#include <cmath>

#include "runtime/executor/tick.h"

namespace tumbler {
namespace {

/// Whether the setpoints of position take effect in this tick.
bool PositionIsControlled(const state_t& state) {
  return ControlsPosition(static_cast<ExecutorState>(state.state),
                          static_cast<Reaction>(state.reaction));
}

}  // namespace

void ViewedRun::Take(const state_t& state) {
  view_.Take(state);
  if (robot_ != nullptr) robot_->Take(state);
  if (state.tick < 0) return;
  Setpoints& kept = setpoints_[static_cast<std::size_t>(state.tick) % kSetpointsKept];
  kept.tick = state.tick;
  kept.controlled = PositionIsControlled(state);
  kept.position_rad.clear();
  for (const joint_state_t& joint : state.joints) {
    kept.position_rad.push_back(joint.limited_position_rad);
  }
}

void ViewedRun::Take(const event_t& event) {
  events_.push_back(event);
  if (events_.size() > kEventsKept) events_.pop_front();
}

void ViewedRun::Take(const run_t& run) { view_.Take(run); }

void ViewedRun::Take(const truth_t& truth) {
  if (robot_ != nullptr) robot_->Take(truth);
}

void ViewedRun::Forget() {
  view_ = LiveView();
  events_.clear();
  setpoints_ = {};
  if (robot_ != nullptr) robot_->Forget();
}

std::optional<double> ViewedRun::FollowingError(std::size_t joint) const {
  const state_t& state = *view_.state();
  const std::int32_t age = state.joints[joint].reply_age_ticks;
  if (age < 0 || state.tick <= age || !PositionIsControlled(state)) return {};
  const std::int64_t asked = state.tick - 1 - age;
  const Setpoints& kept = setpoints_[static_cast<std::size_t>(asked) % kSetpointsKept];
  if (kept.tick != asked || !kept.controlled || joint >= kept.position_rad.size()) return {};
  return static_cast<double>(state.joints[joint].measured_position_rad) -
         static_cast<double>(kept.position_rad[joint]);
}

Json ViewedRun::Figures() const {
  const run_t& r = *view_.run();
  return {{"robot", r.robot},
          {"version", r.version},
          {"motion", r.motion},
          {"bus", r.bus},
          {"mode", r.mode},
          {"rate_hz", r.rate_hz},
          {"speed", r.speed},
          {"ticks", r.ticks},
          {"late_ticks", r.late_ticks},
          {"missed_ticks", r.missed_ticks},
          {"lost_records", r.lost_records},
          {"unpublished", r.unpublished},
          {"not_received", view_.lost()},
          {"bus_load_max", r.bus_load},
          {"reply_age_max_ticks", r.reply_age_max_ticks},
          {"wake_up_us", Json::Array({r.wake_up_p50_us, r.wake_up_p99_us, r.wake_up_max_us})},
          {"tick_us", Json::Array({r.tick_p50_us, r.tick_p99_us, r.tick_max_us})}};
}

Json ViewedRun::Poses() {
  // Without a run_t the joints have no names yet, and may be another robot's.
  if (robot_ == nullptr || !view_.run() || view_.run()->joints != robot_->joints()) return nullptr;
  return robot_->Poses();
}

Json ViewedRun::Frame() {
  Json frame = view_.Value();
  if (frame.is_null()) return frame;
  const state_t& state = *view_.state();
  for (std::size_t j = 0; j < state.joints.size(); ++j) {
    const std::optional<double> error = FollowingError(j);
    frame["joints"][j]["following_error_rad"] = error ? Json(*error) : Json(nullptr);
  }
  frame["wake_up_us"] = state.wake_up_us;
  frame["tick_us"] = state.tick_us;
  frame["figures"] = view_.run() ? Figures() : Json(nullptr);
  frame["poses"] = Poses();
  frame["root_is_true"] = robot_ != nullptr && robot_->RootIsTrue();
  return frame;
}

Json ViewedRun::EventToJson(const event_t& event) {
  std::string text = event.text;
  if (event.from_state != event.to_state) {
    text = event.from_state + " \u2192 " + event.to_state + (text.empty() ? "" : ": ") + text;
  }
  return {{"time_s", static_cast<double>(event.time_ns) * 1e-9}, {"text", text}};
}

Json ViewedRun::Events() const {
  Json events = Json::Array();
  for (const event_t& event : events_) events.Append(EventToJson(event));
  return events;
}

}  // namespace tumbler
