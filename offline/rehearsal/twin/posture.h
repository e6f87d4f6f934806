#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/sequence_toml.h"
#include "offline/rehearsal/twin/twin.h"

namespace tumbler {

/// How a fall is told from a motion.
struct PostureConfig {
  /// At rest: root and joints slower than this, for so long. A robot that rocks on its feet passes
  /// through rest, but not for a third of a second.
  double speed_max_m_s = 0.03;
  double rate_max_rad_s = 0.05;
  double rest_s = 0.3;
  /// How near a pose is to a known one. Of the pitch, the sequence's exit tolerance where larger.
  double pitch_tolerance_rad = 0.1;
  double joint_tolerance_rad = 0.3;
  double z_tolerance_m = 0.05;
  /// Links that must not touch anything.
  std::vector<std::string> clear_links;
};

/// Something that the robot did, as a whole.
struct PostureEvent {
  enum class Kind { kRest, kFall };
  Kind kind = Kind::kRest;
  std::int64_t time_ns = 0;
  double root_x_m = 0, root_z_m = 0, root_pitch_rad = 0;
  std::string pose;   ///< Of a rest: the known pose; empty where it is none.
  std::string cause;  ///< Of a fall, in words.
};

/// One line for people, without its time.
std::string Describe(const PostureEvent& event);

/// What the drives of a robot do, for the watch.
struct DrivesPosture {
  bool all_enabled = false;
  bool let_go = false;  ///< All disabled, by the host rather than by a watchdog or an error.
};

/// Watches a robot from outside, without knowing what it was told: whether it rests, in which of
/// the poses that its motion begins and ends in, and whether it fell.
///
/// A fall is, once all drives have been enabled, that
///  - the robot comes to rest in a pose that no node of the motion begins or ends in (height, pitch
///    less whole turns, joints), nor is the pose in which it was started; or
///  - a link of `clear_links` touches something.
/// Nothing is a fall any more once the host has taken the torque off a robot in a known pose: it
/// was let go. After a fall the next one counts from when the robot was in a known pose
/// again.
class PostureWatch {
 public:
  PostureWatch(const SequenceFile& motion, const PostureConfig& config, const PrimitivePose& start);

  /// To be called every few milliseconds, with times that grow.
  void Observe(const TwinState& state, const std::vector<TwinContact>& contacts,
               const DrivesPosture& drives);

  /// All rests and falls so far, in order.
  [[nodiscard]] const std::vector<PostureEvent>& events() const { return events_; }
  [[nodiscard]] int falls() const { return falls_; }
  [[nodiscard]] bool fallen() const { return fallen_; }
  /// The known pose in which it rests now; empty when it moves or the pose is none.
  [[nodiscard]] const std::string& resting_as() const { return resting_as_; }

 private:
  struct KnownPose {
    std::string name;
    double z_m, pitch_rad, pitch_tolerance_rad;
    std::vector<double> joints_rad;
  };
  [[nodiscard]] bool Slow(const TwinState& state) const;
  [[nodiscard]] const KnownPose* FindPose(const TwinState& state) const;
  void Fall(const TwinState& state, std::string cause);
  static PostureEvent EventAt(const TwinState& state, PostureEvent::Kind kind);

  PostureConfig config_;
  std::vector<KnownPose> poses_;
  std::vector<PostureEvent> events_;
  int falls_ = 0;
  bool watched_ = false;
  bool fallen_ = false;
  bool let_go_ = false;
  bool resting_ = false;
  std::string resting_as_;
  std::int64_t slow_since_ns_ = -1;  // -1: it moves
};

}  // namespace tumbler
