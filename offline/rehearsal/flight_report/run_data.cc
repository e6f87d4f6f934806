#include "offline/rehearsal/flight_report/run_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>

#include "common/sequence_toml.h"
#include "firmware_interface/drives/logged_position.h"
#include "offline/rehearsal/flight_report/robot_paths.h"
#include "offline/rehearsal/flight_report/truth.h"
#include "runtime/linux/operator_mailbox.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/recorded_assembly.h"
#include "runtime/telemetry/sentences.h"

namespace tumbler {
namespace {

constexpr double kTurn_rad = 2 * std::numbers::pi;
/// Time between two samples of a run's plan. A display shows no finer motion.
constexpr double kPlanSpacing_s = 0.005;
/// A force below this does not count as a push.
constexpr double kPush_n = 1e-9;

double Seconds(std::int64_t ns) { return static_cast<double>(ns) / 1e9; }

bool InMotion(ExecutorState state) {
  return state == ExecutorState::kRunning || state == ExecutorState::kSettling;
}

/// Whether the setpoints of position take effect in this tick.
bool Controlled(const RunTick& tick) {
  return tick.state != ExecutorState::kDisarmed && tick.state != ExecutorState::kArming &&
         !(tick.state == ExecutorState::kFault && tick.reaction >= Reaction::kDamp);
}

class RunReader {
 public:
  RunReader(FlightRecord& record, const std::string& truth_log)
      : record_(record),
        configuration_(record.configuration()),
        motion_(LoadMotion(configuration_.motion_file,
                           [this](const std::string& path) { return TextOf(path); })),
        assembly_(Assemble(configuration_)),
        paths_(motion_) {
    run_.name = record.name();
    run_.recorded = true;
    run_.scene = paths_.scene();
    run_.robot_hash = motion_.primitives.front().provenance.robot_hash;
    run_.period_s = Seconds(configuration_.period_ns);
    if (run_.scene.joint_names != configuration_.joints) {
      throw RecordError(fmt::format("{}: its joints ({}) are not those of its motion ({})",
                                    run_.name, fmt::join(configuration_.joints, ", "),
                                    fmt::join(run_.scene.joint_names, ", ")));
    }
    for (const auto& [name, meaning] :
         {std::pair("wake-up", "from what the loop slept for to when it was awake"),
          std::pair("tick", "from when the loop was awake to all done"),
          std::pair("reply", "from handing a setpoint to the bus to the arrival of the reply"),
          std::pair("frame age", "from the arrival of a frame to the tick that took it")}) {
      run_.latencies.push_back({name, meaning, {}});
    }
    FindZero();
    ReadTicks();
    if (!truth_log.empty()) TakeTruthLog(truth_log);
    ReadTruths();
    MakePlan();
    for (RunLatency& latency : run_.latencies) {
      std::sort(latency.values_ns.begin(), latency.values_ns.end());
    }
    std::stable_sort(run_.events.begin(), run_.events.end(),
                     [](const RunEvent& a, const RunEvent& b) { return a.time_s < b.time_s; });
    Describe();
  }

  RunData Take() { return std::move(run_); }

 private:
  [[nodiscard]] std::string TextOf(const std::string& path) const {
    for (const LoadedFile& file : configuration_.files) {
      if (file.path == path) return file.text;
    }
    throw RecordError(fmt::format("{}: '{}' is not among its files", run_.name, path));
  }

  void FindZero() {
    const auto entry = std::make_unique<TickEntry>();
    bool any = false;
    while (record_.Next(*entry)) {
      if (!any || entry->record.state == ExecutorState::kRunning) {
        zero_ns_ = entry->notes.deadline_ns;
      }
      any = true;
      if (entry->record.state == ExecutorState::kRunning) break;
    }
    if (!any) throw RecordError(fmt::format("{}: holds no tick", run_.name));
    record_.Rewind();
  }

  void ReadTicks() {
    const auto entry = std::make_unique<TickEntry>();
    while (record_.Next(*entry)) {
      KeepTruths();
      AddTick(*entry);
    }
    KeepTruths();
    if (!run_.bands.empty() && in_band_) run_.bands.back().to_s = run_.ticks.back().time_s;
  }

