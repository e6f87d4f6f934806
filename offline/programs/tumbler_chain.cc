// tumbler chain: checks whether the primitives of a sequence fit together, and plays the sequence
// in simulation.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/json.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/certify/chain.h"
#include "offline/pages/motion_report.h"
#include "offline/pages/page_file.h"
#include "offline/pages/space_motion.h"
#include "offline/pages/space_page.h"

namespace tumbler {
namespace {

constexpr const char* kExitCodes =
    R"(Exit codes:
  0  it fits, goes through, and each motion does what it is for
  1  wrong usage, a file that cannot be used or written, or a join that does not fit
  4  the robot fell, missed what a motion is for, or the chain ended before that could be judged)";

struct Arguments {
  std::string sequence;
  ChainOptions options;
  std::string json;
  std::string report;
};

/// Prints a table of what was compared at every edge: for each quantity, the largest of all joints.
ExitStatus Check(const Arguments& arguments) {
  const SequenceFile file = ReadSequence(arguments.sequence);
  fmt::print(stderr, "{}", EditNotes(arguments.sequence, file.primitives));
  const std::vector<JoinComparison> comparisons = CompareJoins(file);
  fmt::print("{:<40} {:<38} {:<10} {:>12} {:>12}\n", "join", "quantity", "largest at", "apart",
             "allowed");
  const JoinComparison* first_bad = nullptr;
  // Edges, and those that lead to a node in place of theirs.
  std::vector<std::pair<int, int>> joins;
  for (const JoinComparison& c : comparisons) {
    if (joins.empty() || joins.back() != std::pair(c.edge, c.to)) joins.emplace_back(c.edge, c.to);
  }
  for (const auto& [e, to] : joins) {
    std::vector<const JoinComparison*> rows;  // the largest of each quantity, in order
    for (const JoinComparison& c : comparisons) {
      if (c.edge != e || c.to != to) continue;
      if (first_bad == nullptr && !c.fits()) first_bad = &c;
      const auto same = std::find_if(rows.begin(), rows.end(), [&c](const auto* row) {
        return row->quantity == c.quantity && row->joint.empty() == c.joint.empty();
      });
      if (same == rows.end()) {
        rows.push_back(&c);
      } else if (!(std::abs(c.difference) <= std::abs((*same)->difference))) {
        *same = &c;
      }
    }
    const std::string name =
        fmt::format("{} -> {}", file.graph.node(file.graph.edge(e).from).name.view(),
                    file.graph.node(to).name.view());
    for (const JoinComparison* row : rows) {
      fmt::print("{:<40} {:<38} {:<10} {:>12} {:>12}{}\n", row == rows.front() ? name : "",
                 fmt::format("{} [{}]", row->quantity, row->unit),
                 row->joint.empty() ? "root" : row->joint,
                 fmt::format("{:.2e}", std::abs(row->difference)),
                 fmt::format("{:.2e}", row->tolerance), row->fits() ? "" : "  does not fit");
    }
  }
  if (first_bad != nullptr) {
    throw FileError(file.path, file.edge_lines[static_cast<std::size_t>(first_bad->edge)],
                    fmt::format("edge[{}]", first_bad->edge), Describe(file, *first_bad));
  }
  const SimulatedMotion motion(file, TaskSpaces::kPlaneAndSpace);
  RequireSameGround(motion);
  RequireOneRobot(motion);
  for (std::size_t i = 0; i < file.primitives.size(); ++i) {
    for (const RobustnessFigure& figure : file.primitives[i].robustness)
      fmt::print("{}: robots as asked: {}\n", file.primitive_names[i], ToText(figure));
    if (!file.primitives[i].window) continue;
    for (const auto& [what, text] : WindowLines(*file.primitives[i].window))
      fmt::print("{}: {}: {}\n", file.primitive_names[i], what, text);
  }
  fmt::print("{}: {} nodes, {} joins, all fit; limits hold for all t\n", file.graph.name.view(),
             file.graph.node_count, joins.size());
  return ExitStatus::kDone;
}

/// The number, or null, since JSON has no infinity: the margin of a node that was not played.
Json FiniteOrNull(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json PurposeOf(const PlayedNode& passage) {
  Json purpose = Json::Array();
  for (const JudgedTarget& judged : passage.purpose) purpose.Append(ToJson(judged));
  return purpose;
}

/// Says which targets were not judged.
void PrintNotJudged(const SequenceFile& file, const ChainOutcome& outcome, std::FILE* people) {
  for (const PlayedNode& p : outcome.passages) {
    for (const JudgedTarget& judged : p.purpose) {
      if (judged.result) continue;
      fmt::print(people, "{} at {:.2f} s: {}: {}\n", file.graph.node(p.node).name.view(), p.start_s,
                 judged.name(), judged.Verdict());
    }
  }
}

Json ToJson(const SequenceFile& file, const ChainOutcome& outcome) {
  Json json = {{"sequence", file.graph.name.view()},
               {"cycles", outcome.cycles},
               {"duration_s", outcome.duration_s},
               {"travelled_m", outcome.travelled_m},
               {"failure", nullptr}};
  if (outcome.failure) {
    json["failure"] = {{"cause", ToString(outcome.failure->cause)},
                       {"node", file.graph.node(outcome.failure->node).name.view()},
                       {"time_s", outcome.failure->time_s},
                       {"text", outcome.failure->text}};
  }
  json["passages"] = Json::Array();
  for (const PlayedNode& p : outcome.passages) {
    json["passages"].Append({{"node", file.graph.node(p.node).name.view()},
                             {"start_s", p.start_s},
                             {"hold_s", p.hold_s},
                             {"entry_z_error_m", p.entry_z_error_m},
                             {"entry_pitch_error_rad", p.entry_pitch_error_rad},
                             {"entry_speed", p.entry_speed},
                             {"exit_z_error_m", p.exit_z_error_m},
                             {"exit_pitch_error_rad", p.exit_pitch_error_rad},
                             {"exit_speed", p.exit_speed},
                             {"posture", ToString(p.posture)},
                             {"peak_torque_nm", p.peak_torque_nm},
                             {"torque_margin_nm", FiniteOrNull(p.torque_margin_nm)},
                             {"peak_penetration_m", p.peak_penetration_m},
                             {"travelled_m", p.travelled_m},
                             {"turned_rad", p.turned_rad},
                             {"purpose", PurposeOf(p)}});
  }
  return json;
}

void WriteChainPage(const SimulatedMotion& motion, const Arguments& arguments, std::FILE* people) {
  if (!motion.problem().space) {
    fmt::print(people, "report {}\n",
               WriteReport(MakeChainReport(motion, arguments.options), arguments.report));
    return;
  }
  const SpaceMotionPage page = MakeSpaceChainPage(motion, arguments.options);
  if (page.frames.size() < 2) {
    fmt::print(people, "no report: it ends where it begins, and there is nothing to show\n");
    return;
  }
  fmt::print(people, "report {}\n", WritePage(SpacePage(page), arguments.report));
}

ExitStatus Simulate(const Arguments& arguments) {
  std::vector<std::string> inputs;
  const SimulatedMotion motion(LoadSequence(arguments.sequence, NotingReader(inputs)),
                               TaskSpaces::kPlaneAndSpace);
  fmt::print(stderr, "{}", EditNotes(arguments.sequence, motion.file().primitives));
  const bool in_space = motion.problem().space.has_value();
  std::vector<std::string> outputs = {arguments.json};
  if (!arguments.report.empty()) outputs.push_back(PagePath(arguments.report));
  CheckDistinct(inputs, outputs);
  CheckResult(arguments.json);
  if (!arguments.report.empty()) CheckFolderWritable(PageFolder(arguments.report));
  const SequenceFile& file = motion.file();
  const ChainOutcome outcome = SimulateChain(motion, arguments.options);
  std::FILE* const people = arguments.json == "-" ? stderr : stdout;
  fmt::print(people, "{:>9} {:<22} {:>10} {:>10} {:>9} {:<8} {:>7} {:>7} {:>9} {:>8}\n",
             "start [s]", "node", "entry err", "exit err", "speed", "posture", "[N m]", "[mm]",
             in_space ? "level [m]" : "dx [m]", "turn");
  for (const PlayedNode& p : outcome.passages) {
    fmt::print(people,
               "{:9.2f} {:<22} {:10.2e} {:10.2e} {:9.1e} {:<8} {:7.2f} {:7.2f} {:9.4f} {:8.4f}\n",
               p.start_s, file.graph.node(p.node).name.view(), p.entry_pitch_error_rad,
               p.exit_pitch_error_rad, p.exit_speed, ToString(p.posture), p.peak_torque_nm,
               1e3 * p.peak_penetration_m, p.travelled_m, p.turned_rad);
  }
  fmt::print(people, "{}: {} cycles in {:.2f} s, {:.3f} m {}; {}\n", file.graph.name.view(),
             outcome.cycles, outcome.duration_s, outcome.travelled_m,
             in_space ? "from where it began" : "along x",
             outcome.failure ? "it did not go through" : "no fall");
  const ChainOutcome::Judged purposes = outcome.CountJudged();
  if (!outcome.failure) {
    fmt::print(people, "  {}{}\n",
               purposes.judged + purposes.not_judged == 0
                   ? "its motions are for nothing that could be judged"
                   : fmt::format("{} of {} targets of what motions are for met", purposes.judged,
                                 purposes.judged + purposes.not_judged),
               purposes.not_judged == 0 ? "" : fmt::format(", {} NOT JUDGED", purposes.not_judged));
    PrintNotJudged(file, outcome, people);
  }
  const auto worst = std::min_element(outcome.passages.begin(), outcome.passages.end(),
                                      [](const PlayedNode& a, const PlayedNode& b) {
                                        return a.torque_margin_nm < b.torque_margin_nm;
                                      });
  if (worst->torque_margin_nm < 0) {
    fmt::print(people, "note: '{}' at {:.2f} s takes {:.2f} N m more than a joint's limit\n",
               file.graph.node(worst->node).name.view(), worst->start_s, -worst->torque_margin_nm);
  }
  if (!arguments.report.empty()) WriteChainPage(motion, arguments, people);
  if (!arguments.json.empty()) WriteResult(arguments.json, ToJson(file, outcome).Dump(2) + '\n');
  if (!outcome.failure) return purposes.not_judged == 0 ? ExitStatus::kDone : ExitStatus::kAmiss;
  fmt::print(stderr, "failed: {} at {:.3f} s, in '{}': {}\n", ToString(outcome.failure->cause),
             outcome.failure->time_s, file.graph.node(outcome.failure->node).name.view(),
             outcome.failure->text);
  return ExitStatus::kAmiss;
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line("Checks a sequence of primitives, and plays it in the nominal simulation.",
                   "tumbler chain");
  line.SetFooter(kExitCodes);
  line.RequireSubcommand();
  CommandLine check = line.Subcommand("check", "Compare both sides of every join");
  CommandLine simulate =
      line.Subcommand("simulate", "Play it from the start, the state carried through");
  for (CommandLine command : {check, simulate})
    command.Option("SEQUENCE", arguments.sequence, "Sequence file (TOML)").Required();
  simulate.Option("--cycles", arguments.options.cycles, "How many; 0: none before the branch")
      .Within(0, 100000)
      .ShowDefault();
  simulate.Option("--branch", arguments.options.branch,
                  "Take this branch once the cycles are done");
  simulate
      .Option(
          "--hold-s", arguments.options.last_hold_s,
          "Hold after the last node [s]; on a bar, at most until what the motion is for has been "
          "judged; none after a "
          "motion that ends in motion")
      .Within(0.0, 60.0)
      .ShowDefault();
  simulate
      .Option("--step", arguments.options.step_s,
              "Integration step [s]; 0: that of each primitive's task")
      .Within(0.0, 0.01)
      .ShowDefault();
  simulate.Option("--report", arguments.report,
                  "Write a page that shows the chain to this file, *.html, or into this folder");
  simulate.Option("--json", arguments.json,
                  "Write figures as JSON to this file, or to standard output for -");
  line.Parse(argc, argv);
  return check.given() ? Check(arguments) : Simulate(arguments);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler chain", argc, argv, tumbler::Main);
}
