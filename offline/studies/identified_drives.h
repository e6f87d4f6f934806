#pragma once

#include <optional>
#include <string>

#include "firmware_interface/devices/drives_toml.h"
#include "offline/problem/posterior_toml.h"

namespace tumbler {

/// What of these drives makes their robot another one to its records.
PosteriorDrives FactsOf(const DrivesConfig& drives);

/// In words, where drives differ: `kp_nm_per_rad of leg1 is 200 and 150`. Empty: they do not.
/// Zeros, which only shift what encoders read, are not compared (`ShiftZeros`), and neither is what
/// is stated of motors, which is where a fit begins.
/// @param all  compares them, too.
std::string DifferenceOf(const PosteriorDrives& a, const PosteriorDrives& b, bool all);

/// A posterior as one of records that were made with other zeros of the same drives: what an
/// encoder reads more than the true angle grows with zero_offset_rad.
/// @pre DifferenceOf finds none, or drives of the posterior are not known.
void ShiftZeros(PosteriorFile& file, const PosteriorDrives& to);

/// A drives file with zero_offset_rad of the robot that was identified, under which its encoders
/// read true angles, and with what was found of its motors (MotorFacts).
/// @param text, name  of the file with which the records were made; an empty name: there was none
///                    (DefaultDrives).
/// @param drives      of the same, in the order of the robot's joints.
/// @throws FileError  when a key cannot be changed.
std::string CorrectedDrives(const std::string& text, const std::string& name,
                            const DrivesConfig& drives, const PosteriorFile& file);

}  // namespace tumbler
