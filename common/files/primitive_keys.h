#pragma once

#include <array>
#include <string>
#include <vector>

#include "common/core/primitive.h"
#include "common/files/certificate_keys.h"
#include "common/files/file_keys.h"
#include "common/files/primitive_toml.h"

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

/// The largest gains of a feedback [rad/rad, rad/(rad/s)], of either sign, and the most that it may
/// correct [rad, rad/s]. More would be another motion.
inline constexpr double kMaxAngleGain = 20;
inline constexpr double kMaxRateGain = 5;
inline constexpr double kMaxCorrection_rad = 1;
inline constexpr double kMaxCorrectionRate_rad_s = 100;

/// `[feedback]` as the file has it.
struct FeedbackEntry {
  std::string link;
  double error_min_rad = 0;
  double error_full_rad = 0;
  double error_max_rad = 0;
  double start_error_max_rad = 0;
  double fade_in_s = 0;
  double fade_out_s = 0;
  std::vector<double> knots_s;
};
inline constexpr auto kFeedbackKeys = AllRequired(std::array{
    KeyOf<&FeedbackEntry::link>("link",
                                "the link whose absolute angle is fed back: root pitch plus the "
                                "joints of its chain")
        .Allowed("a link of `[[feedback.chain]]`"),
    KeyOf<&FeedbackEntry::error_min_rad>("error_min_rad", {0, 3.14},
                                         "where the error is smaller, nothing is corrected")
        .Allowed("0 to `error_full_rad`"),
    KeyOf<&FeedbackEntry::error_full_rad>(
        "error_full_rad", {0, 3.14},
        "from this error on, everything is corrected; in between a growing share")
        .Allowed("0 to `error_max_rad`"),
    KeyOf<&FeedbackEntry::error_max_rad>("error_max_rad", {0, 3.14, true},
                                         "where the error is larger, nothing is corrected"),
    KeyOf<&FeedbackEntry::start_error_max_rad>(
        "start_error_max_rad", {0, 3.14, true},
        "where it is larger at the start, nothing is corrected in the whole motion")
        .Allowed("above 0, to `error_max_rad`"),
    KeyOf<&FeedbackEntry::fade_in_s>("fade_in_s", {0, 10, true},
                                     "in which the correction grows to its full share"),
    KeyOf<&FeedbackEntry::fade_out_s>("fade_out_s", {0, 10, true},
                                      "in which it vanishes when the angle is not known any more"),
    KeyOf<&FeedbackEntry::knots_s>("knots_s", "of the gains, which are straight lines in between")
        .Allowed("2 to 16 increasing numbers, from 0 to `duration_s` or later"),
});
inline constexpr auto kFeedbackAngleKeys = AllRequired(std::array{
    KeyOf<&SplineEntry::degree>("degree", {2, JointMotion<double>::Spline::kMaxDegree},
                                "of the link's angle in the plan"),
    KeyOf<&SplineEntry::knots_s>("knots_s", "likewise"),
    KeyOf<&SplineEntry::coefficients>("coefficients_rad", {-100, 100}, "its control points"),
});

/// A `[[feedback.joint]]` as the file has it.
struct JointFeedbackEntry {
  std::string name;
  std::vector<double> angle_gains;
  std::vector<double> rate_gains;
  double correction_max_rad = 0;
  double correction_rate_max_rad_s = 0;
};
inline constexpr auto kJointFeedbackKeys = AllRequired(std::array{
    KeyOf<&JointFeedbackEntry::name>("name", "of the joint")
        .Allowed("those of `[[joint]]`, in order"),
    KeyOf<&JointFeedbackEntry::angle_gains>("angle_gains_rad_per_rad",
                                            {-kMaxAngleGain, kMaxAngleGain},
                                            "at each knot: correction per error of the angle"),
    KeyOf<&JointFeedbackEntry::rate_gains>("rate_gains_rad_per_rad_s",
                                           {-kMaxRateGain, kMaxRateGain},
                                           "at each knot: correction per error of its rate"),
    KeyOf<&JointFeedbackEntry::correction_max_rad>("correction_max_rad", {0, kMaxCorrection_rad},
                                                   "the most that the setpoint is corrected by"),
    KeyOf<&JointFeedbackEntry::correction_rate_max_rad_s>("correction_rate_max_rad_s",
                                                          {0, kMaxCorrectionRate_rad_s, true},
                                                          "how fast the correction may change"),
});
inline constexpr auto kLinkChainKeys = AllRequired(std::array{
    KeyOf<&LinkChain::link>("link", "of the robot; the root is one, too")
        .Allowed("1 to 32 bytes, unique"),
    KeyOf<&LinkChain::joints>("joints", {-1, 1},
                              "for each joint, by how much the link's angle grows with it")
        .Allowed("1, -1 or 0"),
});

