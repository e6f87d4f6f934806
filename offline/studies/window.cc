#include "offline/studies/window.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <span>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "common/files/primitive_hash.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/sequence_toml.h"
#include "common/files/temporary_folder.h"
#include "common/files/toml_reader.h"
#include "offline/studies/checkpoint.h"
#include "offline/studies/lane_trials.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;

constexpr double kLeastFriction = 0.05, kMostFriction = 2;
/// Of the task's stiffness and damping, either way.
constexpr double kMostFactor = 20;

/// Values from one to the other, both included, in equal steps of their logarithms.
std::vector<double> Logarithmic(double from, double to, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i)
    values.push_back(from * portable::Power(to / from, double(i) / (count - 1)));
  values.front() = from;
  values.back() = to;
  return values;
}

/// Plays robots of one study, in lanes or in the twin, on several threads.
class ModelPlayer {
 public:
  ModelPlayer(const RobustnessStudy& study, int threads) : threads_(std::max(1, threads)) {
    const Trials twin(study);
    try {
      lanes_ = std::make_unique<LaneTrials>(study, FinestSteps());
    } catch (const Refused& error) {
      // The motion itself is none that is refused: the twin has it.
      not_in_lanes_ = error.what();
      of_thread_.assign(Index(threads_), twin);
    }
  }

  [[nodiscard]] const Trials& trials() const {
    return lanes_ ? lanes_->trials() : of_thread_.front();
  }
  [[nodiscard]] bool in_lanes() const { return lanes_ != nullptr; }
  [[nodiscard]] const std::string& not_in_lanes() const { return not_in_lanes_; }

  std::vector<TrialOutcome> Play(const std::vector<RobotVariation>& robots) {
    std::vector<TrialOutcome> outcomes(robots.size());
    const std::size_t each = lanes_ ? Packet::kLanes : 1;
    const int parts = static_cast<int>((robots.size() + each - 1) / each);
    ParallelFor(parts, threads_, [&](int part, int thread) {
      const std::size_t first = Index(part) * each;
      if (!lanes_) {
        outcomes[first] = of_thread_[Index(thread)].Play(robots[first]);
        return;
      }
      const std::size_t count = std::min(each, robots.size() - first);
      std::vector<TrialOutcome> played = lanes_->Play(std::span(robots).subspan(first, count));
      std::move(played.begin(), played.end(),
                outcomes.begin() + static_cast<std::ptrdiff_t>(first));
    });
    return outcomes;
  }

 private:
  static int FinestSteps() { return FinerStepsFor(kMostFactor, kMostFactor); }

  int threads_;
  std::string not_in_lanes_;
  std::unique_ptr<LaneTrials> lanes_;  // which threads share
  std::vector<Trials> of_thread_;
};

std::array<double, 2> ScannedOf(const GroundProperty& property, double model) {
  if (property.value != &ContactLaw::mu) return {model / kMostFactor, model * kMostFactor};
  return {std::min(kLeastFriction, model / 2), std::max(kMostFriction, model * 2)};
}

PropertyWindow FindWindow(const GroundProperty& property, const WindowScan& how,
                          ModelPlayer& player) {
  PropertyWindow window;
  window.property = property;
  window.model = player.trials().scene().contact.*property.value;
  window.scanned = ScannedOf(property, window.model);
  std::map<double, TrialOutcome> known;
  const Scan scan = ScanAround(window.model, window.scanned, how.steps, how.parts,
                               [&](const std::vector<double>& values) {
                                 std::vector<RobotVariation> robots;
                                 for (const double value : values) {
                                   robots.push_back(player.trials().Model());
                                   robots.back().*property.factor = value / window.model;
                                 }
                                 const std::vector<TrialOutcome> outcomes = player.Play(robots);
                                 std::vector<bool> stand;
                                 for (std::size_t i = 0; i < values.size(); ++i) {
                                   known[values[i]] = outcomes[i];
                                   stand.push_back(outcomes[i].stands());
                                 }
                                 return stand;
                               });
  window.ends = scan.ends;
  window.again = scan.again;
  for (std::size_t side = 0; side < 2; ++side) {
    if (scan.beyond[side]) window.beyond[side] = {*scan.beyond[side], known.at(*scan.beyond[side])};
  }
  return window;
}

