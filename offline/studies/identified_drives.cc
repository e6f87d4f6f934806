#include "offline/studies/identified_drives.h"

#include <fmt/format.h>

#include <algorithm>
#include <variant>

#include "common/files/toml_writer.h"
#include "firmware_interface/devices/drives_draft.h"
#include "offline/studies/stated_motors.h"

namespace tumbler {
namespace {

const PosteriorDrive* DriveOf(const PosteriorDrives& drives, const std::string& joint) {
  const auto at = std::ranges::find(drives.of_joint, joint, &PosteriorDrive::joint);
  return at == drives.of_joint.end() ? nullptr : &*at;
}

/// By how much more than the true angle an encoder reads.
double ErrorOf(const RobotPosterior& posterior, const std::string& joint) {
  for (std::size_t i = 0; i < posterior.size(); ++i) {
    if (posterior.quantities[i] == RobotQuantity{RobotQuantity::Kind::kZero, joint})
      return posterior.mean[i];
  }
  return 0;
}

/// A drives file of DefaultDrives.
std::string TextOf(const DrivesConfig& drives) {
  TomlWriter writer("a drives file");
  writer.Line("# The drives of a simulation without a drives file, which the records were made");
  writer.Line("# with. Before you drive real motors, make this file from them: tumbler bench.");
  writer.Text("format", "tumbler-drives");
  writer.Line("version = 1\n\n[bus]");
  writer.Line(fmt::format("bit_rate = {}", drives.bit_rate));
  writer.Number("rate_hz", drives.rate_hz);
  for (const DriveEntry& drive : drives.drives) {
    const MitConfig& mit = std::get<MitConfig>(drive.config);
    writer.Line("\n[[drive]]");
    writer.Text("joint", drive.joint);
    writer.Text("protocol", MitProtocol::kName);
    writer.Line(fmt::format("command_id = {}\nreply_id = {}\ndirection = {}", mit.command_id,
                            mit.reply_id, static_cast<int>(mit.joint.direction)));
    const auto number = [&writer](const char* key, float value) {
      // The shortest text of the float, not that of the double that it is.
      writer.Line(fmt::format("{} = {:#}", key, value));
    };
    number("gear_ratio", mit.joint.gear_ratio);
    number("zero_offset_rad", mit.joint.zero_offset_rad);
    number("kp_nm_per_rad", drive.kp_nm_per_rad);
    number("kd_nm_s_per_rad", drive.kd_nm_s_per_rad);
    writer.Line("[drive.range]");
    const auto range = [&writer](const char* key, const DriveRange& of) {
      writer.Line(fmt::format("{} = [{:#}, {:#}]", key, of.min, of.max));
    };
    range("position_rad", mit.command.position_rad);
    range("velocity_rad_s", mit.command.velocity_rad_s);
    range("kp_nm_per_rad", mit.command.kp_nm_per_rad);
    range("kd_nm_s_per_rad", mit.command.kd_nm_s_per_rad);
    range("torque_nm", mit.command.torque_nm);
  }
  return writer.Take();
}

}  // namespace

PosteriorDrives FactsOf(const DrivesConfig& drives) {
  PosteriorDrives facts;
  facts.rate_hz = drives.rate_hz;
  for (const DriveEntry& entry : drives.drives) {
    const JointMap& joint = JointOf(entry.config);
    facts.of_joint.push_back(
        {entry.joint, std::string(DriveProtocols::kNames[entry.config.index()]),
         static_cast<double>(entry.kp_nm_per_rad), static_cast<double>(entry.kd_nm_s_per_rad),
         static_cast<double>(joint.direction), static_cast<double>(joint.gear_ratio),
         static_cast<double>(joint.zero_offset_rad), entry.motor.torque_factor,
         entry.motor.torque_time_constant_s, entry.motor.velocity_filter_s});
  }
  return facts;
}

std::string DifferenceOf(const PosteriorDrives& a, const PosteriorDrives& b, bool all) {
  const auto both = [](const std::string& what, const auto& of_a, const auto& of_b) {
    return fmt::format("{} is {} and {}", what, of_a, of_b);
  };
  if (a.rate_hz != b.rate_hz) return both("rate_hz", a.rate_hz, b.rate_hz);
  for (const PosteriorDrive& drive : a.of_joint) {
    const PosteriorDrive* const other = DriveOf(b, drive.joint);
    if (other == nullptr) return fmt::format("{} has a drive, and has none", drive.joint);
    if (drive.protocol != other->protocol)
      return both("protocol of " + drive.joint, drive.protocol, other->protocol);
    struct Number {
      const char* key;
      double PosteriorDrive::*of;
    };
    for (const Number& number :
         {Number{"kp_nm_per_rad", &PosteriorDrive::kp_nm_per_rad},
          Number{"kd_nm_s_per_rad", &PosteriorDrive::kd_nm_s_per_rad},
          Number{"direction", &PosteriorDrive::direction},
          Number{"gear_ratio", &PosteriorDrive::gear_ratio},
          Number{"zero_offset_rad", &PosteriorDrive::zero_offset_rad},
          Number{"torque_factor", &PosteriorDrive::torque_factor},
          Number{"torque_time_constant_s", &PosteriorDrive::torque_time_constant_s},
          Number{"velocity_filter_s", &PosteriorDrive::velocity_filter_s}}) {
      const double of_a = drive.*number.of, of_b = other->*number.of;
      if (number.of == &PosteriorDrive::zero_offset_rad && !all) break;
      if (of_a != of_b) return both(fmt::format("{} of {}", number.key, drive.joint), of_a, of_b);
    }
  }
  return "";
}

void ShiftZeros(PosteriorFile& file, const PosteriorDrives& to) {
  for (std::size_t i = 0; i < file.posterior.size(); ++i) {
    const RobotQuantity& quantity = file.posterior.quantities[i];
    if (quantity.kind != RobotQuantity::Kind::kZero) continue;
    const PosteriorDrive* const was = DriveOf(file.drives, quantity.of);
    const PosteriorDrive* const is = DriveOf(to, quantity.of);
    if (was == nullptr || is == nullptr) continue;
    const double by_rad = is->zero_offset_rad - was->zero_offset_rad;
    file.posterior.mean[i] += by_rad;
    if (!file.information.empty()) file.information.centre[i] += by_rad;
  }
  for (PosteriorDrive& drive : file.drives.of_joint) {
    if (const PosteriorDrive* const is = DriveOf(to, drive.joint))
      drive.zero_offset_rad = is->zero_offset_rad;
  }
}

std::string CorrectedDrives(const std::string& text, const std::string& name,
                            const DrivesConfig& drives, const PosteriorFile& file) {
  DrivesDraft draft(name.empty() ? TextOf(drives) : text, name.empty() ? "drives.toml" : name);
  for (std::size_t i = 0; i < draft.config().drives.size(); ++i) {
    const DriveEntry& drive = draft.config().drives[i];
    const double error_rad = ErrorOf(file.posterior, drive.joint);
    const MotorFacts was = drive.motor, is = MotorFound(file, drive.joint);
    if (error_rad != 0) {
      const auto offset_rad = static_cast<double>(JointOf(drive.config).zero_offset_rad);
      draft.SetNumber(i, "zero_offset_rad", offset_rad - error_rad);
    }
    const auto set = [&](const char* key, double MotorFacts::*of) {
      if (is.*of != was.*of) draft.SetNumber(i, key, is.*of);
    };
    set("torque_factor", &MotorFacts::torque_factor);
    set("torque_time_constant_s", &MotorFacts::torque_time_constant_s);
    set("velocity_filter_s", &MotorFacts::velocity_filter_s);
  }
  draft.Check();
  std::string head =
      "# Zeros and motors of the robot that was identified, by tumbler identify fit.\n";
  if (file.effective) {
    head +=
        "# AN EFFECTIVE MODEL: it did not explain its records. Do not drive with these zeros.\n";
  }
  return head + draft.text();
}

}  // namespace tumbler
