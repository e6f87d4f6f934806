#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/primitive.h"
#include "common/files/key_table.h"
#include "common/files/purpose.h"

namespace tumbler {

/// The version that this build writes, and the only one that it reads.
inline constexpr int kPrimitiveFileVersion = 2;

/// How long after a motion's end its exit is, with the joints held [s].
inline constexpr double kExitAfter_s = 2;

/// Where a motion starts, or where it leaves the robot: `kExitAfter_s` after its end, or at its end
/// when joints move there. The joints are at the ends of their splines.
struct PrimitivePose {
  double root_x_m = 0;  ///< Of the root link's frame, world axes.
  double root_z_m = 0;
  double root_pitch_rad = 0;
  std::vector<double> joint_positions_rad;  ///< In the order of the primitive's joints.
  /// The root's velocity in a motion that does not start, or end, at rest.
  double root_x_m_s = 0, root_z_m_s = 0, root_pitch_rad_s = 0;

  [[nodiscard]] bool root_moves() const {
    return root_x_m_s != 0 || root_z_m_s != 0 || root_pitch_rad_s != 0;
  }
  /// In space: the root's y, and how its frame is turned in the world, as the unit quaternion w, x,
  /// y, z. Its pitch is 0 then. All 0 in the plane.
  double root_y_m = 0;
  std::array<double, 4> root_quaternion{};
  [[nodiscard]] bool is_in_space() const { return root_quaternion != std::array<double, 4>{}; }
  /// Of the joints that have no motor, in the order of the robot's file; empty where each has one.
  std::vector<double> passive_positions_rad = {};
};

/// An interval in which one collision shape of the robot carried force in the plan.
struct ContactInterval {
  std::string shape;     ///< `LINK/INDEX` of the shape, in the URDF's order.
  std::string obstacle;  ///< The obstacle's name in the task.
  double start_s = 0;
  double end_s = 0;
  double peak_normal_force_n = 0;
};

/// The figures that were verified when the motion was made. Proofs hold for all t; maxima are those
/// of dense samples.
struct Certificate {
  /// The least of `gradient_errors`; 1e9 where the differences are not finite.
  double gradient_error = 0;
  /// Steps of the central differences with which the analytic gradient was compared, through
  /// contact.
  std::array<double, 3> gradient_difference_steps_rad{};
  /// Relative error of the gradient at each of these steps.
  std::array<double, 3> gradient_errors{};
  /// Relative change of the cost's gradient when the integration step is halved.
  double gradient_step_halving_change = 0;
  /// Largest component of the cost's gradient that no active constraint holds [cost per rad].
  double projected_gradient = 0;
  /// The same as a part of what it is made of, at most 1. None: not known, as with motions that are
  /// found by robots that differ.
  std::optional<double> kkt_residual;
  /// Largest excess of a limit, relative to the limit (of a position, in rad); 0 when all hold.
  double constraint_violation = 0;
  /// Change of the final pitch when the integration step is halved.
  double step_halving_error_rad = 0;
  /// Pitch 2 s after the end, less the pitch that was asked for.
  double settled_pitch_error_rad = 0;
  double peak_torque_nm = 0;              ///< From dense samples.
  double peak_penetration_m = 0;          ///< Into the compliant layer, from dense samples.
  double position_margin_rad = 0;         ///< Smallest distance to a limit, from control points.
  double velocity_margin_rad_s = 0;       ///< Likewise.
  double acceleration_margin_rad_s2 = 0;  ///< Likewise.
  double torque_margin_nm = 0;            ///< Smallest distance to a limit, from dense samples.
  /// Smallest distance between two of the robot's own shapes, from dense samples. None where it has
  /// none that are to stay apart, and in files from before this figure.
  std::optional<double> self_clearance_m;
};

/// How many robots that differ from the model were as asked after every motion of a study
/// (`tumbler robustness --certify`). It was about the motion as it is in this file.
struct RobustnessFigure {
  enum class Where { kTwin, kLanes };
  static constexpr std::array<std::string_view, 2> kWhereNames = {"twin", "lanes"};

