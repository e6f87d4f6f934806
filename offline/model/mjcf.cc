#include "offline/model/mjcf.h"

#include <fmt/format.h>

#include <stdexcept>

#include "common/core/functions.h"
#include "common/files/markup.h"
#include "common/files/toml_reader.h"

#ifdef TUMBLER_WITH_MUJOCO

#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>

#include "offline/model/pose.h"

namespace tumbler {
namespace {

using Model = std::unique_ptr<mjModel, decltype(&mj_deleteModel)>;

Model Load(const std::string& path) {
  std::array<char, 1000> error{};
  Model model(mj_loadXML(path.c_str(), nullptr, error.data(), static_cast<int>(error.size())),
              &mj_deleteModel);
  if (model == nullptr) {
    std::string why(error.data());
    while (!why.empty() && why.back() == '\n') why.pop_back();
    throw FileError(path, 0, "", fmt::format("MuJoCo does not take it: {}", why));
  }
  return model;
}

std::string Text(double value) { return fmt::format("{}", value == 0 ? 0.0 : value); }
std::string Text(const SpaceVector& v) {
  return fmt::format("{} {} {}", Text(v.x()), Text(v.y()), Text(v.z()));
}

/// The numbers of an object in one of MuJoCo's arrays, `size` for each.
template <int size, class Number>
const Number* Row(const Number* all, int object) {
  return all + static_cast<std::ptrdiff_t>(size) * object;
}

class Converter {
 public:
  Converter(const mjModel& model, std::optional<double> velocity)
      : m_(model), velocity_(velocity) {}

  MjcfRobot Convert() {
    const int root = FreeRoot();
    urdf_ = fmt::format("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n",
                        MarkupText(m_.names[0] == 0 ? "robot" : std::string(m_.names)));
    for (int body = 0; body < m_.nbody; ++body) {
      if (root > 0 && body == 0) {
        if (m_.body_geomnum[0] > 0) Note("shapes of the world are left out");
        continue;
      }
      if (body == root || body == 0) {
        AddLink(body, SpaceVector::Zero());
      } else {
        AddBody(body);
      }
    }
    urdf_ += "</robot>\n";
    if (m_.neq > 0) Note(fmt::format("{} equality constraints are left out", m_.neq));
    if (m_.ntendon > 0) Note(fmt::format("{} tendons are left out", m_.ntendon));
    if (!velocity_)
      Note("MJCF has no limits of velocity, which a task needs: --velocity gives them");
    return {std::move(urdf_), std::move(notes_)};
  }

 private:
  void Note(std::string note) { notes_.push_back(std::move(note)); }

  /// The only body that the world carries, if it is free; -1: there is no such body.
  [[nodiscard]] int FreeRoot() const {
    int root = -1;
    for (int body = 1; body < m_.nbody; ++body) {
      if (m_.body_parentid[body] != 0) continue;
      if (root > 0) return -1;
      root = body;
    }
    const bool free =
        root > 0 && m_.body_jntnum[root] == 1 && m_.jnt_type[m_.body_jntadr[root]] == mjJNT_FREE;
    return free ? root : -1;
  }

  static SpaceVector Vector(const mjtNum* numbers) { return {numbers[0], numbers[1], numbers[2]}; }
  /// MuJoCo's w x y z.
  static SpaceMatrix Rotation(const mjtNum* quat) {
    return Pose::RotationOf(quat[1], quat[2], quat[3], quat[0]);
  }

  [[nodiscard]] std::string NameOf(mjtObj kind, int id) const {
    const char* const name = mj_id2name(&m_, kind, id);
    if (name != nullptr && *name != '\0') return name;
    return fmt::format("{}{}", kind == mjOBJ_BODY ? "body" : "joint", id);
  }

  static std::string Origin(const SpaceVector& xyz, const SpaceMatrix& R) {
    const double pitch = portable::Atan2(-R(2, 0), portable::Length(R(0, 0), R(1, 0)));
    double roll = 0, yaw = 0;
    if (portable::Length(R(0, 0), R(1, 0)) > 1e-9) {
      roll = portable::Atan2(R(2, 1), R(2, 2));
      yaw = portable::Atan2(R(1, 0), R(0, 0));
    } else {
      yaw = portable::Atan2(-R(0, 1), R(1, 1));
    }
    return fmt::format("<origin xyz=\"{}\" rpy=\"{}\"/>", Text(xyz),
                       Text(SpaceVector(roll, pitch, yaw)));
  }

