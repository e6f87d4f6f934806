#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tumbler {

class Json;

/// What a motion is for: a value that its task's cost asks for at one instant, of the robot's root
/// or of a point of a link.
struct PurposeTarget {
  enum class Of : std::uint8_t {
    kX,
    kZ,
    kPitch,
    kXRate,
    kZRate,
    kPitchRate,
    kSpeed,  ///< The largest |rate| of the root in the last kRestWatched_s: the motion ends at
             ///< rest.
    kPointX,
    kPointZ,
    kPointXRate,
    kPointZRate,
    // Of a link in space, along a direction of the world (`along`).
    kPosition,         ///< Of the link's point `in_space`.
    kVelocity,         ///< Likewise.
    kAngularVelocity,  ///< Of the link.
    kMisalignment,     ///< Of the link's axis `in_space` with `along`: 2 sin(angle / 2).
    /// Of the link's axis `in_space` about `along` (SpaceQuantity::Of::kHeading). A result is that
    /// of the angles that are whole turns apart which is nearest to the target.
    kHeading,
  };
  enum class When : std::uint8_t {
    kEnd,      ///< At the end of the motion.
    kSettled,  ///< At the end of the settle phase.
    kLater,    ///< 2 s after the end of the motion (kExitAfter_s).
    kTime,     ///< At `time_s`.
  };
  /// Their names in files, in their order.
  static constexpr std::array<std::string_view, 16> kOfNames = {"x",
                                                                "z",
                                                                "pitch",
                                                                "x_rate",
                                                                "z_rate",
                                                                "pitch_rate",
                                                                "speed",
                                                                "point_x",
                                                                "point_z",
                                                                "point_x_rate",
                                                                "point_z_rate",
                                                                "position",
                                                                "velocity",
                                                                "angular_velocity",
                                                                "misalignment",
                                                                "heading"};
  static constexpr std::array<std::string_view, 4> kWhenNames = {"end", "settled", "later", "time"};

  Of of = Of::kPitch;
  When when = When::kEnd;
  double target = 0;                ///< [m, rad, m/s, rad/s]
  double tolerance = 0;             ///< A result farther from the target than this misses it.
  double time_s = 0;                ///< Since the start of the motion; of `kTime`.
  std::string link = {};            ///< That has the point; empty where there is none.
  std::array<double, 2> point_m{};  ///< x and z in the link's frame.
  /// In space: a point [m] or an axis, in the link's frame, and a unit vector of the world.
  std::array<double, 3> in_space{}, along{};

  [[nodiscard]] bool at_time() const { return when == When::kTime; }
  [[nodiscard]] bool of_point() const { return of >= Of::kPointX && of <= Of::kPointZRate; }
  [[nodiscard]] bool is_in_space() const { return of >= Of::kPosition; }
  [[nodiscard]] bool of_axis() const { return of == Of::kMisalignment || of == Of::kHeading; }
  /// For people, such as "pitch, settled", "speed of the root, 2 s later", or "point_z of leg1_link
  /// at (0.2, 0), at 0.3 s".
  [[nodiscard]] std::string name() const { return NameAfter(2); }
  /// The same for a target of `kLater` that was looked at so long after the end of the motion [s].
  [[nodiscard]] std::string NameAfter(double later_s) const;
  [[nodiscard]] const char* unit() const;
  /// A result that is not a number misses.
  [[nodiscard]] bool MetBy(double result) const { return std::abs(result - target) <= tolerance; }
  /// For people: "asked 1.5708, got 1.57037 rad (within 0.05)".
  [[nodiscard]] std::string AskedAndGot(double result) const;
};

/// A target, and what the motion's plan gives.
struct PurposeFigure : PurposeTarget {
  double result = 0;
  [[nodiscard]] bool met() const { return MetBy(result); }
};

/// A target, and what a simulated robot gives. A target that nobody looked at was neither met nor
/// missed.
struct JudgedTarget {
  PurposeTarget target;
  std::optional<double> result;        ///< Absent where it was not judged.
  std::optional<double> after_s = {};  ///< How long after the end of the motion that was.
  /// Why it is never judged, as the end of a sentence about it; empty: the run ended before.
  std::string obstacle = {};

  /// Judges a value that a robot has. A heading that is not a number is none: the axis is along the
  /// direction about which it would be, and the target is not judged.
  void Judge(double value);
  /// As the target's, with the time at which it was judged: "pitch, 4 s later".
  [[nodiscard]] std::string name() const;
  [[nodiscard]] std::optional<bool> met() const;
  /// For people: as AskedAndGot, with ": MISSED" where it was; or "not judged, the run ended
  /// before".
  [[nodiscard]] std::string Verdict() const;
};

/// Whether every target was met. Absent where one that nobody judged may have been missed, and
/// where there is none.
[[nodiscard]] std::optional<bool> AllMet(const std::vector<JudgedTarget>& purpose);

/// For files: `of` (its name), `unit`, `target`, `result`, `after_s`, `tolerance`, `met`.
[[nodiscard]] Json ToJson(const JudgedTarget& judged);

/// No coordinate of the root of a robot at rest moves faster than this [m/s, rad/s], in the last
/// kRestWatched_s: so long that the answer does not depend on the phase in which it rocks.
inline constexpr double kRestSpeed = 0.1;
inline constexpr double kRestWatched_s = 0.25;

}  // namespace tumbler
