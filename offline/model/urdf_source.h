#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "offline/model/robot_finding.h"

namespace tumbler {

/// An angle of an `<origin rpy>` that was written with few digits, and is taken as what was meant.
struct RoundedAngle {
  std::uint32_t line = 0;
  std::string key;       ///< Of the link or joint, such as `joint 'leg1'`.
  double given = 0;      ///< [rad]
  std::string taken_as;  ///< A multiple of pi/2 other than 0, such as `pi/2` or `-3 pi/2`.
};
/// For people: "origin rpy 1.5708 is taken as pi/2".
std::string Describe(const RoundedAngle& angle);
/// How far an angle may be from a multiple of pi/2 to be taken as one [rad]: 1.5708 and 3.1416 are.
inline constexpr double kRoundedBy_rad = 1e-4;

/// Stands in `UrdfSource::text` for a limit that the file lacks. One so large is none.
inline constexpr double kNoLimit = 1e300;

/// The text of a URDF, for the things that urdfdom neither keeps nor checks: the lines of elements,
/// the order of joints, what it does not know (a `<capsule>`, a `world` that no link is), and
/// mistakes that it accepts in silence or reports without a line.
class UrdfSource {
 public:
  /// @param file  for messages.
  /// @throws RobotFileError  with line and element of everything of this kind that is wrong:
  ///   - the text is not XML, or a xacro file, which only makes a URDF;
  ///   - a number is not finite, or other text stands beside it;
  ///   - an attribute or element that the robot needs is missing;
  ///   - an element that may be there once is there twice;
  ///   - a name is missing, empty or not unique;
  ///   - links and joints do not make one tree.
  UrdfSource(const std::string& text, const std::string& file);

  /// The line of an element inside a link or joint, such as `mass`; where there is none, the line
  /// of the link or joint.
  [[nodiscard]] std::uint32_t LineOfLink(const std::string& link, std::string_view element) const;
  [[nodiscard]] std::uint32_t LineOfJoint(const std::string& joint, std::string_view element) const;

  /// The text for a parser: the file's, with each of `rounded_angles` as it is taken, and with what
  /// the parser does not know in terms that it does: a capsule is a cylinder of the same overall
  /// length, held joints are fixed.
  [[nodiscard]] const std::string& text() const { return text_; }
  [[nodiscard]] const std::vector<RoundedAngle>& rounded_angles() const { return rounded_angles_; }
  /// For people: what else was taken otherwise than it is written, and the robot is the same.
  [[nodiscard]] const std::vector<RobotFinding>& notes() const { return notes_; }
  /// What a task needs of a joint and the file lacks, by the joint's name; the robot can be looked
  /// at without.
  [[nodiscard]] const std::multimap<std::string, RobotFinding>& lacks() const { return lacks_; }
  /// Joints whose type is none of ours, such as `floating`, by their names: why they are held.
  [[nodiscard]] const std::map<std::string, std::string>& held_joints() const { return held_; }

  /// Names of all joints in the order of the file.
  [[nodiscard]] const std::vector<std::string>& joint_order() const { return joint_order_; }

 private:
  class Reader;
  using Lines = std::map<std::string, std::uint32_t, std::less<>>;  // by element; "": the whole
  using Index = std::map<std::string, Lines, std::less<>>;
  static std::uint32_t LineOf(const Index& index, const std::string& name,
                              std::string_view element);

  std::string text_;
  std::vector<RoundedAngle> rounded_angles_;
  std::vector<RobotFinding> notes_;
  std::multimap<std::string, RobotFinding> lacks_;
  std::map<std::string, std::string> held_;
  Index links_;
  Index joints_;
  std::vector<std::string> joint_order_;
};

}  // namespace tumbler
