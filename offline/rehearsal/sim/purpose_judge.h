#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "common/sequence_toml.h"
#include "offline/rehearsal/twin/twin.h"
#include "runtime/core/tick.h"
#include "runtime/run/run_summary.h"

namespace tumbler {

/// Judges what a simulated robot does against what its motions are for, node after node: each
/// target of a primitive's purpose at its instant, if it is one of the root at or after the end of
/// the motion, and the pitch 2 s after the motion against the plan's. Where the sequence gives the
/// motion longer to settle, what is asked of the settled robot and 2 s later is judged when that
/// time is over, just before the next motion begins; a motion that another one follows earlier is
/// judged when that one begins. One that is rolled out after a fault is judged, too.
class PurposeJudge {
 public:
  /// How many passages are kept. Of a longer run those are left out, the oldest first, that were
  /// judged and as asked, unless they came next after one that was not.
  static constexpr std::size_t kKept = 100;

  /// @param file       the sequence, which has to outlive the judge.
  /// @param free_root  whether the root moves at all.
  /// @param hinged     whether it does so on a bar, where a robot without feedback is nowhere at
  ///                   rest soon, so that only the purpose is judged.
  PurposeJudge(const SequenceFile& file, bool free_root, bool hinged);

  /// To be called in every tick.
  void Observe(const TickRecord& record, std::int64_t time_ns, const TwinState& truth);

  /// The passages so far, but for those that were left out. What has not been seen yet is absent.
  [[nodiscard]] const std::vector<Passage>& passages() const { return passages_; }
  [[nodiscard]] const PassagesLeftOut& left_out() const { return left_out_; }
  /// The node whose motion has begun and has not ended; empty where there is none.
  [[nodiscard]] std::string moving() const {
    return moving_ < 0 ? "" : std::string(file_.graph.node(moving_).name.view());
  }

 private:
  void Watch(std::int64_t time_ns, const TwinState& truth);
  void LeaveOutOne();
  void Begin(int node, std::int64_t time_ns, const TwinState& truth);
  [[nodiscard]] bool CanJudge(const PurposeTarget& target) const;
  [[nodiscard]] double InstantOf(const PurposeTarget& target) const;
  [[nodiscard]] double ResultOf(const PurposeTarget& target, const TwinState& truth) const;

  const SequenceFile& file_;
  bool free_root_, hinged_;
  ExecutorState last_ = ExecutorState::kDisarmed;
  bool rolls_ = false;  // whether the motion was being rolled out
  int moving_ = -1;
  double expected_pitch_rad_ = 0;
  std::deque<std::pair<std::int64_t, double>> speeds_;  // time, largest rate of the root
  // Of the last motion that ended:
  double turned_rad_ = 0;  // The robot's pitch is that of the task plus this.
  double duration_s_ = 0, settle_s_ = 0;
  PrimitivePose entry_;
  std::int64_t end_ns_ = 0;
  double start_x_m_ = 0;  // where the last motion that began did
  std::vector<Passage> passages_;
  PassagesLeftOut left_out_;
};

}  // namespace tumbler
