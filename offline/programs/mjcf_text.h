#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "common/files/markup.h"
#include "common/files/purpose.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// A file of MuJoCo in the making: what those of robots in the plane and in space share.
class MjcfText {
 public:
  /// Steps of the physics [s], with which MuJoCo is accurate here.
  static constexpr double kStep_s = 2e-4;

  template <typename... Args>
  void Line(int indent, fmt::format_string<Args...> format, Args&&... args) {
    text_.append(Index(2 * indent), ' ');
    fmt::format_to(std::back_inserter(text_), format, std::forward<Args>(args)...);
    text_ += '\n';
  }

  /// Of a sphere. MuJoCo has none without a size; points of meshes are.
  static double SphereSize(double radius_m) { return std::max(radius_m, 1e-6); }

  /// Text of an attribute: names of files are anybody's.
  static std::string Escaped(std::string_view text) { return MarkupText(text); }
  /// Text of a comment, in which XML has no "--".
  static std::string InComment(std::string_view text) {
    std::string out;
    for (const char c : MarkupText(text))
      out += c == '-' && out.ends_with('-') ? " -" : std::string(1, c);
    return out;
  }

  /// The attributes of a joint that both kinds of robots have.
  static std::string JointAttributes(const RobotJointLimits& limits, double rotor_inertia_kg_m2,
                                     double damping_nm_s_per_rad, double dry_friction_nm) {
    std::string text;
    if (std::isfinite(limits.lower_rad) && std::isfinite(limits.upper_rad)) {
      text += fmt::format(" limited=\"true\" range=\"{:.17g} {:.17g}\"", limits.lower_rad,
                          limits.upper_rad);
    }
    text += fmt::format(" armature=\"{:.17g}\" damping=\"{:.17g}\"", rotor_inertia_kg_m2,
                        damping_nm_s_per_rad);
    if (dry_friction_nm > 0) text += fmt::format(" frictionloss=\"{:.17g}\"", dry_friction_nm);
    return text;
  }

  /// What a motion is for, for people.
  void Purposes(const std::vector<PurposeFigure>& purpose) {
    if (purpose.empty()) return;
    Line(1, "<custom>");
    for (const PurposeFigure& figure : purpose) {
      Line(2, "<text name=\"{}\" data=\"{}\"/>", Escaped(figure.name()),
           Escaped(figure.AskedAndGot(figure.result)));
    }
    Line(1, "</custom>");
  }

  /// An actuator for each joint, which obeys a drive's law.
  void Actuators(const Problem& problem, const DriveGains& gains) {
    Line(1, "<actuator>");
    for (const ActuatedJoint& joint : problem.joints) {
      const double most = joint.limits.torque_max_nm;
      Line(2,
           "<general name=\"{0}\" joint=\"{0}\" gainprm=\"1\" biastype=\"affine\" biasprm=\"0 "
           "{1:.17g} {2:.17g}\" forcelimited=\"true\" forcerange=\"{3:.17g} {4:.17g}\"/>",
           Escaped(problem.name_of(joint)), -gains.kp_nm_per_rad, -gains.kd_nm_s_per_rad, -most,
           most);
    }
    Line(1, "</actuator>");
  }

  std::string Take() { return std::move(text_); }

 private:
  std::string text_;
};

}  // namespace tumbler
