#pragma once

#include <string>
#include <vector>

#include "common/files/json.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/bench/bench_world.h"
#include "runtime/bench/findings.h"

namespace tumbler {

/// A value that a drive holds.
struct DriveReading {
  std::string name;     ///< e.g. `6076h:00 rated torque`, `register 9 time-out`
  std::string unit;     ///< e.g. `mN m`; empty: none, or unknown.
  double value = 0;     ///< As the drive counts it.
  bool is_hex = false;  ///< Whether people read it as a hexadecimal number.
};

/// Asks a drive for everything that its protocol lets it tell of itself and its set-up, in ways
/// that move nothing: objects of CiA 402, messages of CANSimple, registers of Damiao. What it does
/// not answer is left out. Other MIT drives, and AK drives of V3, tell nothing.
///
/// To be called while no session speaks with the drive: answers of Damiao's drives look like their
/// replies.
/// @throws BenchInterrupted, BenchFault  (bench_session.h).
std::vector<DriveReading> ReadDrive(BenchWorld& world, const DriveEntry& entry);

/// Compares the ranges that a Damiao drive holds, and the rated torque of a CiA 402 drive, with the
/// drives file.
Judgement JudgeReadings(const DriveEntry& entry, const std::vector<DriveReading>& readings);

/// One value in words.
std::string Describe(const DriveReading& reading);
Json ToJson(const std::vector<DriveReading>& readings);

}  // namespace tumbler
