#pragma once

#include <string>
#include <string_view>

namespace tumbler {

/// A text for HTML, SVG and XML, also within an attribute: `&`, `<`, `>` and `"` are written as
/// entities.
std::string MarkupText(std::string_view text);

}  // namespace tumbler
