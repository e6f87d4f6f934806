#include "runtime/run/record_play.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "common/files/toml_reader.h"
#include "runtime/assembly/interrupts.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/record/recorded_assembly.h"
#include "runtime/run/run_program.h"

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

/// Whether the operator has ended the motion.
bool EndsBy(const std::vector<RecordedWish>& wishes) {
  return std::ranges::any_of(wishes, [](const RecordedWish& recorded) {
    return recorded.wish.request != OperatorRequest::kBranch;
  });
}

/// Says of the drives of now what is otherwise than at the recorded ones.
void CompareDrives(const RecordToPlay& record, const RunOptions& options) {
  const RecordConfiguration& was = record.configuration;
  if (options.drives.empty() || was.drives_file.empty()) return;
  const DrivesConfig now = LoadDrivesOf(was.joints, options.drives, ReadTextFile);
  const DrivesConfig then = LoadDrivesOf(was.joints, was.drives_file, RecordedFiles(was));
  for (std::size_t i = 0; i < was.joints.size(); ++i) {
    const DriveEntry &a = now.drives[i], &b = then.drives[i];
    const JointMap &map = JointOf(a.config), &old = JointOf(b.config);
    const auto compare = [&](const char* what, double is, double was_then) {
      if (is == was_then) return;
      fmt::print(stderr,
                 "note: joint {}: {} is {:.6g}; it was {:.6g} in the run that was recorded\n",
                 was.joints[i], what, is, was_then);
    };
    compare("direction", map.direction, old.direction);
    compare("gear_ratio", map.gear_ratio, old.gear_ratio);
    compare("zero_offset_rad", map.zero_offset_rad, old.zero_offset_rad);
    compare("watchdog_s", a.watchdog_s, b.watchdog_s);
  }
}

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

std::optional<RunSummary> PlayRecord(const RecordToPlay& record, RunOptions options) {
  RecordConfiguration recorded = record.configuration;
  RunSource source;
  source.recorded = &recorded;
  source.record_name = record.name;
  source.given = record.given;
  if (record.primitive.empty()) {
    options.motion = recorded.motion_file;
    source.motion = RecordedFiles(recorded);
    options.cycles = recorded.executor.cycles;
    options.ended_by_record = recorded.executor.branch >= 0 || EndsBy(record.wishes);
    if (!options.arm && options.cycles == 0 && !options.ended_by_record &&
        LoadMotion(options.motion, source.motion).graph.edge_count > 0) {
      throw std::runtime_error(fmt::format(
          "{}: {} goes round until it is stopped, and no request in the record ends it: a dry run "
          "would have no end",
          record.name, options.motion));
    }
  } else {
    options.motion = record.primitive;
    recorded.executor.cycles = 0;
    recorded.executor.branch = -1;
    if (LoadMotion(record.primitive).graph.edge_count > 0) {
      throw std::runtime_error(
          fmt::format("{}: is a sequence; --motion takes a primitive", record.primitive));
    }
  }
  options.speed = std::min(1.0, static_cast<double>(recorded.executor.speed));
  options.hold_s = 1e-9 * static_cast<double>(recorded.procedure.hold_ticks * recorded.period_ns);
  if (options.drives.empty()) {
    if (options.arm || recorded.drives_file.empty()) {
      throw std::runtime_error(fmt::format(
          "{}: {}: say with --drives which drives are on the bus", record.name,
          recorded.drives_file.empty()
              ? "is of a simulation without a drives file"
              : "its drives are those of that day, and zeros and limits may have changed"));
    }
    options.drives = recorded.drives_file;
    source.drives = RecordedFiles(recorded);
  } else if (record.primitive.empty()) {
    CompareDrives(record, options);
  }
  WishReplayer replayer(record.wishes);
  source.each_tick = [&replayer](const ControlLoop& loop) { replayer.Observe(loop.record()); };
  return PlayRun(std::move(options), nullptr, source);
}

}  // namespace tumbler
