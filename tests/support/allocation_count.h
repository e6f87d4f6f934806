#pragma once

#include <cstddef>

namespace tumbler::testing {

/// How often the program has called operator new. (The file that defines this function replaces
/// it.) This is for code that may allocate, but not more the longer it runs.
std::size_t AllocationCount() noexcept;

}  // namespace tumbler::testing
