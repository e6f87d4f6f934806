/* Preloaded into user-mode Linux on processors with AMX (scripts/guest).
 *
 * User-mode Linux sets the extended state of its processes from a buffer of 2696 bytes, which is all that there was before
 * AMX: with tile registers it is 11 kB, and the kernel takes all of it or nothing (xstateregs_set: -EFAULT), so that the
 * guest ends before it has begun. Here what is missing is completed from the state that the process has. */
#define _GNU_SOURCE
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

long ptrace(enum __ptrace_request request, ...) {
  va_list arguments;
  va_start(arguments, request);
  pid_t pid = va_arg(arguments, pid_t);
  void *address = va_arg(arguments, void *);
  void *data = va_arg(arguments, void *);
  va_end(arguments);
  if (request == PTRACE_SETREGSET && address == (void *)NT_X86_XSTATE) {
    static char whole[65536] __attribute__((aligned(64)));
    const struct iovec *given = data;
    struct iovec all = {whole, sizeof whole};
    if (syscall(SYS_ptrace, PTRACE_GETREGSET, pid, address, &all) == 0 && all.iov_len > given->iov_len) {
      memcpy(whole, given->iov_base, given->iov_len);
      return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, address, &all);
    }
  }
  /* The system call gives what is peeked through its last argument, the function as its result. */
  if (request == PTRACE_PEEKTEXT || request == PTRACE_PEEKDATA || request == PTRACE_PEEKUSER) {
    long word = 0;
    long status = syscall(SYS_ptrace, request, pid, address, &word);
    return status < 0 ? status : word;
  }
  return syscall(SYS_ptrace, request, pid, address, data);
}
