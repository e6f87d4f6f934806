#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/sequence_toml.h"
#include "firmware_interface/drives/drives_toml.h"

namespace tumbler {

/// A motion and the drives that play it.
struct RunParts {
  SequenceFile file;                                ///< The motion as it was loaded,
  std::unique_ptr<const Sequence<float>> sequence;  ///< and as the executor has it.
  DrivesConfig drives;                              ///< One for each joint, in its order.

  /// Where each joint is when the motion begins [rad].
  [[nodiscard]] std::vector<double> StartPositions() const;
};

/// Loads the motion, still without drives.
/// @throws FileError; std::invalid_argument where it is larger than an executor takes.
[[nodiscard]] RunParts LoadRunMotion(const std::string& path, const FileReader& read = {});

/// Names of the joints that a motion moves, in its order.
[[nodiscard]] std::vector<std::string> JointsOf(const SequenceFile& motion);

/// The drives of these joints, in their order.
/// @param path  of the drives file; empty: DefaultDrives.
/// @throws FileError; std::runtime_error naming a joint that has no drive in the file.
[[nodiscard]] DrivesConfig LoadDrivesOf(const std::vector<std::string>& joints,
                                        const std::string& path, const FileReader& read);

}  // namespace tumbler
