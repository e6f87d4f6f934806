#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/files/sequence_toml.h"
#include "offline/twin/twin.h"

namespace tumbler {

/// The thresholds that tell a fall from a motion.
struct PostureConfig {
  /// The robot is at rest when root and joints, also those without a motor, have been slower than
  /// this for `rest_s`. A robot that rocks on its feet passes through rest, but not for a third of
  /// a second.
  double speed_max_m_s = 0.03;
  double rate_max_rad_s = 0.05;
  double rest_s = 0.3;
  /// A pose counts as a known one when it differs by at most this. For the pitch the sequence's
  /// exit tolerance counts where it is larger. Joints that slide have the tolerance of the height.
  /// A joint without a motor may rest anywhere, which is no fall, but another pose; its whole turns
  /// do not count.
  double pitch_tolerance_rad = 0.1;
  double joint_tolerance_rad = 0.3;
  double z_tolerance_m = 0.05;
  /// Links that must not touch anything.
  std::vector<std::string> clear_links;
};

/// A rest or a fall of the robot, or that its own shapes overlap.
struct PostureEvent {
  enum class Kind { kRest, kFall, kOverlap };
  Kind kind = Kind::kRest;
  std::int64_t time_ns = 0;
  double root_x_m = 0, root_z_m = 0, root_pitch_rad = 0;
  /// In space, in place of the pitch: the root's y, the angle of its frame's z axis with the
  /// vertical, and where its x axis points, seen from above.
  bool in_space = false;
  double root_y_m = 0, tilt_rad = 0, heading_rad = 0;
  std::string pose;   ///< The known pose in which the robot rests; empty: it rests otherwise.
  std::string cause;  ///< The cause of a fall, or what overlaps, in words.
};

/// One line about an event for people, without its time.
std::string Describe(const PostureEvent& event);

/// The state of a robot's drives, for PostureWatch.
struct DrivesPosture {
  bool all_enabled = false;
  /// Whether the host, not a watchdog or an error, has disabled all drives, or takes their
  /// stiffness away little by little.
  bool let_go = false;
};

/// Watches a robot from outside, without knowing its commands. It tells whether the robot rests, in
/// which of the poses in which its motion begins or ends, and whether it fell.
///
/// The robot falls when, after all drives were enabled,
///  - it comes to rest in a pose (height, pitch less whole turns, joints) in which no node of the
///    motion begins or ends, and in which it was not started; of a robot in space, what is vertical
///    in its frame takes the place of the pitch, and its heading does not count; or
///  - a link of `clear_links` touches something.
/// When the host takes the torque off a robot in a known pose, or begins to lower it there, it lets
/// the robot go, and nothing counts as a fall any more. After a fall, the robot has to be in a
/// known pose again before it can fall again.
///
/// Own shapes that overlap are an event of their own, once until all of them are apart again: no
/// robot does that, so that what the simulation shows from then on is no motion of the robot.
class PostureWatch {
 public:
  /// How many events are kept. Then the oldest rest is left out for each new one; falls and
  /// overlaps only where there are no rests.
  static constexpr std::size_t kKept = 200;

  /// Which joints slide; empty: none does.
  struct Slides {
    std::vector<bool> joints;   ///< Of the motion.
    std::vector<bool> passive;  ///< Those without a motor.
  };
  PostureWatch(const SequenceFile& motion, const PostureConfig& config, const PrimitivePose& start,
               Slides slides = {});

  /// To be called every few milliseconds, with times that grow.
  void Observe(const TwinState& state, const std::vector<TwinContact>& contacts,
               const DrivesPosture& drives);

  /// The events so far, in order, but for those that were left out.
  [[nodiscard]] const std::vector<PostureEvent>& events() const { return events_; }
  /// How many events were left out.
  [[nodiscard]] std::size_t left_out() const { return left_out_; }
  [[nodiscard]] int falls() const { return falls_; }
  [[nodiscard]] bool fallen() const { return fallen_; }
  /// How often own shapes came to overlap.
  [[nodiscard]] int overlaps() const { return overlaps_; }
  /// The name of the known pose in which the robot rests now; empty when it moves, or rests in
  /// another pose.
  [[nodiscard]] const std::string& resting_as() const { return resting_as_; }
  /// The largest downward speed of the root since the robot was let go [m/s]; 0 before.
  [[nodiscard]] double sinking_max_m_s() const { return sinking_max_m_s_; }

 private:
  struct KnownPose {
    std::string name;
    double z_m, pitch_rad, pitch_tolerance_rad;
    std::vector<double> joints_rad;
    std::vector<double> passive_rad;  // empty: of a pose that does not say
    Quaternion quaternion{};          // in space: how the root's frame is turned
  };
  [[nodiscard]] bool Slow(const TwinState& state) const;
  /// @param passive  whether joints without a motor count.
  [[nodiscard]] const KnownPose* FindPose(const TwinState& state, bool passive) const;
  void Fall(const TwinState& state, std::string cause);
  /// Adds an event, with its place, and makes room for it.
  PostureEvent& Add(const TwinState& state, PostureEvent::Kind kind);
  static PostureEvent EventAt(const TwinState& state, PostureEvent::Kind kind);

  PostureConfig config_;
  Slides slides_;
  std::vector<KnownPose> poses_;
  std::vector<PostureEvent> events_;
  std::size_t left_out_ = 0;
  int falls_ = 0;
  int overlaps_ = 0;
  bool overlapping_ = false;
  bool watched_ = false;
  bool fallen_ = false;
  bool let_go_ = false;
  bool resting_ = false;
  std::string resting_as_;
  double sinking_max_m_s_ = 0;
  std::int64_t slow_since_ns_ = -1;  // -1: the robot moves
};

}  // namespace tumbler