  void KeepTruths() {
    for (const auto& bytes : record_.truths()) {
      truth_t& truth = truths_.emplace_back();
      if (!DecodeTruth(bytes, truth)) {
        throw RecordError(
            fmt::format("{}: the true state of the robot in it is of another version", run_.name));
      }
    }
  }

  void Event(double time_s, RunEvent::Kind kind, std::string text) {
    run_.events.push_back({time_s, kind, std::move(text)});
  }

  void AddTick(const TickEntry& entry) {
    const TickRecord& record = entry.record;
    RunTick tick;
    tick.time_s = Seconds(entry.notes.deadline_ns - zero_ns_);
    tick.tick = record.tick;
    tick.state = record.state;
    tick.reaction = record.reaction;
    tick.node = int{record.node};
    tick.primitive_time_s = double{record.primitive_time_s};
    const bool first = run_.ticks.empty();
    const RunTick before = first ? tick : run_.ticks.back();
    if (!first && tick.time_s <= before.time_s) {
      throw RecordError(
          fmt::format("{}: time goes backwards after {} ticks", run_.name, run_.ticks.size()));
    }
    AddEvents(entry, tick, before, first);
    AddLatencies(entry, !first && entry.index == index_before_ + 1);
    FollowBand(tick, before);
    index_before_ = entry.index;
    send_before_ns_ = entry.notes.send_ns;
    run_.ticks.push_back(tick);
    for (std::size_t j = 0; j < run_.joint_count(); ++j) {
      run_.joint_ticks.push_back(record.joints[j]);
    }
  }

  void AddEvents(const TickEntry& entry, const RunTick& tick, const RunTick& before, bool first) {
    const TickRecord& record = entry.record;
    const double t = tick.time_s;
    if (!first && entry.index > index_before_ + 1) {
      Event(t, RunEvent::Kind::kTiming,
            fmt::format("{} ticks were not recorded", entry.index - index_before_ - 1));
    } else if (!first && tick.tick > before.tick + 1) {
      Event(t, RunEvent::Kind::kTiming,
            fmt::format("{} control periods missed", tick.tick - before.tick - 1));
    }
    const TickNotes& notes = entry.notes;
    if (notes.request != 0 && (notes.request_id != request_id_ || notes.request != request_)) {
      std::string text =
          fmt::format("operator: {}", ToString(static_cast<OperatorRequest>(notes.request)));
      if (notes.request_refusal != Refusal::kNone) {
        text += fmt::format(", refused: {}", ToString(notes.request_refusal));
      }
      Event(t, RunEvent::Kind::kRequest, text);
    }
    request_id_ = notes.request_id;
    request_ = notes.request;
    if (record.command != OperatorCommand::kNone) {
      std::string text = ToString(record.command);
      if (record.command == OperatorCommand::kBranch) {
        text += fmt::format(" {}", motion_.graph.BranchName(entry.branch));
      }
      Event(t, RunEvent::Kind::kRequest, text);
      if (record.refusal.refusal != Refusal::kNone) {
        Event(t, RunEvent::Kind::kRefusal,
              tumbler::Describe(record.refusal, configuration_.joints));
      }
    }
    if (record.first_fault.fault != Fault::kNone &&
        (first_fault_.fault != record.first_fault.fault ||
         first_fault_.tick != record.first_fault.tick)) {
      Event(t, RunEvent::Kind::kFault,
            tumbler::Describe(record.first_fault, configuration_.joints));
    }
    first_fault_ = record.first_fault;
    for (std::size_t f = 1; f < kFaultCount; ++f) {
      const auto bit = std::uint32_t{1} << f;
      const auto fault = static_cast<Fault>(f);
      if ((record.faults & bit) != 0 && (faults_ & bit) == 0 && fault != record.first_fault.fault) {
        Event(t, RunEvent::Kind::kFault, fmt::format("also: {}", ToString(fault)));
      }
    }
    faults_ = record.faults;
    const bool new_node = tick.state == ExecutorState::kRunning && BeginsNode(tick, before);
    if (first || tick.state != before.state || new_node) {
      std::string text = ToString(tick.state);
      if (InMotion(tick.state)) {
        text += fmt::format(": {}", motion_.graph.node(tick.node).name.view());
      }
      if (tick.state == ExecutorState::kFault) {
        text += fmt::format(": {}", ToString(tick.reaction));
      }
      Event(t, RunEvent::Kind::kState, text);
    }
  }

