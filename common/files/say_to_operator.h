#pragma once

#include <cstdio>
#include <string>

namespace tumbler {

/// Writes a line to standard error. What cannot be written there, because nobody reads it any more
/// or the disk is full, is lost: it never ends a program, as fmt::print would, which throws. For
/// whatever is said while motors may have torque.
inline void SayToOperator(const std::string& line) noexcept {
  std::fputs(line.c_str(), stderr);
  std::fputc('\n', stderr);
}

}  // namespace tumbler
