#pragma once

#include <string>

namespace tumbler {

/// The page of offline/report/page with style and scripts in it; `{{title}}` and `{{data}}` are
/// still to be filled in.
std::string ReportPage();

}  // namespace tumbler