GroundMap MapOf(const std::vector<PropertyWindow>& windows, const WindowScan& how,
                ModelPlayer& player) {
  GroundMap map;
  map.mu = Logarithmic(windows[0].scanned[0], windows[0].scanned[1], how.map_mu);
  map.stiffness_n_per_m =
      Logarithmic(windows[1].scanned[0], windows[1].scanned[1], how.map_stiffness);
  std::vector<RobotVariation> robots;
  for (const double stiffness : map.stiffness_n_per_m) {
    for (const double mu : map.mu) {
      robots.push_back(player.trials().Model());
      robots.back().friction = mu / windows[0].model;
      robots.back().stiffness = stiffness / windows[1].model;
    }
  }
  const std::vector<TrialOutcome> outcomes = player.Play(robots);
  for (std::size_t row = 0; row < map.stiffness_n_per_m.size(); ++row) {
    std::vector<Verdict>& verdicts = map.verdicts.emplace_back();
    for (std::size_t i = 0; i < map.mu.size(); ++i)
      verdicts.push_back(outcomes[row * map.mu.size() + i].verdict);
  }
  return map;
}

/// What became of a robot, in a few words.
std::string WordsOf(const TrialOutcome& outcome) {
  return fmt::format("{}{}{}{}", ToString(outcome.verdict), outcome.in.empty() ? "" : " in ",
                     outcome.in, outcome.reason.empty() ? "" : ": " + outcome.reason);
}

char CharacterOf(Verdict verdict) {
  switch (verdict) {
    case Verdict::kStands:
      return '#';
    case Verdict::kAmiss:
      return 'o';
    case Verdict::kNotJudged:
      return '?';
    case Verdict::kFell:
      return '.';
    default:
      return 'x';
  }
}

std::string TextOf(const GroundMap& map) {
  std::string text = fmt::format(
      "  mu from {} (left) to {}, stiffness from {} (below) to {} N/m: # as asked, "
      "o amiss, . fell, x overlap or fault, ? not judged\n",
      GroundValueText(map.mu.front()), GroundValueText(map.mu.back()),
      GroundValueText(map.stiffness_n_per_m.front()),
      GroundValueText(map.stiffness_n_per_m.back()));
  for (std::size_t row = map.verdicts.size(); row-- > 0;) {
    text += fmt::format("  {:>9} ", GroundValueText(map.stiffness_n_per_m[row]));
    for (const Verdict verdict : map.verdicts[row])
      text += fmt::format(" {}", CharacterOf(verdict));
    text += "\n";
  }
  return text;
}

GroundWindow::Ends GroundWindow::*EndsOf(const GroundProperty& property) {
  if (property.value == &ContactLaw::mu) return &GroundWindow::mu;
  return property.value == &ContactLaw::stiffness_n_per_m ? &GroundWindow::stiffness_n_per_m
                                                          : &GroundWindow::damping_n_s_per_m;
}
GroundWindow::Ends GroundWindow::*ScannedEndsOf(const GroundProperty& property) {
  if (property.value == &ContactLaw::mu) return &GroundWindow::mu_scanned;
  return property.value == &ContactLaw::stiffness_n_per_m
             ? &GroundWindow::stiffness_scanned_n_per_m
             : &GroundWindow::damping_scanned_n_s_per_m;
}

}  // namespace

