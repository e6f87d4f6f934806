#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "runtime/assembly/assembly.h"
#include "runtime/assembly/service_notice.h"
#include "runtime/executor/run_procedure.h"
#include "runtime/record/flight_recorder.h"
#include "runtime/record/record_configuration.h"
#include "runtime/record/tick_feed.h"
#include "runtime/run/control_loop.h"
#include "runtime/run/run_summary.h"
#include "runtime/run/world.h"

namespace tumbler {

/// An assembled run in its world, from the first tick to the last.
class Play {
 public:
  /// All of these must outlive the play. In real time this starts the threads of the feed, and
  /// the one that tells a service manager of the loop. So make the object before the thread of the
  /// loop gets a real-time policy, which they must not inherit.
  Play(Assembly& assembly, World& world, TickFeed& feed);

  /// Runs the loop until the procedure is over, with InterruptMailbox for the operator. In virtual
  /// time the feed is drained after every tick.
  /// @param each_tick  called after every tick; may be empty.
  void Run(const RunProcedureConfig& config, std::int64_t period_ns,
           const std::function<void(const ControlLoop&)>& each_tick = {});

  // After the run:
  [[nodiscard]] const RunProcedure& procedure() const { return *procedure_; }
  [[nodiscard]] const ControlLoop& loop() const { return *loop_; }
  /// Adds to the summary, which has the joints, how the run ended and the loop's figures.
  void Conclude(RunSummary& summary) const;

 private:
  /// A sentence about the fault or the refusal that ended the run; empty if neither did.
  [[nodiscard]] std::string Reason(const std::vector<std::string>& joints) const;
  /// What a drive says of its error, to be added to a sentence; empty if nothing.
  [[nodiscard]] std::string DriveProblem(int joint) const;

  Assembly& assembly_;
  World& world_;
  TickFeed& feed_;
  std::unique_ptr<RunProcedure> procedure_;
  std::unique_ptr<ControlLoop> loop_;
  std::unique_ptr<ServiceNotice> service_;  // until the loop is over
};

/// Time 0 of the world's clock, in microseconds since 1970; 0 in virtual time.
[[nodiscard]] std::int64_t UtimeAtZero(World& world);

/// Opens the record of a run. From then on a limit on the size of files ends the recording, as a
/// full disk does, and not the program.
/// @param say  gets messages, on another thread; must not block.
/// @throws std::runtime_error naming the file when it exists already or cannot be written.
[[nodiscard]] std::unique_ptr<FlightRecorder> OpenRecorder(
    const std::string& file, const RecordConfiguration& configuration,
    std::function<void(const std::string&)> say);

/// Completes the record with what the summary says of the run, and adds to it what was recorded.
void StopRecorder(FlightRecorder& recorder, RunSummary& summary, const Patience& patience = {});

}  // namespace tumbler
