// The way from reset to main on a Cortex-M with a floating-point unit, and the functions that the
// compiler expects of a C++ run-time library, without a heap. The linker script is cortex_m.ld.

#include "runtime/embedded/startup.h"

#include <array>
#include <cstddef>
#include <cstdint>

#include "runtime/embedded/semihosting.h"

extern "C" {

// Symbols of the linker script; their addresses count.
extern std::uint32_t data_start, data_end, bss_start, bss_end, stack_bottom, stack_top;
extern const std::uint32_t data_load;
using Initialiser = void (*)();
extern const Initialiser init_array_start, init_array_end;

/// C++ forbids to call main by that name.
int Main() asm("main");

[[noreturn]] void FaultHandler() {
  tumbler::semihosting::Print("fault: the processor stopped at an instruction\n");
  tumbler::semihosting::Exit(false);
}

/// Standard functions that give up call this. newlib's own would bring in signals and, with them, a
/// heap.
[[noreturn]] void abort() {
  tumbler::semihosting::Print("abort\n");
  tumbler::semihosting::Exit(false);
}
[[noreturn]] void __cxa_pure_virtual() { abort(); }
/// main never returns, so nothing static is ever destroyed.
void* __dso_handle = nullptr;
int __aeabi_atexit(void*, void (*)(void*), void*) { return 0; }

[[noreturn, gnu::noinline]] static void Start() {
  tumbler::RepaintStack();
  const volatile std::uint32_t* from = &data_load;
  for (volatile std::uint32_t* to = &data_start; to < &data_end; ++to) *to = *from++;
  for (volatile std::uint32_t* p = &bss_start; p < &bss_end; ++p) *p = 0;
  for (const Initialiser* f = &init_array_start; f < &init_array_end; ++f) (*f)();
  tumbler::semihosting::Exit(Main() == 0);
}

[[noreturn]] void ResetHandler() {
  // CPACR gives full access to the floating-point unit. This comes before anything uses it.
  auto* const access = reinterpret_cast<volatile std::uint32_t*>(0xe000ed88U);
  *access = *access | 0xfU << 20U;
  asm volatile("dsb\n isb" ::: "memory");
  Start();
}

}  // extern "C"

// Classes with virtual destructors refer to this function. Nothing calls it, since nothing is
// allocated.
void operator delete(void* /*pointer*/) noexcept { abort(); }
void operator delete(void* /*pointer*/, std::size_t /*size*/) noexcept { abort(); }

namespace tumbler {
namespace {

constexpr std::uint32_t kPattern = 0xdeadbeefU;

using Handler = void (*)();

struct VectorTable {
  std::uint32_t* initial_stack;
  std::array<Handler, 15> handlers;  // Reset, NMI, and the system's exceptions up to SysTick.
};

[[gnu::section(".vectors"), gnu::used]] const VectorTable kVectors = {
    &stack_top,
    {ResetHandler, FaultHandler, FaultHandler, FaultHandler, FaultHandler, FaultHandler,
     FaultHandler, FaultHandler, FaultHandler, FaultHandler, FaultHandler, FaultHandler,
     FaultHandler, FaultHandler, FaultHandler}};

}  // namespace

[[gnu::noinline]] std::uint32_t RepaintStack() noexcept {
  constexpr std::uintptr_t kOwnFrame = 64;  // more than this function can need [bytes]
  const std::uintptr_t here = reinterpret_cast<std::uintptr_t>(__builtin_frame_address(0));
  const auto* const end = reinterpret_cast<std::uint32_t*>(here - kOwnFrame);
  for (volatile std::uint32_t* p = &stack_bottom; p < end; ++p) *p = kPattern;
  return static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(&stack_top) - here);
}

std::uint32_t StackSize() noexcept {
  return static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(&stack_top) -
                                    reinterpret_cast<std::uintptr_t>(&stack_bottom));
}

std::uint32_t StackUsed() noexcept {
  const volatile std::uint32_t* p = &stack_bottom;
  while (p < &stack_top && *p == kPattern) ++p;
  return static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(&stack_top) -
                                    reinterpret_cast<std::uintptr_t>(p));
}

}  // namespace tumbler
