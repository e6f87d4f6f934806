#include "runtime/run/record_play.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>

#include "common/program.h"
#include "common/say_to_operator.h"
#include "runtime/assembly/file_keeper.h"
#include "runtime/assembly/run_checks.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/linux/interrupts.h"
#include "runtime/linux/machine.h"
#include "runtime/linux/realtime_thread.h"
#include "runtime/record/recorded_assembly.h"
#include "runtime/run/interface_world.h"
#include "runtime/run/play.h"

namespace tumbler {
namespace {

/// The operator's request that leads to a command; kNone for a command that the run procedure gives
/// by itself.
OperatorRequest RequestOf(OperatorCommand command) {
  switch (command) {
    case OperatorCommand::kFinish:
      return OperatorRequest::kFinish;
    case OperatorCommand::kStop:
      return OperatorRequest::kStop;
    case OperatorCommand::kDisarm:
      return OperatorRequest::kDisarm;
    case OperatorCommand::kBranch:
      return OperatorRequest::kBranch;
    default:
      return OperatorRequest::kNone;
  }
}

/// The configuration for the record of the play.
RecordConfiguration DescribeForRecord(const RecordConfiguration& configuration,
                                      const RecordPlayOptions& options, World& world) {
  RecordConfiguration played = configuration;
  played.program = "tumbler-replay " TUMBLER_VERSION;
  played.kernel = DescribeKernel();
  played.machine = DescribeMachine(options.arm ? options.bus : "");
  played.bus = options.bus;
  played.dry_run = !options.arm;
  played.virtual_time = !world.real_time();
  played.utime_at_zero_us = UtimeAtZero(world);
  return played;
}

/// Puts this thread under the scheduling that the options ask for, if any.
/// @param enter  EnterRealtime, or TryRealtime to learn of a refusal before anything is touched.
/// @throws Refused  when motors are to be driven and real time is neither in force nor given up.
void Schedule(const RecordPlayOptions& options, std::int64_t period_ns,
              RealtimeGrant (*enter)(const RealtimeConfig&)) {
  if (!options.arm) return;
  if (!options.realtime) {
    if (options.without_realtime) return;
    throw Refused("driving motors takes --realtime (or --without-realtime, and late ticks)");
  }
  RealtimeConfig scheduling;
  scheduling.period_ns = period_ns;
  const RealtimeGrant grant = enter(scheduling);
  if (!grant.in_force() && !options.without_realtime) throw Refused(grant.problems);
}

/// Gives the mailbox each recorded wish when its tick comes.
class WishReplayer {
 public:
  explicit WishReplayer(const std::vector<RecordedWish>& wishes)
      : next_(wishes.begin()), end_(wishes.end()) {}
  void Observe(const TickRecord& record) {
    if (!first_tick_ && record.state == ExecutorState::kRunning) first_tick_ = record.tick;
    if (first_tick_ && next_ != end_ && record.tick + 1 >= *first_tick_ + next_->offset) {
      InterruptMailbox().Put(next_->wish);
      ++next_;
    }
  }

