#pragma once

#include <array>
#include <span>

#include "common/primitive.h"
#include "common/status.h"
#include "firmware_interface/drives/drive.h"
#include "firmware_interface/drives/protocols.h"

namespace tumbler {

/// The drives of one bus as a value of fixed size: any mixture of protocols, no heap. They are
/// handed to an executor by pointer, so a bank stays where it is.
class DriveBank {
 public:
  DriveBank() = default;
  DriveBank(const DriveBank&) = delete;
  DriveBank& operator=(const DriveBank&) = delete;

  /// Adds the next joint's drive. Where a configuration has a `leader`, the first of them leads the
  /// bus, whatever it says: the first of CiA 402 sends SYNC and the host's heartbeat for all.
  /// @retval kInvalidArgument   the configuration is not valid.
  /// @retval kCapacityExceeded  kMaxJoints drives are in it.
  Status Add(const DriveConfig& config) noexcept;

  /// In the order of Add.
  [[nodiscard]] std::span<Drive* const> drives() const noexcept {
    return {pointers_.data(), count_};
  }

 private:
  std::array<DriveProtocols::Host, kMaxJoints> slots_;
  std::array<Drive*, kMaxJoints> pointers_{};
  std::size_t count_ = 0;
  bool has_leader_ = false;
};

}  // namespace tumbler
