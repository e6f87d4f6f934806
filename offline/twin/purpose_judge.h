#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "common/files/sequence_toml.h"
#include "offline/problem/purpose_gauge.h"
#include "offline/problem/task_frame.h"
#include "offline/twin/twin.h"
#include "runtime/executor/tick.h"
#include "runtime/run/run_summary.h"

namespace tumbler {

/// Judges what a simulated robot does against what its motions are for, node after node: each
/// target of a primitive's purpose in the first tick at or after its instant, in the motion or
/// after it, of the root or of a point of a link; and the pitch 2 s after the motion against the
/// plan's. Where the sequence gives the motion longer to settle, what is asked of the settled robot
/// and 2 s later is judged when that time is over, just before the next motion begins; a motion
/// that another one follows earlier is judged when that one begins. One that is rolled out after a
/// fault is judged, too. A motion that is broken off is not judged at all.
///
/// Where joints exchange their roles, a point is that of the link which has the link's role.
class PurposeJudge {
 public:
  /// How many passages are kept. Of a longer run those are left out, the oldest first, that were
  /// judged and as asked, unless they came next after one that was not.
  static constexpr std::size_t kKept = 100;

  /// @param file   the sequence, which has to outlive the judge.
  /// @param robot  that is simulated; not kept. On a bar, a robot without feedback is nowhere at
  ///               rest soon, and a fixed root is always where it is, so that of these only the
  ///               purpose is judged.
  PurposeJudge(const SequenceFile& file, const PlanarRobot& robot);
  /// In space a motion is judged as if it had begun where its primitive does, and with the heading
  /// that it has there: the ground is taken for level. What is vertical in the root's frame after
  /// the motion is compared with the exit's, in place of a pitch.
  PurposeJudge(const SequenceFile& file, const SpaceRobot& robot);

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
  template <class Robot>
  PurposeJudge(const SequenceFile& file, const Robot& robot, bool hinged);
  void Watch(std::int64_t time_ns, const TwinState& truth);
  void LeaveOutOne();
  /// Sets q_, qd_ and axes_.
  void TakeRootInSpace(const TwinState& truth);
  /// The root's pitch, or in space the angle of what is vertical with what is at a node's exit.
  [[nodiscard]] double AngleOf(const TwinState& truth, int node) const;
  void BeginMotion(int node, bool after_another, const TwinState& truth);
  void EndMotion(int node, std::int64_t time_ns, const TwinState& truth);
  void JudgeUnderWay(double time_s, const TwinState& truth);
  void JudgeLast(double since_end_s, bool settled, bool next, const TwinState& truth);
  [[nodiscard]] double ResultOf(std::size_t target, int node, const TwinState& truth);

  const SequenceFile& file_;
  bool free_root_, hinged_;
  std::size_t root_dofs_;
  std::vector<std::size_t> joint_dofs_, passive_dofs_;
  std::vector<std::vector<PurposeGauge>> gauges_;  // of each primitive's targets
  std::vector<double> q_, qd_;                     // room for a state in the coordinates of a task
  SpaceMatrix axes_ = SpaceMatrix::Identity();     // of the root in space, likewise
  ExecutorState last_ = ExecutorState::kDisarmed;
  bool rolls_ = false;  // whether the motion was being rolled out
  int moving_ = -1;
  double expected_pitch_rad_ = 0;
  std::deque<std::pair<std::int64_t, double>> speeds_;  // time, largest rate of the root
  // Of the last motion that began:
  double start_x_m_ = 0;
  TaskFrame task_;                       // In space.
  double turned_rad_ = 0;                // The robot's pitch is that of the task plus this.
  std::vector<JudgedTarget> under_way_;  // its purpose, until it ends
  // Of the last motion that ended, until another begins:
  int ended_ = -1;  // its node
  std::int64_t end_ns_ = 0;
  std::vector<Passage> passages_;
  PassagesLeftOut left_out_;
};

}  // namespace tumbler
