#include "offline/studies/recorded_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <tuple>
#include <utility>
#include <variant>

#include "common/files/primitive_hash.h"
#include "common/files/sequence_toml.h"
#include "firmware_interface/can/frame_length.h"
#include "firmware_interface/devices/drive_bank.h"
#include "firmware_interface/devices/mit.h"
#include "offline/problem/simulated_motion.h"
#include "offline/twin/simulated_robot.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/record_export.h"
#include "runtime/record/recorded_assembly.h"

namespace tumbler {
namespace {

constexpr double kUnanswered = std::numeric_limits<double>::quiet_NaN();

/// A motion of which less was recorded tells nothing.
constexpr double kLeast_s = 0.2;

double Seconds(std::int64_t ns) { return 1e-9 * static_cast<double>(ns); }

/// The value that one in `of` is below; 0 of none.
double OneIn(std::size_t of, std::vector<double> values) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / of);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}
double Median(std::vector<double> values) { return OneIn(2, std::move(values)); }

/// Whatever stands still between a robot and the host's clock makes a reply later, and nothing
/// makes it earlier, so that those which are back soonest tell most truly when their setpoints came
/// (as in the clock filter of NTP, RFC 5905, section 10): one in so many. Of those that take longer
/// by more than this is not known when their readings were sampled [s].
constexpr std::size_t kSoonest = 10;
constexpr double kLater_s = 30e-6;

/// Step of a reply's position at the shaft [rad] and whether the wire rounds it downwards; 0:
/// floats.
double WireStep(const DriveConfig& config) {
  if (const auto* mit = std::get_if<MitConfig>(&config)) {
    const DriveRange& range = mit->reply.position_rad;
    return (static_cast<double>(range.max) - static_cast<double>(range.min)) / 65535;
  }
  if (const auto* cia402 = std::get_if<Cia402Config>(&config))
    return 2 * std::numbers::pi / static_cast<double>(cia402->position_units_per_turn);
  return 0;
}

/// Gains as they arrive.
std::pair<double, double> GainsOnWire(const DriveEntry& entry) {
  float kp = entry.kp_nm_per_rad, kd = entry.kd_nm_s_per_rad;
  if (const auto* mit = std::get_if<MitConfig>(&entry.config)) {
    const auto sent = [&](float gain, const DriveRange& range) {
      const std::uint16_t code = MitQuantise(mit->joint.ToDriveGain(gain), range, 12);
      return mit->joint.ToJointGain(MitDequantise(code, range, 12));
    };
    kp = sent(kp, mit->command.kp_nm_per_rad);
    kd = sent(kd, mit->command.kd_nm_s_per_rad);
  }
  return {static_cast<double>(kp), static_cast<double>(kd)};
}

/// Of a drive whose encoder and wire both round downwards. The steps are nearly alike, so that what
/// the wire rounds away is no noise: it changes slowly with the angle. But an interval of the wire
/// has one count of the encoder in it.
class CountReader {
 public:
  CountReader(const JointMap& joint, double encoder_rad, double wire_rad)
      : ratio_(static_cast<double>(joint.direction * joint.gear_ratio)),
        zero_rad_(static_cast<double>(joint.zero_offset_rad)),
        step_rad_(encoder_rad >= wire_rad && wire_rad > 0 ? encoder_rad : 0) {}
  /// Whether counts can be told.
  [[nodiscard]] bool tells() const { return step_rad_ > 0; }
  /// What the encoder read where the wire brought this [rad].
  [[nodiscard]] double Of(double reading_rad) const {
    if (!tells()) return reading_rad;
    constexpr double kFloat_rad = 5e-6;  // what single precision leaves of 12.5 rad
    const double shaft_rad = ratio_ * (reading_rad - zero_rad_);
    return std::ceil((shaft_rad - kFloat_rad) / step_rad_) * step_rad_ / ratio_ + zero_rad_;
  }

 private:
  double ratio_, zero_rad_, step_rad_;
};

double EncoderStep(const ReadingSettings& settings) {
  return settings.encoder_counts_per_turn == 0
             ? 0.0
             : 2 * std::numbers::pi / settings.encoder_counts_per_turn;
}

CountReader CountsOf(const DriveEntry& entry, const ReadingSettings& settings) {
  return {JointOf(entry.config), EncoderStep(settings), WireStep(entry.config)};
}

