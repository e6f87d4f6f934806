#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "common/files/file_keys.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// The keys of a task. Keys that depend on the robot's joints are in task_toml.cc, those of
/// `[contact]` in contact_toml.cc, those of `[[obstacle]]` in obstacle_toml.cc, those of `[motor]`
/// in motor_toml.cc, and those of `[self_contact]` in self_contact_toml.cc.

inline constexpr FileHeader kTaskHeader{"tumbler-task", 1, nullptr,
                                        "is {0}; this program reads tasks up to version {1}"};

struct TaskRobot {
  std::string robot;
  RootKind root = RootKind::kPlanarXz;  ///< How its root link is held.
};
/// Names of RootKind.
inline constexpr std::array<std::string_view, 4> kTaskRoots = {"planar-xz", "fixed", "hinge-y",
                                                               "floating"};
inline constexpr std::array kTaskRobotKeys = {
    KeyOf<&TaskRobot::robot>("robot", "URDF, relative to the task's folder")
        .Required()
        .Allowed("a file"),
    KeyOf<&TaskRobot::root>("root", kTaskRoots,
                            "how the root link is held; `hinge-y`: hung from a bar along y through "
                            "its frame's origin, which it turns about without a motor; `floating`: "
                            "not at all, [in space](space.md)"),
};

/// Names of HeldTorque.
inline constexpr std::array<std::string_view, 2> kHeldTorques = {"end", "rest"};
inline constexpr std::array kTaskTimeKeys = {
    KeyOf<&Problem::duration_s>("duration_s", {0.05, 20}, "of the motion").Required(),
    KeyOf<&Problem::settle_s>("settle_s", {0, 5}, "joints held after it, part of the problem"),
    KeyOf<&Problem::held_torque>(
        "held_torque", kHeldTorques,
        "the feed-forward that goes on after the motion: what the spline "
        "through the plan's torques ends with, or the plan's torque at "
        "the end of the settle phase, on which the spline then ends (with "
        "`settle_s` only, not on a bar, and not with `[robust.feedback]`)"),
};

/// The bounds of a duration that is free.
struct TaskDurations {
  std::optional<double> min_s, max_s;
};
inline constexpr std::array kTaskDurationKeys = {
    KeyOf<&TaskDurations::min_s>("duration_min_s", {0.05, 20},
                                 "the motion's duration is found, too: not below this ..."),
    KeyOf<&TaskDurations::max_s>("duration_max_s", {0.05, 20},
                                 "... nor above this; `duration_s`, with which the search begins, "
                                 "has to lie between them (tasks with `[robust]` have the same "
                                 "keys there)"),
};

/// The place at which the root link's frame starts, and how it moves there.
struct TaskStart {
  double x_m = 0;
  double pitch_rad = 0;
  std::optional<double> z_m;
  double x_m_s = 0, z_m_s = 0, pitch_rad_s = 0;
  std::optional<double> x_min_m_s, x_max_m_s, z_min_m_s, z_max_m_s, pitch_min_rad_s,
      pitch_max_rad_s;
};
inline constexpr Range kTaskPlace{-1e3, 1e3};
inline constexpr Range kTaskRate{-100, 100};
inline constexpr std::array kTaskStartKeys = {
    KeyOf<&TaskStart::x_m>("x_m", kTaskPlace,
                           "of the root link's frame, or of its bar (not of a fixed root, like "
                           "the next two)"),
    KeyOf<&TaskStart::pitch_rad>("pitch_rad", kTaskPlace,
                                 "on a bar, up to 0.5 rad from where the robot is at rest, below "
                                 "or above the bar, and put there"),
    KeyOf<&TaskStart::z_m>(
        "z_m", kTaskPlace,
        "without it the robot is put on the ground and left to come to rest, pitch included; a bar "
        "is at 0 without it")
        .Allowed("-1000 to 1000, no shape inside an obstacle"),
};
inline constexpr std::array kTaskStartRateKeys = {
    KeyOf<&TaskStart::x_m_s>("x_m_s", kTaskRate,
                             "velocity of the root; with `--start-from` those of the exit are "
                             "taken, and this and the next two are left out"),
    KeyOf<&TaskStart::z_m_s>("z_m_s", kTaskRate, "likewise; neither of the two on a bar"),
    KeyOf<&TaskStart::pitch_rad_s>("pitch_rad_s", kTaskRate, "likewise"),
    KeyOf<&TaskStart::x_min_m_s>("x_min_m_s", kTaskRate,
                                 "the velocity is found, too: not below this ..."),
    KeyOf<&TaskStart::x_max_m_s>("x_max_m_s", kTaskRate,
                                 "... nor above this; `x_m_s` has to lie between them (not with "
                                 "`[robust]`, and likewise the next four)"),
    KeyOf<&TaskStart::z_min_m_s>("z_min_m_s", kTaskRate, "bounds of `z_m_s` ..."),
    KeyOf<&TaskStart::z_max_m_s>("z_max_m_s", kTaskRate, "... where it is found"),
    KeyOf<&TaskStart::pitch_min_rad_s>("pitch_min_rad_s", kTaskRate, "bounds of `pitch_rad_s` ..."),
    KeyOf<&TaskStart::pitch_max_rad_s>("pitch_max_rad_s", kTaskRate, "... where it is found"),
};

