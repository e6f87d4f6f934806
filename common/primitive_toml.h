#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/primitive.h"

namespace tumbler {

/// The version that this build writes, and the newest one that it reads.
inline constexpr int kPrimitiveFileVersion = 1;

/// Where a motion starts, and where it leaves the robot 2 s after its end: at rest, with its joints
/// at the ends of their splines.
struct PrimitivePose {
  double root_x_m = 0;  ///< Of the root link's frame, world axes.
  double root_z_m = 0;
  double root_pitch_rad = 0;
  std::vector<double> joint_positions_rad;  ///< In the order of the primitive's joints.
};

/// An interval in which one collision shape of the robot carried force in the plan.
struct ContactInterval {
  std::string shape;     ///< `LINK/INDEX` of the shape, in the URDF's order.
  std::string obstacle;  ///< The obstacle's name in the task.
  double start_s = 0;
  double end_s = 0;
  double peak_normal_force_n = 0;
};

/// What was verified about the motion when it was made. Proofs hold for all t; maxima are of dense
/// samples.
struct Certificate {
  std::string coefficients_hash;  ///< Of everything that the runtime plays; see HashOfCoefficients.
  /// Relative, analytic against central differences, through contact: the least of
  /// `gradient_errors`, which belong to the difference steps beside them. 1e9 where the differences
  /// are not finite.
  double gradient_error = 0;
  std::array<double, 3> gradient_difference_steps_rad{};
  std::array<double, 3> gradient_errors{};
  double gradient_step_halving_change = 0;  ///< Relative, of the gradient of the cost, when the
                                            ///< integration step is halved.
  double projected_gradient = 0;    ///< Largest component that no constraint holds, cost per rad.
  double constraint_violation = 0;  ///< Largest, scaled; zero when every bound holds.
  double step_halving_error_rad =
      0;  ///< Change of the final pitch when the integration step is halved.
  double settled_pitch_error_rad =
      0;  ///< Pitch 2 s after the end, less the pitch that was asked for.
  double peak_torque_nm = 0;
  double peak_penetration_m = 0;          ///< Into the compliant layer.
  double position_margin_rad = 0;         ///< Smallest distance to a limit, from control points.
  double velocity_margin_rad_s = 0;       ///< Likewise.
  double acceleration_margin_rad_s2 = 0;  ///< Likewise.
  double torque_margin_nm = 0;            ///< From dense samples.
};

/// Where the file comes from; enough to make it again.
struct Provenance {
  std::string tool;  ///< Program and version.
  std::uint64_t seed = 0;
  double objective = 0;
  std::int64_t evaluations = 0;
  std::string robot_file;  ///< Names for people; the texts below are what counts.
  std::string task_file;
  std::string robot_hash;  ///< HashOfText of `robot_urdf`.
  std::string task_hash;   ///< HashOfText of `task_toml`.
  std::string start_file;  ///< The primitive at whose exit this one starts; empty: at the task's
                           ///< own start.
  std::string start_hash;  ///< Its `coefficients_hash`; empty with `start_file`.
  std::string robot_urdf;  ///< The whole text of the robot's URDF.
  std::string task_toml;   ///< The whole text of the task: contact and obstacles for a simulation,
                           ///< which starts at the file's entry pose.
};

/// A primitive with all that its file says about it.
struct PrimitiveFile {
  Primitive<double> primitive;
  PrimitivePose entry;
  PrimitivePose exit;
  std::vector<ContactInterval> contacts;
  Certificate certificate;
  Provenance provenance;
};

/// Smallest distances of control points to the limits, over all joints; negative when one is
/// exceeded.
struct LimitMargins {
  double position_rad = 0;
  double velocity_rad_s = 0;
  double acceleration_rad_s2 = 0;
  double torque_nm = 0;  ///< Of the feed-forward spline.
};
LimitMargins MarginsOf(const Primitive<double>& primitive);

/// FNV-1a (64 bit) of a text as `fnv1a64:` and 16 hexadecimal digits. It finds accidents, not
/// forgeries.
std::string HashOfText(std::string_view text);

/// The same of everything that the runtime plays: names, duration, settle time, tolerances, limits,
/// degree, knots and coefficients, each double by its bits.
std::string HashOfCoefficients(const Primitive<double>& primitive);

/// The file's text. Every double reads back bit for bit.
/// @throws std::invalid_argument when a value is not finite or the parts do not fit together:
/// whatever is returned, ParsePrimitive accepts.
std::string ToToml(const PrimitiveFile& file);

/// Reads and checks a whole primitive: version, structure, finite values, splines that share
/// duration and fit their capacity, limits that hold for all t by the control points, hashes that
/// match, a certificate whose margins are those of the coefficients. @throws FileError with file,
/// line, key, value and allowed range; nothing is returned.
PrimitiveFile ParsePrimitive(std::string_view text, const std::string& name);
PrimitiveFile LoadPrimitive(const std::string& path);

/// The primitive in the scalar that the executor uses: every number is the nearest float, and no
/// control point is moved beyond that, so that ends, entry poses and seams stay consistent.
/// Rounding keeps the order of numbers, hence positions and torques within their limits;
/// differences of rounded points (velocity, acceleration) can exceed theirs by rounding errors.
/// Those two limits are then widened to the rounded points, by 0.1 % at most, so that the result
/// holds its own limits exactly.
/// @throws std::invalid_argument when rounding breaks a limit by more (it then names joint,
/// quantity and amount), merges knots, or a number does not fit.
Primitive<float> ToRuntime(const Primitive<double>& primitive);

}  // namespace tumbler
