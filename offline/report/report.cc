#include "offline/report/report.h"

#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "offline/report/report_page.h"

namespace tumbler {
namespace {

using Json = nlohmann::ordered_json;

[[noreturn]] void Refuse(const std::string& field, const std::string& problem) {
  throw std::invalid_argument(fmt::format("report: {}: {}", field, problem));
}

void CheckFinite(double value, const std::string& field) {
  if (!std::isfinite(value)) Refuse(field, fmt::format("is {}, must be finite", value));
}

void CheckSize(std::size_t size, std::size_t expected, const std::string& field,
               std::string_view what) {
  if (size != expected) {
    Refuse(field,
           fmt::format("has {} entries, must have {}: one for each {}", size, expected, what));
  }
}

void CheckUnit(double x, double z, const std::string& field) {
  CheckFinite(x, field + ".normal_x");
  CheckFinite(z, field + ".normal_z");
  const double length = std::hypot(x, z);
  if (std::abs(length - 1) > 1e-6) {
    Refuse(field + ".normal", fmt::format("has length {}, must have length 1", length));
  }
}

void CheckSample(const ReportData& data, std::size_t index) {
  const ReportSample& sample = data.samples[index];
  const std::string name = fmt::format("samples[{}]", index);
  CheckFinite(sample.time_s, name + ".time_s");
  if (index > 0 && sample.time_s <= data.samples[index - 1].time_s) {
    Refuse(name + ".time_s", fmt::format("is {}, must be later than the {} before it",
                                         sample.time_s, data.samples[index - 1].time_s));
  }
  CheckFinite(sample.root_pitch_rad, name + ".root_pitch_rad");
  CheckSize(sample.link_poses.size(), data.links.size(), name + ".link_poses", "link");
  for (std::size_t k = 0; k < sample.link_poses.size(); ++k) {
    for (std::size_t c = 0; c < 3; ++c) {
      CheckFinite(sample.link_poses[k][c], fmt::format("{}.link_poses[{}][{}]", name, k, c));
    }
  }
  const auto check_joints = [&](const std::vector<double>& values, std::string_view field) {
    CheckSize(values.size(), data.joint_names.size(), fmt::format("{}.{}", name, field), "joint");
    for (std::size_t k = 0; k < values.size(); ++k) {
      CheckFinite(values[k], fmt::format("{}.{}[{}]", name, field, k));
    }
  };
  check_joints(sample.joint_positions_rad, "joint_positions_rad");
  check_joints(sample.joint_velocities_rad_s, "joint_velocities_rad_s");
  check_joints(sample.joint_torques_nm, "joint_torques_nm");
  for (std::size_t k = 0; k < sample.forces.size(); ++k) {
    const ReportSample::Force& force = sample.forces[k];
    const std::string of = fmt::format("{}.forces[{}]", name, k);
    CheckFinite(force.x_m, of + ".x_m");
    CheckFinite(force.z_m, of + ".z_m");
    CheckFinite(force.fx_n, of + ".fx_n");
    CheckFinite(force.fz_n, of + ".fz_n");
    CheckUnit(force.normal_x, force.normal_z, of);
  }
}

void CheckRobot(const ReportData& data) {
  if (data.links.empty()) Refuse("links", "is empty, must have at least the root");
  for (std::size_t k = 0; k < data.links.size(); ++k) {
    for (std::size_t s = 0; s < data.links[k].shapes.size(); ++s) {
      const ReportShape& shape = data.links[k].shapes[s];
      const std::string of = fmt::format("links[{}].shapes[{}]", k, s);
      CheckFinite(shape.x1_m, of + ".x1_m");
      CheckFinite(shape.z1_m, of + ".z1_m");
      CheckFinite(shape.x2_m, of + ".x2_m");
      CheckFinite(shape.z2_m, of + ".z2_m");
      CheckFinite(shape.radius_m, of + ".radius_m");
      if (shape.radius_m < 0) {
        Refuse(of + ".radius_m", fmt::format("is {}, must be at least 0", shape.radius_m));
      }
    }
  }
  const std::size_t joints = data.joint_names.size();
  if (data.joint_links.empty()) {
    if (joints >= data.links.size()) {
      Refuse("joint_links", fmt::format("is empty, and {} joints cannot move links 1 to {} of {}",
                                        joints, joints, data.links.size()));
    }
  } else {
    CheckSize(data.joint_links.size(), joints, "joint_links", "joint");
    for (std::size_t k = 0; k < joints; ++k) {
      const int link = data.joint_links[k];
      if (link < 0 || link >= static_cast<int>(data.links.size())) {
        Refuse(fmt::format("joint_links[{}]", k),
               fmt::format("is {}, must be from 0 to {}", link, data.links.size() - 1));
      }
    }
  }
  if (!data.torque_limits_nm.empty()) {
    CheckSize(data.torque_limits_nm.size(), joints, "torque_limits_nm", "joint");
  }
  if (!data.position_limits_rad.empty()) {
    CheckSize(data.position_limits_rad.size(), joints, "position_limits_rad", "joint");
  }
  for (std::size_t k = 0; k < data.torque_limits_nm.size(); ++k) {
    CheckFinite(data.torque_limits_nm[k], fmt::format("torque_limits_nm[{}]", k));
  }
  for (std::size_t k = 0; k < data.position_limits_rad.size(); ++k) {
    CheckFinite(data.position_limits_rad[k][0], fmt::format("position_limits_rad[{}][0]", k));
    CheckFinite(data.position_limits_rad[k][1], fmt::format("position_limits_rad[{}][1]", k));
  }
}

void Check(const ReportData& data) {
  CheckFinite(data.duration_s, "duration_s");
  CheckRobot(data);
  for (std::size_t k = 0; k < data.obstacles.size(); ++k) {
    const ReportObstacle& obstacle = data.obstacles[k];
    const std::string name = fmt::format("obstacles[{}]", k);
    CheckFinite(obstacle.x_m, name + ".x_m");
    CheckFinite(obstacle.z_m, name + ".z_m");
    CheckFinite(obstacle.radius_m, name + ".radius_m");
    CheckFinite(obstacle.half_x_m, name + ".half_x_m");
    CheckFinite(obstacle.half_z_m, name + ".half_z_m");
    if (obstacle.kind != ReportObstacle::Kind::kCircle) {
      CheckUnit(obstacle.normal_x, obstacle.normal_z, name);
    } else if (obstacle.radius_m <= 0) {
      Refuse(name + ".radius_m", fmt::format("is {}, must be above 0", obstacle.radius_m));
    }
  }
  if (data.samples.size() < 2) {
    Refuse("samples", fmt::format("has {} entries, must have at least 2", data.samples.size()));
  }
  for (std::size_t i = 0; i < data.samples.size(); ++i) CheckSample(data, i);
  for (std::size_t k = 0; k < data.evaluations.size(); ++k) {
    CheckFinite(data.evaluations[k].cost, fmt::format("evaluations[{}].cost", k));
    CheckFinite(data.evaluations[k].violation, fmt::format("evaluations[{}].violation", k));
  }
}

/// One number of every sample, as a column.
template <typename Read>
Json Column(const ReportData& data, Read read) {
  Json column = Json::array();
  for (const ReportSample& sample : data.samples) column.push_back(read(sample));
  return column;
}

Json LinkToJson(const ReportData& data, std::size_t k) {
  Json shapes = Json::array();
  for (const ReportShape& shape : data.links[k].shapes) {
    shapes.push_back({{"x1", shape.x1_m},
                      {"z1", shape.z1_m},
                      {"x2", shape.x2_m},
                      {"z2", shape.z2_m},
                      {"r", shape.radius_m},
                      {"collides", shape.collides}});
  }
  const auto coordinate = [&](std::size_t c) {
    return Column(data, [k, c](const ReportSample& sample) { return sample.link_poses[k][c]; });
  };
  return {{"name", data.links[k].name},
          {"shapes", shapes},
          {"x_m", coordinate(0)},
          {"z_m", coordinate(1)},
          {"pitch_rad", coordinate(2)}};
}

Json JointToJson(const ReportData& data, std::size_t k) {
  Json joint = {{"name", data.joint_names[k]},
                {"link", data.joint_links.empty() ? static_cast<int>(k) + 1 : data.joint_links[k]},
                {"torque_limit_nm", nullptr},
                {"position_limits_rad", nullptr}};
  if (!data.torque_limits_nm.empty()) joint["torque_limit_nm"] = data.torque_limits_nm[k];
  if (!data.position_limits_rad.empty()) joint["position_limits_rad"] = data.position_limits_rad[k];
  joint["position_rad"] = Column(data, [k](const auto& s) { return s.joint_positions_rad[k]; });
  joint["velocity_rad_s"] =
      Column(data, [k](const auto& s) { return s.joint_velocities_rad_s[k]; });
  joint["torque_nm"] = Column(data, [k](const auto& s) { return s.joint_torques_nm[k]; });
  return joint;
}

Json ForcesToJson(const ReportSample& sample) {
  Json forces = Json::array();
  for (const ReportSample::Force& force : sample.forces) {
    forces.push_back({{"x", force.x_m},
                      {"z", force.z_m},
                      {"fx", force.fx_n},
                      {"fz", force.fz_n},
                      {"nx", force.normal_x},
                      {"nz", force.normal_z}});
  }
  return forces;
}

Json ToJson(const ReportData& data) {
  Json json = {{"title", data.title}, {"subtitle", data.subtitle}, {"duration_s", data.duration_s}};
  json["times_s"] = Column(data, [](const auto& s) { return s.time_s; });
  json["root_pitch_rad"] = Column(data, [](const auto& s) { return s.root_pitch_rad; });
  json["links"] = Json::array();
  for (std::size_t k = 0; k < data.links.size(); ++k) json["links"].push_back(LinkToJson(data, k));
  json["joints"] = Json::array();
  for (std::size_t k = 0; k < data.joint_names.size(); ++k) {
    json["joints"].push_back(JointToJson(data, k));
  }
  json["forces"] = Column(data, ForcesToJson);
  json["obstacles"] = Json::array();
  for (const ReportObstacle& obstacle : data.obstacles) {
    const bool circle = obstacle.kind == ReportObstacle::Kind::kCircle;
    const bool box = obstacle.kind == ReportObstacle::Kind::kBox;
    json["obstacles"].push_back({{"name", obstacle.name},
                                 {"kind", circle ? "circle"
                                          : box  ? "box"
                                                 : "half-space"},
                                 {"x", obstacle.x_m},
                                 {"z", obstacle.z_m},
                                 {"nx", obstacle.normal_x},
                                 {"nz", obstacle.normal_z},
                                 {"hx", obstacle.half_x_m},
                                 {"hz", obstacle.half_z_m},
                                 {"r", obstacle.radius_m}});
  }
  json["evaluations"] = Json::array();
  for (const ReportEvaluation& evaluation : data.evaluations) {
    json["evaluations"].push_back({{"evaluation", evaluation.evaluation},
                                   {"cost", evaluation.cost},
                                   {"violation", evaluation.violation},
                                   {"global", evaluation.global}});
  }
  json["certificate"] = Json::array();
  for (const auto& [name, value] : data.certificate) {
    json["certificate"].push_back(Json::array({name, value}));
  }
  return json;
}

/// JSON that may stand in a script element: an HTML parser looks for `</script` and `<!--` even
/// inside strings.
std::string ScriptText(const Json& json) {
  const std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
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

std::string HtmlText(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      default:
        safe += c;
    }
  }
  return safe;
}

std::string FillIn(const std::string& page, std::string_view title, std::string_view data) {
  constexpr std::string_view kTitle = "{{title}}";
  constexpr std::string_view kData = "{{data}}";
  const std::size_t title_at = page.find(kTitle);
  const std::size_t data_at = page.find(kData);
  std::string filled = page.substr(0, title_at);
  filled += title;
  filled += page.substr(title_at + kTitle.size(), data_at - title_at - kTitle.size());
  filled += data;
  filled += page.substr(data_at + kData.size());
  return filled;
}

}  // namespace

std::string WriteReport(const ReportData& data, const std::string& directory) {
  Check(data);
  const std::string page =
      FillIn(ReportPage(), HtmlText(data.title + " - motion report"), ScriptText(ToJson(data)));

  const std::filesystem::path path = std::filesystem::path(directory) / "index.html";
  const auto fail = [&path](const std::string& reason) {
    throw std::runtime_error(fmt::format("cannot write {}: {}", path.string(), reason));
  };
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) fail(error.message());
  const std::filesystem::path partial = path.string() + ".partial";
  {
    std::ofstream file(partial, std::ios::binary);
    file << page << std::flush;
    if (!file) {
      const std::string reason = std::generic_category().message(errno);
      std::filesystem::remove(partial, error);
      fail(reason);
    }
  }
  std::filesystem::rename(partial, path, error);
  if (error) {
    const std::string reason = error.message();
    std::filesystem::remove(partial, error);
    fail(reason);
  }
  return path.string();
}

}  // namespace tumbler
