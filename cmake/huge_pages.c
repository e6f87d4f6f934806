// Loaded into compilers (cmake/HugePages.cmake): asks for huge pages for all memory that they map
// for themselves.

#define _GNU_SOURCE
#include <stddef.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

void* mmap(void* address, size_t length, int protection, int flags, int descriptor, off_t offset) {
  void* const mapped =
      (void*)syscall(SYS_mmap, address, length, protection, flags, descriptor, offset);
  if (mapped != MAP_FAILED && (flags & MAP_ANONYMOUS) != 0) {
    madvise(mapped, length, MADV_HUGEPAGE);  // a wish: nothing depends on it
  }
  return mapped;
}

void* mmap64(void* address, size_t length, int protection, int flags, int descriptor,
             off_t offset) {
  return mmap(address, length, protection, flags, descriptor, offset);
}
