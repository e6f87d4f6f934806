#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "offline/model/joint_limits.h"
#include "offline/model/pose.h"
#include "offline/model/robot.h"
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

/// The links and joints of a URDF with their lines.
class UrdfSource {
 public:
  /// A link, as the file has it.
  struct Link {
    struct Inertial {
      Pose pose;  ///< In the link's frame.
      double mass_kg = 0;
      SpaceMatrix inertia_kg_m2 = SpaceMatrix::Zero();
    };
    std::string name;
    std::optional<Inertial> inertial;
    /// With poses in the link's frame, and of no body. A capsule is a cylinder of the same overall
    /// length.
    std::vector<RobotShape> collision_shapes, visual_shapes;
  };

  /// A joint, as the file has it.
  struct Joint {
    enum class Type : std::uint8_t { kRevolute, kContinuous, kPrismatic, kFixed };
    struct Mimic {
      std::string joint;
      double multiplier = 1, offset = 0;
    };
    std::string name;
    Type type = Type::kFixed;
    /// Why it is fixed here; empty: its type is one of ours, not such as `floating`.
    std::string held_because;
    std::string parent, child;  ///< Links.
    Pose pose;                  ///< Of its frame, in the parent's.
    SpaceVector axis{1, 0, 0};  ///< In its own frame; of any length.
    /// Infinite where a limit is missing, or so large that it is none. A continuous joint may have
    /// none at all.
    std::optional<RobotJointLimits> limits;
    double damping = 0, friction = 0;
    std::optional<Mimic> mimic;
    /// What a task needs of it and the file lacks; the robot can be looked at without.
    std::vector<RobotFinding> lacks;
  };

  /// @param file  for messages.
  /// @throws RobotFileError  with line and element of everything of this kind that is wrong:
  ///   - the text is not XML, or a xacro file, which only makes a URDF;
  ///   - a number is not finite, or other text stands beside it;
  ///   - an attribute or element that the robot needs is missing;
  ///   - an element that may be there once is there twice;
  ///   - a name is missing, empty or not unique;
  ///   - links and joints do not make one tree.
  UrdfSource(const std::string& text, const std::string& file);

  [[nodiscard]] const std::string& name() const { return name_; }
  /// The link that no joint carries.
  [[nodiscard]] const Link& root() const { return *FindLink(root_); }
  /// In the order of the file.
  [[nodiscard]] const std::vector<Joint>& joints() const { return joints_; }
  /// Those of which a link is the parent, in the order of their names.
  [[nodiscard]] std::vector<const Joint*> JointsOn(const std::string& link) const;
  /// Null where there is none with this name.
  [[nodiscard]] const Link* FindLink(const std::string& name) const;
  [[nodiscard]] const Joint* FindJoint(const std::string& name) const;

  /// The line of an element inside a link or joint, such as `mass`; where there is none, the line
  /// of the link or joint.
  [[nodiscard]] std::uint32_t LineOfLink(const std::string& link, std::string_view element) const;
  [[nodiscard]] std::uint32_t LineOfJoint(const std::string& joint, std::string_view element) const;

  [[nodiscard]] const std::vector<RoundedAngle>& rounded_angles() const { return rounded_angles_; }
  /// For people: what else was taken otherwise than it is written, and the robot is the same.
  [[nodiscard]] const std::vector<RobotFinding>& notes() const { return notes_; }

 private:
  class Reader;
  using Lines = std::map<std::string, std::uint32_t, std::less<>>;  // by element; "": the whole
  /// Where a link or joint is.
  struct Place {
    std::size_t index = 0;  // in `links_` or `joints_`
    Lines lines;
  };
  using Places = std::map<std::string, Place, std::less<>>;
  static std::uint32_t LineIn(const Places& places, const std::string& name,
                              std::string_view element);

  std::string name_, root_;
  std::vector<Link> links_;
  std::vector<Joint> joints_;
  Places link_places_, joint_places_;
  std::map<std::string, std::map<std::string, std::size_t>> on_link_;  // joints by link and name
  std::vector<RoundedAngle> rounded_angles_;
  std::vector<RobotFinding> notes_;
};

}  // namespace tumbler
