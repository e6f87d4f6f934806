#include "offline/pages/recorded_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "common/files/sequence_toml.h"
#include "offline/pages/viewed_robot.h"
#include "offline/pages/viewed_run.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/message_readers.h"
#include "runtime/record/messages.h"
#include "runtime/record/record_export.h"
#include "runtime/record/recorded_assembly.h"

namespace tumbler {
namespace {

constexpr std::int64_t kFramesMax = 6000;
constexpr std::int64_t kEventsMax = 2000;
constexpr std::int64_t kFiguresEvery_ns = 250'000'000;  // as telemetry sends them

std::int64_t CountTicks(FlightRecord& record) {
  const auto entry = std::make_unique<TickEntry>();
  std::int64_t ticks = 0;
  while (record.Next(*entry)) ++ticks;
  record.Rewind();
  return ticks;
}

}  // namespace

RecordedRun RecordedView(const std::string& path) {
  const MappedFile file(path);
  FlightRecord record(file.bytes(), path);
  const std::int64_t ticks = CountTicks(record);
  if (ticks < 2) throw RecordError(fmt::format("{}: holds {} ticks", path, ticks));
  const RecordConfiguration& configuration = record.configuration();
  ViewedRobot robot(LoadMotion(configuration.motion_file, RecordedFiles(configuration)));
  ViewedRun run(&robot);
  const RunDescription about = DescribeRun(record.configuration());
  EventWatch watch(about);
  RunMessage figures(about);
  figures.SetScheduling(about.scheduling);
  Json frames = Json::Array(), events = Json::Array();
  const std::int64_t step = (ticks + kFramesMax - 1) / kFramesMax;
  std::optional<std::int64_t> figures_at_ns;
  state_t state;
  TimedRecords records = TimedRecordsOf(record.configuration());
  const auto entry = std::make_unique<TickEntry>();
  for (std::int64_t i = 0; record.Next(*entry); ++i) {
    for (const auto& bytes : record.truths()) {
      truth_t truth;
      if (ReadMessage(bytes, truth)) run.Take(truth);
    }
    const TimedRecord timed = records.Next(*entry);
    figures.Count(timed);
    if (!figures_at_ns || timed.time_ns >= *figures_at_ns + kFiguresEvery_ns) {
      run.Take(figures.At(timed.time_ns, 0, 0));
      figures_at_ns = timed.time_ns;
    }
    FillState(timed, state);
    run.Take(state);
    const std::optional<event_t> event = watch.Next(timed);
    if (event && static_cast<std::int64_t>(events.size()) < kEventsMax) {
      events.Append(ViewedRun::EventToJson(*event));
    }
    if (i % step == 0 || i + 1 == ticks) frames.Append(run.Frame());
  }
  RecordedRun recorded;
  recorded.data = {{"mode", "record"}, {"name", path},     {"scene", robot.Scene()},
                   {"ticks", ticks},   {"frames", frames}, {"events", events}};
  if (!record.damages().empty()) recorded.remarks = record.Remarks();
  return recorded;
}

}  // namespace tumbler
