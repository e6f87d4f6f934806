#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/core/sequence.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/assembly/machine.h"

namespace tumbler {

/// The description of a run as a whole, for the message run_t.
struct RunDescription {
  std::int64_t number = 0;  ///< Drawn by each run in real time, so that requests can name it.
  std::string robot;        ///< Its name.
  std::string motion;
  std::string bus;
  std::string mode;  ///< `armed`, `dry run` or `simulated`
  bool attended = false;
  bool keyed = false;        ///< Whether requests for motion have to be signed.
  double rate_hz = 1000;     ///< Rate of the loop.
  int bit_rate = 1'000'000;  ///< Bit rate of the bus [bit/s].
  double speed = 1;
  std::vector<std::string> joints;       ///< In the order of the records.
  std::vector<std::string> error_codes;  ///< Of each joint's drive, as `ErrorCodesOf` gives it.
  std::vector<std::string> nodes;        ///< Names of the sequence's nodes.
  std::vector<std::string> branches;     ///< The branches that the operator may name.
  Machine machine;
  std::string scheduling;
};

/// The part of a description that follows from motion and drives: motion, rates, joints, nodes and
/// branches.
[[nodiscard]] RunDescription DescribeMotion(const SequenceGraph<float>& graph,
                                            const DrivesConfig& drives);

}  // namespace tumbler
