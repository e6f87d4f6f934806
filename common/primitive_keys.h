#pragma once

#include <array>
#include <string>
#include <vector>

#include "common/certificate_keys.h"
#include "common/file_keys.h"
#include "common/primitive.h"
#include "common/primitive_toml.h"

namespace tumbler {

/// The keys of the primitive file, in its order, for its reader and its writer; certificate_keys.h
/// has those of `[certificate]`.

inline constexpr FileHeader kPrimitiveHeader{"tumbler-primitive", kPrimitiveFileVersion};

/// The key of the file's ContentHash, which is of everything but this key.
struct ContentHashEntry {
  std::string content_hash;
};
inline constexpr auto kContentHashKeys = AllRequired(std::array{
    KeyOf<&ContentHashEntry::content_hash>("content_hash", "of everything else in the file"),
});

inline constexpr auto kPrimitiveKeys = AllRequired(std::array{
    KeyOf<&Primitive<double>::name>("name", ""),
    KeyOf<&Primitive<double>::duration_s>("duration_s", Range::Positive(), "of the motion"),
    KeyOf<&Primitive<double>::settle_s>(
        "settle_s", Range::NonNegative(),
        "how long its last setpoint is held before it counts as finished"),
    KeyOf<&Primitive<double>::entry_tolerance_rad>("entry_tolerance_rad", Range::Positive(),
                                                   "as in the task"),
    KeyOf<&Primitive<double>::following_tolerance_rad>("following_tolerance_rad", Range::Positive(),
                                                       "as in the task"),
});

inline constexpr auto kJointKeys = AllRequired(std::array{
    KeyOf<&JointMotion<double>::name>("name", "of the joint in the URDF"),
});

inline constexpr auto kJointLimitKeys = AllRequired(std::array{
    KeyOf<&JointLimits<double>::position_min_rad>("position_min_rad", ""),
    KeyOf<&JointLimits<double>::position_max_rad>("position_max_rad", "")
        .Allowed("above `position_min_rad`"),
    KeyOf<&JointLimits<double>::velocity_max_rad_s>("velocity_max_rad_s", Range::Positive(), ""),
    KeyOf<&JointLimits<double>::acceleration_max_rad_s2>("acceleration_max_rad_s2",
                                                         Range::Positive(), ""),
    KeyOf<&JointLimits<double>::torque_max_nm>("torque_max_nm", Range::Positive(), ""),
});

/// A spline as the file has it.
struct SplineEntry {
  int degree = 0;
  std::vector<double> knots_s;
  std::vector<double> coefficients;  ///< Control points.
};

/// A drive's velocity loop can follow a path with continuous acceleration. Cubic splines are that
/// smooth.
inline constexpr auto kPositionKeys = AllRequired(std::array{
    KeyOf<&SplineEntry::degree>("degree", {3, JointMotion<double>::Spline::kMaxDegree},
                                "of the path"),
    KeyOf<&SplineEntry::knots_s>("knots_s", "likewise"),
    KeyOf<&SplineEntry::coefficients>("coefficients_rad", "its control points"),
});

inline constexpr auto kTorqueKeys = AllRequired(std::array{
    KeyOf<&SplineEntry::degree>("degree", {0, JointMotion<double>::Spline::kMaxDegree},
                                "of the feed-forward"),
    KeyOf<&SplineEntry::knots_s>("knots_s", "likewise"),
    KeyOf<&SplineEntry::coefficients>("coefficients_nm", "its control points"),
});

inline constexpr auto kPoseKeys = AllRequired(std::array{
    KeyOf<&PrimitivePose::root_x_m>("root_x_m", "of the root link's frame"),
    KeyOf<&PrimitivePose::root_z_m>("root_z_m", "of the root link's frame"),
    KeyOf<&PrimitivePose::root_pitch_rad>("root_pitch_rad", "of the root link's frame"),
    KeyOf<&PrimitivePose::joint_positions_rad>("joint_positions_rad", "in the order of the joints")
        .Allowed("the ends of their paths"),
});

inline constexpr auto kContactKeys = AllRequired(std::array{
    KeyOf<&ContactInterval::shape>("shape", "`LINK/INDEX` of the collision shape"),
    KeyOf<&ContactInterval::obstacle>("obstacle", "its name in the task"),
    KeyOf<&ContactInterval::start_s>("start_s", Range::NonNegative(), ""),
    KeyOf<&ContactInterval::end_s>("end_s", Range::NonNegative(), "").Allowed("`start_s` or more"),
    KeyOf<&ContactInterval::peak_normal_force_n>("peak_normal_force_n", Range::NonNegative(), ""),
});

inline constexpr auto kPurposeKeys = AllRequired(std::array{
    KeyOf<&PurposeTarget::of, PurposeFigure>(
        "of", PurposeTarget::kOfNames,
        "what the task asks for: a value of the root; `speed`: to end at rest, no rate of the root "
        "faster in the last 0.25 s"),
    KeyOf<&PurposeTarget::when, PurposeFigure>(
        "when", PurposeTarget::kWhenNames,
        "at the end of the motion, of the settle phase, or 2 s after the motion"),
    KeyOf<&PurposeTarget::target, PurposeFigure>("target", ""),
    KeyOf<&PurposeTarget::tolerance, PurposeFigure>("tolerance", Range::Positive(),
                                                    "farther from the target misses it"),
    KeyOf<&PurposeFigure::result>(
        "result", "of the plan, simulated with a 16th of the step with which it was found"),
});

inline constexpr auto kProvenanceKeys = AllRequired(std::array{
    KeyOf<&Provenance::tool>("tool", "program and version"),
    KeyOf<&Provenance::seed>("seed", Range::NonNegative(), ""),
    KeyOf<&Provenance::objective>("objective", "cost"),
    KeyOf<&Provenance::evaluations>("evaluations", Range::NonNegative(), "rollouts"),
    KeyOf<&Provenance::robot_file>("robot_file", "names for people; the texts below count"),
    KeyOf<&Provenance::task_file>("task_file", "names for people; the texts below count"),
    KeyOf<&Provenance::robot_hash>("robot_hash", "of the texts below"),
    KeyOf<&Provenance::task_hash>("task_hash", "of the texts below"),
});
/// Keys of a motion that starts at the exit of another one: the file has both or neither.
inline constexpr auto kStartFileKeys = AllRequired(std::array{
    KeyOf<&Provenance::start_file>(
        "start_file", "the primitive at whose exit it starts (`--start-from`), else left out"),
    KeyOf<&Provenance::start_hash>("start_hash", "that one's `content_hash`, likewise"),
});
/// Keys of a motion that was solved from the paths of another one: the file has both or neither.
inline constexpr auto kGuessFileKeys = AllRequired(std::array{
    KeyOf<&Provenance::guess_file>(
        "guess_file", "the primitive whose paths it was solved from (`--guess`), else left out"),
    KeyOf<&Provenance::guess_hash>("guess_hash", "that one's `content_hash`, likewise"),
});
/// The key of a motion that was changed by hand and signed: the file has it or not.
inline constexpr auto kEditedKeys = AllRequired(std::array{
    KeyOf<&Provenance::edited>(
        "edited",
        "why the file was changed by hand after it was made (`tumbler-sign`), else left out"),
});
inline constexpr auto kSourceTextKeys = AllRequired(std::array{
    LongTextOf<&Provenance::robot_urdf>(
        "robot_urdf", "whole texts: enough to make the file again, or to simulate it"),
    LongTextOf<&Provenance::task_toml>(
        "task_toml", "whole texts: enough to make the file again, or to simulate it"),
});

}  // namespace tumbler