/// A `[[abort]]` as the file has it.
struct AbortEntry {
  static constexpr std::array<std::string_view, kAbortWayCount> kWayNames = {"catch", "fold",
                                                                             "roll-out", "damp"};
  double from_s = 0;
  double to_s = 0;
  AbortWay way = AbortWay::kCatch;
  double late_max_s = 0;
  double limits_share = 0;
  std::vector<double> joint_positions_rad;
};
inline constexpr auto kAbortKeys = AllRequired(std::array{
    KeyOf<&AbortEntry::from_s>("from_s", Range::NonNegative(),
                               "where a span of the motion's time begins")
        .Allowed("0, then `to_s` of the span before"),
    KeyOf<&AbortEntry::to_s>("to_s", Range::Positive(), "where it ends")
        .Allowed("above `from_s`; of the last span `duration_s`"),
    KeyOf<&AbortEntry::way>("way", AbortEntry::kWayNames,
                            "what the joints do when the motion is [aborted](runtime.md#aborts) "
                            "in this span"),
});
/// The key of a span with the way `roll-out`.
inline constexpr auto kRollOutKeys = AllRequired(std::array{
    KeyOf<&AbortEntry::late_max_s>(
        "late_max_s", {0, 1}, "only with `roll-out`: a motion that is later is damped instead"),
});
/// Keys of a span with the way `fold`.
inline constexpr auto kFoldKeys = AllRequired(std::array{
    KeyOf<&AbortEntry::limits_share>("limits_share", {0, 1, true},
                                     "only with `fold`: of the limits of velocity and "
                                     "acceleration that the way to the pose may use"),
    KeyOf<&AbortEntry::joint_positions_rad>(
        "joint_positions_rad", "only with `fold`: the pose, in the order of the joints")
        .Allowed("within the joints' limits"),
});

inline constexpr auto kAbortFigureKeys = AllRequired(std::array{
    KeyOf<&AbortFigure::robots>("robots", {1, 1e6},
                                "the model and others, for which the table of aborts was found "
                                "(`tumbler abort`); the table is left out where it was not"),
    KeyOf<&AbortFigure::seed>("seed", Range::NonNegative(), "of the others"),
    KeyOf<&AbortFigure::scale>("scale", {0, 10}, "of the spreads"),
    KeyOf<&AbortFigure::spreads>("spreads", "in which they differ"),
    KeyOf<&AbortFigure::drives_file>("drives_file", "a name for people; empty: the default drives"),
    KeyOf<&AbortFigure::drives_hash>("drives_hash", "of that file; empty as `drives_file` is"),
    KeyOf<&AbortFigure::impact_m_s>("impact_m_s", Range::NonNegative(),
                                    "the hardest impact of an abort, root mean square over robots "
                                    "and times"),
    KeyOf<&AbortFigure::impact_max_m_s>("impact_max_m_s", Range::NonNegative(), "the largest"),
    KeyOf<&AbortFigure::damped_impact_m_s>("damped_impact_m_s", Range::NonNegative(),
                                           "the same where every abort is answered by damping"),
    KeyOf<&AbortFigure::damped_impact_max_m_s>("damped_impact_max_m_s", Range::NonNegative(),
                                               "likewise the largest"),
});

inline constexpr auto kPoseKeys = AllRequired(std::array{
    KeyOf<&PrimitivePose::root_x_m>("root_x_m", "of the root link's frame"),
    KeyOf<&PrimitivePose::root_z_m>("root_z_m", "of the root link's frame"),
    KeyOf<&PrimitivePose::root_pitch_rad>("root_pitch_rad", "of the root link's frame"),
    KeyOf<&PrimitivePose::joint_positions_rad>("joint_positions_rad", "in the order of the joints")
        .Allowed("the ends of their paths"),
});
/// Keys of a pose of a robot that has joints without a motor.
inline constexpr auto kPassivePoseKeys = std::array{
    KeyOf<&PrimitivePose::passive_positions_rad>(
        "passive_positions_rad",
        "of the joints without a motor, in the order of the robot's file; left out where each has "
        "one")
        .Default("none"),
};

