#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/error_texts.h"
#include "firmware_interface/devices/logged_position.h"
#include "offline/pages/robot_paths.h"
#include "offline/pages/run_data.h"
#include "offline/pages/run_events.h"
#include "offline/pages/run_facts.h"
#include "offline/pages/run_plan.h"
#include "offline/pages/space_poses.h"
#include "offline/pages/truth.h"
#include "offline/problem/task_toml.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/message_readers.h"
#include "runtime/record/recorded_assembly.h"

namespace tumbler {
namespace {

double Seconds(std::int64_t ns) { return static_cast<double>(ns) / 1e9; }

/// Reads a flight record tick by tick.
class RunReader {
 public:
  RunReader(FlightRecord& record, const std::string& truth_log)
      : record_(record),
        configuration_(record.configuration()),
        motion_(LoadMotion(configuration_.motion_file, RecordedFiles(configuration_))),
        assembly_(Assemble(configuration_)),
        events_(motion_.graph, configuration_.joints, ErrorCodesOf(assembly_.parts().drives)) {
    run_.name = record.name();
    run_.recorded = true;
    FindRobot();
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
    if (paths_) AddPlan(run_, *paths_, motion_.graph.start);
    for (RunLatency& latency : run_.latencies) {
      std::sort(latency.values_ns.begin(), latency.values_ns.end());
    }
    run_.events = events_.Take();
    AddFacts(run_, record_, motion_.graph.name.view());
  }

  RunData Take() { return std::move(run_); }

 private:
  void FindRobot() {
    const PrimitiveFile& first = motion_.primitives.front();
    if (!first.entry.is_in_space()) {
      paths_.emplace(motion_);
      run_.scene = paths_->scene();
      run_.passive_names = paths_->passive_names();
      return;
    }
    const Problem problem = TaskOf(first, TaskSpaces::kPlaneAndSpace).problem;
    const SpaceScene& scene = problem.space->scene;
    run_.space.emplace();
    run_.space->bodies = BodiesOf(scene.robot);
    run_.space->obstacles = scene.obstacles;
    for (std::size_t j = 0; j < scene.robot.joint_count(); ++j) {
      const std::size_t dof = scene.robot.DofOfJoint(j);
      run_.scene.joint_names.push_back(scene.robot.tree.dofs[dof].name);
      run_.space->joint_hues.push_back(HueOf(scene.robot, static_cast<int>(dof)));
    }
    poses_.emplace(scene.robot);
    const PrimitivePose& entry = motion_.PrimitiveOf(motion_.graph.start).entry;
    entry_ = {{entry.root_x_m, entry.root_y_m, entry.root_z_m},
              entry.root_quaternion,
              entry.joint_positions_rad};
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
      space_truth_t& truth = truths_.emplace_back();
      if (!ReadMessage(bytes, truth)) {
        throw RecordError(
            fmt::format("{}: the true state of the robot in it is of another version", run_.name));
      }
    }
  }