  /// A body's joints, with links without mass between them, and its link. The frame of a link is
  /// that of its body, moved to the joint that carries it.
  void AddBody(int body) {
    const int parent = m_.body_parentid[body];
    std::string above = NameOf(mjOBJ_BODY, parent);
    SpaceVector place =
        Vector(Row<3>(m_.body_pos, body)) - origins_[static_cast<std::size_t>(parent)];
    SpaceMatrix turned = Rotation(Row<4>(m_.body_quat, body));
    const std::string name = NameOf(mjOBJ_BODY, body);
    SpaceVector origin = SpaceVector::Zero();  // of the link, in the body's frame
    if (m_.body_jntnum[body] == 0) {
      AddJoint(fmt::format("{}_mount", name), "fixed", above, name, place, turned, "");
    }
    for (int k = 0; k < m_.body_jntnum[body]; ++k) {
      const int joint = m_.body_jntadr[body] + k;
      const SpaceVector at = m_.jnt_type[joint] == mjJNT_FREE ? SpaceVector::Zero()
                                                              : Vector(Row<3>(m_.jnt_pos, joint));
      place += turned * (at - origin);
      origin = at;
      const bool last = k + 1 == m_.body_jntnum[body];
      const std::string below = last ? name : fmt::format("{}_{}", name, k);
      if (!last) urdf_ += fmt::format("  <link name=\"{}\"/>\n", MarkupText(below));
      AddMoving(joint, above, below, place, turned);
      above = below;
      place = SpaceVector::Zero();
      turned = SpaceMatrix::Identity();
    }
    AddLink(body, origin);
  }

  void AddMoving(int joint, const std::string& above, const std::string& below,
                 const SpaceVector& place, const SpaceMatrix& turned) {
    const std::string name = NameOf(mjOBJ_JOINT, joint);
    const int type = m_.jnt_type[joint];
    if (type == mjJNT_FREE || type == mjJNT_BALL) {
      AddJoint(name, type == mjJNT_FREE ? "floating" : "ball", above, below, place, turned, "");
      return;
    }
    const bool limited = m_.jnt_limited[joint] != 0, slides = type == mjJNT_SLIDE;
    std::string more =
        fmt::format("    <axis xyz=\"{}\"/>\n    <limit", Text(Vector(Row<3>(m_.jnt_axis, joint))));
    if (limited || slides) {
      const mjtNum zero = m_.qpos0[m_.jnt_qposadr[joint]];
      const double lower = limited ? Row<2>(m_.jnt_range, joint)[0] - zero : -1000;
      const double upper = limited ? Row<2>(m_.jnt_range, joint)[1] - zero : 1000;
      more += fmt::format(" lower=\"{}\" upper=\"{}\"", Text(lower), Text(upper));
    }
    if (const std::optional<double> effort = EffortOf(joint))
      more += fmt::format(" effort=\"{}\"", Text(*effort));
    if (velocity_) more += fmt::format(" velocity=\"{}\"", Text(*velocity_));
    const int dof = m_.jnt_dofadr[joint];
    more += fmt::format("/>\n    <dynamics damping=\"{}\" friction=\"{}\"/>\n",
                        Text(m_.dof_damping[dof]), Text(m_.dof_frictionloss[dof]));
    AddJoint(name,
             slides    ? "prismatic"
             : limited ? "revolute"
                       : "continuous",
             above, below, place, turned, more);
    if (m_.dof_armature[dof] > 0) {
      Note(fmt::format("joint '{0}': armature, for the task: limits.{0}.rotor_inertia_kg_m2 = {1}",
                       name, m_.dof_armature[dof]));
    }
    if (m_.jnt_stiffness[joint] > 0) {
      Note(fmt::format("joint '{}': its spring of {} is left out ([passive] has springs)", name,
                       m_.jnt_stiffness[joint]));
    }
  }

  /// What the joint's actuators can do together, if that has a limit.
  [[nodiscard]] std::optional<double> EffortOf(int joint) const {
    double effort = 0;
    bool any = false;
    for (int a = 0; a < m_.nu; ++a) {
      if (m_.actuator_trntype[a] != mjTRN_JOINT || Row<2>(m_.actuator_trnid, a)[0] != joint)
        continue;
      const auto largest = [](const mjtNum* range) {
        return std::max(std::abs(range[0]), std::abs(range[1]));
      };
      double force = 0;
      if (m_.actuator_forcelimited[a] != 0) {
        force = largest(Row<2>(m_.actuator_forcerange, a));
      } else if (m_.actuator_ctrllimited[a] != 0 && m_.actuator_gaintype[a] == mjGAIN_FIXED &&
                 m_.actuator_biastype[a] == mjBIAS_NONE) {
        force = largest(Row<2>(m_.actuator_ctrlrange, a)) *
                std::abs(Row<mjNGAIN>(m_.actuator_gainprm, a)[0]);
      } else {
        return std::nullopt;
      }
      any = true;
      effort += force * std::abs(Row<6>(m_.actuator_gear, a)[0]);
    }
    if (!any) return std::nullopt;
    return effort;
  }