/// The lie of the ground.
struct TaskGround {
  double slope_rad = 0;
};
inline constexpr std::array kTaskGroundKeys = {
    KeyOf<&TaskGround::slope_rad>(
        "slope_rad", {-0.7, 0.7},
        "of the ground, upwards to the right: gravity is turned, and everything else, pitch and "
        "targets too, is relative to the ground (`planar-xz`)"),
};

/// What holds a hinged root.
struct TaskBar {
  double friction_nm_s_per_rad = 0;
};
inline constexpr std::array kTaskBarKeys = {
    KeyOf<&TaskBar::friction_nm_s_per_rad>("friction_nm_s_per_rad", {0, 100},
                                           "viscous friction of the root's bearing (`hinge-y`)"),
};

/// The limits of a joint. They begin as those of the URDF, and the task tightens them.
struct TaskLimits : JointLimits<double> {
  TaskLimits() { acceleration_max_rad_s2 = 1000; }
  double rotor_inertia_kg_m2 = 0;
};
inline constexpr std::array kTaskLimitKeys = {
    KeyOf<&TaskLimits::position_min_rad, TaskLimits>("position_min_rad", "")
        .Default("the URDF's, else -100")
        .Allowed("within the URDF's",
                 [](const TaskLimits& limits) {
                   return Range{limits.position_min_rad, limits.position_max_rad};
                 }),
    KeyOf<&TaskLimits::position_max_rad, TaskLimits>("position_max_rad", "")
        .Default("the URDF's, else 100")
        .Allowed("within the URDF's",
                 [](const TaskLimits& limits) {
                   return Range{limits.position_min_rad, limits.position_max_rad};
                 }),
    KeyOf<&TaskLimits::velocity_max_rad_s, TaskLimits>("velocity_max_rad_s", "")
        .Default("the URDF's, else 100")
        .Allowed("above 0, to the default",
                 [](const TaskLimits& limits) {
                   return Range{0, limits.velocity_max_rad_s, true};
                 }),
    KeyOf<&TaskLimits::acceleration_max_rad_s2, TaskLimits>("acceleration_max_rad_s2",
                                                            {0, 1e5, true}, "URDF has none"),
    KeyOf<&TaskLimits::torque_max_nm, TaskLimits>("torque_max_nm", "")
        .Default("the URDF's effort, else 1000")
        .Allowed("above 0, to the default",
                 [](const TaskLimits& limits) {
                   return Range{0, limits.torque_max_nm, true};
                 }),
    KeyOf<&TaskLimits::rotor_inertia_kg_m2>("rotor_inertia_kg_m2", {0, 10},
                                            "of the motor, seen through its gear"),
};

inline constexpr std::array kTaskToleranceKeys = {
    KeyOf<&Problem::entry_tolerance_rad>(
        "entry_rad", {0, 3, true},
        "a run starts only with every joint this near to its first position"),
    KeyOf<&Problem::following_tolerance_rad>(
        "following_rad", {0, 3, true},
        "a joint further from its setpoint while running is a fault"),
};

inline constexpr auto kTaskDrivesKeys = AllRequired(std::array{
    KeyOf<&DriveGains::kp_nm_per_rad>("kp_nm_per_rad", {0, 1e4, true},
                                      "of every joint's drive, at the joint"),
    KeyOf<&DriveGains::kd_nm_s_per_rad>("kd_nm_s_per_rad", {0, 1e3}, "likewise"),
});