Scan ScanAround(double model, std::array<double, 2> scanned, int steps, int parts,
                const std::function<std::vector<bool>(const std::vector<double>&)>& play) {
  // From the model outwards: first down, then up.
  std::array<std::vector<double>, 2> values;
  std::vector<double> all;
  for (std::size_t side = 0; side < 2; ++side) {
    values[side] = Logarithmic(model, scanned[side], steps + 1);
    all.insert(all.end(), values[side].begin() + 1, values[side].end());
  }
  const std::vector<bool> stand = play(all);
  Scan scan;
  std::array<std::vector<double>, 2> finer;
  for (std::size_t side = 0; side < 2; ++side) {
    const auto first = stand.begin() + static_cast<std::ptrdiff_t>(side) * steps;
    const auto end = std::find(first, first + steps, false);
    const auto last = Index(static_cast<int>(end - first));  // of `values`
    scan.ends[side] = values[side][last];
    if (end == first + steps) continue;
    scan.beyond[side] = values[side][last + 1];
    for (std::size_t i = last + 2; i < values[side].size(); ++i) {
      if (first[static_cast<std::ptrdiff_t>(i) - 1]) scan.again.push_back(values[side][i]);
    }
    finer[side] = Logarithmic(values[side][last], values[side][last + 1], parts + 1);
    finer[side].erase(finer[side].begin());
    finer[side].pop_back();
  }
  std::vector<double> between = finer[0];
  between.insert(between.end(), finer[1].begin(), finer[1].end());
  if (between.empty()) return scan;
  const std::vector<bool> finer_stand = play(between);
  std::size_t i = 0;
  for (std::size_t side = 0; side < 2; ++side) {
    bool inside = true;
    for (const double value : finer[side]) {
      const bool stands = finer_stand[i++];
      if (inside && stands) scan.ends[side] = value;
      if (inside && !stands) scan.beyond[side] = value;
      inside = inside && stands;
    }
  }
  std::ranges::sort(scan.again);
  return scan;
}

WindowResult FindWindows(const RobustnessStudy& study, int threads, const WindowScan& scan) {
  WindowResult result;
  result.study = study;
  result.files = HashOfFiles(study);
  // The model differs in nothing, and what is drawn of a ground's range would not be it.
  result.study.spreads = Spreads{};
  ModelPlayer player(result.study, threads);
  const Scene& scene = player.trials().scene();
  if (scene.obstacles.empty()) {
    throw Refused(study.motion +
                  ": there is no ground in its task, of which it could take more or less");
  }
  for (const GroundProperty& property : kGroundProperties) {
    if (scene.contact.*property.value > 0) continue;
    throw Refused(
        fmt::format("{}: the {} of its task's ground is 0, around which there is no window "
                    "of factors",
                    study.motion, property.name));
  }
  result.name = player.trials().name();
  result.study.lanes = player.in_lanes();
  result.not_in_lanes = player.not_in_lanes();
  result.model = player.Play({player.trials().Model()}).front();
  if (!result.model.stands()) return result;
  for (const GroundProperty& property : kGroundProperties)
    result.windows.push_back(FindWindow(property, scan, player));
  if (player.in_lanes()) result.map = MapOf(result.windows, scan, player);
  return result;
}

WindowResult FindWindows(const PrimitiveFile& file, int threads) {
  const TemporaryFolder folder;
  RobustnessStudy study;
  study.motion = (folder.path() / "motion.toml").string();
  WriteResult(study.motion, ToToml(file));
  // Not with the name of a file that nobody knows.
  const auto without_file = [&study](std::string text) {
    const std::string name = study.motion + ": ";
    for (std::size_t at = text.find(name); at != std::string::npos; at = text.find(name))
      text.erase(at, name.size());
    return text;
  };
  try {
    WindowResult result = FindWindows(study, threads, WindowScan{});
    result.not_in_lanes = without_file(result.not_in_lanes);
    return result;
  } catch (const Refused& error) {
    throw Refused(without_file(error.what()));
  } catch (const FileError& error) {
    throw Refused(without_file(error.what()));
  }
}

GroundWindow WindowOf(const WindowResult& result) {
  GroundWindow window;
  for (const PropertyWindow& found : result.windows) {
    window.*EndsOf(found.property) = found.ends;
    window.*ScannedEndsOf(found.property) = found.scanned;
  }
  window.hold_s = result.study.run.hold_s;
  window.where =
      result.study.lanes ? RobustnessFigure::Where::kLanes : RobustnessFigure::Where::kTwin;
  window.drives_file = PrintableInLine(result.study.drives);
  if (!result.study.drives.empty())
    window.drives_hash = HashOfText(ReadTextFile(result.study.drives));
  return window;
}