RecordedDrive DriveOf(const DriveEntry& entry, double torque_max_nm,
                      const ReadingSettings& settings) {
  RecordedDrive drive;
  std::tie(drive.kp, drive.kd) = GainsOnWire(entry);
  drive.torque_max_nm = torque_max_nm;
  drive.motor = entry.motor;
  const JointMap& joint = JointOf(entry.config);
  const double per_shaft = 1 / (static_cast<double>(joint.direction * joint.gear_ratio));
  const double encoder = per_shaft * EncoderStep(settings);
  const double wire = CountsOf(entry, settings).tells() ? 0.0 : per_shaft * WireStep(entry.config);
  drive.encoder_bias_rad = -0.5 * encoder;
  drive.wire_bias_rad = -0.5 * wire;
  drive.noise_rad = std::sqrt((encoder * encoder + wire * wire) / 12);
  return drive;
}

/// Whether a drive samples its joint as this frame ends.
bool SamplesAt(const DriveConfig& drive, const CanFrame& frame) {
  return DriveProtocols::With(drive, [&frame](auto protocol, const auto& config) {
    return decltype(protocol)::SamplesAt(config, frame);
  });
}

/// What is kept of a tick until the next one brings the replies.
struct KeptTick {
  ExecutorState state = ExecutorState::kDisarmed;
  std::int64_t tick = 0;
  std::int64_t deadline_ns = 0, send_ns = 0;
  std::int64_t host_bits = 0, reply_bits = 0;
  std::int64_t last_reply_ns = 0;
  bool fault = false;
  std::vector<RecordedJoint> joints;
  std::vector<double> arrival_bits;
};

class Reader {
 public:
  Reader(const std::string& path, const ReadingSettings& settings)
      : settings_(settings),
        file_(path),
        record_(file_.bytes(), path),
        timed_(TimedRecordsOf(record_.configuration())) {}

  RecordedMotion Read() {
    const RecordConfiguration& configuration = record_.configuration();
    if (configuration.dry_run)
      Fail("is of a dry run, in which nothing was sent; play the motion on the robot");
    const FileReader read = RecordedFiles(configuration);
    RunParts parts = LoadRunMotion(configuration.motion_file, read);
    parts.drives =
        LoadDrivesOf(configuration.joints, configuration.drives_file, read, GainsOf(parts.file));
    const PrimitiveFile& first = parts.file.PrimitiveOf(parts.file.graph.start);
    RecordedMotion result;
    result.name = record_.name();
    result.motion_name = std::string(parts.file.graph.name.view());
    result.scene = SimulatedMotion(parts.file).scene();
    result.start = StartOf(parts.file);
    result.robot_text = first.provenance.robot_urdf;
    result.robot_file = first.provenance.robot_file;
    result.task_text = first.provenance.task_toml;
    result.task_file = first.provenance.task_file;
    result.drives = parts.drives;
    result.periods_with_ticks = configuration.virtual_time;
    simulated_ = configuration.bus == "sim";
    result.drives_file = configuration.drives_file;
    if (!result.drives_file.empty()) result.drives_text = read(result.drives_file);
    // A robot that is simulated at a slower pace has its time: that of its drives' rate.
    const double pace = 1 / (parts.drives.rate_hz * Seconds(configuration.period_ns));
    if (std::abs(pace - 1) > 1e-3) pace_ = pace;
    result.tick_s = pace_ * Seconds(configuration.period_ns);
    for (std::size_t j = 0; j < configuration.joints.size(); ++j) {
      result.joints.push_back(
          DriveOf(parts.drives.drives[j], LargestTorqueLimit(parts.file, j), settings_));
    }
    joints_ = result.joints.size();
    bit_s_ = 1.0 / result.drives.bit_rate;
    for (const DriveEntry& drive : parts.drives.drives) {
      if (bank_.Add(drive.config) != Status::kOk) Fail("has drives that cannot be");
      counts_.push_back(CountsOf(drive, settings_));
      configs_.push_back(drive.config);
      answers_.push_back(false);
    }
    TakeTicks();
    Choose(result);
    return result;
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw RecordError(fmt::format("{}: {}", record_.name(), what));
  }

  void TakeTicks() {
    const auto entry = std::make_unique<TickEntry>();
    while (record_.Next(*entry)) {
      const TimedRecord timed = timed_.Next(*entry);
      if (!kept_.empty()) TakeReplies(*entry, timed);
      kept_.push_back(Keep(*entry));
    }
  }

