#pragma once

#include <string_view>
#include <vector>

namespace tumbler {

/// What drives of a model are delivered with, as far as it differs between models. The tables stand
/// with the readers of the protocols' drives files, with their sources.
struct DriveModel {
  std::string_view name;      ///< As the key `model` has it.
  double velocity_rad_s = 0;  ///< Ranges of setpoints are +- this,
  double torque_nm = 0;       ///< and +- this.
  /// Pole pairs of the motor times turns of the motor per turn of the shaft; 0: not in the table.
  double pole_pairs_and_gear = 0;
};

[[nodiscard]] std::vector<DriveModel> MitModels();
[[nodiscard]] std::vector<DriveModel> AkV3Models();

}  // namespace tumbler