inline constexpr Range kTaskStep_s{1e-5, 1e-2};
inline constexpr std::array kSearchKeys = {
    KeyOf<&SearchSettings::seed>("seed", Range::NonNegative(), "`--seed` replaces it"),
    KeyOf<&SearchSettings::batch>("batch", {1, 1e6}, "random starts at a time, until ..."),
    KeyOf<&SearchSettings::promising>("promising", {1, 1000}, "... so many stand out ..."),
    KeyOf<&SearchSettings::max_samples>("max_samples", {1, 1e6}, "... or so many were tried"),
    KeyOf<&SearchSettings::refine>("refine", {1, 1000},
                                   "of the best go to the local solver; when none leads anywhere, "
                                   "the search goes on"),
    KeyOf<&SearchSettings::modes>("modes", {1, 20}, "half-sine modes of a random path"),
    KeyOf<&SearchSettings::spread_rad>("spread_rad", {0, 20}, "amplitude of the first mode"),
    KeyOf<&SearchSettings::basin_rad>(
        "basin_rad", {1e-3, 1e3},
        "a motion that ends further from a target of its pitch does not stand out"),
    KeyOf<&SearchSettings::torque_penalty>("torque_penalty", {0, 1e6}, "in the ranking"),
    KeyOf<&SearchSettings::core_penalty>("core_penalty", {0, 1e6}, "in the ranking"),
    KeyOf<&SearchSettings::clearance_penalty>("clearance_penalty", {0, 1e6}, "in the ranking"),
    KeyOf<&SearchSettings::step_s>("step_s", kTaskStep_s, "step of the semi-implicit Euler method")
        .Default("{}, at most 1.5 times the advisable one"),
};

inline constexpr std::array<std::string_view, 2> kGradients = {"adjoint", "forward"};
inline constexpr std::array kSolverKeys = {
    KeyOf<&SolverSettings::step_s>(
        "step_s", kTaskStep_s,
        "equal integration step, of which certificate and cross-check "
        "take a sixteenth, in space a quarter; a warning says when it is longer than "
        "contact [allows](method.md#contact-by-intent)")
        .Default("{}, at most the advisable one"),
    KeyOf<&SolverSettings::tolerance>("tolerance", {1e-12, 1e-2},
                                      "of the error of a state or its derivative z in one of the "
                                      "solver's [adaptive steps](method.md#steps), divided by 1 + "
                                      "\\|z\\|"),
    KeyOf<&SolverSettings::screen_step_s>("screen_step_s", kTaskStep_s,
                                          "equal step with which starts are screened")
        .Default("the larger of {} (at most twice the advisable one) and `step_s`",
                 [](SolverSettings& solver) {
                   solver.screen_step_s = std::max(solver.step_s, solver.screen_step_s);
                 }),
    KeyOf<&SolverSettings::screen_evaluations>("screen_evaluations", {1, 1e5},
                                               "of cost and gradient, for each start"),
    KeyOf<&SolverSettings::finalists>("finalists", {1, 1000}, "how many of those go on ..."),
    KeyOf<&SolverSettings::max_evaluations>("max_evaluations", {1, 1e5}, "... to this many in all"),
    KeyOf<&SolverSettings::kkt_residual>(
        "kkt_residual", {1e-12, 1},
        "they end at a [Kuhn-Tucker residual](method.md#local-solution) no larger; for less than "
        "the default, give `tolerance` less, too"),
    KeyOf<&SolverSettings::prove>(
        "prove",
        "whether they go on until then, as `--prove` asks; otherwise only while that takes no "
        "longer than the search did"),
    KeyOf<&SolverSettings::relative_tolerance>(
        "relative_tolerance", {0, 1, true},
        "screening ends when the cost changes by less than this part of itself"),
    KeyOf<&SolverSettings::gradient>("gradient", kGradients,
                                     "how gradients are computed: backwards through the steps, or "
                                     "by the paper's gradient equations"),
    KeyOf<&SolverSettings::torque_margin>(
        "torque_margin", {0, 0.5},
        "of the torque limit, kept free for what happens between samples"),
    KeyOf<&SolverSettings::core_margin>("core_margin", {0, 0.9},
                                        "part of the compliant layer that a motion leaves unused"),
    KeyOf<&SolverSettings::sharpness>("sharpness", {1, 1e4},
                                      "of the smooth maxima of torque, penetration and "
                                      "clearance"),
};

}  // namespace tumbler
