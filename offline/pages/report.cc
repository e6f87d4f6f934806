#include "offline/pages/report.h"

#include <fmt/format.h>

#include "offline/pages/page_file.h"
#include "offline/pages/report_checks.h"
#include "offline/pages/report_page.h"

namespace tumbler {
namespace {

void CheckPeak(const ReportData& data) {
  if (!data.peak_torque) return;
  const ReportPeak& peak = *data.peak_torque;
  CheckFinite(peak.time_s, "peak_torque.time_s");
  CheckFinite(peak.torque_nm, "peak_torque.torque_nm");
  if (peak.joint < 0 || static_cast<std::size_t>(peak.joint) >= data.joint_names.size()) {
    RefuseField("peak_torque.joint", fmt::format("is {}, must be the index of a joint, of which "
                                                 "there are {}",
                                                 peak.joint, data.joint_names.size()));
  }
}

void CheckTable(const ReportTable& table, const std::string& name) {
  for (std::size_t k = 0; k < table.rows.size(); ++k) {
    if (table.rows[k].size() == table.columns.size()) continue;
    RefuseField(
        fmt::format("{}.rows[{}]", name, k),
        fmt::format("has {} texts, must have {}", table.rows[k].size(), table.columns.size()));
  }
}

void Check(const ReportData& data) {
  CheckFinite(data.duration_s, "duration_s");
  CheckFinite(data.settle_s, "settle_s");
  CheckScene(data);
  if (data.samples.size() < 2) {
    RefuseField("samples",
                fmt::format("has {} entries, must have at least 2", data.samples.size()));
  }
  for (std::size_t i = 0; i < data.samples.size(); ++i) CheckSample(data, data.samples, i);
  for (std::size_t k = 0; k < data.evaluations.size(); ++k) {
    CheckFinite(data.evaluations[k].cost, fmt::format("evaluations[{}].cost", k));
    CheckFinite(data.evaluations[k].violation, fmt::format("evaluations[{}].violation", k));
  }
  CheckPeak(data);
  CheckTable(data.minima, "minima");
  CheckTable(data.window, "window");
}

/// A column of JSON: one number of every sample.
template <typename Read>
Json Column(const ReportData& data, Read read) {
  Json column = Json::Array();
  for (const ReportSample& sample : data.samples) column.Append(read(sample));
  return column;
}

Json ForcesToJson(const ReportSample& sample) {
  Json forces = Json::Array();
  for (const ReportSample::Force& force : sample.forces) {
    forces.Append({{"x", force.x_m},
                   {"z", force.z_m},
                   {"fx", force.fx_n},
                   {"fz", force.fz_n},
                   {"nx", force.normal_x},
                   {"nz", force.normal_z}});
  }
  return forces;
}

Json TextsToJson(const std::vector<std::string>& texts) {
  Json array = Json::Array();
  for (const std::string& text : texts) array.Append(text);
  return array;
}

Json TableToJson(const ReportTable& table) {
  Json json = {{"columns", TextsToJson(table.columns)}, {"rows", Json::Array()}};
  for (const std::vector<std::string>& row : table.rows) json["rows"].Append(TextsToJson(row));
  return json;
}

Json ToJson(const ReportData& data) {
  Json json = {{"title", data.title},
               {"subtitle", data.subtitle},
               {"duration_s", data.duration_s},
               {"settle_s", data.settle_s},
               {"evaluation_count", data.evaluation_count}};
  json["times_s"] = Column(data, [](const auto& s) { return s.time_s; });
  json["root_pitch_rad"] = Column(data, [](const auto& s) { return s.root_pitch_rad; });
  json.Merge(SceneToJson(data));
  for (std::size_t k = 0; k < data.links.size(); ++k) {
    json["links"][k].Merge(LinkPath(data.samples, k));
  }
  for (std::size_t k = 0; k < data.joint_names.size(); ++k) {
    Json& joint = json["joints"][k];
    joint["position_rad"] = Column(data, [k](const auto& s) { return s.joint_positions_rad[k]; });
    joint["velocity_rad_s"] =
        Column(data, [k](const auto& s) { return s.joint_velocities_rad_s[k]; });
    joint["torque_nm"] = Column(data, [k](const auto& s) { return s.joint_torques_nm[k]; });
  }
  json["forces"] = Column(data, ForcesToJson);
  json["evaluations"] = Json::Array();
  for (const ReportEvaluation& evaluation : data.evaluations) {
    json["evaluations"].Append({{"evaluation", evaluation.evaluation},
                                {"cost", evaluation.cost},
                                {"violation", evaluation.violation},
                                {"global", evaluation.global}});
  }
  if (data.peak_torque) {
    json["peak_torque"] = {{"joint", data.peak_torque->joint},
                           {"time_s", data.peak_torque->time_s},
                           {"torque_nm", data.peak_torque->torque_nm}};
  }
  json["minima"] = TableToJson(data.minima);
  json["window"] = TableToJson(data.window);
  json["window_note"] = data.window_note;
  json["certificate"] = Json::Array();
  for (const auto& [name, value] : data.certificate) {
    json["certificate"].Append(Json::Array({name, value}));
  }
  return json;
}

}  // namespace

std::string WriteReport(const ReportData& data, const std::string& directory) {
  Check(data);
  return WritePage(FillPage(ReportPage(), data.title + " - motion report", ToJson(data)),
                   directory);
}

}  // namespace tumbler
