#include "offline/studies/task_sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "common/files/primitive_hash.h"
#include "common/files/result_file.h"
#include "offline/certify/task_result.h"
#include "offline/solve/guess.h"
#include "offline/studies/work_file.h"

namespace tumbler {
namespace {

namespace fs = std::filesystem;

using Points = std::map<int, SweepPoint>;

std::string InFolder(const SweepPlan& plan, const std::string& name) {
  return (fs::path(plan.folder) / name).string();
}

std::string PrimitiveName(const SweepStudy& study, int point) {
  return fmt::format("{}-{:04}.toml", study.grid.base().problem.name, point);
}

WorkFile::Work WorkOf(const SweepStudy& study) {
  const Task& base = study.grid.base();
  std::string text = HashOfText(base.task_text) + HashOfText(base.robot_text);
  if (study.guess) text += ContentHash(*study.guess);
  text += fmt::format(" {}\n", study.seed.value_or(base.problem.search.seed));
  for (const GridAxis& axis : study.grid.axes()) {
    text += axis.of;
    for (const double value : axis.values) text += fmt::format(" {}", ExactDecimal(value));
    text += "\n";
  }
  return {.format = "tumbler-library-points",
          .version = 1,
          .identity = HashOfText(text),
          .program = "tumbler sweep",
          .differs =
              "is about other points: task, robot, guess, seed or the values of --over "
              "differ"};
}

Json FiguresOf(const SweepPoint& point) {
  Json json = {{"found", point.found}};
  if (!point.found) {
    json["cause"] = point.cause;
    return json;
  }
  json.Merge({{"file", point.file},
              {"file_hash", point.hash},
              {"objective", point.objective},
              {"duration_s", point.duration_s},
              {"peak_torque_nm", point.peak_torque_nm},
              {"evaluations", point.evaluations}});
  return json;
}

/// A point with the text of its primitive, as processes tell each other.
struct Solved {
  int point = 0;
  SweepPoint outcome;
  std::string primitive;
};

std::string ToLine(const Solved& solved, bool with_primitive) {
  Json json = {{"point", solved.point}};
  json.Merge(FiguresOf(solved.outcome));
  if (with_primitive) json["primitive"] = solved.primitive;
  return json.Dump(-1) + "\n";
}

/// @throws FileError  naming the file and the line that is none.
std::vector<Solved> ReadLines(std::string_view text, const std::string& name, int points) {
  std::vector<Solved> read;
  for (std::uint32_t line = 2; !text.empty(); ++line) {
    const std::size_t end = text.find('\n');
    const std::optional<Json> json = Json::Parse(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    Solved& solved = read.emplace_back();
    SweepPoint& outcome = solved.outcome;
    try {
      if (!json) throw std::out_of_range("");
      const std::optional<std::int64_t> point = (*json)["point"].integer();
      if (!point || *point < 0 || *point >= points) throw std::out_of_range("");
      solved.point = static_cast<int>(*point);
      outcome.found = (*json)["found"].boolean();
      if (!outcome.found) {
        outcome.cause = (*json)["cause"].text();
        continue;
      }
      outcome.file = (*json)["file"].text();
      outcome.hash = (*json)["file_hash"].text();
      outcome.objective = (*json)["objective"].number();
      outcome.duration_s = (*json)["duration_s"].number();
      outcome.peak_torque_nm = (*json)["peak_torque_nm"].number();
      outcome.evaluations = (*json)["evaluations"].integer().value_or(0);
      if (const Json* primitive = json->Find("primitive")) solved.primitive = primitive->text();
    } catch (const std::logic_error&) {  // a member is missing, or of another kind
      throw FileError(name, line, "", "is not the outcome of a point; remove the line");
    }
  }
  return read;
}

/// Whether the primitive of a point is there as it was written.
bool IsThere(const SweepPlan& plan, const SweepPoint& point) {
  if (!point.found) return true;
  const std::string path = InFolder(plan, point.file);
  return fs::is_regular_file(path) && HashOfText(ReadTextFile(path)) == point.hash;
}

/// Opens the folder's list of points. @param lines  gets those that need not be solved again.
WorkFile OpenLibrary(const SweepStudy& study, const SweepPlan& plan, std::string& lines) {
  const std::string path = InFolder(plan, "points.jsonl");
  if (fs::exists(plan.folder) && !fs::is_empty(plan.folder) && !fs::exists(path)) {
    throw FileError(plan.folder, 0, "",
                    "has files in it, and is no library of tumbler sweep; name another folder");
  }
  std::string all;
  WorkFile file(path, WorkOf(study), all);
  for (const Solved& solved : ReadLines(all, path, study.grid.size())) {
    if (solved.outcome.found && solved.outcome.file != PrimitiveName(study, solved.point))
      throw FileError(path, 0, "file", "is not the name that the point's primitive has");
    if (IsThere(plan, solved.outcome)) lines += ToLine(solved, false);
  }
  return file;
}

/// Solves a point. Empty when that was interrupted.
std::optional<Solved> Solve(const SweepStudy& study, const SweepPlan& plan, int point) {
  Solved solved;
  solved.point = point;
  SweepPoint& outcome = solved.outcome;
  Task task;
  try {
    task = study.grid.TaskAt(point);
    if (study.guess) TakeGuess(task, *study.guess, study.guess_file);
    CheckGuess(task);
  } catch (const FileError& error) {  // Each value was checked by itself; these do not go together.
    outcome.cause = error.what();
    return solved;
  }
  if (study.seed) task.problem.search.seed = *study.seed;
  WorkSettings settings;
  settings.quiet = true;
  settings.interrupt = plan.interrupt;
  const TaskResult result = WorkOn(std::move(task), settings);
  if (result.outcome.interrupted) return std::nullopt;
  outcome.found = result.usable && result.file.has_value();
  if (!outcome.found) {
    outcome.cause = result.cause;
    return solved;
  }
  solved.primitive = ToToml(*result.file);
  outcome.file = PrimitiveName(study, point);
  outcome.hash = HashOfText(solved.primitive);
  outcome.objective = result.best.rollout.cost;
  outcome.duration_s = result.file->primitive.duration_s;
  outcome.peak_torque_nm = result.file->certificate.peak_torque_nm;
  outcome.evaluations = result.outcome.evaluations;
  return solved;
}

/// Writes the primitives of new points, and then their lines.
void Keep(const std::string& lines, const SweepStudy& study, const SweepPlan& plan,
          WorkFile& library) {
  for (const Solved& solved : ReadLines(lines, "points", study.grid.size())) {
    if (solved.outcome.found)
      PendingFile(InFolder(plan, solved.outcome.file), solved.primitive).Commit();
    library.Add(ToLine(solved, false));
  }
}

void Learn(const std::string& lines, const SweepStudy& study, Points& known) {
  for (Solved& solved : ReadLines(lines, "points", study.grid.size()))
    known.insert_or_assign(solved.point, std::move(solved.outcome));
}

}  // namespace

SweepDone RunSweep(const SweepStudy& study, const SweepPlan& plan, const Processes& processes) {
  std::optional<WorkFile> library;
  std::string lines;
  if (processes.rank() == 0) library.emplace(OpenLibrary(study, plan, lines));
  Points known;
  Learn(processes.FromFirst(lines), study, known);
  const auto tell = [&] {
    if (plan.progress) plan.progress(static_cast<int>(known.size()));
  };
  tell();
  std::vector<int> all, mine;  // still to be solved by all processes, and by this one
  for (int point = 0; point < study.grid.size(); ++point) {
    if (known.count(point) > 0) continue;
    if (all.size() % Index(processes.count()) == Index(processes.rank())) mine.push_back(point);
    all.push_back(point);
  }
  const std::size_t batch = Index(plan.threads), round = batch * Index(processes.count());
  for (std::size_t done = 0, own = 0; done < all.size(); done += round, own += batch) {
    if (plan.interrupt != nullptr && *plan.interrupt) break;
    const std::size_t first = std::min(own, mine.size());
    std::vector<std::optional<Solved>> solved(std::min(batch, mine.size() - first));
    ParallelFor(static_cast<int>(solved.size()), plan.threads, [&](int i, int /*thread*/) {
      solved[Index(i)] = Solve(study, plan, mine[first + Index(i)]);
    });
    std::string told;
    for (const std::optional<Solved>& point : solved) {
      if (point) told += ToLine(*point, true);
    }
    for (const std::string& text : processes.ToFirst(told)) {
      if (library) Keep(text, study, plan, *library);
      Learn(text, study, known);
    }
    tell();
  }
  SweepDone sweep;
  sweep.known = static_cast<int>(known.size());
  if (sweep.known < study.grid.size() || processes.rank() > 0) return sweep;
  for (auto& [point, outcome] : known) sweep.points.push_back(std::move(outcome));
  PendingFile(InFolder(plan, "library.json"), ToJson(study, sweep.points).Dump(2) + "\n").Commit();
  return sweep;
}

std::vector<std::string> FilesOf(const SweepStudy& study, const SweepPlan& plan) {
  std::vector<std::string> files = {InFolder(plan, "points.jsonl"), InFolder(plan, "library.json")};
  for (int point = 0; point < study.grid.size(); ++point)
    files.push_back(InFolder(plan, PrimitiveName(study, point)));
  return files;
}

std::string ToText(const SweepStudy& study, const std::vector<SweepPoint>& points) {
  const std::vector<GridAxis>& axes = study.grid.axes();
  std::vector<std::size_t> widths;
  std::string text;
  for (const GridAxis& axis : axes) {
    std::size_t& width = widths.emplace_back(axis.of.size());
    for (const double value : axis.values) width = std::max(width, MessageNumber(value).size());
    text += fmt::format("{:>{}}  ", axis.of, width);
  }
  text += "  objective  duration   torque  primitive\n";
  int found = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::vector<double> values = study.grid.At(static_cast<int>(i));
    for (std::size_t a = 0; a < axes.size(); ++a)
      text += fmt::format("{:>{}}  ", MessageNumber(values[a]), widths[a]);
    const SweepPoint& point = points[i];
    if (point.found) {
      ++found;
      text += fmt::format("{:>11.4g}  {:6.3f} s  {:5.2f} Nm  {}\n", point.objective,
                          point.duration_s, point.peak_torque_nm, point.file);
    } else {
      // What to do about it is in library.json.
      text += fmt::format("no motion: {}\n", point.cause.substr(0, point.cause.find(';')));
    }
  }
  return text + fmt::format("{} of {} points have a motion\n", found, points.size());
}

Json ToJson(const SweepStudy& study, const std::vector<SweepPoint>& points) {
  const Task& base = study.grid.base();
  Json json = {{"format", "tumbler-library"},
               {"version", 1},
               {"task", base.task_file},
               {"name", base.problem.name},
               {"seed", study.seed.value_or(base.problem.search.seed)}};
  if (study.guess) json["guess"] = study.guess_file;
  json["axes"] = Json::Array();
  for (const GridAxis& axis : study.grid.axes())
    json["axes"].Append({{"of", axis.of}, {"values", axis.values}});
  json["points"] = Json::Array();
  for (std::size_t i = 0; i < points.size(); ++i) {
    Json point = {{"values", study.grid.At(static_cast<int>(i))}};
    point.Merge(FiguresOf(points[i]));
    json["points"].Append(std::move(point));
  }
  return json;
}

}  // namespace tumbler
