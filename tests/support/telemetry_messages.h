#pragma once

#include <cstdint>

#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>
#include <tumbler/truth_t.hpp>

namespace tumbler::testing {

/// Messages of telemetry of a robot with two joints.
inline state_t State(std::int64_t tick) {
  state_t state{};
  state.tick = state.number = tick;
  state.state = state_t::STATE_RUNNING;
  state.joint_count = 2;
  state.joints.resize(2);
  return state;
}

inline run_t About() {
  run_t run{};
  run.joint_count = 2;
  run.joints = {"left", "right"};
  run.error_codes = {"", ""};
  run.node_count = 1;
  run.nodes = {"node"};
  return run;
}

inline truth_t Truth() {
  truth_t truth{};
  truth.joint_count = truth.contact_count = 1;
  truth.joints.resize(1);
  truth.contacts.resize(1);
  return truth;
}

}  // namespace tumbler::testing
