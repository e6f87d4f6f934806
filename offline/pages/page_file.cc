#include "offline/pages/page_file.h"

#include <algorithm>
#include <filesystem>

#include "common/files/markup.h"
#include "common/files/result_file.h"
#include "common/files/toml_reader.h"
#include "offline/pages/report_checks.h"

namespace tumbler {
// An HTML parser looks for `</script` and `<!--` even inside strings, so every `<` is escaped.
std::string ScriptText(const Json& json) {
  const std::string text = json.Dump(-1);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe += c;
    }
  }
  return safe;
}

std::string FillPlaces(std::string_view page,
                       const std::vector<std::pair<std::string_view, std::string>>& texts) {
  std::string filled;
  for (std::size_t open = page.find("{{"); open != std::string_view::npos; open = page.find("{{")) {
    filled += page.substr(0, open);
    page.remove_prefix(open);
    const auto named = std::ranges::find_if(texts, [page](const auto& text) {
      return page.substr(2).starts_with(text.first) &&
             page.substr(2 + text.first.size()).starts_with("}}");
    });
    const bool found = named != texts.end();
    filled += found ? std::string_view(named->second) : page.substr(0, 2);
    page.remove_prefix(found ? named->first.size() + 4 : 2);
  }
  return filled.append(page);
}

Json SceneToJson(const ReportData& data) {
  CheckScene(data);
  Json json = {{"links", Json::Array()}, {"joints", Json::Array()}, {"obstacles", Json::Array()}};
  for (const ReportLink& link : data.links) {
    Json shapes = Json::Array();
    for (const ReportShape& shape : link.shapes) {
      shapes.Append(
          {{"corners", shape.corners_m}, {"r", shape.radius_m}, {"collides", shape.collides}});
    }
    json["links"].Append({{"name", link.name}, {"shapes", shapes}});
  }
  for (std::size_t k = 0; k < data.joint_names.size(); ++k) {
    Json joint = {
        {"name", data.joint_names[k]},
        {"link", data.joint_links.empty() ? static_cast<int>(k) + 1 : data.joint_links[k]},
        {"torque_limit_nm", nullptr},
        {"position_limits_rad", nullptr}};
    if (!data.torque_limits_nm.empty()) joint["torque_limit_nm"] = data.torque_limits_nm[k];
    if (!data.position_limits_rad.empty()) {
      joint["position_limits_rad"] = data.position_limits_rad[k];
    }
    json["joints"].Append(joint);
  }
  for (const ReportObstacle& obstacle : data.obstacles) {
    json["obstacles"].Append(
        {{"name", obstacle.name}, {"corners", obstacle.corners_m}, {"r", obstacle.radius_m}});
  }
  if (data.ground_z_m) json["ground_z"] = *data.ground_z_m;
  return json;
}

Json LinkPath(const std::vector<ReportSample>& samples, std::size_t link) {
  Json x = Json::Array(), z = Json::Array(), pitch = Json::Array();
  for (const ReportSample& sample : samples) {
    x.Append(sample.link_poses[link][0]);
    z.Append(sample.link_poses[link][1]);
    pitch.Append(sample.link_poses[link][2]);
  }
  return {{"x_m", x}, {"z_m", z}, {"pitch_rad", pitch}};
}

std::string FillPage(const std::string& page, std::string_view title, const Json& data) {
  return FillPlaces(page, {{"title", MarkupText(title)}, {"data", ScriptText(data)}});
}

std::string PagePath(const std::string& out) {
  if (out == "-")
    throw FileError(out, 0, "", "a page cannot be written to standard output; './-' is a folder");
  if (std::filesystem::path(out).extension() == ".html") return out;
  return (std::filesystem::path(out) / "index.html").string();
}

std::string PageFolder(const std::string& out) {
  const std::filesystem::path path = PagePath(out);
  return path.has_parent_path() ? path.parent_path().string() : ".";
}

std::string WritePage(const std::string& page, const std::string& out) {
  const std::string path = PagePath(out);
  PendingFile(path, page).Commit();
  return path;
}

}  // namespace tumbler
