#include "firmware_interface/drives/drive_bank.h"

namespace tumbler {

// std::visit and std::get can throw; a chain of std::get_if cannot.

Status Validate(const DriveConfig& config) noexcept {
  if (const auto* mit = std::get_if<MitConfig>(&config)) return mit->Validate();
  if (const auto* can = std::get_if<CanSimpleConfig>(&config)) return can->Validate();
  return std::get_if<Cia402Config>(&config)->Validate();
}

const JointMap& JointOf(const DriveConfig& config) noexcept {
  if (const auto* mit = std::get_if<MitConfig>(&config)) return mit->joint;
  if (const auto* can = std::get_if<CanSimpleConfig>(&config)) return can->joint;
  return std::get_if<Cia402Config>(&config)->joint;
}

ShaftRanges CommandRanges(const DriveConfig& config) noexcept {
  if (const auto* mit = std::get_if<MitConfig>(&config)) {
    return {mit->command.position_rad, mit->command.velocity_rad_s, mit->command.torque_nm};
  }
  if (const auto* can = std::get_if<CanSimpleConfig>(&config)) return can->range;
  return std::get_if<Cia402Config>(&config)->range;
}

DriveRange ReportedPositions(const DriveConfig& config) noexcept {
  if (const auto* mit = std::get_if<MitConfig>(&config)) return mit->reply.position_rad;
  return CommandRanges(config).position_rad;  // Floats and 32 bits reach as far, at least.
}

Status DriveBank::Add(const DriveConfig& config) noexcept {
  if (count_ == slots_.size()) return Status::kCapacityExceeded;
  if (Validate(config) != Status::kOk) return Status::kInvalidArgument;
  Slot& slot = slots_[count_];
  Drive*& pointer = pointers_[count_];
  if (const auto* mit = std::get_if<MitConfig>(&config)) {
    pointer = &slot.emplace<MitDrive>(*mit);
  } else if (const auto* can = std::get_if<CanSimpleConfig>(&config)) {
    pointer = &slot.emplace<CanSimpleDrive>(*can);
  } else {
    Cia402Config cia402 = *std::get_if<Cia402Config>(&config);
    cia402.leader = !has_leader_;
    has_leader_ = true;
    pointer = &slot.emplace<Cia402Drive>(cia402);
  }
  ++count_;
  return Status::kOk;
}

}  // namespace tumbler
