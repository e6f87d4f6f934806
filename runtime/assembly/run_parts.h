#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/drives_toml.h"

namespace tumbler {

/// A motion and the drives that play it.
struct RunParts {
  SequenceFile file;                                ///< The motion as it was loaded.
  std::unique_ptr<const Sequence<float>> sequence;  ///< The same motion for the executor.
  DrivesConfig drives;                              ///< One drive for each joint, in its order.

  /// The position of each joint when the motion begins [rad].
  [[nodiscard]] std::vector<double> StartPositions() const;
};

/// Loads the motion. The result has no drives yet.
/// @throws FileError; std::invalid_argument when the motion is larger than an executor takes.
[[nodiscard]] RunParts LoadRunMotion(const std::string& path, const FileReader& read = {});

/// Names of the joints that a motion moves, in its order.
[[nodiscard]] std::vector<std::string> JointsOf(const SequenceFile& motion);

/// The drives of these joints, in their order.
/// @param path  of the drives file; empty: DefaultDrives.
/// @param gains  of these, where the motion says with which it was found (GainsOf).
/// @throws FileError; std::runtime_error naming a joint that has no drive in the file, or about
///         gains that the default drives cannot carry.
[[nodiscard]] DrivesConfig LoadDrivesOf(const std::vector<std::string>& joints,
                                        const std::string& path, const FileReader& read,
                                        const std::optional<DriveGains>& gains = {});

}  // namespace tumbler
