#include "runtime/run/play.h"

#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <utility>

#include "firmware_interface/devices/error_texts.h"
#include "runtime/assembly/interrupts.h"
#include "runtime/record/sentences.h"

namespace tumbler {
namespace {

/// Takes what has come since the bus was opened: it does not tell how the drives are now.
void DropOldFrames(CanBus& bus) {
  constexpr int kMost = 100'000;  // Somebody may send without end.
  ReceivedFrame ignored;
  for (int i = 0; i < kMost && bus.Receive(ignored) == Status::kOk; ++i) {
  }
}

}  // namespace

Play::Play(Assembly& assembly, World& world, TickFeed& feed)
    : assembly_(assembly), world_(world), feed_(feed) {
  if (!world_.real_time()) return;
  feed_.Start();
  service_ = std::make_unique<ServiceNotice>(ServiceManager::FromEnvironment());
  service_->Start();
}

void Play::Run(const RunProcedureConfig& config, std::int64_t period_ns,
               const std::function<void(const ControlLoop&)>& each_tick) {
  procedure_ = std::make_unique<RunProcedure>(config);
  Clock& clock = world_.clock();
  if (world_.real_time()) DropOldFrames(world_.bus());
  const std::int64_t start_ns = world_.real_time() ? clock.now_ns() + period_ns : 0;
  loop_ =
      std::make_unique<ControlLoop>(ControlLoop::Parts{assembly_.executor(), world_.bus(), clock,
                                                       *procedure_, InterruptMailbox(), &feed_},
                                    period_ns, start_ns);
  while (loop_->Step()) {
    if (service_) service_->NoteTick();
    world_.Observe(*loop_);
    if (each_tick) each_tick(*loop_);
    if (!world_.real_time()) feed_.Drain();
  }
  service_.reset();
}

void Play::Conclude(RunSummary& summary) const {
  summary.cycles = loop_->record().cycles;
  summary.runs = procedure_->runs();
  summary.outcome = procedure_->outcome();
  summary.reason = Reason(summary.joints);
  if (summary.reason.empty() && summary.outcome == RunOutcome::kStopped)
    summary.reason = "stopped by the operator";
  summary.statistics = loop_->statistics();
}

std::string Play::Reason(const std::vector<std::string>& joints) const {
  const std::vector<std::string> error_codes = ErrorCodesOf(assembly_.parts().drives);
  const FaultDetail& fault = loop_->record().first_fault;
  const bool concerns_drive =
      fault.fault == Fault::kDriveError || fault.fault == Fault::kArmingTimeout;
  if (fault.fault != Fault::kNone) {
    return Describe(fault, joints, error_codes) + (concerns_drive ? DriveProblem(fault.joint) : "");
  }
  if (procedure_->outcome() != RunOutcome::kRefused) return "";
  const RefusalDetail& refusal = procedure_->refusal();
  return Describe(refusal, joints, error_codes) +
         (refusal.refusal == Refusal::kDriveError ? DriveProblem(refusal.joint) : "");
}

std::string Play::DriveProblem(int joint) const {
  const auto index = static_cast<std::size_t>(joint);
  if (joint < 0 || index >= assembly_.drives().size()) return "";
  const Drive& drive = *assembly_.drives()[index];
  const DriveConfig& config = assembly_.parts().drives.drives[index].config;
  const std::uint32_t error = drive.feedback().error;
  const bool refused = drive.set_up_refusal().code != 0;  // That is its error, then.
  return (error == 0 || refused ? "" : "; it reports " + DescribeDriveError(config, error)) +
         DescribeRemarks(config, drive);
}

std::int64_t UtimeAtZero(World& world) {
  if (!world.real_time()) return 0;
  const auto since_epoch = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(since_epoch).count() -
         world.clock().now_ns() / 1000;
}

std::unique_ptr<FlightRecorder> OpenRecorder(const std::string& file,
                                             const RecordConfiguration& configuration,
                                             std::function<void(const std::string&)> say) {
  std::signal(SIGXFSZ, SIG_IGN);
  FlightRecorderConfig config;
  config.file = file;
  config.configuration = EncodeConfiguration(configuration);
  config.ring_bytes =
      RingBytes(configuration.joints.size(), 1e9 / static_cast<double>(configuration.period_ns));
  config.say = std::move(say);
  return std::make_unique<FlightRecorder>(config);
}

void StopRecorder(FlightRecorder& recorder, RunSummary& summary, const Patience& patience) {
  recorder.Stop(ToOutcome(summary), patience);
  summary.recorded_ticks = recorder.recorded();
  summary.unrecorded_ticks = recorder.pushed() - recorder.recorded();
  summary.record_problem = recorder.problem();
}

}  // namespace tumbler
