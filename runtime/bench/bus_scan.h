#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/bench/bench_world.h"

namespace tumbler {

/// A drive that a scan has found.
struct FoundDrive {
  std::string protocol;         ///< As in drives files: `mit`, `cansimple`, `canopen-csp`, `ak-v3`.
  int number = 0;               ///< MIT, AK V3: CAN ID; otherwise the node's number.
  std::optional<int> reply_id;  ///< MIT: the identifier of its replies.
  bool damiao = false;          ///< MIT: whether it has registers as Damiao's drives do.
  bool by_itself = false;       ///< Whether it was heard before anything was asked.
  std::string details;          ///< What else it said, in words; may be empty.
};

/// What a scan asks.
struct ScanConfig {
  double listen_s = 0.5;  ///< How long only to listen.
  bool passive = false;   ///< Whether to do nothing else.
  /// The CAN IDs at which drives are looked for but those of CANSimple and CiA 402, 1 ... 255.
  int mit_first = 1;
  int mit_last = 127;
  int rounds = 3;             ///< How often silent identifiers are asked.
  double patience_s = 0.002;  ///< Time between two questions.
};

/// Looks for drives of all protocols. First it listens, and then it asks, in ways that turn no
/// motor:
///
/// - CANSimple: a remote frame for the encoder's estimates of every node;
/// - CiA 402: reading the device type (1000h) of every node;
/// - MIT: the frame that leaves motor mode. A drive that somebody else drives would let go; so
///   nothing is asked when setpoints are heard. Those that answer are asked for a register of
///   Damiao's, whose replies have but the low bits of the identifier. Identifiers that belong to a
///   node that was found are left out, because the frame would be another command there;
/// - every other protocol of devices/protocols.h: the host's order for torque off; of AK V3, that
/// is
///   a setpoint without gains and torque. AK V3 drives are heard before, unless they are not set to
///   report by themselves, as they have to be.
///
/// @throws Refused  when somebody commands drives, or nobody acknowledges.
/// @throws BenchInterrupted  (bench_session.h) after Ctrl-C.
std::vector<FoundDrive> ScanBus(BenchWorld& world, const ScanConfig& config);

/// One line about a drive: `mit 1, replies on 17`.
std::string Describe(const FoundDrive& drive);
Json ToJson(const FoundDrive& drive);

/// The drive of a file that was found, by its protocol and number; null when it was not.
const FoundDrive* FindDrive(const std::vector<FoundDrive>& found, const DriveEntry& entry);

}  // namespace tumbler
