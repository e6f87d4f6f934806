#include "runtime/embedded/semihosting.h"

#include <array>
#include <cstring>

namespace tumbler::semihosting {
namespace {

enum Operation : std::uint32_t {
  kOpen = 0x01,
  kClose = 0x02,
  kWrite0 = 0x04,
  kWrite = 0x05,
  kRead = 0x06,
  kCommandLine = 0x15,
  kExit = 0x18,
};

std::uint32_t Call(Operation operation, std::uintptr_t argument) noexcept {
  register std::uint32_t r0 asm("r0") = operation;
  register std::uintptr_t r1 asm("r1") = argument;
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

template <std::size_t kCount>
std::uint32_t Call(Operation operation, const std::array<std::uintptr_t, kCount>& block) noexcept {
  return Call(operation, reinterpret_cast<std::uintptr_t>(block.data()));
}

int Open(const char* path, std::uintptr_t mode) noexcept {
  const std::array<std::uintptr_t, 3> block{reinterpret_cast<std::uintptr_t>(path), mode,
                                            std::strlen(path)};
  return static_cast<int>(Call(kOpen, block));
}

}  // namespace

int OpenForReading(const char* path) noexcept { return Open(path, 1); }  // "rb"
int OpenForWriting(const char* path) noexcept { return Open(path, 5); }  // "wb"

std::size_t Read(int handle, std::span<std::uint8_t> bytes) noexcept {
  const std::array<std::uintptr_t, 3> block{static_cast<std::uintptr_t>(handle),
                                            reinterpret_cast<std::uintptr_t>(bytes.data()),
                                            bytes.size()};
  return bytes.size() - Call(kRead, block);
}

bool Write(int handle, std::span<const std::uint8_t> bytes) noexcept {
  const std::array<std::uintptr_t, 3> block{static_cast<std::uintptr_t>(handle),
                                            reinterpret_cast<std::uintptr_t>(bytes.data()),
                                            bytes.size()};
  return Call(kWrite, block) == 0;
}

void Close(int handle) noexcept {
  const std::array<std::uintptr_t, 1> block{static_cast<std::uintptr_t>(handle)};
  Call(kClose, block);
}

void Print(const char* text) noexcept { Call(kWrite0, reinterpret_cast<std::uintptr_t>(text)); }

void Print(std::uint32_t number) noexcept {
  std::array<char, 11> text{};
  std::size_t first = text.size() - 1;
  do {
    text[--first] = static_cast<char>('0' + number % 10);
    number /= 10;
  } while (number != 0);
  Print(text.data() + first);
}

bool CommandLine(std::span<char> text) noexcept {
  const std::array<std::uintptr_t, 2> block{reinterpret_cast<std::uintptr_t>(text.data()),
                                            text.size()};
  return Call(kCommandLine, block) == 0;
}

void Exit(bool success) noexcept {
  constexpr std::uintptr_t kApplicationExit = 0x20026;
  constexpr std::uintptr_t kRunTimeError = 0x20023;
  Call(kExit, success ? kApplicationExit : kRunTimeError);
  while (true) {
  }
}

}  // namespace tumbler::semihosting
