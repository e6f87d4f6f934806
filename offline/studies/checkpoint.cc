#include "offline/studies/checkpoint.h"

#include <fmt/format.h>

#include <optional>
#include <stdexcept>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_hash.h"
#include "common/files/result_file.h"
#include "common/files/toml_reader.h"
#include "offline/studies/spread_names.h"
#include "runtime/assembly/run_checks.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;

std::optional<Verdict> VerdictOf(std::string_view name) {
  for (const Verdict verdict : kVerdicts) {
    if (name == ToString(verdict)) return verdict;
  }
  return std::nullopt;
}

bool Equal(const TrialOutcome& a, const TrialOutcome& b) {
  return a.verdict == b.verdict && a.motions == b.motions && a.in == b.in && a.reason == b.reason &&
         a.left_s == b.left_s && a.rests == b.rests && a.drops == b.drops &&
         a.lies_rad == b.lies_rad && a.begun == b.begun;
}

/// A line for each file that a study is about.
std::string HashesOfFiles(const RobustnessStudy& study) {
  std::vector<std::string> inputs;
  static_cast<void>(LoadMotion(study.motion, NotingReader(inputs)));
  const std::string drives = DrivesFileOf(study);
  if (!drives.empty()) inputs.push_back(drives);
  if (!study.twin.empty()) inputs.push_back(study.twin);
  std::string text;
  for (const std::string& input : inputs) text += HashOfText(ReadTextFile(input)) + "\n";
  return text;
}

}  // namespace

std::string HashOfFiles(const RobustnessStudy& study) { return HashOfText(HashesOfFiles(study)); }

std::string IdentityOf(const RobustnessStudy& study) {
  const std::string drives = DrivesFileOf(study);
  std::string text = fmt::format("{} {} {} {} {} {} {} {}\n", study.seed, study.scale,
                                 study.run.hold_s, study.run.cycles, study.run.branch, study.lanes,
                                 drives.empty(), study.twin.empty());
  if (study.disturbs()) text += fmt::format("{} {}\n", study.push_n, study.sensor_faults);
  if (study.drops) text += "drops\n";
  if (study.run.get_ups > 0) text += fmt::format("get ups {}\n", study.run.get_ups);
  for (const SpreadName& spread : kSpreadNames)
    text += fmt::format("{} {}\n", spread.key, spread.TextOf(study.spreads));
  return HashOfText(text + HashesOfFiles(study));
}

WorkFile::Work CheckpointOf(const std::string& identity) {
  return {.format = "tumbler-robots",
          .version = 4,  // 3 left out points and what is asked for in the motion
          .identity = identity,
          .program = "tumbler robustness",
          .differs =
              "is about other robots: motion, drives, seed, spreads or another option "
              "differ"};
}

std::string CheckpointLine(std::uint64_t index, const TrialOutcome& outcome) {
  const Json json = {{"robot", index},
                     {"verdict", ToString(outcome.verdict)},
                     {"motions", outcome.motions},
                     {"in", outcome.in},
                     {"reason", outcome.reason},
                     {"left_s", outcome.left_s},
                     {"rests", outcome.rests},
                     {"drops", outcome.drops},
                     {"lies_rad", outcome.lies_rad},
                     {"begun", outcome.begun}};
  return json.Dump(-1) + "\n";
}

void ReadCheckpointLines(std::string_view text, const std::string& name, std::uint32_t line,
                         Outcomes& outcomes) {
  for (; !text.empty(); ++line) {
    const std::size_t end = text.find('\n');
    const std::string_view whole = text.substr(0, end);
    const std::optional<Json> json = Json::Parse(whole);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    TrialOutcome outcome;
    std::optional<std::int64_t> robot;
    try {
      if (!json) throw std::out_of_range("");
      robot = (*json)["robot"].integer();
      const std::optional<Verdict> verdict = VerdictOf((*json)["verdict"].text());
      const std::optional<std::int64_t> motions = (*json)["motions"].integer();
      if (!robot || *robot < 0 || !verdict || !motions) throw std::out_of_range("");
      outcome.verdict = *verdict;
      outcome.motions = static_cast<int>(*motions);
      outcome.in = (*json)["in"].text();
      outcome.reason = (*json)["reason"].text();
      outcome.left_s = (*json)["left_s"].number();
      outcome.rests = (*json)["rests"].boolean();
      const std::optional<std::int64_t> drops = (*json)["drops"].integer();
      if (!drops) throw std::out_of_range("");
      outcome.drops = static_cast<int>(*drops);
      outcome.lies_rad = (*json)["lies_rad"].number();
      outcome.begun = (*json)["begun"].text();
      // Two torn lines may make one that can be read, and a number too large for its kind is cut.
      if (CheckpointLine(static_cast<std::uint64_t>(*robot), outcome) != std::string(whole) + "\n")
        throw std::out_of_range("");
    } catch (const std::logic_error&) {  // a member is missing, or of another kind
      throw FileError(name, line, "", "is not the outcome of a robot; remove the line");
    }
    const auto [at, added] = outcomes.emplace(static_cast<std::uint64_t>(*robot), outcome);
    if (!added && !Equal(at->second, outcome)) {
      throw FileError(name, line, "robot",
                      fmt::format("{} has another outcome elsewhere; remove the files", *robot));
    }
  }
}

}  // namespace tumbler
