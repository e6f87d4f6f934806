#include "offline/pages/run_facts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

namespace tumbler {
namespace {

void AddFact(RunData& run, const std::string& name, std::string value) {
  run.facts.emplace_back(name, std::move(value));
}

void DescribeJoint(RunData& run, std::size_t j) {
  double error = 0, error_s = 0, torque = -1, torque_s = 0;
  std::int32_t age = 0;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const JointRecord& joint = run.joint(i, j);
    const auto following = run.FollowingError(i, j);
    if (following && !(std::abs(*following) <= error)) {
      error = std::abs(*following);
      error_s = run.ticks[i].time_s;
    }
    const double measured = std::abs(double{joint.measured.torque_nm});
    if (joint.reply_age_ticks >= 0 && measured > torque) {
      torque = measured;
      torque_s = run.ticks[i].time_s;
    }
    age = std::max(age, joint.reply_age_ticks);
  }
  const std::string& name = run.scene.joint_names[j];
  AddFact(run, name + ": following error at most",
          fmt::format("{:.5f} rad at {:.3f} s", error, error_s));
  AddFact(run, name + ": measured torque at most",
          torque < 0 ? "not measured" : fmt::format("{:.3f} N·m at {:.3f} s", torque, torque_s));
  AddFact(run, name + ": oldest reply", fmt::format("{} ticks", age));
}

/// Adds how far an angle of the true robot is off the plan, in motion.
/// @param of  takes the angle from a sample.
template <typename Of>
void DescribeTrueAngle(RunData& run, const std::string& name, const Of& of) {
  double most = 0, most_s = 0;
  std::size_t k = 0;
  for (const ReportSample& truth : run.truth) {
    while (k + 1 < run.plan.size() && run.plan[k + 1].time_s <= truth.time_s) ++k;
    const bool playing =
        std::any_of(run.bands.begin(), run.bands.end(), [&truth](const RunBand& band) {
          return truth.time_s >= band.from_s && truth.time_s <= band.to_s;
        });
    const double apart = std::abs(of(truth) - of(run.plan[k]));
    if (playing && apart > most) {
      most = apart;
      most_s = truth.time_s;
    }
  }
  AddFact(run, fmt::format("true {} off the plan by at most", name),
          fmt::format("{:.4f} rad at {:.3f} s, in motion", most, most_s));
}

void DescribeTruth(RunData& run) {
  if (run.truth.empty()) return;
  // A fixed root is never off anything.
  const auto turns = [](const ReportSample& sample) { return sample.root_pitch_rad != 0; };
  if (std::ranges::any_of(run.truth, turns) || std::ranges::any_of(run.plan, turns))
    DescribeTrueAngle(run, "root pitch", [](const auto& sample) { return sample.root_pitch_rad; });
  const auto tells = [](const ReportSample& sample) {
    return !sample.passive_positions_rad.empty();
  };
  if (!std::ranges::all_of(run.truth, tells)) return;
  for (std::size_t i = 0; i < run.passive_names.size(); ++i) {
    DescribeTrueAngle(run, run.passive_names[i],
                      [i](const auto& sample) { return sample.passive_positions_rad[i]; });
  }
}

}  // namespace

void AddFacts(RunData& run, const FlightRecord& record, std::string_view motion_name) {
  const RecordConfiguration& c = record.configuration();
  AddFact(run, "outcome",
          record.end()               ? record.end()->outcome
          : record.damages().empty() ? "the recording was interrupted"
                                     : "not known: the record is damaged");
  AddFact(run, "motion", std::string(motion_name) + " (" + c.motion_file + ")");
  AddFact(run, "bus",
          fmt::format("{}{}{}", c.bus, c.dry_run ? ", dry run" : "",
                      c.virtual_time ? ", virtual time" : ""));
  AddFact(
      run, "rate, speed",
      fmt::format("{:.6g} Hz, {:.3g}", 1 / run.period_s, static_cast<double>(c.executor.speed)));
  AddFact(run, "ticks",
          fmt::format("{} over {:.3f} s", run.ticks.size(),
                      run.ticks.back().time_s - run.ticks.front().time_s));
  for (std::size_t j = 0; j < run.joint_count(); ++j) DescribeJoint(run, j);
  DescribeTruth(run);
  AddFact(run, "made by", c.program);
  AddFact(run, "on", c.kernel);
  run.damaged = !record.damages().empty();
  for (const Damage& damage : record.damages()) {
    AddFact(run, "damaged", fmt::format("byte {}: {}", damage.offset, damage.what));
  }
  if (record.cut_off()) AddFact(run, "cut off", fmt::format("after byte {}", record.offset()));
}

}  // namespace tumbler
