#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware_interface/can/can_link.h"

namespace tumbler {

/// What matters of a machine and one of its CAN interfaces for a loop that drives motors.
struct HostFacts {
  std::string interface;
  bool can_in_kernel = false;   ///< Whether a CAN socket can be made.
  std::optional<CanLink> link;  ///< None: there is no such interface.
  std::string link_problem;     ///< Why not.
  bool may_restart_link = false;
  std::string kernel;                 ///< Its kind of preemption by its version, e.g. `PREEMPT_RT`.
  std::int64_t priority_max = 0;      ///< Of SCHED_FIFO for this user; 0: none.
  std::int64_t locked_bytes_max = 0;  ///< Memory that this user may lock; -1: any amount.
  bool may_keep_awake = false;        ///< Whether /dev/cpu_dma_latency can be opened.
  std::string governor;  ///< Of the first processor; empty: its frequency is not governed.
  std::string isolated;  ///< Processors kept free of other work, as in `isolcpus`; empty: none.
  int processors = 1;
};

/// Asks the kernel. Sends nothing and changes nothing. May allocate and block.
/// @param root  the folder that has proc, sys and dev.
[[nodiscard]] HostFacts GatherHostFacts(const std::string& interface,
                                        const std::string& root = "/");

/// One thing that was examined.
struct HostFinding {
  enum class Level : std::uint8_t {
    kGood,
    kAdvice,   ///< Runs are possible, but not as good as they could be.
    kMissing,  ///< An armed run would be refused, or would not work.
  };
  Level level = Level::kGood;
  std::string what;    ///< e.g. `bit rate`
  std::string state;   ///< e.g. `1000000 bit/s`
  std::string remedy;  ///< What to do; empty where nothing is.
};

/// Judges the facts, in the order in which things are set up.
[[nodiscard]] std::vector<HostFinding> Diagnose(const HostFacts& facts);

/// One line for each finding, and one below it for its remedy.
[[nodiscard]] std::string Describe(const std::vector<HostFinding>& findings);

}  // namespace tumbler
