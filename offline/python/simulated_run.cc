#include "offline/python/simulated_run.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <utility>

#include "common/files/planned_passages.h"
#include "common/files/program.h"
#include "common/files/say_to_operator.h"
#include "common/files/sequence_toml.h"
#include "offline/twin/simulated_world.h"
#include "runtime/assembly/assembly.h"
#include "runtime/assembly/file_keeper.h"
#include "runtime/assembly/machine.h"
#include "runtime/assembly/run_checks.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/record/record_configuration.h"
#include "runtime/run/play.h"

namespace tumbler {
namespace {

RunParts LoadPartsOf(SimulatedRunPlan& plan, const Simulation& simulation, const FileReader& read) {
  RunParts parts = LoadRunMotion(plan.motion, read);
  if (plan.drives.empty() && !plan.twin.empty()) plan.drives = simulation.drives_file_of(plan.twin);
  parts.drives = LoadDrivesOf(JointsOf(parts.file), plan.drives, read, GainsOf(parts.file));
  CheckRanges(*parts.sequence, parts.drives);
  CheckSchedule(parts.drives, [](const std::string& /*sentence*/) {});
  CheckWatchdogs(parts.drives, true);
  return parts;
}

RecordConfiguration ConfigurationOf(const SimulatedRunPlan& plan, const Assembly& assembly,
                                    const FileKeeper& files, const ExecutorConfig& executor,
                                    const RunProcedureConfig& procedure, std::int64_t period_ns) {
  RecordConfiguration configuration;
  configuration.program = "tumbler, the Python module " TUMBLER_VERSION;
  configuration.kernel = DescribeKernel();
  configuration.machine = DescribeMachine("");
  configuration.bus = "sim";
  configuration.virtual_time = true;
  configuration.period_ns = period_ns;
  configuration.joints = JointsOf(assembly.parts().file);
  configuration.motion_file = plan.motion;
  configuration.drives_file = plan.drives;
  configuration.executor = executor;
  configuration.procedure = procedure;
  configuration.files = files.files();
  return configuration;
}

RunSummary SummaryOf(const SimulatedRunPlan& plan, const Assembly& assembly, const Play& play,
                     FlightRecorder& recorder, World& world) {
  const RunParts& parts = assembly.parts();
  RunSummary summary;
  summary.bus = "sim";
  summary.simulated = true;
  summary.primitive = std::string(parts.sequence->graph.name.view());
  summary.speed = plan.settings.speed;
  summary.rate_hz = parts.drives.rate_hz;
  summary.joints = JointsOf(parts.file);
  summary.machine = DescribeMachine("");
  summary.worst_case_tick_bits = parts.drives.WorstCaseTickBits();
  summary.worst_case_load = parts.drives.WorstCaseLoad();
  summary.files = {plan.record};
  play.Conclude(summary);
  world.Summarize(summary);
  StopRecorder(recorder, summary);
  return summary;
}

}  // namespace

int BranchOf(const SequenceFile& motion, const std::string& path, const std::string& branch,
             int cycles) {
  const auto& graph = motion.graph;
  if (!branch.empty()) {
    const int number = graph.FindBranch(branch);
    if (number >= 0) return number;
    throw std::invalid_argument(fmt::format("branch: {} has no '{}'", path, branch));
  }
  if (graph.edge_count == 0 && cycles != 0) {
    throw std::invalid_argument(
        fmt::format("cycles: is for sequences that go round; {} ends by itself", path));
  }
  if (graph.edge_count > 0 && cycles == 0)
    throw std::invalid_argument(fmt::format("cycles: {} goes on for ever; say how many", path));
  RequireEnd(motion, cycles, branch);
  return -1;
}

RunSummary SimulateRun(const SimulatedRunPlan& asked, const std::atomic<bool>& stop) {
  SimulatedRunPlan plan = asked;
  const Simulation simulation = MakeSimulation();
  FileKeeper files;
  Assembly assembly(LoadPartsOf(plan, simulation, files.reader()));
  const RunParts& parts = assembly.parts();
  plan.settings.branch = BranchOf(parts.file, plan.motion, plan.branch, plan.settings.cycles);
  try {
    plan.settings.begin = BeginningNamed(parts.sequence->graph, plan.from_node);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("from_node: {}: {}", plan.motion, error.what()));
  }
  try {
    CheckGetUps(plan.settings.get_ups, parts.sequence->graph.beginning_count, parts.drives);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("get_ups: {}: {}", plan.motion, error.what()));
  }
  ExecutorConfig executor = ExecutorConfigOf(plan.settings, parts.drives);
  if (!plan.faults.empty()) LoadFaultsOf(parts, plan.faults, executor);
  if (assembly.Configure(executor) != Status::kOk)
    throw Refused(fmt::format("{}: the executor does not take this motion", plan.motion));
  const auto period_ns = static_cast<std::int64_t>(std::llround(1e9 / parts.drives.rate_hz));
  const RunProcedureConfig procedure =
      ProcedureConfigOf(plan.settings, parts.drives, parts.sequence->graph);

  TickFeed feed;
  SimulatedWorldConfig world_config;
  world_config.twin_file = plan.twin;
  world_config.bus_faults = plan.bus_faults;
  world_config.begin = plan.settings.begin;
  world_config.truth_sink = [&feed](std::span<const std::uint8_t> truth) { feed.PushTruth(truth); };
  const std::unique_ptr<World> world =
      simulation.make_world(parts.file, parts.drives, world_config);
  const std::unique_ptr<FlightRecorder> recorder = OpenRecorder(
      plan.record, ConfigurationOf(plan, assembly, files, executor, procedure, period_ns),
      [](const std::string& text) { SayToOperator("tumbler: " + text); });
  feed.Add(recorder.get());
  world->Open();
  Play play(assembly, *world, feed);
  play.Run(procedure, period_ns, [&stop](const ControlLoop& /*loop*/) {
    if (stop) throw std::runtime_error("the run was stopped");
  });
  // What is missing is told once the record says how the run ended.
  RunSummary summary = SummaryOf(plan, assembly, play, *recorder, *world);
  if (const std::string problem = feed.TruthProblem(); !problem.empty())
    throw std::runtime_error(fmt::format("{}: {}", plan.record, problem));
  return summary;
}

}  // namespace tumbler
