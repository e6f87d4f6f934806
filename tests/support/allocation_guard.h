#pragma once

namespace tumbler::testing {

/// Aborts with a message at any heap allocation that the calling thread makes while one of these is
/// alive: malloc and its kin, operator new, and what they hide behind. Freeing is caught as well,
/// since it takes the same locks; and so is any mutex that it locks, contended or not.
///
/// Works by replacing malloc and the rest in the executable that links this file; operator new
/// calls malloc. Sanitizers bring their own malloc, which must not be replaced: then the guard does
/// nothing, and `kActive` says so.
class AllocationGuard {
 public:
  static const bool kActive;

  AllocationGuard() noexcept;
  ~AllocationGuard();
  AllocationGuard(const AllocationGuard&) = delete;
  AllocationGuard& operator=(const AllocationGuard&) = delete;
};

}  // namespace tumbler::testing