std::string CertifyWindow(const WindowResult& result) {
  const std::string& motion = result.study.motion;
  if (HashOfFiles(result.study) != result.files) {
    throw Refused(
        fmt::format("{}: a file of it was changed while it was played; nothing was "
                    "written, start again",
                    motion));
  }
  if (result.windows.empty()) {
    throw Refused(
        fmt::format("{}: the model itself is not as asked, so there is no window: {}; "
                    "nothing was written",
                    motion, WordsOf(result.model)));
  }
  std::vector<std::string> inputs;
  static_cast<void>(LoadMotion(motion, NotingReader(inputs)));
  if (inputs != std::vector<std::string>{motion}) {
    throw Refused(motion +
                  ": is a sequence; a window is written into a primitive, of that motion "
                  "alone: name the primitives");
  }
  PrimitiveFile file = LoadPrimitive(motion);
  file.window = WindowOf(result);
  PendingFile pending(motion, ToToml(file));
  pending.Commit();
  return motion;
}

std::string ToText(const WindowResult& result) {
  if (result.windows.empty()) {
    return fmt::format("{}: the model itself is not as asked, so there is no window: {}\n",
                       result.name, WordsOf(result.model));
  }
  std::string text = fmt::format("{}: the model is as asked on ground with\n", result.name);
  for (const PropertyWindow& window : result.windows) {
    const std::string unit = window.property.unit;
    text += fmt::format(
        "  {:<10} {}{} (task: {})\n", window.property.name, WindowText(window.ends, window.scanned),
        unit.empty() ? unit : fmt::format(" {}", unit), GroundValueText(window.model));
    for (const auto& beyond : window.beyond) {
      if (!beyond) continue;
      text += fmt::format("    with {}: {}\n", GroundValueText(beyond->value),
                          WordsOf(beyond->outcome));
    }
    if (window.again.empty()) continue;
    text += "    as asked again with";
    for (const double value : window.again) text += fmt::format(" {}", GroundValueText(value));
    text += "\n";
  }
  text += fmt::format(
      "  each with the task's other values; {}{}\n",
      result.study.lanes ? "in lanes" : "in the twin, since " + result.not_in_lanes,
      result.study.run.cycles > 0 ? fmt::format(", {} cycles", result.study.run.cycles) : "");
  if (result.map) text += TextOf(*result.map);
  return text;
}

Json ToJson(const WindowResult& result) {
  Json json = {{"name", result.name},
               {"motion", result.study.motion},
               {"cycles", result.study.run.cycles},
               {"hold_s", result.study.run.hold_s},
               {"lanes", result.study.lanes},
               {"not_in_lanes", result.not_in_lanes},
               {"model", ToString(result.model.verdict)},
               {"reason", result.model.reason}};
  Json& windows = json["window"];
  windows = Json::Object();
  for (const PropertyWindow& window : result.windows) {
    Json beyond = Json::Array();
    for (const auto& next : window.beyond) {
      beyond.Append(next ? Json{{"value", next->value},
                                {"verdict", ToString(next->outcome.verdict)},
                                {"in", next->outcome.in},
                                {"reason", next->outcome.reason}}
                         : Json());
    }
    windows[window.property.key] = {{"task", window.model},
                                    {"from", window.ends[0]},
                                    {"to", window.ends[1]},
                                    {"scanned_from", window.scanned[0]},
                                    {"scanned_to", window.scanned[1]},
                                    {"beyond", beyond},
                                    {"again", Json(window.again)}};
  }
  if (!result.map) return json;
  Json& map = json["ground_map"];
  map["mu"] = Json(result.map->mu);
  map["stiffness_n_per_m"] = Json(result.map->stiffness_n_per_m);
  map["verdicts"] = Json::Array();
  for (const auto& row : result.map->verdicts) {
    Json verdicts = Json::Array();
    for (const Verdict verdict : row) verdicts.Append(ToString(verdict));
    map["verdicts"].Append(verdicts);
  }
  return json;
}

}  // namespace tumbler
