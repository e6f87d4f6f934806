#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "offline/model/robot_finding.h"

class TiXmlDocument;
class TiXmlElement;

namespace tumbler {

/// Of joints, in a file.
inline constexpr std::array<std::string_view, 4> kJointTypes = {"revolute", "continuous",
                                                                "prismatic", "fixed"};
/// Of shapes. A `<capsule>` is none of URDF's, but files have it.
inline constexpr std::string_view kCapsule = "capsule";
inline constexpr std::array<std::string_view, 5> kGeometries = {"sphere", "cylinder", "box", "mesh",
                                                                kCapsule};

/// Reads the elements of a URDF.
/// @param file  for messages.
/// @returns     the outermost element, `<robot>`, which has a name.
/// @throws RobotFileError  when the text is not XML, or no URDF.
[[nodiscard]] TiXmlElement& ParseUrdfElements(const std::string& text, const std::string& file,
                                              TiXmlDocument& document);

[[nodiscard]] std::uint32_t LineOf(const TiXmlElement& element);
/// An attribute; empty where there is none.
[[nodiscard]] std::string TextOf(const TiXmlElement& element, const char* attribute);
/// The numbers in a text, if it holds nothing but numbers and white space.
[[nodiscard]] std::optional<std::vector<double>> ToNumbers(std::string_view text);
/// Whether the element is in a `<geometry>`.
[[nodiscard]] bool IsGeometry(const TiXmlElement& element);

/// Notes what is wrong with one link or joint. Where it notes nothing, numbers are numbers, as many
/// as there have to be and in their ranges; what a robot needs is there, and once.
class ElementChecker {
 public:
  /// @param key  of the link or joint, such as `joint 'leg1'`.
  ElementChecker(std::vector<RobotFinding>& mistakes, std::string key);

  void CheckLink(const TiXmlElement& link) const;
  void CheckJoint(const TiXmlElement& joint) const;

  void Note(const TiXmlElement& where, const std::string& problem) const;
  /// The element; null, and noted, where there is none.
  const TiXmlElement* Required(const TiXmlElement& parent, const char* name) const;

 private:
  void CheckNumbers(const TiXmlElement& element) const;
  void CheckOnlyOne(const TiXmlElement& parent, const char* name) const;
  void CheckShape(const TiXmlElement& shape) const;

  std::vector<RobotFinding>& mistakes_;
  std::string key_;
};

}  // namespace tumbler
