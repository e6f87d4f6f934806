#include "offline/programs/setpoints.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <vector>

#include "common/core/index.h"
#include "common/files/csv_field.h"
#include "common/files/planned_passages.h"

namespace tumbler {
namespace {

/// Writes rows at the instants of one clock, which goes on from motion to motion.
class Rows {
 public:
  Rows(const SequenceFile& file, const DriveGains& gains, double rate_hz)
      : file_(file), gains_(gains), rate_hz_(rate_hz) {
    text_ = "time_s,node";
    for (const auto& motion : file.primitives.front().primitive.motions()) {
      for (const char* of : {"position_rad", "velocity_rad_s", "torque_nm", "ctrl"})
        text_ += ',' + CsvField(fmt::format("{}.{}", motion.name.view(), of));
    }
    text_ += '\n';
  }

  /// The instants of a motion that begins where the one before has ended.
  void Play(int node, double duration_s) {
    for (; Time() < begin_s_ + duration_s; ++row_) Write(node, Time() - begin_s_, true);
    begin_s_ += duration_s;
  }
  /// Those of a hold at this time of the node's motion.
  void Hold(int node, double at_s, double duration_s, bool with_torque) {
    for (; Time() < begin_s_ + duration_s; ++row_) Write(node, at_s, false, with_torque);
    begin_s_ += duration_s;
  }
  [[nodiscard]] std::string Take() { return std::move(text_); }

 private:
  [[nodiscard]] double Time() const { return static_cast<double>(row_) / rate_hz_; }

  void Write(int node, double at_s, bool moves, bool with_torque = true) {
    const Primitive<double>& primitive = file_.PrimitiveOf(node).primitive;
    fmt::format_to(std::back_inserter(text_), "{},\"{}\"", Time(),
                   file_.graph.node(node).name.view());
    for (int j = 0; j < primitive.joint_count; ++j) {
      const auto& path = primitive.joints[Index(file_.graph.RoleOf(node, j))];
      const auto sample = path.position.Evaluate(at_s);
      const double velocity = moves ? sample.first : 0;
      const double torque = with_torque ? path.torque.Evaluate(at_s).value : 0;
      fmt::format_to(
          std::back_inserter(text_), ",{},{},{},{}", sample.value, velocity, torque,
          gains_.kp_nm_per_rad * sample.value + gains_.kd_nm_s_per_rad * velocity + torque);
    }
    text_ += '\n';
  }

  const SequenceFile& file_;
  DriveGains gains_;
  double rate_hz_;
  std::string text_;
  std::int64_t row_ = 0;
  double begin_s_ = 0;
};

}  // namespace

std::string SetpointsCsv(const SequenceFile& file, const DriveGains& gains,
                         const SetpointOptions& options) {
  const auto& graph = file.graph;
  const std::vector<PlannedPassage> planned = PlannedPassages(file, options.cycles, options.branch);
  Rows rows(file, gains, options.rate_hz);
  rows.Hold(graph.start, 0, options.lead_s, false);
  for (const PlannedPassage& passage : planned) {
    const double duration_s = file.PrimitiveOf(passage.node).primitive.duration_s;
    rows.Play(passage.node, duration_s);
    const double hold_s =
        passage.edge < 0 ? options.last_hold_s : graph.edge(passage.edge).settle_s;
    rows.Hold(passage.node, duration_s, hold_s, true);
  }
  return rows.Take();
}

}  // namespace tumbler
