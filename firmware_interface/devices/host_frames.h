#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace tumbler {

/// A kind of frame that only a host sends to drives of a protocol. Heard from somebody else, it is
/// a foreign command (`Drive::IsCommand`).
///
/// Each protocol has one table of them, with everything that its drives obey: the few that the
/// runtime sends, and those of other hosts and of vendors' tools. `IsCommand`, the filter of the
/// socket and the protocol's page in docs/ follow from the table.
struct HostFrame {
  /// The identifier where the drive's number is zero, or that of all drives.
  std::uint32_t id = 0;
  std::string_view name;
  bool to_all = false;    ///< Whether all drives have this identifier in common.
  bool extended = false;  ///< Whether the identifier has 29 bits.
};

/// The kinds of frames to one drive as bits: bit i says that the table has the identifier
/// i << shift. For a look at a frame without a search.
constexpr std::uint32_t KindBits(std::span<const HostFrame> frames, int shift,
                                 bool extended = false) noexcept {
  std::uint32_t bits = 0;
  for (const HostFrame& frame : frames) {
    if (!frame.to_all && frame.extended == extended) bits |= 1U << (frame.id >> shift);
  }
  return bits;
}
/// Whether a kind is among these bits.
constexpr bool IsKind(std::uint32_t bits, std::uint32_t kind) noexcept {
  return kind < 32 && (bits >> kind & 1U) != 0;
}

}  // namespace tumbler
