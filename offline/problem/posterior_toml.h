#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/files/key_table.h"
#include "common/files/primitive_toml.h"
#include "offline/scene/robot_posterior.h"

namespace tumbler {

/// What `tumbler identify fit` writes of a robot for other programs: `posterior.toml`.
struct PosteriorFile {
  RobotPosterior posterior;
  /// Of each quantity in its coordinate, before the first record.
  std::vector<double> prior_deviations;
  /// Whether chi is above its limit. Then it is no model of the robot: it only moves as the robot
  /// did in the records.
  bool effective = false;
  double chi = 0, chi_max = 0;
  /// Whether the robot was weighed. Otherwise masses and forces are in the drives' newton metres.
  bool weighed = false;
  std::vector<std::string> records;  ///< Names, for people.
};

/// The file's text, which reads back bit for bit.
std::string ToToml(const PosteriorFile& file);

/// @throws FileError  with file, line, key, value and allowed range: also where the covariance is
///                    none.
PosteriorFile ParsePosterior(std::string_view text, const std::string& name);
PosteriorFile LoadPosterior(const std::string& path);

/// The keys of the file, for docs/formats.md.
std::vector<KeyTable> PosteriorKeyTables();

}  // namespace tumbler
