#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/files/key_table.h"
#include "common/files/primitive_toml.h"
#include "offline/scene/robot_posterior.h"

namespace tumbler {

/// What of a drive makes its robot another one to its records.
struct PosteriorDrive {
  std::string joint, protocol;
  double kp_nm_per_rad = 0, kd_nm_s_per_rad = 0;
  double direction = 1, gear_ratio = 1, zero_offset_rad = 0;
  /// As their drives file said before anything was fitted.
  double torque_factor = 1, torque_time_constant_s = 0, velocity_filter_s = 0;

  bool operator==(const PosteriorDrive&) const = default;
};

/// The drives with which records were made.
struct PosteriorDrives {
  double rate_hz = 0;
  std::vector<PosteriorDrive> of_joint;  ///< Empty: they are not known.

  bool operator==(const PosteriorDrives&) const = default;
};

/// What `tumbler identify fit` writes of a robot for other programs: `posterior.toml`.
struct PosteriorFile {
  RobotPosterior posterior;
  /// For a fit of further records. Empty: the file is of an earlier version, which has none.
  RobotInformation information;
  /// Of each quantity in its coordinate, before the first record.
  std::vector<double> prior_deviations;
  /// Whether chi is above its limit. Then it is no model of the robot: it only moves as the robot
  /// did in the records.
  bool effective = false;
  double chi = 0, chi_max = 0;
  /// Whether the robot was weighed. Otherwise masses and forces are in the drives' newton metres.
  bool weighed = false;
  double weight_kg = 0;  ///< What the scale said; 0: it was not weighed.
  /// The files that were fitted, as paths from the folder of this file. A fit of further records
  /// reads them again where they are still there.
  std::vector<std::string> records;
  /// Of what the records have to say, in their order (RecordedMotion::Fingerprint).
  std::vector<std::string> fingerprints;
  PosteriorDrives drives;
};

/// The file's text, which reads back bit for bit.
std::string ToToml(const PosteriorFile& file);

/// @param scene  of the robot that is asked about: its links and joints have to be those of the
///               file. Null: any.
/// @throws FileError  with file, line, key, value and allowed range: also where a value is none of
///                    a robot, or the covariance is none.
PosteriorFile ParsePosterior(std::string_view text, const std::string& name,
                             const Scene* scene = nullptr);
PosteriorFile LoadPosterior(const std::string& path, const Scene* scene = nullptr);

/// The keys of the file, for docs/formats.md.
std::vector<KeyTable> PosteriorKeyTables();

}  // namespace tumbler