  void AddJoint(const std::string& name, const char* type, const std::string& above,
                const std::string& below, const SpaceVector& place, const SpaceMatrix& turned,
                const std::string& more) {
    urdf_ += fmt::format(
        "  <joint name=\"{}\" type=\"{}\">\n    <parent link=\"{}\"/>\n    <child link=\"{}\"/>\n"
        "    {}\n{}  </joint>\n",
        MarkupText(name), type, MarkupText(above), MarkupText(below), Origin(place, turned), more);
  }

  void AddLink(int body, const SpaceVector& origin) {
    origins_.resize(static_cast<std::size_t>(m_.nbody), SpaceVector::Zero());
    origins_[static_cast<std::size_t>(body)] = origin;
    const std::string name = NameOf(mjOBJ_BODY, body);
    urdf_ += fmt::format("  <link name=\"{}\">\n", MarkupText(name));
    if (body > 0 && m_.body_mass[body] > 0) {
      const SpaceVector I = Vector(Row<3>(m_.body_inertia, body));
      urdf_ += fmt::format(
          "    <inertial>\n      {}\n      <mass value=\"{}\"/>\n      <inertia ixx=\"{}\" "
          "ixy=\"0\" ixz=\"0\" iyy=\"{}\" iyz=\"0\" izz=\"{}\"/>\n    </inertial>\n",
          Origin(Vector(Row<3>(m_.body_ipos, body)) - origin,
                 Rotation(Row<4>(m_.body_iquat, body))),
          Text(m_.body_mass[body]), Text(I.x()), Text(I.y()), Text(I.z()));
    }
    for (int k = 0; k < m_.body_geomnum[body]; ++k)
      AddGeom(m_.body_geomadr[body] + k, name, origin);
    urdf_ += "  </link>\n";
  }

  void AddGeom(int geom, const std::string& link, const SpaceVector& origin) {
    const SpaceVector size = Vector(Row<3>(m_.geom_size, geom));
    std::string form;
    switch (m_.geom_type[geom]) {
      case mjGEOM_SPHERE:
        form = fmt::format("<sphere radius=\"{}\"/>", Text(size.x()));
        break;
      case mjGEOM_CAPSULE:
        form = fmt::format("<capsule radius=\"{}\" length=\"{}\"/>", Text(size.x()),
                           Text(2 * size.y()));
        break;
      case mjGEOM_CYLINDER:
        form = fmt::format("<cylinder radius=\"{}\" length=\"{}\"/>", Text(size.x()),
                           Text(2 * size.y()));
        break;
      case mjGEOM_BOX:
        form = fmt::format("<box size=\"{}\"/>", Text(2 * size));
        break;
      case mjGEOM_MESH:
        form = fmt::format("<mesh filename=\"{}\"/>",
                           MarkupText(mj_id2name(&m_, mjOBJ_MESH, m_.geom_dataid[geom])));
        break;
      default:
        Note(fmt::format("link '{}': a plane, height field or ellipsoid is left out", link));
        return;
    }
    const bool collides = m_.geom_contype[geom] != 0 || m_.geom_conaffinity[geom] != 0;
    const char* const element = collides ? "collision" : "visual";
    urdf_ += fmt::format(
        "    <{0}>\n      {1}\n      <geometry>{2}</geometry>\n    </{0}>\n", element,
        Origin(Vector(Row<3>(m_.geom_pos, geom)) - origin, Rotation(Row<4>(m_.geom_quat, geom))),
        form);
  }

  const mjModel& m_;
  std::optional<double> velocity_;
  std::string urdf_;
  std::vector<std::string> notes_;
  std::vector<SpaceVector> origins_;  // of each body's link, in the body's frame
};

}  // namespace

MjcfRobot ReadMjcf(const std::string& path, std::optional<double> velocity) {
  static_cast<void>(ReadTextFile(path));  // says what is wrong with a file that is none
  const Model model = Load(path);
  return Converter(*model, velocity).Convert();
}

}  // namespace tumbler

#else

namespace tumbler {

MjcfRobot ReadMjcf(const std::string& path, std::optional<double> /*velocity*/) {
  throw std::runtime_error(fmt::format(
      "{}: this build cannot read MJCF; build it where libmujoco-dev is installed, with "
      "-DTUMBLER_WITH_MUJOCO=ON",
      path));
}

}  // namespace tumbler

#endif
