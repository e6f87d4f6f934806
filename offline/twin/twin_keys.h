#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/files/file_keys.h"
#include "offline/twin/simulated_robot.h"
#include "offline/twin/twin_toml.h"

namespace tumbler {

/// The keys of the twin's file. twin_toml.cc reads the tables whose keys are names of joints or
/// links, and the task's readers read `[contact]` and `[[obstacle]]`.

inline constexpr FileHeader kTwinHeader{"tumbler-twin", 1, "is '{0}'; allowed: '{1}'"};

inline constexpr std::array kTwinFileKeys = {
    KeyOf<&TwinSources::motion>("motion",
                                "primitive or sequence, relative to this file's folder; for "
                                "`tumbler twin` where the command line names none")
        .Allowed("a file"),
    KeyOf<&TwinSources::drives>("drives", "drives, likewise; `tumbler run sim` takes them too")
        .Allowed("a file"),
    KeyOf<&TwinSources::robot>("robot",
                               "URDF in the place of the motion's, with the same links and joints: "
                               "a robot that is not the one that the motion was found for")
        .Default("the motion's")
        .Allowed("a file"),
};

inline constexpr std::array<std::string_view, 2> kTwinSteps = {"error-bound", "fixed"};
inline constexpr std::array kTwinStepKeys = {
    KeyOf<&TwinConfig::steps>("steps", kTwinSteps,
                              "as long as an error bound and the drives allow, or all `step_s`"),
    SecondsOf<&TwinConfig::step_ns>("step_s", {1e-6, 1e-3},
                                    "of the physics and of the drives' law where steps are fixed; "
                                    "else the shortest that the error bound asks for"),
};

/// The place at which the robot starts. Values that the file leaves out are those of the motion.
struct TwinStart {
  bool held = TwinConfig{}.held;
  double stand_m = TwinConfig{}.stand_m;
  double x_m = 0;
  double pitch_rad = 0;
  std::optional<double> z_m;
};
inline constexpr Range kTwinPlace{-1e3, 1e3};
inline constexpr std::array kTwinStartKeys = {
    KeyOf<&TwinStart::held>("held", "held by hand, joints and all, until every drive is enabled"),
    KeyOf<&TwinStart::stand_m>("stand_m", {0, 10},
                               "a stand lifts the root link by so much and holds it for good, the "
                               "joints are free: for commissioning; 0: none"),
    KeyOf<&TwinStart::x_m>("x_m", kTwinPlace, "of the root link's frame").Default("the motion's"),
    KeyOf<&TwinStart::pitch_rad>("pitch_rad", kTwinPlace, "of the root link's frame")
        .Default("the motion's"),
    KeyOf<&TwinStart::z_m>("z_m", kTwinPlace,
                           "without it a robot with another pitch or other joints is lowered until "
                           "it rests, pitch included")
        .Default("the motion's, or where it rests"),
};

/// The same of a robot in space.
struct SpaceTwinStart {
  bool held = TwinConfig{}.held;
  double stand_m = TwinConfig{}.stand_m;
  double x_m = 0, y_m = 0;
  Quaternion quaternion{};
  std::optional<double> z_m;
};
inline constexpr std::array kSpaceTwinStartKeys = {
    KeyOf<&SpaceTwinStart::held>("held", kTwinStartKeys[0].text.meaning),
    KeyOf<&SpaceTwinStart::stand_m>("stand_m", {0, 10}, kTwinStartKeys[1].text.meaning),
    KeyOf<&SpaceTwinStart::x_m>("x_m", kTwinPlace, "of the root link's frame")
        .Default("the motion's"),
    KeyOf<&SpaceTwinStart::y_m>("y_m", kTwinPlace, "likewise").Default("the motion's"),
    KeyOf<&SpaceTwinStart::quaternion>("quaternion", {-1.001, 1.001},
                                       "how the root's frame is turned: w, x, y, z")
        .Default("the motion's"),
    KeyOf<&SpaceTwinStart::z_m>("z_m", kTwinPlace,
                                "without it a robot that is turned otherwise or has other joints "
                                "is lowered until it rests")
        .Default("the motion's, or where it rests"),
};

/// The values of `[motor]` and `[motor.JOINT]` for a joint.
struct MotorEntry : JointMotor, JointLosses {};
inline constexpr Range kMotorSpeed{0, 1e4, true};
inline constexpr std::array kMotorKeys = {
    KeyOf<&MotorEntry::torque_max_nm, MotorEntry>("torque_max_nm", {1e-3, 1e4}, "current limit")
        .Default("the motion's largest limit"),
    KeyOf<&MotorEntry::base_speed_rad_s, MotorEntry>(
        "base_speed_rad_s", kMotorSpeed,
        "above the first the torque in the direction of motion falls, to zero at the second")
        .Default("the task's, else none")
        .Allowed("above 0, to 10 000; both or neither"),
    KeyOf<&MotorEntry::no_load_speed_rad_s, MotorEntry>(
        "no_load_speed_rad_s", kMotorSpeed,
        "above the first the torque in the direction of motion falls, to zero at the second")
        .Default("the task's, else none")
        .Allowed("above 0, to 10 000; both or neither"),
    KeyOf<&MotorEntry::encoder_counts_per_turn, MotorEntry>("encoder_counts_per_turn", {0, 1 << 26},
                                                            "of the drive's shaft; 0: exact"),
    KeyOf<&MotorEntry::answer_delay_s, MotorEntry>("answer_delay_s", {0, 0.1},
                                                   "from the end of a frame to its answer"),
    KeyOf<&MotorEntry::torque_time_constant_s, MotorEntry>("torque_time_constant_s", {0, 0.1},
                                                           "of the current loop, first order")
        .Default("the drives file's, 0 where it says none"),
    KeyOf<&MotorEntry::torque_factor, MotorEntry>(
        "torque_factor", {0.1, 10},
        "of what the motor exerts for each N m that its drive reckons with")
        .Default("the drives file's, 1 where it says none"),
    KeyOf<&MotorEntry::velocity_filter_s, MotorEntry>(
        "velocity_filter_s", {0, 0.1},
        "of the filter through which the drive sees its velocity, first order; 0: none")
        .Default("the drives file's, 0 where it says none"),
    KeyOf<&MotorEntry::rotor_inertia_kg_m2, MotorEntry>("rotor_inertia_kg_m2", {0, 10},
                                                        "seen through the gear")
        .Default("the task's"),
    KeyOf<&MotorEntry::viscous_friction_nm_s_per_rad, MotorEntry>(
        "viscous_friction_nm_s_per_rad", {0, 10}, "besides the URDF's damping")
        .Default("the task's; 0.02 where it has no `[motor]`"),
    KeyOf<&MotorEntry::dry_friction_nm, MotorEntry>(
        "dry_friction_nm", {0, 5}, "full above 0.05 rad/s, as smooth below it as the ground's")
        .Default("the task's; the URDF's friction where it has no `[motor]`"),
    KeyOf<&MotorEntry::ambient_c, MotorEntry>(
        "ambient_c", {-50, 150}, "the winding approaches ambient + heating torque^2, first order"),
    KeyOf<&MotorEntry::heating_k_per_nm2, MotorEntry>("heating_k_per_nm2", {0, 1e4}, "likewise"),
    KeyOf<&MotorEntry::thermal_time_constant_s, MotorEntry>("thermal_time_constant_s", {0.1, 1e5},
                                                            "likewise"),
};

inline constexpr std::array kStopKeys = {
    KeyOf<&TwinConfig::stop_stiffness_nm_per_rad>("stiffness_nm_per_rad", {0, 1e4}, ""),
    KeyOf<&TwinConfig::stop_damping_nm_s_per_rad>("damping_nm_s_per_rad", {0, 50}, ""),
};

inline constexpr Range kTwinFriction{0, 10};
/// The values that an obstacle of a twin has besides those of a task's obstacle.
struct TwinObstacle {
  std::optional<double> mu;
};
inline constexpr std::array kTwinObstacleKeys = {
    KeyOf<&TwinObstacle::mu>("mu", kTwinFriction, "friction of its own"),
};

/// A list of names for messages.
inline std::string Join(const std::vector<std::string>& names) {
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}
inline void RequireOneOf(const TomlTable& table, std::string_view key, const std::string& name,
                         const char* what, const std::vector<std::string>& names) {
  if (std::find(names.begin(), names.end(), name) != names.end()) return;
  table.Fail(key, fmt::format("'{}' is not a {} here; allowed: {}", name, what, Join(names)));
}

/// A table `[[patch]]`, with the obstacles that it may name.
struct PatchEntry : FrictionPatch {
  const std::vector<std::string>* obstacles = nullptr;
};
inline void ReadPatchObstacle(TomlTable& table, std::string_view key, PatchEntry& patch) {
  patch.obstacle = table.String(key);
  RequireOneOf(table, key, patch.obstacle, "obstacle", *patch.obstacles);
}
inline constexpr std::array kPatchKeys = {
    KeyReadBy<PatchEntry>("obstacle", ReadPatchObstacle, "")
        .Schema(R"({"type": "string"})")
        .Required()
        .Allowed("of the task or of this file"),
    KeyOf<&FrictionPatch::mu, PatchEntry>("mu", kTwinFriction, "").Required(),
    KeyOf<&FrictionPatch::from_x_m, PatchEntry>("from_x_m", kTwinPlace, "in the world").Required(),
    KeyOf<&FrictionPatch::to_x_m, PatchEntry>("to_x_m", "in the world")
        .Required()
        .Allowed("above `from_x_m`, to 1000",
                 [](const PatchEntry& patch) {
                   return Range{patch.from_x_m, kTwinPlace.max, true};
                 }),
};

/// A table `[[push]]`, with the links that it may name. By default its time counts from when all
/// drives are enabled.
struct PushEntry : Push {
  PushEntry() { since_enabled = true; }
  const std::vector<std::string>* links = nullptr;
  std::array<double, 2> force_in_plane_n{}, point_in_plane_m{};  ///< x and z.
};
inline void ReadPushLink(TomlTable& table, std::string_view key, PushEntry& push) {
  push.link = table.String(key);
  RequireOneOf(table, key, push.link, "link", *push.links);
}
inline constexpr std::array<std::string_view, 2> kSince = {"start", "enabled"};
inline constexpr std::array kPushKeys = {
    KeyReadBy<PushEntry>("link", ReadPushLink, "")
        .Schema(R"({"type": "string"})")
        .Required()
        .Allowed("a link of the robot"),
    KeyOf<&PushEntry::start_s, PushEntry>("start_s", {0, 1e6}, "").Required(),
    KeyOf<&PushEntry::since_enabled, PushEntry>(
        "since", kSince,
        "counted from the start of the simulation, or from when all drives were first enabled"),
    KeyOf<&PushEntry::duration_s, PushEntry>("duration_s", {0, 1e6, true}, "").Required(),
};
inline constexpr std::array kPlanePushKeys = {
    KeyOf<&PushEntry::force_in_plane_n>("force_n", {-1e4, 1e4},
                                        "x, z in the world; of a robot in space x, y, z")
        .Required()
        .Allowed("two numbers, -10 000 to 10 000"),
    KeyOf<&PushEntry::point_in_plane_m>("point_m", kTwinPlace,
                                        "x, z in the link's frame; of a robot in space x, y, z")
        .Default("the frame's origin")
        .Allowed("two numbers, -1000 to 1000"),
};
inline constexpr std::array kSpacePushKeys = {
    KeyOf<&PushEntry::force_n, PushEntry>("force_n", {-1e4, 1e4}, "x, y, z in the world")
        .Required()
        .Allowed("three numbers, -10 000 to 10 000"),
    KeyOf<&PushEntry::point_m, PushEntry>("point_m", kTwinPlace, "x, y, z in the link's frame")
        .Default("the frame's origin")
        .Allowed("three numbers, -1000 to 1000"),
};

/// `[sensor]`: errors of the drives file's inertial sensor.
inline constexpr std::array kTwinSensorKeys = {
    KeyOf<&SimulatedSensorConfig::noise_rad>("noise_rad", {0, 1},
                                             "standard deviation of each report's pitch"),
    KeyOf<&SimulatedSensorConfig::rate_noise_rad_s>("rate_noise_rad_s", {0, 10},
                                                    "of the rate about each axis"),
    KeyOf<&SimulatedSensorConfig::bias_rad>("bias_rad", {-3, 3}, "of the pitch"),
    KeyOf<&SimulatedSensorConfig::rate_bias_rad_s>("rate_bias_rad_s", {-10, 10},
                                                   "of the rate in the plane"),
    KeyOf<&SimulatedSensorConfig::delay_s>("delay_s", {0, 1}, "from measuring to sending"),
    KeyOf<&SimulatedSensorConfig::mount_error_rad>(
        "mount_error_rad", {-3, 3}, "roll of the sensor on its link, beside `mount_rpy_rad`"),
    KeyOf<&SimulatedSensorConfig::seed>("seed", {0, 9e15}, "of the noise"),
};

/// A table `[[sensor_failure]]`. By default its time counts from when all drives are enabled.
struct SensorFailureEntry : SensorFailure {
  SensorFailureEntry() { since_enabled = true; }
};
inline constexpr std::array<std::string_view, 5> kSensorFaults = {"silent", "frozen", "offset",
                                                                  "swapped-axis", "late"};
inline constexpr std::array kSensorFailureKeys = {
    KeyOf<&SensorFailure::fault, SensorFailureEntry>(
        "fault", kSensorFaults,
        "sends nothing; repeats its last report; is turned by an angle in the plane; has y and z "
        "exchanged; reports late")
        .Required(),
    KeyOf<&SensorFailure::start_s, SensorFailureEntry>("start_s", {0, 1e6}, "").Required(),
    KeyOf<&SensorFailure::since_enabled, SensorFailureEntry>("since", kSince,
                                                             "what the time counts from"),
    KeyOf<&SensorFailure::duration_s, SensorFailureEntry>("duration_s", {0, 1e9, true}, ""),
    KeyOf<&SensorFailure::offset_rad, SensorFailureEntry>("offset_rad", {-3.2, 3.2}, "of `offset`"),
    KeyOf<&SensorFailure::late_s, SensorFailureEntry>("late_s", {0, 10}, "of `late`"),
};

inline constexpr std::array kFallKeys = {
    KeyOf<&PostureConfig::rest_s>("rest_s", {0.01, 10},
                                  "how long the robot has to be still to be at rest"),
    KeyOf<&PostureConfig::clear_links>("clear_links", "links that must not touch anything")
        .Allowed("links of the robot"),
};

}  // namespace tumbler
