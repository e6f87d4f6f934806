#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace tumbler {

/// The text of a URDF, for the things that urdfdom neither keeps nor checks: the lines of elements,
/// the order of joints, and mistakes that it accepts in silence or reports without a line.
class UrdfSource {
 public:
  /// @param file  for messages.
  /// @throws FileError  with line and element when
  ///   - the text is not XML;
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

  /// Names of all joints in the order of the file.
  [[nodiscard]] const std::vector<std::string>& joint_order() const { return joint_order_; }

 private:
  using Lines = std::map<std::string, std::uint32_t, std::less<>>;  // by element; "": the whole
  using Index = std::map<std::string, Lines, std::less<>>;
  static std::uint32_t LineOf(const Index& index, const std::string& name,
                              std::string_view element);
  /// @param parents  the link that carries each link; the root has none.
  /// @throws FileError unless there is at most one root, and every link leads up to it.
  void CheckTree(const std::vector<std::string>& links,
                 const std::map<std::string, std::string>& parents, const std::string& file) const;

  Index links_;
  Index joints_;
  std::vector<std::string> joint_order_;
};

}  // namespace tumbler