  [[nodiscard]] static bool BeginsNode(const RunTick& tick, const RunTick& before) {
    return before.state != ExecutorState::kRunning || tick.node != before.node ||
           tick.primitive_time_s < before.primitive_time_s;
  }

  void AddLatencies(const TickEntry& entry, bool adjacent) {
    const TickNotes& times = entry.notes;
    run_.latencies[0].values_ns.push_back(times.awake_ns - times.due_ns);
    run_.latencies[1].values_ns.push_back(times.done_ns - times.awake_ns);
    for (const DriveEntry& drive : assembly_.parts().drives.drives) {
      if (!adjacent) break;
      for (const ReceivedFrame& received : entry.input().received) {
        if (received.time_ns < send_before_ns_) continue;
        if (!ReportedPosition(drive.config, received.frame)) continue;
        run_.latencies[2].values_ns.push_back(received.time_ns - send_before_ns_);
        break;
      }
    }
    for (const ReceivedFrame& received : entry.input().received) {
      run_.latencies[3].values_ns.push_back(times.awake_ns - received.time_ns);
    }
  }

  void FollowBand(const RunTick& tick, const RunTick& before) {
    const bool begins =
        tick.state == ExecutorState::kRunning && (run_.ticks.empty() || BeginsNode(tick, before));
    if (in_band_ && (begins || !InMotion(tick.state))) {
      run_.bands.back().to_s = tick.time_s;
      in_band_ = false;
    }
    if (!begins) return;
    in_band_ = true;
    run_.bands.push_back({tick.time_s, tick.time_s, tick.node,
                          std::string(motion_.graph.node(tick.node).name.view())});
  }

  /// Takes the truth from an LCM log, in place of the truth in the record.
  void TakeTruthLog(const std::string& path) {
    truths_.clear();
    for (LoggedTruth& logged : ReadTruthLog(path)) {
      logged.truth.time_ns = (logged.utime_us - configuration_.utime_at_zero_us) * 1000;
      const double t = Seconds(logged.truth.time_ns - zero_ns_);
      if (t < run_.ticks.front().time_s - 1 || t > run_.ticks.back().time_s + 1) continue;
      truths_.push_back(std::move(logged.truth));
    }
    if (truths_.empty()) {
      throw std::runtime_error(fmt::format("{}: holds nothing of the time of {}", path, run_.name));
    }
  }

  void ReadTruths() {
    std::string resting_as;
    bool fallen = false;
    std::array<double, 2> push{};
    for (const truth_t& truth : truths_) {
      const double t = Seconds(truth.time_ns - zero_ns_);
      if (!run_.truth.empty() && t <= run_.truth.back().time_s) continue;
      std::vector<double> position, velocity, torque;
      for (const std::string& name : configuration_.joints) {
        const auto joint = std::find_if(truth.joints.begin(), truth.joints.end(),
                                        [&name](const joint_truth_t& j) { return j.name == name; });
        if (joint == truth.joints.end()) {
          throw std::runtime_error(fmt::format("{}: its truth has no joint '{}'", run_.name, name));
        }
        position.push_back(joint->position_rad);
        velocity.push_back(joint->velocity_rad_s);
        torque.push_back(joint->torque_nm);
      }
      ReportSample sample =
          paths_.Pose({truth.root_x_m, truth.root_z_m, truth.root_pitch_rad}, position);
      sample.time_s = t;
      sample.joint_velocities_rad_s = velocity;
      sample.joint_torques_nm = torque;
      run_.truth.push_back(std::move(sample));
      if (truth.resting_as != resting_as && !truth.resting_as.empty()) {
        Event(t, RunEvent::Kind::kTruth, fmt::format("the robot rests {}", truth.resting_as));
      }
      if (truth.fallen != 0 && !fallen) Event(t, RunEvent::Kind::kTruth, "the robot has fallen");
      const bool pushed = std::hypot(push[0], push[1]) > kPush_n;
      const bool pushes = std::hypot(truth.push_x_n, truth.push_z_n) > kPush_n;
      if (pushes && !pushed) {
        Event(t, RunEvent::Kind::kTruth,
              fmt::format("the robot is pushed: {:.3g} N along x, {:.3g} N along z", truth.push_x_n,
                          truth.push_z_n));
      }
      resting_as = truth.resting_as;
      fallen = truth.fallen != 0;
      push = {truth.push_x_n, truth.push_z_n};
    }
    truths_.clear();
  }