  KeptTick Keep(const TickEntry& entry) {
    KeptTick kept;
    kept.state = entry.record.state;
    kept.tick = entry.tick;
    kept.deadline_ns = entry.notes.deadline_ns;
    kept.send_ns = entry.notes.send_ns;
    kept.fault = entry.record.faults != 0;
    for (std::size_t j = 0; j < joints_; ++j) {
      const JointSetpoint& encoded = entry.record.joints[j].encoded;
      RecordedJoint joint;
      joint.setpoint = {static_cast<double>(encoded.position_rad),
                        static_cast<double>(encoded.velocity_rad_s),
                        static_cast<double>(encoded.torque_nm)};
      joint.reading_rad = joint.sampled_s = kUnanswered;
      for (const CanFrame& frame : entry.frames[j].frames()) {
        kept.host_bits += FrameBits(frame);
        if (SamplesAt(configs_[j], frame)) answers_[j] = true;
      }
      kept.arrival_bits.push_back(static_cast<double>(kept.host_bits - kIntermissionBits));
      kept.joints.push_back(joint);
    }
    return kept;
  }

  /// Gives what a tick has received to the ticks before it that were answered.
  void TakeReplies(const TickEntry& next, const TimedRecord& timed) {
    if (next.tick != kept_.back().tick + 1) return;
    std::vector<KeptTick*> answered(joints_, &kept_.back());
    for (std::size_t i = 0; i < next.received_count; ++i) {
      const ReceivedFrame& received = next.received[i];
      KeptTick* of = &kept_.back();
      for (std::size_t j = 0; j < joints_; ++j) {
        if (!bank_.drives()[j]->Decode(received.frame)) continue;
        of = &Answered(received, j);
        answered[j] = of;
        break;
      }
      of->reply_bits += FrameBits(received.frame);
      of->last_reply_ns = std::max(of->last_reply_ns, received.time_ns);
    }
    for (std::size_t j = 0; j < joints_; ++j) {
      const JointRecord& joint = next.record.joints[j];
      const bool fresh = joint.reply_age_ticks == 0 && joint.reply_status != ReplyStatus::kRepeated;
      if (!fresh) continue;
      answered[j]->joints[j].reading_rad =
          counts_[j].Of(static_cast<double>(joint.measured.position_rad));
      // Of what answers the tick before nothing tells when its frames ended.
      if (answers_[j] && answered[j] != &kept_.back()) continue;
      answered[j]->joints[j].sampled_s =
          pace_ * (1e-6 * static_cast<double>(timed.reply_sampled_us[j]) +
                   Seconds(timed.time_ns - answered[j]->deadline_ns));
    }
  }

  /// The tick whose setpoint a reply answers: the last one, unless that could not have come to the
  /// drive and the reply back by then. So it is where a host is late by most of a period. Of a
  /// simulated robot it is reckoned from the tick: in real time it stands still while it is
  /// reckoned with, so that the clock has gone on when setpoints are sent.
  [[nodiscard]] KeptTick& Answered(const ReceivedFrame& received, std::size_t joint) {
    KeptTick& last = kept_.back();
    const double bits = last.arrival_bits[joint] +
                        static_cast<double>(FrameBits(received.frame) - kIntermissionBits);
    const std::int64_t sent_ns = simulated_ ? last.deadline_ns : last.send_ns;
    const bool too_early = pace_ * Seconds(received.time_ns - sent_ns) < bits * bit_s_;
    if (!too_early || kept_.size() < 2) return last;
    KeptTick& before = kept_[kept_.size() - 2];
    return before.tick + 1 == last.tick ? before : last;
  }

  /// Of the kept ticks: where the hold before the motion begins, where the motion does, and where
  /// what can be used of it and its settling ends.
  struct Parts {
    std::size_t holds = 0, begins = 0, end = 0;
  };

  /// Takes hold, motion and settling.
  void Choose(RecordedMotion& result) {
    if (kept_.empty()) Fail("holds no tick");
    Parts parts;
    FindBeginning(result, parts);
    FindEnd(result, parts);
    result.begins = parts.begins - parts.holds;
    FindLateness(parts, result);
    TakeTicks(parts, result);
    RequireMotion(result);
  }

  [[nodiscard]] bool Is(std::size_t kept, ExecutorState state) const {
    return kept_[kept].state == state;
  }

