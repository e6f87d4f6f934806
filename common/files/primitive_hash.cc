#include "common/files/primitive_hash.h"

#include <fmt/format.h>

#include <cstdint>

namespace tumbler {

std::string HashOfText(std::string_view text) {
  std::uint64_t state = 0xcbf29ce484222325ULL;
  for (const char byte : text)
    state = (state ^ static_cast<unsigned char>(byte)) * 0x100000001b3ULL;
  return fmt::format("fnv1a64:{:016x}", state);
}

}  // namespace tumbler
