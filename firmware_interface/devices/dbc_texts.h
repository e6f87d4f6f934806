#pragma once

#include <string_view>

namespace tumbler {

/// The text of a file in firmware_interface/devices/dbc/, such as `mit_mini_cheetah.dbc`; empty:
/// there is none of that name.
std::string_view DbcText(std::string_view file);

}  // namespace tumbler