  /// Sets holds and begins.
  void FindBeginning(RecordedMotion& result, Parts& parts) {
    std::size_t begins = 0;
    while (begins < kept_.size() && !Is(begins, ExecutorState::kRunning)) ++begins;
    if (begins == kept_.size()) {
      Fail(fmt::format("no motion was played in its {:.3g} s; play one of tumbler identify excite",
                       static_cast<double>(kept_.size()) * result.tick_s));
    }
    // A motion may begin with a hold of its own.
    std::size_t holds = begins;
    while (holds > 0 && Is(holds - 1, ExecutorState::kHolding) && Holds(holds - 1, begins)) --holds;
    const std::size_t first = begins;
    while (begins + 1 < kept_.size() && Is(begins + 1, ExecutorState::kRunning) &&
           Holds(begins + 1, first)) {
      ++begins;
    }
    if (begins - holds < Ticks(settings_.hold_min_s, result)) {
      result.rested = false;
      result.remarks.push_back(fmt::format(
          "the robot was held for {:.3g} s before its motion; it is taken to have rested, "
          "which takes {:.3g} s to see",
          static_cast<double>(begins - holds) * result.tick_s, settings_.hold_min_s));
    }
    parts.holds = std::max(holds, begins - std::min(begins, Ticks(settings_.hold_s, result)));
    parts.begins = begins;
  }

  /// Sets end.
  void FindEnd(RecordedMotion& result, Parts& parts) {
    std::size_t end = parts.begins, settles = 0;
    const char* cut = nullptr;
    while (end < kept_.size()) {
      if (kept_[end].fault) {
        cut = "a fault";
      } else if (end > 0 && kept_[end].tick != kept_[end - 1].tick + 1) {
        cut = record_.damages().empty() && record_.lost().empty()
                  ? "missed periods"
                  : "ticks that the record has lost";
      }
      if (cut != nullptr) break;
      if (Is(end, ExecutorState::kSettling) || Is(end, ExecutorState::kHolding)) {
        if (++settles > Ticks(settings_.settle_s, result)) break;
      } else if (!Is(end, ExecutorState::kRunning)) {
        break;
      }
      ++end;
    }
    const double length_s = static_cast<double>(end - parts.begins) * result.tick_s;
    if (cut != nullptr) {
      result.remarks.push_back(
          fmt::format("used up to {}, {:.3g} s after the motion began", cut, length_s));
    } else if (end == kept_.size() && settles == 0) {
      result.remarks.push_back(fmt::format(
          "is cut in the motion; used are the {:.3g} s of it that are there", length_s));
    }
    if (length_s < kLeast_s) {
      Fail(fmt::format("only {:.3g} s of its motion can be used ({}); needed are {:.3g} s",
                       length_s, cut != nullptr ? cut : "the record ends", kLeast_s));
    }
    parts.end = end;
  }

  /// How much later than the bus needs replies are read.
  void FindLateness(const Parts& parts, RecordedMotion& result) const {
    std::vector<double> late;
    const bool all_answer = std::ranges::all_of(answers_, [](bool answers) { return answers; });
    for (std::size_t k = parts.holds; k < parts.end; ++k) {
      const KeptTick& kept = kept_[k];
      if (kept.last_reply_ns != 0 && all_answer) {
        const double bus_s =
            bit_s_ * static_cast<double>(kept.host_bits + kept.reply_bits - kIntermissionBits);
        late.push_back(pace_ * Seconds(kept.last_reply_ns - kept.send_ns) - bus_s);
      }
    }
    result.late_s = std::max(0.0, simulated_ ? Median(late) : OneIn(kSoonest, late));
  }

  /// From the tick to the end of a setpoint's frame, were it sent at once [s].
  [[nodiscard]] double ByHost(const KeptTick& kept, std::size_t joint) const {
    return pace_ * Seconds(kept.send_ns - kept.deadline_ns) + bit_s_ * kept.arrival_bits[joint];
  }

  /// By joint: how much later than that setpoints come [s], by the replies that are back soonest.
  /// NaN where few came before the next tick.
  [[nodiscard]] std::vector<double> SoonestReplies(const Parts& parts) const {
    std::vector<double> soonest_s;
    for (std::size_t j = 0; j < joints_; ++j) {
      std::vector<double> late_s;
      for (std::size_t k = parts.holds; k < parts.end; ++k) {
        const double sampled_s = kept_[k].joints[j].sampled_s;
        if (std::isfinite(sampled_s)) late_s.push_back(sampled_s - ByHost(kept_[k], j));
      }
      const bool known = late_s.size() * kSoonest >= parts.end - parts.holds;
      soonest_s.push_back(known ? OneIn(kSoonest, std::move(late_s)) : kUnanswered);
    }
    return soonest_s;
  }

