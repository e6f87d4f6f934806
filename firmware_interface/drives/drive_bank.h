#pragma once

#include <array>
#include <span>
#include <variant>

#include "common/primitive.h"
#include "common/status.h"
#include "firmware_interface/drives/cansimple.h"
#include "firmware_interface/drives/cia402.h"
#include "firmware_interface/drives/drive.h"
#include "firmware_interface/drives/drive_range.h"
#include "firmware_interface/drives/joint_map.h"
#include "firmware_interface/drives/mit.h"

namespace tumbler {

/// One drive, in any of the protocols.
using DriveConfig = std::variant<MitConfig, CanSimpleConfig, Cia402Config>;

[[nodiscard]] Status Validate(const DriveConfig& config) noexcept;
[[nodiscard]] const JointMap& JointOf(const DriveConfig& config) noexcept;
/// What can be asked of the drive, at its shaft.
[[nodiscard]] ShaftRanges CommandRanges(const DriveConfig& config) noexcept;
/// Positions of the shaft that the drive can report without wrapping.
[[nodiscard]] DriveRange ReportedPositions(const DriveConfig& config) noexcept;

/// The drives of one bus as a value of fixed size: any mixture of protocols, no heap. They are
/// handed to an executor by pointer, so a bank stays where it is.
class DriveBank {
 public:
  DriveBank() = default;
  DriveBank(const DriveBank&) = delete;
  DriveBank& operator=(const DriveBank&) = delete;

  /// Adds the next joint's drive. The first of CiA 402 leads its bus: it sends SYNC and the host's
  /// heartbeat for all; `leader` of the configuration is not looked at.
  /// @retval kInvalidArgument   the configuration is not valid.
  /// @retval kCapacityExceeded  kMaxJoints drives are in it.
  Status Add(const DriveConfig& config) noexcept;

  /// In the order of Add.
  [[nodiscard]] std::span<Drive* const> drives() const noexcept {
    return {pointers_.data(), count_};
  }

 private:
  using Slot = std::variant<std::monostate, MitDrive, CanSimpleDrive, Cia402Drive>;
  std::array<Slot, kMaxJoints> slots_;
  std::array<Drive*, kMaxJoints> pointers_{};
  std::size_t count_ = 0;
  bool has_leader_ = false;
};

}  // namespace tumbler