  void MakePlan() {
    const std::size_t step =
        std::max<std::size_t>(1, static_cast<std::size_t>(kPlanSpacing_s / run_.period_s));
    double dx = 0, turn = 0;
    int node = run_.bands.empty() ? motion_.graph.start : run_.bands.front().node;
    std::optional<double> began;  // start of the present node [s]
    std::size_t band = 0;
    for (std::size_t i = 0; i < run_.ticks.size(); ++i) {
      const RunTick& tick = run_.ticks[i];
      if (band < run_.bands.size() && tick.time_s >= run_.bands[band].from_s) {
        const int next = run_.bands[band].node;
        if (began) {
          // The next node begins where this one ends.
          const ReportSample& end = run_.plan.back();
          const ReportSample& begin = paths_.PlanOf(next).front();
          dx = end.link_poses[0][0] - begin.link_poses[0][0];
          turn = kTurn_rad * std::round((end.root_pitch_rad - begin.root_pitch_rad) / kTurn_rad);
        }
        node = next;
        began = tick.time_s;
        ++band;
      } else if (i % step != 0 && i + 1 != run_.ticks.size()) {
        continue;
      }
      const double t = began ? PlanTime(i) : 0;
      ReportSample sample = paths_.PlanAt(node, t);
      sample.time_s = tick.time_s;
      Place(sample, dx, turn);
      run_.plan.push_back(std::move(sample));
    }
  }

  /// The primitive's own time at tick i [s]. It advances with the speed of the run, goes on past
  /// the primitive's end while that is held, and stands still once the motion was broken off.
  [[nodiscard]] double PlanTime(std::size_t i) {
    for (std::size_t k = last_running_; k <= i; ++k) {
      if (run_.ticks[k].state == ExecutorState::kRunning) last_running_ = k;
    }
    const RunTick& last = run_.ticks[last_running_];
    const bool ended = last_running_ + 1 < run_.ticks.size() &&
                       run_.ticks[last_running_ + 1].state == ExecutorState::kSettling;
    return last.primitive_time_s + (ended ? run_.ticks[i].time_s - last.time_s : 0);
  }

  void Fact(const std::string& name, std::string value) {
    run_.facts.emplace_back(name, std::move(value));
  }

  void Describe() {
    const RecordConfiguration& c = configuration_;
    Fact("outcome", record_.end() ? record_.end()->outcome : "the recording was interrupted");
    Fact("motion", std::string(motion_.graph.name.view()) + " (" + c.motion_file + ")");
    Fact("bus", fmt::format("{}{}{}", c.bus, c.dry_run ? ", dry run" : "",
                            c.virtual_time ? ", virtual time" : ""));
    Fact("rate, speed", fmt::format("{:.6g} Hz, {:.3g}", 1 / run_.period_s,
                                    static_cast<double>(c.executor.speed)));
    Fact("ticks", fmt::format("{} over {:.3f} s", run_.ticks.size(),
                              run_.ticks.back().time_s - run_.ticks.front().time_s));
    for (std::size_t j = 0; j < run_.joint_count(); ++j) DescribeJoint(j);
    DescribeTruth();
    Fact("made by", c.program);
    Fact("on", c.kernel);
    for (const Damage& damage : record_.damages()) {
      Fact("damaged", fmt::format("byte {}: {}", damage.offset, damage.what));
    }
    if (record_.cut_off()) Fact("cut off", fmt::format("after byte {}", record_.offset()));
  }