  void TakeTicks(const Parts& parts, RecordedMotion& result) {
    std::vector<std::vector<double>> arrivals(joints_);
    std::size_t answered = 0, late = 0;
    const std::vector<double> soonest_s = SoonestReplies(parts);
    for (std::size_t k = parts.holds; k < parts.end; ++k) {
      KeptTick& kept = kept_[k];
      for (std::size_t j = 0; j < joints_; ++j) {
        RecordedJoint& joint = kept.joints[j];
        answered += std::isfinite(joint.reading_rad) ? 1 : 0;
        // A drive that samples as its setpoint comes tells when that was.
        const bool told = std::isfinite(joint.sampled_s) && answers_[j];
        double arrival_s = told ? joint.sampled_s : ByHost(kept, j) + result.late_s;
        // What came after the next tick has no time, and is later than any that has one.
        const bool answered_late = std::isfinite(joint.reading_rad) &&
                                   !(joint.sampled_s - ByHost(kept, j) <= soonest_s[j] + kLater_s);
        if (!simulated_ && answers_[j] && std::isfinite(soonest_s[j]) && answered_late) {
          arrival_s = joint.sampled_s = ByHost(kept, j) + soonest_s[j];
          joint.reading_rad = kUnanswered;
          ++late;
        }
        joint.arrival_s = std::clamp(arrival_s, 0.0, result.tick_s);
        if (!std::isfinite(joint.sampled_s)) joint.sampled_s = joint.arrival_s;
        arrivals[j].push_back(joint.arrival_s);
      }
      result.ticks.push_back(std::move(kept.joints));
    }
    for (std::size_t j = 0; j < joints_; ++j) result.joints[j].arrival_s = Median(arrivals[j]);
    const std::size_t asked = result.ticks.size() * joints_;
    if (answered * 2 < asked) {
      Fail(fmt::format("drives answered only {} of {} setpoints; an estimate needs half at least",
                       answered, asked));
    }
    if (late > 0) {
      result.remarks.push_back(fmt::format(
          "{} of {} replies came later by more than {:.3g} ms than those that are back soonest: "
          "when they were sampled is not known, and they are left out",
          late, answered, 1e3 * kLater_s));
    }
    if (answered < asked) {
      result.remarks.push_back(fmt::format("{} of {} setpoints have no answer and are left out",
                                           asked - answered, asked));
    }
  }

  [[nodiscard]] static std::size_t Ticks(double time_s, const RecordedMotion& result) {
    return static_cast<std::size_t>(std::lround(time_s / result.tick_s));
  }

  /// Whether a tick has the setpoints of another.
  [[nodiscard]] bool Holds(std::size_t tick, std::size_t other) const {
    constexpr double kSame_rad = 1e-3;
    for (std::size_t j = 0; j < joints_; ++j) {
      const double off =
          kept_[tick].joints[j].setpoint.position - kept_[other].joints[j].setpoint.position;
      if (std::abs(off) > kSame_rad) return false;
    }
    return true;
  }

  void RequireMotion(const RecordedMotion& result) const {
    double most = 0;
    for (std::size_t j = 0; j < joints_; ++j) {
      double low = std::numeric_limits<double>::infinity(), high = -low;
      for (const auto& tick : result.ticks) {
        if (!std::isfinite(tick[j].reading_rad)) continue;
        low = std::min(low, tick[j].reading_rad);
        high = std::max(high, tick[j].reading_rad);
      }
      most = std::max(most, high - low);
    }
    if (most < settings_.motion_min_rad) {
      Fail(
          fmt::format("no joint moved by more than {:.2g} rad, of which nothing can be learnt; "
                      "play a motion of tumbler identify excite",
                      most));
    }
  }

  const ReadingSettings& settings_;
  MappedFile file_;
  FlightRecord record_;
  std::size_t joints_ = 0;
  double pace_ = 1;         ///< Seconds of the robot in a second of the loop's clock.
  bool simulated_ = false;  ///< Whether the robot was.
  std::vector<KeptTick> kept_;
  DriveBank bank_;  ///< Tells whose replies are.
  std::vector<CountReader> counts_;
  std::vector<DriveConfig> configs_;
  std::vector<bool> answers_;  ///< Whether a drive samples as its setpoint comes.
  TimedRecords timed_;         ///< Tells when replies were sampled.
  double bit_s_ = 0;
};

}  // namespace

std::string RecordedMotion::Fingerprint() const {
  std::string text;
  const auto end =
      std::min(ticks.size(), begins + static_cast<std::size_t>(std::lround(kLeast_s / tick_s)));
  for (std::size_t k = begins; k < end; ++k) {
    for (const RecordedJoint& joint : ticks[k]) {
      text += fmt::format("{} {} {} {}\n", joint.setpoint.position, joint.setpoint.velocity,
                          joint.setpoint.third, joint.reading_rad);
    }
  }
  return HashOfText(text);
}

RecordedMotion ReadRecordedMotion(const std::string& path, const ReadingSettings& settings) {
  return Reader(path, settings).Read();
}

}  // namespace tumbler