 private:
  std::optional<std::int64_t> first_tick_;
  std::vector<RecordedWish>::const_iterator next_;
  std::vector<RecordedWish>::const_iterator end_;
};

}  // namespace

std::vector<RecordedWish> WishesOf(FlightRecord& record) {
  std::vector<RecordedWish> wishes;
  record.Rewind();
  const auto entry = std::make_unique<TickEntry>();
  std::optional<std::int64_t> first_tick;
  ExecutorState before = ExecutorState::kDisarmed;
  while (record.Next(*entry)) {
    const bool in_motion = before == ExecutorState::kRunning || before == ExecutorState::kSettling;
    before = entry->record.state;
    if (!first_tick && before == ExecutorState::kRunning) first_tick = entry->tick;
    if (!first_tick || !in_motion) continue;
    const OperatorRequest request = RequestOf(entry->command);
    if (request == OperatorRequest::kNone) continue;
    RecordedWish& recorded = wishes.emplace_back();
    recorded.offset = entry->tick - *first_tick;
    recorded.wish.request = request;
    recorded.wish.branch = entry->branch;
  }
  return wishes;
}

RecordConfiguration ConfigurationToPlay(const RecordConfiguration& recorded,
                                        const RecordPlayOptions& options) {
  RecordConfiguration configuration = recorded;
  configuration.executor.last_known = {};    // of another day
  configuration.procedure.attended = false;  // One run, which starts by itself.
  if (std::int64_t& hold = configuration.procedure.end_hold_ticks; hold != 0)
    hold = options.arm ? -1 : 2'000'000'000 / configuration.period_ns;
  FileKeeper keeper;
  const FileReader read = keeper.reader();
  if (!options.primitive.empty()) {
    const SequenceFile motion = LoadMotion(options.primitive, read);
    if (motion.graph.edge_count > 0) {
      throw std::runtime_error(
          fmt::format("{}: is a sequence; --primitive takes a primitive", options.primitive));
    }
    configuration.motion_file = options.primitive;
    configuration.executor.cycles = 0;
    configuration.executor.branch = -1;
  }
  if (options.drives.empty() && configuration.drives_file.empty()) {
    throw std::runtime_error(
        "the record is of a simulation without a drives file: say with --drives which drives are "
        "on the bus");
  }
  if (!options.drives.empty()) {
    const DrivesConfig drives = LoadDrivesOf(configuration.joints, options.drives, read);
    if (std::llround(1e9 / drives.rate_hz) != configuration.period_ns) {
      throw std::runtime_error(fmt::format(
          "{}: rate_hz is {:.6g}, but the record's is {:.6g}: its setpoints belong to its ticks",
          options.drives, drives.rate_hz, 1e9 / static_cast<double>(configuration.period_ns)));
    }
    configuration.drives_file = options.drives;
    for (std::size_t i = 0; i < drives.drives.size(); ++i) {
      configuration.executor.joints[i] = JointConfigOf(drives.drives[i]);
    }
  }
  // A file that was read now replaces the one that was recorded under its name.
  for (const LoadedFile& file : keeper.files()) {
    std::erase_if(configuration.files,
                  [&file](const LoadedFile& other) { return other.path == file.path; });
    configuration.files.push_back(file);
  }
  return configuration;
}

PlayedRecord PlayRecord(const RecordConfiguration& configuration,
                        const std::vector<RecordedWish>& wishes, const RecordPlayOptions& options,
                        const std::string& record_file) {
  Assembly assembly = Assemble(configuration);
  const RunParts& parts = assembly.parts();
  CheckRanges(*parts.sequence, parts.drives);
  CheckSchedule(parts.drives, [](const std::string& text) { fmt::print(stderr, "{}\n", text); });
  CheckWatchdogs(parts.drives, !options.arm);
  Schedule(options, configuration.period_ns, TryRealtime);
  const InterfaceName name{options.bus, configuration.drives_file};
  const std::unique_ptr<World> world =
      options.arm ? MakeInterfaceWorld(name, parts.drives)
                  : MakeDryRunWorld(name, parts.drives, parts.StartPositions());
  const std::unique_ptr<FlightRecorder> recorder =
      OpenRecorder(record_file, DescribeForRecord(configuration, options, *world),
                   [](const std::string& text) { SayToOperator("tumbler-replay: " + text); });

  world->Open();
  Play play(assembly, *world, {nullptr, recorder.get()});
  CatchInterrupts();
  Schedule(options, configuration.period_ns, EnterRealtime);
  WishReplayer replayer(wishes);
  play.Run(configuration.procedure, configuration.period_ns,
           [&replayer](const ControlLoop& loop) { replayer.Observe(loop.record()); });
  recorder->Stop(ToString(play.procedure().outcome()));
  RunSummary ignored;
  world->Summarize(ignored);  // This discards frames that are still to be sent.
  return {play.procedure().outcome(), play.Reason(configuration.joints)};
}

}  // namespace tumbler