  void DescribeJoint(std::size_t j) {
    double error = 0, error_s = 0, torque = 0, torque_s = 0;
    std::int32_t age = 0;
    for (std::size_t i = 0; i < run_.ticks.size(); ++i) {
      const JointRecord& joint = run_.joint(i, j);
      const auto following = run_.FollowingError(i, j);
      if (following && !(std::abs(*following) <= error)) {
        error = std::abs(*following);
        error_s = run_.ticks[i].time_s;
      }
      const double measured = std::abs(double{joint.measured.torque_nm});
      if (joint.reply_age_ticks >= 0 && measured > torque) {
        torque = measured;
        torque_s = run_.ticks[i].time_s;
      }
      age = std::max(age, joint.reply_age_ticks);
    }
    const std::string& name = run_.scene.joint_names[j];
    Fact(name + ": following error at most", fmt::format("{:.5f} rad at {:.3f} s", error, error_s));
    Fact(name + ": measured torque at most",
         fmt::format("{:.3f} N·m at {:.3f} s", torque, torque_s));
    Fact(name + ": oldest reply", fmt::format("{} ticks", age));
  }

  void DescribeTruth() {
    if (run_.truth.empty()) return;
    double pitch = 0, pitch_s = 0;
    std::size_t k = 0;
    for (const ReportSample& truth : run_.truth) {
      while (k + 1 < run_.plan.size() && run_.plan[k + 1].time_s <= truth.time_s) ++k;
      const bool playing =
          std::any_of(run_.bands.begin(), run_.bands.end(), [&truth](const RunBand& band) {
            return truth.time_s >= band.from_s && truth.time_s <= band.to_s;
          });
      const double apart = std::abs(truth.root_pitch_rad - run_.plan[k].root_pitch_rad);
      if (playing && apart > pitch) {
        pitch = apart;
        pitch_s = truth.time_s;
      }
    }
    Fact("true root pitch off the plan by at most",
         fmt::format("{:.4f} rad at {:.3f} s, in motion", pitch, pitch_s));
  }