  /// The name of what was played: the primitive, or a sequence that it is part of. The figure of a
  /// sequence is about its other primitives, too, as they were then.
  std::string motion;
  int cycles = 0;  ///< Of the sequence; 0 of a primitive.
  int stand = 0;   ///< As asked after every motion.
  int robots = 0;
  double share_95_low = 0;  ///< Of the confidence interval (ShareOf).
  double share_95_high = 1;
  std::uint64_t seed = 0;      ///< Of the robots.
  double scale = 1;            ///< Of all spreads.
  std::string spreads;         ///< In which they differ: options with their values.
  double hold_s = 0;           ///< After the last motion.
  Where where = Where::kTwin;  ///< What robots were played in.
  std::string drives_file;     ///< A name for people; empty: the default drives.
  std::string drives_hash;     ///< HashOfText of that file; empty when `drives_file` is.
};

/// In which values of the ground's properties the motion is as asked of the model: of each one the
/// values around the task's that go without a gap, everything else as in the task
/// (`tumbler robustness --window --certify`). It was about the motion as it is in this file.
struct GroundWindow {
  /// The least and the largest value of a window, and those that were looked at. An end that is one
  /// of these may not be the window's own: it reaches at least so far.
  using Ends = std::array<double, 2>;

  Ends mu{}, mu_scanned{};                                          ///< Coefficient of friction.
  Ends stiffness_n_per_m{}, stiffness_scanned_n_per_m{};            ///< Likewise.
  Ends damping_n_s_per_m{}, damping_scanned_n_s_per_m{};            ///< Likewise.
  double hold_s = 0;                                                ///< After the motion.
  RobustnessFigure::Where where = RobustnessFigure::Where::kLanes;  ///< What it was played in.
  std::string drives_file;  ///< A name for people; empty: the default drives.
  std::string drives_hash;  ///< HashOfText of that file; empty when `drives_file` is.
};

/// How the table of aborts was found (`tumbler abort`), and how hard the impacts were of the robots
/// that it was found for.
struct AbortFigure {
  int robots = 1;                ///< The model and others.
  std::uint64_t seed = 0;        ///< Of the others.
  double scale = 1;              ///< Of all spreads.
  std::string spreads;           ///< In which they differ: options with their values.
  std::string drives_file;       ///< A name for people; empty: the default drives.
  std::string drives_hash;       ///< HashOfText of that file; empty when `drives_file` is.
  double impact_m_s = 0;         ///< The hardest impact: root mean square over robots and times.
  double impact_max_m_s = 0;     ///< The largest.
  double damped_impact_m_s = 0;  ///< The same where every abort is answered by damping.
  double damped_impact_max_m_s = 0;  ///< Likewise.
};

/// The gains of every joint's drive, at the joint.
struct DriveGains {
  double kp_nm_per_rad = 0;
  double kd_nm_s_per_rad = 0;

