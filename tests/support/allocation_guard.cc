#include "tests/support/allocation_guard.h"

#include <dlfcn.h>
#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TUMBLER_SANITIZER_OWNS_MALLOC
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || \
    __has_feature(memory_sanitizer)
#define TUMBLER_SANITIZER_OWNS_MALLOC
#endif
#endif

namespace tumbler::testing {

// The model has to be initial-exec, since the dynamic one may itself allocate at first use.
[[gnu::tls_model("initial-exec")]] static thread_local int guards = 0;

AllocationGuard::AllocationGuard() noexcept { ++guards; }
AllocationGuard::~AllocationGuard() { --guards; }

#ifdef TUMBLER_SANITIZER_OWNS_MALLOC
const bool AllocationGuard::kActive = false;
#else
const bool AllocationGuard::kActive = true;

static void Check(const char* function) {
  if (guards == 0) return;
  guards = 0;  // From now on allocations are allowed: abort() and the message may need them.
  constexpr const char* kText = ": called while an AllocationGuard is alive\n";
  if (write(STDERR_FILENO, function, std::strlen(function)) < 0 ||
      write(STDERR_FILENO, kText, std::strlen(kText)) < 0) {
    std::_Exit(1);
  }
  std::abort();
}
#endif

}  // namespace tumbler::testing

#ifndef TUMBLER_SANITIZER_OWNS_MALLOC
// glibc keeps its allocator under these names for programs that replace the public ones.
extern "C" {
void* __libc_malloc(std::size_t size);                     // NOLINT(bugprone-reserved-identifier)
void* __libc_calloc(std::size_t count, std::size_t size);  // NOLINT(bugprone-reserved-identifier)
void* __libc_realloc(void* pointer, std::size_t size);     // NOLINT(bugprone-reserved-identifier)
// NOLINTNEXTLINE(bugprone-reserved-identifier)
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* pointer);  // NOLINT(bugprone-reserved-identifier)

void* malloc(std::size_t size) {
  tumbler::testing::Check("malloc");
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  tumbler::testing::Check("calloc");
  return __libc_calloc(count, size);
}
void* realloc(void* pointer, std::size_t size) {
  tumbler::testing::Check("realloc");
  return __libc_realloc(pointer, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  tumbler::testing::Check("aligned_alloc");
  return __libc_memalign(alignment, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  tumbler::testing::Check("memalign");
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** pointer, std::size_t alignment, std::size_t size) {
  tumbler::testing::Check("posix_memalign");
  *pointer = __libc_memalign(alignment, size);
  return *pointer == nullptr ? ENOMEM : 0;
}
void free(void* pointer) {
  if (pointer != nullptr) tumbler::testing::Check("free");
  __libc_free(pointer);
}
}

extern "C" int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  using Lock = int (*)(pthread_mutex_t*);
  static std::atomic<Lock> lock{nullptr};
  Lock next = lock.load(std::memory_order_relaxed);
  if (next == nullptr) {
    next = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
    lock.store(next, std::memory_order_relaxed);
  }
  tumbler::testing::Check("pthread_mutex_lock");
  return next(mutex);
}
#endif