  FlightRecord& record_;
  const RecordConfiguration& configuration_;
  SequenceFile motion_;
  Assembly assembly_;
  RobotPaths paths_;
  RunData run_;
  std::int64_t zero_ns_ = 0;
  std::int64_t index_before_ = 0;
  std::int64_t send_before_ns_ = 0;
  FaultDetail first_fault_;
  std::uint32_t faults_ = 0;
  std::uint32_t request_id_ = 0;
  std::uint8_t request_ = 0;
  bool in_band_ = false;
  std::size_t last_running_ = 0;
  std::vector<truth_t> truths_;
};

}  // namespace

const char* ToString(RunEvent::Kind kind) {
  switch (kind) {
    case RunEvent::Kind::kState:
      return "state";
    case RunEvent::Kind::kRequest:
      return "request";
    case RunEvent::Kind::kRefusal:
      return "refusal";
    case RunEvent::Kind::kFault:
      return "fault";
    case RunEvent::Kind::kTiming:
      return "timing";
    case RunEvent::Kind::kTruth:
      return "truth";
  }
  return "?";
}

std::int64_t RunLatency::PercentileNs(double share) const {
  if (values_ns.empty()) return 0;
  const double at = std::ceil(share * static_cast<double>(values_ns.size())) - 1;
  return values_ns[static_cast<std::size_t>(std::max(at, 0.0))];
}

std::optional<double> RunData::FollowingError(std::size_t tick, std::size_t joint_index) const {
  const std::int32_t age = joint(tick, joint_index).reply_age_ticks;
  if (age < 0 || static_cast<std::size_t>(age) + 1 > tick || !Controlled(ticks[tick])) return {};
  const std::size_t asked = tick - 1 - static_cast<std::size_t>(age);
  if (!Controlled(ticks[asked])) return {};
  return double{joint(tick, joint_index).measured.position_rad} -
         double{joint(asked, joint_index).limited.position_rad};
}

RunData ReadRun(const std::string& path, const std::string& truth_log) {
  const MappedFile file(path);
  FlightRecord record(file.bytes(), path);
  return RunReader(record, truth_log).Take();
}

RunData ReadPlan(const std::string& path) {
  const SequenceFile motion = LoadMotion(path);
  if (motion.graph.edge_count > 0) {
    throw std::runtime_error(fmt::format(
        "{}: is a sequence, whose plan depends on how it is played: give its primitives, or the "
        "record of a run",
        path));
  }
  const PrimitiveFile& file = motion.primitives.front();
  const Primitive<double>& primitive = file.primitive;
  RobotPaths paths(motion);
  RunData run;
  run.name = path;
  run.scene = paths.scene();
  run.robot_hash = file.provenance.robot_hash;
  for (const ReportSample& step : paths.PlanOf(motion.graph.start)) {
    const bool last = &step == &paths.PlanOf(motion.graph.start).back();
    if (!last && !run.plan.empty() &&
        step.time_s < run.plan.back().time_s + kPlanSpacing_s - 1e-9) {
      continue;
    }
    ReportSample& sample = run.plan.emplace_back(step);
    for (std::size_t j = 0; j < primitive.motions().size(); ++j) {
      const auto position = primitive.joints[j].position.Evaluate(sample.time_s);
      const bool over = sample.time_s > primitive.duration_s;
      sample.joint_positions_rad[j] = position.value;
      sample.joint_velocities_rad_s[j] = over ? 0 : position.first;
      sample.joint_torques_nm[j] = primitive.joints[j].torque.Evaluate(sample.time_s).value;
    }
  }
  const std::string name(primitive.name.view());
  run.bands.push_back({0, primitive.duration_s, 0, name});
  run.facts = {{"outcome", "a plan, not a run"},
               {"motion", name + " (" + path + ")"},
               {"duration", fmt::format("{:.3f} s", primitive.duration_s)},
               {"made by", file.provenance.tool}};
  return run;
}

std::vector<RunDifference> Compare(const RunData& a, const RunData& b) {
  std::vector<RunDifference> differences;
  if (!a.recorded || !b.recorded || std::abs(a.period_s - b.period_s) > 1e-9) return differences;
  using Read = float (*)(const JointRecord&);
  struct Quantity {
    const char* name;
    const char* unit;
    Read read;
  };
  const auto quantities = {
      Quantity{"measured position", "rad",
               [](const JointRecord& j) { return j.measured.position_rad; }},
      Quantity{"measured velocity", "rad/s",
               [](const JointRecord& j) { return j.measured.velocity_rad_s; }},
      Quantity{"measured torque", "N·m", [](const JointRecord& j) { return j.measured.torque_nm; }},
      Quantity{"commanded position", "rad",
               [](const JointRecord& j) { return j.limited.position_rad; }}};
  const auto number = [](const RunData& run, std::size_t i) {
    return std::llround(run.ticks[i].time_s / run.period_s);
  };
  for (std::size_t j = 0; j < a.joint_count(); ++j) {
    for (const Quantity& quantity : quantities) {
      RunDifference difference{a.scene.joint_names[j], quantity.name, quantity.unit};
      double squares = 0;
      for (std::size_t i = 0, k = 0; i < a.ticks.size() && k < b.ticks.size();) {
        const auto at_a = number(a, i), at_b = number(b, k);
        if (at_a == at_b && a.ticks[i].time_s >= 0 && a.joint(i, j).reply_age_ticks >= 0 &&
            b.joint(k, j).reply_age_ticks >= 0) {
          const double apart =
              std::abs(double{quantity.read(b.joint(k, j))} - double{quantity.read(a.joint(i, j))});
          ++difference.ticks;
          squares += apart * apart;
          if (apart > difference.max) {
            difference.max = apart;
            difference.max_at_s = a.ticks[i].time_s;
          }
        }
        if (at_a <= at_b) ++i;
        if (at_b <= at_a) ++k;
      }
      if (difference.ticks > 0) {
        difference.rms = std::sqrt(squares / static_cast<double>(difference.ticks));
      }
      differences.push_back(difference);
    }
  }
  return differences;
}

}  // namespace tumbler
