#pragma once

#include <string>
#include <string_view>

namespace tumbler {

/// The beginning of a page without scripts, up to its body: colours by day and by night, sizes for
/// a narrow window and for paper.
/// @param title   as text.
/// @param by_day, by_night  further colours: `--stands: #2a7fb8; ...`.
/// @param style   further rules.
std::string PlainPageHead(std::string_view title, std::string_view by_day,
                          std::string_view by_night, std::string_view style);

}  // namespace tumbler
