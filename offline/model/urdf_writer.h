#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "offline/model/pose.h"

namespace tumbler {

/// A robot of another format, as a URDF.
struct TranslatedRobot {
  std::string urdf;
  /// For people: what the URDF does not have, and what was taken otherwise than it may seem.
  std::vector<std::string> notes;
};

/// Where something is fixed to a link, in the link's frame, that has a form.
struct UrdfShape {
  bool collides = true;  ///< Else it is visual.
  Pose pose;
  std::string form;  ///< By one of the functions below.
};
/// Forms of shapes [m]. A capsule's length is that between the centres of its ends.
std::string SphereForm(double radius);
std::string CylinderForm(double radius, double length);
std::string CapsuleForm(double radius, double length);
std::string BoxForm(const SpaceVector& sides);
std::string MeshForm(const std::string& file, const SpaceVector& scale = {1, 1, 1});

struct UrdfInertial {
  Pose pose;  ///< Of the centre of mass and the axes of `moments`, in the link's frame.
  double mass_kg = 0;
  SpaceMatrix moments = SpaceMatrix::Zero();  ///< About the centre of mass [kg m^2].
};

struct UrdfLink {
  std::string name;
  std::optional<UrdfInertial> inertial = {};
  std::vector<UrdfShape> shapes = {};
};

/// A joint about or along an axis.
struct UrdfMotion {
  bool slides = false;
  SpaceVector axis = SpaceVector::UnitZ();              ///< In the child link's frame.
  std::optional<std::pair<double, double>> range = {};  ///< [rad, m]; none: it has no ends.
  std::optional<double> effort = {}, velocity = {};
  double damping = 0, friction = 0;
};

struct UrdfJoint {
  std::string name, parent, child;
  Pose place = {};                        ///< Of the child link's frame at zero, in the parent's.
  std::string type = "fixed";             ///< Of a joint without `motion`.
  std::optional<UrdfMotion> motion = {};  ///< One that slides and has no ends gets 1000 m.
};

/// Writes a URDF, in the order of the calls. Any text may be a name.
class UrdfWriter {
 public:
  explicit UrdfWriter(const std::string& robot);
  void Add(const UrdfLink& link);
  void Add(const UrdfJoint& joint);
  /// The whole text. Nothing can be added any more.
  std::string Finish();

 private:
  std::string text_;
};

}  // namespace tumbler