/// Of a robot in space.
inline constexpr auto kSpacePoseKeys = std::array{
    KeyOf<&PrimitivePose::root_y_m>("root_y_m", "in space: of the root link's frame")
        .Default("in the plane"),
    KeyOf<&PrimitivePose::root_quaternion>("root_quaternion",
                                           "in space: how the root link's frame is turned in the "
                                           "world, w, x, y, z; `root_pitch_rad` is "
                                           "0 then")
        .Default("in the plane")
        .Allowed("a unit quaternion"),
};
/// Of a root that moves there.
inline constexpr std::array kPoseRateKeys = {
    KeyOf<&PrimitivePose::root_x_m_s>("root_x_m_s",
                                      "the root's velocity; without these three it is at rest (at "
                                      "an exit: slower than 0.1 m/s and rad/s)"),
    KeyOf<&PrimitivePose::root_z_m_s>("root_z_m_s", "likewise"),
    KeyOf<&PrimitivePose::root_pitch_rad_s>("root_pitch_rad_s", "likewise"),
};

inline constexpr auto kDriveGainsKeys = AllRequired(std::array{
    KeyOf<&DriveGains::kp_nm_per_rad>(
        "kp_nm_per_rad", {0, 1e4},
        "of each joint's drive through which the motion was found (`[robust]` of its task) or is "
        "to be played (`[drives]`); what a simulation without a drives file takes. Without this "
        "table: 200 and 4"),
    KeyOf<&DriveGains::kd_nm_s_per_rad>("kd_nm_s_per_rad", {0, 1e3}, "likewise"),
});

inline constexpr auto kContactKeys = AllRequired(std::array{
    KeyOf<&ContactInterval::shape>("shape", "`LINK/INDEX` of the collision shape"),
    KeyOf<&ContactInterval::obstacle>("obstacle", "its name in the task"),
    KeyOf<&ContactInterval::start_s>("start_s", Range::NonNegative(), ""),
    KeyOf<&ContactInterval::end_s>("end_s", Range::NonNegative(), "").Allowed("`start_s` or more"),
    KeyOf<&ContactInterval::peak_normal_force_n>(
        "peak_normal_force_n", Range::NonNegative(),
        "at the one point that carries most: a box or a capsule may touch at several"),
});

inline constexpr auto kPurposeKeys = AllRequired(std::array{
    KeyOf<&PurposeTarget::of, PurposeFigure>(
        "of", PurposeTarget::kOfNames,
        "what the task asks for: a value of the root; `speed`: to end at rest, no rate of the root "
        "faster in the last 0.25 s; `point_...`: of a point of a link, see the task's `of`"),
    KeyOf<&PurposeTarget::when, PurposeFigure>(
        "when", PurposeTarget::kWhenNames,
        "at the end of the motion, of the settle phase, 2 s after the motion, or at `time_s`"),
    KeyOf<&PurposeTarget::target, PurposeFigure>("target", ""),
    KeyOf<&PurposeTarget::tolerance, PurposeFigure>("tolerance", Range::Positive(),
                                                    "farther from the target misses it"),
    KeyOf<&PurposeFigure::result>("result",
                                  "of the plan, simulated with a 16th of the step with which it "
                                  "was found, in space a quarter"),
});

/// The key of a target at a time.
inline constexpr auto kPurposeTimeKeys = AllRequired(std::array{
    KeyOf<&PurposeTarget::time_s, PurposeFigure>("time_s", Range::Positive(),
                                                 "since the start of the motion; of `time` only"),
});
/// Keys of a target in space.
inline constexpr auto kPurposeSpaceKeys = AllRequired(std::array{
    KeyOf<&PurposeTarget::link, PurposeFigure>("link", "that it is of; in space, likewise"),
    KeyOf<&PurposeTarget::in_space, PurposeFigure>(
        "in_space", "the point [m] or the axis, in the link's frame; likewise"),
    KeyOf<&PurposeTarget::along, PurposeFigure>("along", "a direction of the world; likewise"),
});
/// Keys of a target of a point.
inline constexpr auto kPurposePointKeys = AllRequired(std::array{
    KeyOf<&PurposeTarget::link, PurposeFigure>("link", "that has the point; of `point_...` only"),
    KeyOf<&PurposeTarget::point_m, PurposeFigure>("point_m",
                                                  "x and z in the link's frame; likewise"),
});

