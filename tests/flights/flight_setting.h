#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/core/sequence.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/simulated_drive.h"
#include "runtime/executor/executor_config.h"
#include "runtime/executor/run_procedure.h"
#include "runtime/executor/sensor_watch.h"
#include "tests/flights/flight.h"

namespace tumbler::testing {

/// One joint's world.
struct FlightJoint {
  double inertia_kg_m2 = 0.02;
  double friction_nm_s_per_rad = 0.02;
  double gravity_nm = 0;  ///< Pulls the joint from its pose as soon as nothing holds it.
  double stop_min_rad = -3, stop_max_rad = 3;
  int reply_size = 8;  ///< Of MIT drives.
};

/// Everything about a flight that does not happen at a time: made from its seed. What
/// `Flight::left_out` leaves out does not change the rest.
struct FlightSetting {
  int protocol = 0;  ///< Its number in devices/protocols.h.
  DrivesConfig drives;
  ExecutorConfig executor;
  SequenceGraph<float> graph;
  std::vector<Primitive<float>> primitives;
  bool has_sensor = false;
  XsensMtiConfig sensor_ids;
  SensorSettings sensor;
  int sensor_every = 1;  ///< Ticks between reports.
  bool sensor_has_time = false;
  bool by_procedure = false;  ///< Whether a run procedure gives the commands.
  RunProcedureConfig procedure;
  std::array<FlightJoint, kMaxJoints> joints;
  int patience_ticks = 50;  ///< Of the operator, before he does the next thing.
  bool repairs = true;      ///< Whether he sets everything right before he arms.
  int transmit_capacity = 10;
  int receive_capacity = 256;
  std::int64_t period_ns = 1'000'000;

  [[nodiscard]] int joint_count() const noexcept { return primitives[0].joint_count; }
  /// Where the joint is when a run begins.
  [[nodiscard]] float StartOf(int joint) const noexcept {
    const SequenceNode& node = graph.node(graph.start);
    const auto role = static_cast<std::size_t>(graph.RoleOf(graph.start, joint));
    return primitives[static_cast<std::size_t>(node.primitive)]
        .joints[role]
        .position.control_points()[0];
  }
};

[[nodiscard]] FlightSetting MakeSetting(std::uint64_t seed, std::uint32_t left_out);

}  // namespace tumbler::testing
