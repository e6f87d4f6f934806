#pragma once

namespace tumbler::testing {

/// While an object of this class is alive, any heap allocation of the thread that made it aborts
/// with a message: malloc and its kin, operator new, and everything that calls them. So does
/// freeing, which takes the same locks, and locking any mutex, contended or not.
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
