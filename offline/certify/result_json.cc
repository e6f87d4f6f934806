#include "offline/certify/result_json.h"

#include <array>
#include <cstddef>
#include <string_view>
#include <utility>
#include <variant>

#include "common/files/json.h"
#include "offline/certify/certificate_text.h"

namespace tumbler {
namespace {

Json FiguresOf(const KktResidual& kkt) {
  auto multipliers = Json::Array();
  for (const Multiplier& multiplier : kkt.multipliers)
    multipliers.Append({{"of", multiplier.name}, {"value", multiplier.value}});
  Json figures = {{"absolute", kkt.absolute}, {"multipliers", multipliers}};
  if (kkt.relative) figures["relative"] = *kkt.relative;
  return figures;
}

Json FiguresOfMinima(const TaskResult& result) {
  auto minima = Json::Array();
  for (std::size_t i = 0; i < result.minima.size(); ++i) {
    const LocalMinimum& minimum = result.minima[i];
    const Solution& solution = result.outcome.solutions[minimum.solution];
    const MotionSummary& summary = result.minima_summaries[i];
    minima.Append({{"objective", solution.rollout.cost},
                   {"feasible", solution.feasible()},
                   {"objections", result.minima_objections[i]},
                   {"constraint_violation", solution.constraint_violation},
                   {"final_pitch_rad", summary.final_pitch_rad},
                   {"settled_pitch_rad", summary.settled_pitch_rad},
                   {"peak_torque_nm", summary.peak_torque_nm},
                   {"kkt", FiguresOf(solution.kkt)},
                   {"evaluations", solution.evaluations},
                   {"end", ToString(solution.end)},
                   {"starts", minimum.starts}});
  }
  return minima;
}

Json FiguresOf(const SecondLook& look) {
  auto purpose = Json::Array();
  for (const PurposeFigure& figure : look.purpose) {
    purpose.Append({{"of", figure.name()},
                    {"unit", figure.unit()},
                    {"target", figure.target},
                    {"result", figure.result},
                    {"tolerance", figure.tolerance},
                    {"met", figure.met()}});
  }
  Json figures = {{"step_s", look.step_s},
                  {"peak_torque_nm", look.peak_torque_nm},
                  {"torque_excess", look.torque_excess},
                  {"held_torque_excess", look.held_torque_excess},
                  {"peak_penetration_m", look.peak_penetration_m},
                  {"purpose", purpose}};
  if (!look.self_clearance_of.empty()) {
    figures["self_clearance_m"] = look.self_clearance_m;
    figures["self_clearance_time_s"] = look.self_clearance_time_s;
    figures["self_clearance_of"] = look.self_clearance_of;
    figures["clearance_m"] = look.clearance_m;
  }
  if (look.slip_m) {
    figures["slip_m"] = *look.slip_m;
    figures["slip_of"] = look.slip_of;
  }
  if (look.drives) {
    figures["drives"] = {{"kp_nm_per_rad", look.drives->kp_nm_per_rad},
                         {"kd_nm_s_per_rad", look.drives->kd_nm_s_per_rad}};
  }
  return figures;
}

/// The figures of a task that has a motion.
Json Figures(const TaskResult& result) {
  const Solution& best = result.best;
  const MotionSummary& summary = result.summary;
  Json json = {{"name", result.problem().name},
               {"seed", result.problem().search.seed},
               {"objective", best.rollout.cost},
               {"evaluations", result.outcome.evaluations},
               {"wall_s", result.wall_s},
               {"cpu_s", result.cpu_s},
               {"look_cpu_s", result.look_cpu_s},
               {"end", ToString(best.end)},
               {"settled_speed", summary.settled_speed}};
  if (!result.problem().space) {  // There, no angle alone says how a root is turned.
    json["final_pitch_rad"] = summary.final_pitch_rad;
    json["settled_pitch_rad"] = summary.settled_pitch_rad;
  }
  if (result.problem().free_duration) json["duration_s"] = result.problem().duration_s;
  constexpr std::array kStartRates = {"start_x_m_s", "start_z_m_s", "start_pitch_rad_s"};
  for (const std::size_t i : result.problem().free_start_coordinates())
    json[kStartRates[i]] = result.problem().start_root_rates[i];
  if (const auto error = result.settled_error_rad()) json["settled_error_rad"] = *error;
  for (const CertificateFigure& figure : FiguresOf(result.file->certificate)) {
    const std::string_view key = figure.key;
    if (key == "settled_pitch_error_rad") continue;  // settled_error_rad has its magnitude.
    std::visit([&](const auto& value) { json[figure.key] = value; }, figure.value);
  }
  json["kkt"] = FiguresOf(best.kkt);
  json["content_hash"] = ContentHash(*result.file);
  json["second_look"] = FiguresOf(result.look);
  if (best.robots) {
    json["robots"] = {
        {"of", best.robots->of}, {"carried", best.robots->carried}, {"scale", best.robots->scale}};
  }
  if (!result.minima.empty()) json["minima"] = FiguresOfMinima(result);
  return json;
}

/// The figures of a task that is ranked.
Json RankedFigures(const TaskResult& result) {
  Json entry = {{"task", result.task.task_file}, {"found", result.file.has_value()}};
  if (result.file) {
    entry.Merge(Figures(result));
    return entry;
  }
  entry.Merge({{"name", result.problem().name},
               {"cause", result.usable ? "interrupted" : result.cause},
               {"evaluations", result.outcome.evaluations},
               {"wall_s", result.wall_s},
               {"cpu_s", result.cpu_s},
               {"look_cpu_s", result.look_cpu_s}});
  if (!result.minima.empty()) entry["minima"] = FiguresOfMinima(result);
  return entry;
}

}  // namespace

std::string ToJson(const TaskResult& result) { return Figures(result).Dump(2) + "\n"; }

std::string ToJson(const std::vector<const TaskResult*>& order) {
  auto ranking = Json::Array();
  for (const TaskResult* result : order) ranking.Append(RankedFigures(*result));
  return Json{{"ranking", ranking}}.Dump(2) + "\n";
}

}  // namespace tumbler
