#pragma once

#include <string>

namespace tumbler {

/// The machine on which a figure about time was measured.
struct Machine {
  /// Release of the kernel, and its kind of preemption: `6.1.0-18-rt (PREEMPT_RT)`.
  std::string kernel;
  /// Model and number of processors.
  std::string cpu;
  /// Driver and product of the CAN interface; `virtual` or `none`.
  std::string adapter;
};

/// Describes this machine.
/// @param interface  the CAN interface, e.g. `can0`; empty for none.
[[nodiscard]] Machine DescribeMachine(const std::string& interface);

}  // namespace tumbler
