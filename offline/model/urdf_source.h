#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace tumbler {

/// What urdfdom neither keeps nor checks of a URDF's text: the lines of its elements, the order of
/// its joints, and mistakes that it accepts in silence or reports without a line.
class UrdfSource {
 public:
  /// @param file  for messages.
  /// @throws FileError with line and element when the text is not XML; when a number is not finite
  /// or has anything around it; when an attribute or element is missing that the robot needs; when
  /// an element that can be there only once is there twice; when names are missing, empty or not
  /// unique; or when links and joints do not make one tree.
  UrdfSource(const std::string& text, const std::string& file);

  /// Line of a link's or joint's element, or of one inside it, such as `mass`. The line of the
  /// whole when it has no such element.
  [[nodiscard]] std::uint32_t LineOfLink(const std::string& link, std::string_view element) const;
  [[nodiscard]] std::uint32_t LineOfJoint(const std::string& joint, std::string_view element) const;

  [[nodiscard]] const std::vector<std::string>& joint_order() const { return joint_order_; }

 private:
  using Lines = std::map<std::string, std::uint32_t, std::less<>>;  // of elements; "" is the whole
  using Index = std::map<std::string, Lines, std::less<>>;
  static std::uint32_t LineOf(const Index& index, const std::string& name,
                              std::string_view element);

  Index links_;
  Index joints_;
  std::vector<std::string> joint_order_;
};

}  // namespace tumbler
