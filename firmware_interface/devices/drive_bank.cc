#include "firmware_interface/devices/drive_bank.h"

namespace tumbler {

Status DriveBank::Add(const DriveConfig& config) noexcept {
  if (count_ == slots_.size()) return Status::kCapacityExceeded;
  if (Validate(config) != Status::kOk) return Status::kInvalidArgument;
  DriveProtocols::Host& slot = slots_[count_];
  pointers_[count_] = DriveProtocols::With(config, [&](auto protocol, auto own) -> Drive* {
    if constexpr (requires { own.leader; }) {
      own.leader = !has_leader_;
      has_leader_ = true;
    }
    return &slot.template emplace<typename decltype(protocol)::Host>(own);
  });
  ++count_;
  return Status::kOk;
}

}  // namespace tumbler
