#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace tumbler::semihosting {

/// Files, console and exit status of a debugger or emulator that listens (Arm, Semihosting for
/// AArch32 and AArch64, 2.0). When nobody listens, the first call stops the processor with a fault.

/// @returns a handle, or -1.
int OpenForReading(const char* path) noexcept;
int OpenForWriting(const char* path) noexcept;
/// @returns the number of bytes that were read: fewer than asked for at the end of the file.
std::size_t Read(int handle, std::span<std::uint8_t> bytes) noexcept;
/// @returns whether all bytes were written.
bool Write(int handle, std::span<const std::uint8_t> bytes) noexcept;
void Close(int handle) noexcept;

/// Writes to the console.
void Print(const char* text) noexcept;
void Print(std::uint32_t number) noexcept;

/// Gets the program's arguments, separated by blanks, with a zero at the end. @returns whether
/// there are any.
bool CommandLine(std::span<char> text) noexcept;

/// Ends the emulation with status 0, or 1.
[[noreturn]] void Exit(bool success) noexcept;

}  // namespace tumbler::semihosting
