#include "offline/programs/view_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/files/file_kind.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/pages/page_file.h"
#include "offline/pages/space_motion.h"
#include "offline/pages/space_run.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/guess.h"
#include "runtime/record/flight_record.h"

namespace tumbler {
namespace {

/// The most runs on one page. With more of them nobody can read the plots.
constexpr std::size_t kRunsMax = 6;

bool IsRecord(const std::string& path) {
  const MappedFile file(path);
  return StartOf(file.bytes()) != RecordStart::kNotARecord && !file.bytes().empty();
}

/// Refuses logs and the like by what they are, rather than as primitives that they are not.
void RejectOtherRunFile(const std::string& path) {
  const MappedFile file(path);
  const std::string_view kind =
      KindOfRunFile({reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size()});
  if (kind.empty()) return;
  throw FileError(path, 0, "",
                  fmt::format("is {}; allowed: flight records (`tumbler run --record`), and "
                              "primitives",
                              kind));
}

/// The motion of a primitive of a robot in space; none of others.
std::optional<PrimitiveFile> MotionInSpace(const std::string& path) {
  const SequenceFile motion = LoadMotion(path);
  if (motion.graph.node_count > 1 || !motion.primitives.front().entry.is_in_space())
    return std::nullopt;
  return motion.primitives.front();
}

/// The page of a motion in space, as `tumbler optimize --report` writes it.
ExitStatus WriteMotionInSpace(const PrimitiveFile& file, const std::string& out) {
  const Task task = TaskOf(file, TaskSpaces::kPlaneAndSpace);
  const SpaceMotionPage page = MakeSpaceMotionPage(task, ParametersOf(file.primitive), file);
  fmt::print("wrote {}\n", WritePage(SpacePage(page), out));
  return ExitStatus::kDone;
}

/// The page of runs, or of the run of a robot in space. @returns its path.
std::string WriteRuns(const std::vector<RunData>& runs, const ReportArguments& arguments) {
  for (const RunData& run : runs) {
    if (run.space && runs.size() > 1) {
      throw std::runtime_error(
          fmt::format("{}: is of a robot in space, of which a page shows one run so far; give it "
                      "alone",
                      run.name));
    }
  }
  const RunData& first = runs.front();
  if (!first.space) return WriteFlightReport(runs, arguments.out, arguments.options);
  return WritePage(SpacePage(MakeSpaceRunPage(first, arguments.options)), arguments.out);
}

}  // namespace

ExitStatus WriteReportOfRuns(const ReportArguments& arguments) {
  std::vector<std::string> inputs = arguments.files;
  inputs.insert(inputs.end(), arguments.truths.begin(), arguments.truths.end());
  CheckDistinct(inputs, {PagePath(arguments.out)});
  if (arguments.files.size() == 1 && !IsRecord(arguments.files.front())) {
    RejectOtherRunFile(arguments.files.front());
    if (const auto file = MotionInSpace(arguments.files.front()))
      return WriteMotionInSpace(*file, arguments.out);
  }
  std::vector<RunData> runs;
  std::size_t truths = 0;
  for (const std::string& path : arguments.files) {
    if (IsRecord(path)) {
      const bool has_log = truths < arguments.truths.size();
      runs.push_back(ReadRun(path, has_log ? arguments.truths[truths] : std::string()));
      ++truths;
    } else {
      RejectOtherRunFile(path);
      runs.push_back(ReadPlan(path));
    }
  }
  if (truths < arguments.truths.size()) {
    throw std::runtime_error(
        fmt::format("{}: --truth is given {} times, for {} records; the first log belongs to the "
                    "first record",
                    arguments.truths[truths], arguments.truths.size(), truths));
  }
  const std::string page = WriteRuns(runs, arguments);
  for (const RunData& run : runs) {
    fmt::print("{}:\n", Printable(run.name));
    for (const auto& [name, value] : run.facts) fmt::print("  {}: {}\n", name, Printable(value));
    for (const RunEvent& event : run.events) {
      if (event.kind != RunEvent::Kind::kFault) continue;
      fmt::print("  fault at {:.3f} s: {}\n", event.time_s, Printable(event.text));
    }
  }
  for (std::size_t k = 1; k < runs.size(); ++k) {
    for (const RunDifference& d : Compare(runs.front(), runs[k])) {
      if (d.ticks == 0) {
        fmt::print("{} less {}: {}, {}: not measured in both\n", runs[k].name, runs.front().name,
                   d.joint, d.quantity);
        continue;
      }
      fmt::print("{} less {}: {}, {}: at most {:.6g} {} at {:.3f} s, rms {:.3g} {}\n", runs[k].name,
                 runs.front().name, d.joint, d.quantity, d.max, d.unit, d.max_at_s, d.rms, d.unit);
    }
  }
  fmt::print("wrote {}\n", page);
  return std::ranges::any_of(runs, &RunData::damaged) ? ExitStatus::kAmiss : ExitStatus::kDone;
}

void CheckReport(const ReportArguments& arguments) {
  if (arguments.files.size() > kRunsMax) {
    throw UsageError("RECORD|PRIMITIVE",
                     fmt::format("are {}, allowed: 1 ... {}", arguments.files.size(), kRunsMax));
  }
  if (!(arguments.options.from_s < arguments.options.to_s)) {
    throw UsageError("--from-s", fmt::format("is {}, must be before --to-s, {}",
                                             arguments.options.from_s, arguments.options.to_s));
  }
  if (arguments.out.empty()) throw UsageError("--out", "is empty");
}

}  // namespace tumbler
