#pragma once

#include <string>

namespace tumbler {

/// What a figure about time was measured on.
struct Machine {
  std::string
      kernel;       ///< Release, and how its code can be interrupted: `6.1.0-18-rt (PREEMPT_RT)`.
  std::string cpu;  ///< Model and number of processors.
  std::string adapter;  ///< Driver and product of the CAN interface; `virtual` or `none`.
};

/// Of this machine.
/// @param interface  e.g. `can0`; empty for none.
[[nodiscard]] Machine DescribeMachine(const std::string& interface);

}  // namespace tumbler