  bool operator==(const DriveGains&) const = default;
};

/// The origin of the file. It has everything that is needed to make the file again.
struct Provenance {
  std::string tool;  ///< Program and version.
  std::uint64_t seed = 0;
  double objective = 0;          ///< The cost of the motion.
  std::int64_t evaluations = 0;  ///< Rollouts that the search and the solver took.
  std::string robot_file;        ///< A name for people; `robot_urdf` is what counts.
  std::string task_file;         ///< A name for people; `task_toml` is what counts.
  std::string robot_hash;        ///< HashOfText of `robot_urdf`.
  std::string task_hash;         ///< HashOfText of `task_toml`.
  /// The primitive at whose exit this one starts; empty: it starts in the pose of its task.
  std::string start_file;
  /// The ContentHash of that primitive; empty when `start_file` is.
  std::string start_hash;
  /// The primitive from whose paths the solver started; empty: from a random search.
  std::string guess_file;
  /// The ContentHash of that primitive; empty when `guess_file` is.
  std::string guess_hash;
  /// The motions that it complements, tried before it: it was found on robots that none of them
  /// carries (`--complement`); empty: on all.
  std::vector<std::string> complement_files;
  /// The ContentHash of each of these primitives.
  std::vector<std::string> complement_hashes;
  /// Why the file was changed by hand after it was made, in the words of those who signed it;
  /// empty: it was not. What was verified was verified before the change.
  std::string edited;
  /// The whole text of the robot's URDF.
  std::string robot_urdf;
  /// The whole text of the task. A simulation takes contact and obstacles from it, and its start
  /// from the file's entry pose.
  std::string task_toml;
};

/// How a link's absolute angle follows from the root's and the joints'.
struct LinkChain {
  std::string link;  ///< Its name in the URDF.
  /// For each joint of the primitive: +1, -1, or 0 where it is not between root and link. The
  /// link's angle is the root's pitch plus the sum of these times the joints' angles.
  std::vector<double> joints;
};

/// The whole content of a primitive file.
struct PrimitiveFile {
  Primitive<double> primitive;
  /// The chains of all links that may carry a sensor, where the primitive has feedback; else none.
  std::vector<LinkChain> chains;
  /// Of the drives through which the motion was found; none: for joints that are exactly on their
  /// paths. A simulation that is given no drives takes these.
  std::optional<DriveGains> drives;
  /// Of the table of aborts; none: it was made otherwise, or there is none.
  std::optional<AbortFigure> abort_figure;
  PrimitivePose entry;
  PrimitivePose exit;
  std::vector<ContactInterval> contacts;
  /// What the motion is for, as a simulation with a shorter step judged it; empty: its task asks
  /// for no value.
  std::vector<PurposeFigure> purpose;
  Certificate certificate;
  /// Empty: nobody has looked.
  std::vector<RobustnessFigure> robustness;
  /// None: nobody has looked.
  std::optional<GroundWindow> window;
  Provenance provenance;
};

/// The hash that a primitive's file has of everything in it: HashOfText of the CanonicalText of its
/// TOML without the key `content_hash`. It identifies the primitive.
/// @throws std::invalid_argument  as ToToml.
std::string ContentHash(const PrimitiveFile& file);

/// The file's text. Every double reads back bit for bit, and ParsePrimitive accepts the text.
/// @throws std::invalid_argument  when a value is not finite or the parts do not fit together.
std::string ToToml(const PrimitiveFile& file);

/// Reads and checks a whole primitive: version, structure, finite values, splines that share
/// duration and fit their capacity, limits that hold for all t by the control points, a certificate
/// whose margins are those of the coefficients, and hashes that match, so that nothing was changed
/// since the file was written.
/// @param name  stands for the file in messages.
/// @throws FileError  with file, line, key, value and allowed range.
PrimitiveFile ParsePrimitive(std::string_view text, const std::string& name);
/// The same of a file.
PrimitiveFile LoadPrimitive(const std::string& path);

/// The text of a primitive file that was changed by hand, with margins and hashes as they follow
/// from what it says now. Everything that ParsePrimitive checks has to hold, apart from these.
/// Comments are lost. The rest of the certificate stays, and is no longer about this motion;
/// figures of robots are left out.
/// @param reason  goes into `provenance.edited`, behind the reasons that are there.
/// @throws FileError              as ParsePrimitive, and when nothing was changed.
/// @throws std::invalid_argument  when the reason is empty or is not UTF-8 text.
std::string SignEdited(std::string_view text, const std::string& name, const std::string& reason);

/// What a figure says, for people: the share with its interval, and of which robots it is.
std::string ToText(const RobustnessFigure& figure);

/// A value of a ground's property for people: three digits, without an exponent.
std::string GroundValueText(double value);
/// A window in words: its ends, of which one at the scan's limit says "or less" or "or more".
std::string WindowText(const GroundWindow::Ends& window, const GroundWindow::Ends& scanned);
/// The windows of the three properties by their names, in words.
std::vector<std::pair<std::string, std::string>> WindowLines(const GroundWindow& window);

/// What made the motion, for people: the tool, and why the file was changed by hand where it was.
std::string MakerOf(const Provenance& provenance);

/// The keys of the file for docs/formats.md, and of its certificate for docs/method.md.
std::vector<KeyTable> PrimitiveKeyTables();
KeyTable CertificateKeyTable();

}  // namespace tumbler
