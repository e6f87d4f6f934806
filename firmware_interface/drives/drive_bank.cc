#include "firmware_interface/drives/drive_bank.h"

namespace tumbler {

// std::visit can throw, and std::get too; a chain of std::get_if cannot.

Status Validate(const DriveConfig& config) noexcept {
  return std::get_if<MitConfig>(&config)->Validate();
}

const JointMap& JointOf(const DriveConfig& config) noexcept {
  return std::get_if<MitConfig>(&config)->joint;
}

ShaftRanges CommandRanges(const DriveConfig& config) noexcept {
  const MitConfig& mit = *std::get_if<MitConfig>(&config);
  return {mit.command.position_rad, mit.command.velocity_rad_s, mit.command.torque_nm};
}

DriveRange ReportedPositions(const DriveConfig& config) noexcept {
  return std::get_if<MitConfig>(&config)->reply.position_rad;
}

Status DriveBank::Add(const DriveConfig& config) noexcept {
  if (count_ == slots_.size()) return Status::kCapacityExceeded;
  if (Validate(config) != Status::kOk) return Status::kInvalidArgument;
  Slot& slot = slots_[count_];
  pointers_[count_++] = &slot.emplace<MitDrive>(*std::get_if<MitConfig>(&config));
  return Status::kOk;
}

}  // namespace tumbler