  void AddTick(const TickEntry& entry) {
    const TickRecord& record = entry.record;
    const RunTick tick = TickOf(entry, zero_ns_);
    const RunTick* const before = run_.ticks.empty() ? nullptr : &run_.ticks.back();
    if (before != nullptr && tick.time_s <= before->time_s) {
      throw RecordError(
          fmt::format("{}: time goes backwards after {} ticks", run_.name, run_.ticks.size()));
    }
    const std::int64_t missing = before == nullptr ? 0 : entry.index - index_before_ - 1;
    events_.TakeTick(entry, tick, before, missing);
    AddLatencies(entry, before != nullptr && missing == 0);
    FollowBand(tick, before);
    index_before_ = entry.index;
    send_before_ns_ = entry.notes.send_ns;
    run_.ticks.push_back(tick);
    for (std::size_t j = 0; j < run_.joint_count(); ++j) {
      run_.joint_ticks.push_back(record.joints[j]);
    }
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

  void FollowBand(const RunTick& tick, const RunTick* before) {
    const bool begins = BeginsNode(tick, before);
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
    const std::vector<space_truth_t> own = std::exchange(truths_, {});
    for (LoggedTruth& logged : ReadTruthLog(path)) {
      std::int64_t& time_ns = logged.truth.truth.time_ns;
      time_ns = (logged.utime_us - configuration_.utime_at_zero_us) * 1000;
      const double t = Seconds(time_ns - zero_ns_);
      if (t < run_.ticks.front().time_s - 1 || t > run_.ticks.back().time_s + 1) continue;
      truths_.push_back(std::move(logged.truth));
    }
    if (truths_.empty()) {
      throw std::runtime_error(fmt::format("{}: holds nothing of the time of {}", path, run_.name));
    }
    if (const double apart = own.empty() ? ApartFromMeasured() : ApartFrom(own);
        apart > (own.empty() ? kMeasuredApart : kTrueApart)) {
      throw std::runtime_error(
          fmt::format("{}: is of another run than {}: a joint or the root is {:.3g} rad or m from "
                      "where the record {} it; allowed: the log of the same run",
                      path, run_.name, apart, own.empty() ? "measured" : "has"));
    }
  }

  /// How far a true state may be from what the same run recorded of it, and the median of how far a
  /// joint is from where it is measured: encoders and their zeros err, and replies are late.
  static constexpr double kTrueApart = 1e-3, kMeasuredApart = 0.2;

  /// The largest distance of the root or of a joint from true states of the same times.
  [[nodiscard]] double ApartFrom(const std::vector<space_truth_t>& own) const {
    constexpr std::int64_t kSame_ns = 500'000;
    double apart = 0;
    auto at = own.begin();
    for (const space_truth_t& state : truths_) {
      const truth_t& truth = state.truth;
      while (at != own.end() && at->truth.time_ns < truth.time_ns - kSame_ns) ++at;
      if (at == own.end()) break;
      if (at->truth.time_ns > truth.time_ns + kSame_ns) continue;
      apart = std::max({apart, std::abs(truth.root_x_m - at->truth.root_x_m),
                        std::abs(state.root_y_m - at->root_y_m),
                        std::abs(truth.root_z_m - at->truth.root_z_m)});
      for (std::size_t j = 0; j < std::min(truth.joints.size(), at->truth.joints.size()); ++j) {
        apart = std::max(apart,
                         std::abs(truth.joints[j].position_rad - at->truth.joints[j].position_rad));
      }
    }
    return apart;
  }

  /// Of the joint of which it is the largest, the median of its distance from where it is measured.
  [[nodiscard]] double ApartFromMeasured() const {
    double largest = 0;
    for (std::size_t j = 0; j < run_.joint_count(); ++j) {
      std::vector<double> apart;
      std::size_t i = 0;
      for (const space_truth_t& state : truths_) {
        const double t = Seconds(state.truth.time_ns - zero_ns_);
        while (i + 1 < run_.ticks.size() && run_.ticks[i].time_s < t) ++i;
        const JointRecord& measured = run_.joint(i, j);
        const auto joint =
            std::ranges::find(state.truth.joints, configuration_.joints[j], &joint_truth_t::name);
        if (measured.reply_age_ticks < 0 || joint == state.truth.joints.end()) continue;
        apart.push_back(
            std::abs(joint->position_rad - static_cast<double>(measured.measured.position_rad)));
      }
      if (apart.empty()) continue;
      std::ranges::nth_element(apart,
                               apart.begin() + static_cast<std::ptrdiff_t>(apart.size() / 2));
      largest = std::max(largest, apart[apart.size() / 2]);
    }
    return largest;
  }

  void ReadTruths() {
    std::optional<double> before_s;
    for (const space_truth_t& state : truths_) {
      const truth_t& truth = state.truth;
      const double t = Seconds(truth.time_ns - zero_ns_);
      if (before_s && t <= *before_s) continue;
      before_s = t;
      if (IsInSpace(state) != run_.space.has_value()) {
        throw RecordError(fmt::format("{}: its truth is of a robot {}, and its motion of one {}",
                                      run_.name, IsInSpace(state) ? "in space" : "in the plane",
                                      run_.space ? "in space" : "in the plane"));
      }
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
      events_.TakeTruth(t, state);
      if (run_.space) {
        SpacePosture posture{{truth.root_x_m, state.root_y_m, truth.root_z_m}, {}, position};
        std::ranges::copy(state.root_quaternion, posture.root_quaternion.begin());
        run_.space->frames.push_back({t, poses_->At(posture), {}});
        run_.space->true_root = true;
        continue;
      }
      ReportSample sample = paths_->Pose({truth.root_x_m, truth.root_z_m, truth.root_pitch_rad},
                                         position, PassiveOf(truth, paths_->passive_names()));
      sample.time_s = t;
      sample.joint_velocities_rad_s = velocity;
      sample.joint_torques_nm = torque;
      run_.truth.push_back(std::move(sample));
    }
    truths_.clear();
    if (run_.space && run_.space->frames.empty()) TakeMeasured();
  }

  /// Frames of the measured joints alone, where nothing tells where the root was.
  void TakeMeasured() {
    SpacePosture posture = entry_;
    for (std::size_t i = 0; i < run_.ticks.size(); ++i) {
      for (std::size_t j = 0; j < run_.joint_count(); ++j) {
        const JointRecord& joint = run_.joint(i, j);
        if (joint.reply_age_ticks >= 0)
          posture.joints_rad[j] = static_cast<double>(joint.measured.position_rad);
      }
      run_.space->frames.push_back({run_.ticks[i].time_s, poses_->At(posture), {}});
    }
  }

  FlightRecord& record_;
  const RecordConfiguration& configuration_;
  SequenceFile motion_;
  Assembly assembly_;
  std::optional<RobotPaths> paths_;  // in the plane
  std::optional<SpacePoses> poses_;  // in space
  SpacePosture entry_;               // likewise
  RunEvents events_;
  RunData run_;
  std::int64_t zero_ns_ = 0;
  std::int64_t index_before_ = 0;
  std::int64_t send_before_ns_ = 0;
  bool in_band_ = false;
  std::vector<space_truth_t> truths_;
};

}  // namespace

RunData ReadRun(const std::string& path, const std::string& truth_log) {
  const MappedFile file(path);
  FlightRecord record(file.bytes(), path);
  return RunReader(record, truth_log).Take();
}

}  // namespace tumbler
