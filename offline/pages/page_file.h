#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/files/json.h"
#include "offline/pages/report.h"

namespace tumbler {

/// A page with texts filled in, each at `{{NAME}}`. What was filled in is not looked through again,
/// so that texts may have such places in them.
std::string FillPlaces(std::string_view page,
                       const std::vector<std::pair<std::string_view, std::string>>& texts);

/// JSON as text that may stand in an element `script`. Numbers that are not finite become null.
std::string ScriptText(const Json& json);

/// A page with its title and data filled in at `{{title}}` and `{{data}}`; both may be any text.
/// Numbers that are not finite become null.
std::string FillPage(const std::string& page, std::string_view title, const Json& data);

/// Where a page goes: to `out` where that ends in `.html`, else to `index.html` in the folder
/// `out`.
std::string PagePath(const std::string& out);

/// The folder of PagePath(out).
std::string PageFolder(const std::string& out);

/// Writes a page to PagePath(out), as a PendingFile. @returns the page's path.
/// @throws FileError  when it cannot be written.
std::string WritePage(const std::string& page, const std::string& out);

/// The robot and its surroundings as the page's scripts draw them: `links` (name, shapes), `joints`
/// (name, link, limits), `obstacles` (name, corners, r), and `ground_z` where ground is level.
/// @throws std::invalid_argument naming the field as WriteReport does.
Json SceneToJson(const ReportData& data);

/// The poses of link number `link` in all samples: columns `x_m`, `z_m`, `pitch_rad`.
Json LinkPath(const std::vector<ReportSample>& samples, std::size_t link);

}  // namespace tumbler
