#pragma once

#include <string>

namespace tumbler {

/// Pages of offline/pages/page with style and scripts in them. `{{title}}` and `{{data}}` are
/// still to be filled in, and of the page of a motion in space what it shows without scripts.
std::string ReportPage();        ///< The page of a motion: page.html.
std::string SpaceReportPage();   ///< The page of a motion in space: space_page.html.
std::string FlightReportPage();  ///< The page of runs: run_page.html.
std::string ViewPage();          ///< The page of a run while it happens, or played: view_page.html.

}  // namespace tumbler
