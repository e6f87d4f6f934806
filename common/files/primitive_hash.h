#pragma once

#include <string>
#include <string_view>

namespace tumbler {

/// FNV-1a (64 bit) of a text as `fnv1a64:` and 16 hexadecimal digits. It finds accidents, not
/// forgeries.
std::string HashOfText(std::string_view text);

}  // namespace tumbler