inline constexpr auto kRobustnessKeys = AllRequired(std::array{
    KeyOf<&RobustnessFigure::motion>(
        "motion", "what was played: this primitive's name, or that of a sequence with it"),
    KeyOf<&RobustnessFigure::cycles>("cycles", Range::NonNegative(), "of the sequence, else 0"),
    KeyOf<&RobustnessFigure::stand>("stand", Range::NonNegative(),
                                    "robots that were as asked after every motion")
        .Allowed("up to `robots`"),
    KeyOf<&RobustnessFigure::robots>("robots", {1, 1e9}, "that were played"),
    KeyOf<&RobustnessFigure::share_95_low>("share_95_low", {0, 1},
                                           "confidence interval of `stand` / `robots`"),
    KeyOf<&RobustnessFigure::share_95_high>("share_95_high", {0, 1},
                                            "confidence interval of `stand` / `robots`"),
    KeyOf<&RobustnessFigure::seed>("seed", Range::NonNegative(), "of the robots"),
    KeyOf<&RobustnessFigure::scale>("scale", {0, 10}, "of the spreads"),
    KeyOf<&RobustnessFigure::spreads>("spreads", "in which the robots differ"),
    KeyOf<&RobustnessFigure::hold_s>("hold_s", {0, 3600}, "after the last motion"),
    KeyOf<&RobustnessFigure::where>("where", RobustnessFigure::kWhereNames,
                                    "what they were played in"),
    KeyOf<&RobustnessFigure::drives_file>("drives_file",
                                          "a name for people; empty: the default drives"),
    KeyOf<&RobustnessFigure::drives_hash>("drives_hash", "of that file; empty as `drives_file` is"),
});

inline constexpr auto kWindowKeys = AllRequired(std::array{
    KeyOf<&GroundWindow::mu>(
        "mu", Range::Positive(),
        "the least and the largest coefficient of friction between which the model is as asked, "
        "everything else as in the task"),
    KeyOf<&GroundWindow::mu_scanned>(
        "mu_scanned", Range::Positive(),
        "between which values that was looked at: a window that ends there reaches at least so far")
        .Allowed("around `mu`"),
    KeyOf<&GroundWindow::stiffness_n_per_m>("stiffness_n_per_m", Range::Positive(),
                                            "likewise, of the contact's stiffness"),
    KeyOf<&GroundWindow::stiffness_scanned_n_per_m>("stiffness_scanned_n_per_m", Range::Positive(),
                                                    "likewise")
        .Allowed("around `stiffness_n_per_m`"),
    KeyOf<&GroundWindow::damping_n_s_per_m>("damping_n_s_per_m", Range::Positive(),
                                            "likewise, of the contact's damping"),
    KeyOf<&GroundWindow::damping_scanned_n_s_per_m>("damping_scanned_n_s_per_m", Range::Positive(),
                                                    "likewise")
        .Allowed("around `damping_n_s_per_m`"),
    KeyOf<&GroundWindow::hold_s>("hold_s", {0, 3600}, "after the motion"),
    KeyOf<&GroundWindow::where>("where", RobustnessFigure::kWhereNames,
                                "what the model was played in"),
    KeyOf<&GroundWindow::drives_file>("drives_file",
                                      "a name for people; empty: the default drives"),
    KeyOf<&GroundWindow::drives_hash>("drives_hash", "of that file; empty as `drives_file` is"),
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
/// Keys of a motion that complements others: the file has both or neither.
inline constexpr auto kComplementFileKeys = AllRequired(std::array{
    KeyOf<&Provenance::complement_files>(
        "complement_files",
        "the primitives that do not carry the robots that it was found on (`--complement`), else "
        "left out"),
    KeyOf<&Provenance::complement_hashes>("complement_hashes",
                                          "the `content_hash` of each, likewise"),
});
/// The key of a motion that was changed by hand and signed: the file has it or not.
inline constexpr auto kEditedKeys = AllRequired(std::array{
    KeyOf<&Provenance::edited>(
        "edited",
        "why the file was changed by hand after it was made (`tumbler sign`), else left out"),
});
inline constexpr auto kSourceTextKeys = AllRequired(std::array{
    LongTextOf<&Provenance::robot_urdf>(
        "robot_urdf", "whole texts: enough to make the file again, or to simulate it"),
    LongTextOf<&Provenance::task_toml>(
        "task_toml", "whole texts: enough to make the file again, or to simulate it"),
});

}  // namespace tumbler
