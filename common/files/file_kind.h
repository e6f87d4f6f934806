#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace tumbler {

/// The first bytes of a flight record (docs/formats.md), and of every event of an LCM log.
inline constexpr std::array<std::uint8_t, 8> kFlightRecordBegin = {'T', 'U', 'M', 'B',
                                                                   'L', 'R', 'E', 'C'};
inline constexpr std::array<std::uint8_t, 4> kLcmEventBegin = {0xED, 0xA1, 0xDA, 0x01};

/// What a file of a run is by its first bytes, with the programs that take it, such as `an LCM log,
/// which tumbler record takes`. For messages of readers that expect something else.
/// @returns nothing for other files, such as texts.
std::string_view KindOfRunFile(std::string_view bytes);

}  // namespace tumbler
