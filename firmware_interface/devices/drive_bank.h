#pragma once

#include <array>
#include <span>

#include "common/core/primitive.h"
#include "common/core/status.h"
#include "firmware_interface/devices/drive.h"
#include "firmware_interface/devices/protocols.h"

namespace tumbler {

/// The drives of one bus, in any mixture of protocols, as an object of fixed size without heap. An
/// executor holds pointers to the drives, so a bank cannot be moved.
class DriveBank {
 public:
  DriveBank() = default;
  DriveBank(const DriveBank&) = delete;
  DriveBank& operator=(const DriveBank&) = delete;

  /// Adds the next joint's drive. Of the configurations with a member `leader`, the first one leads
  /// the bus, whatever its value: the first CiA 402 drive sends SYNC and the host's heartbeat for
  /// all.
  /// @retval kInvalidArgument   the configuration is not valid.
  /// @retval kCapacityExceeded  kMaxJoints drives are in it.
  Status Add(const DriveConfig& config) noexcept;

  /// All drives in the order of Add.
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
