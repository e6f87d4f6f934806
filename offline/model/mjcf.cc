#include "offline/model/mjcf.h"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

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

/// The numbers of an object in one of MuJoCo's arrays, `size` for each.
template <int size, class Number>
const Number* Row(const Number* all, int object) {
  return all + static_cast<std::ptrdiff_t>(size) * object;
}

class Converter {
 public:
  Converter(const mjModel& model, std::optional<double> velocity)
      : m_(model), velocity_(velocity), urdf_(std::string(model.names)) {}

  TranslatedRobot Convert() {
    const int root = FreeRoot();
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
    if (m_.neq > 0) Note(fmt::format("{} equality constraints are left out", m_.neq));
    if (m_.ntendon > 0) Note(fmt::format("{} tendons are left out", m_.ntendon));
    if (!velocity_)
      Note("MJCF has no limits of velocity, which a task needs: --velocity gives them");
    return {urdf_.Finish(), std::move(notes_)};
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
      urdf_.Add({.name = fmt::format("{}_mount", name),
                 .parent = above,
                 .child = name,
                 .place = {turned, place}});
    }
    for (int k = 0; k < m_.body_jntnum[body]; ++k) {
      const int joint = m_.body_jntadr[body] + k;
      const SpaceVector at = m_.jnt_type[joint] == mjJNT_FREE ? SpaceVector::Zero()
                                                              : Vector(Row<3>(m_.jnt_pos, joint));
      place += turned * (at - origin);
      origin = at;
      const bool last = k + 1 == m_.body_jntnum[body];
      const std::string below = last ? name : fmt::format("{}_{}", name, k);
      if (!last) urdf_.Add(UrdfLink{.name = below});
      AddMoving(joint, above, below, {turned, place});
      above = below;
      place = SpaceVector::Zero();
      turned = SpaceMatrix::Identity();
    }
    AddLink(body, origin);
  }

  void AddMoving(int joint, const std::string& above, const std::string& below, const Pose& place) {
    const std::string name = NameOf(mjOBJ_JOINT, joint);
    const int type = m_.jnt_type[joint];
    UrdfJoint made{.name = name, .parent = above, .child = below, .place = place};
    if (type == mjJNT_FREE || type == mjJNT_BALL) {
      made.type = type == mjJNT_FREE ? "floating" : "ball";
      urdf_.Add(made);
      return;
    }
    const int dof = m_.jnt_dofadr[joint];
    UrdfMotion motion{.slides = type == mjJNT_SLIDE,
                      .axis = Vector(Row<3>(m_.jnt_axis, joint)),
                      .effort = EffortOf(joint),
                      .velocity = velocity_,
                      .damping = m_.dof_damping[dof],
                      .friction = m_.dof_frictionloss[dof]};
    if (m_.jnt_limited[joint] != 0) {
      const mjtNum zero = m_.qpos0[m_.jnt_qposadr[joint]];
      const mjtNum* const range = Row<2>(m_.jnt_range, joint);
      motion.range = {range[0] - zero, range[1] - zero};
    }
    made.motion = motion;
    urdf_.Add(made);
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

  void AddLink(int body, const SpaceVector& origin) {
    origins_.resize(static_cast<std::size_t>(m_.nbody), SpaceVector::Zero());
    origins_[static_cast<std::size_t>(body)] = origin;
    UrdfLink link{.name = NameOf(mjOBJ_BODY, body)};
    if (body > 0 && m_.body_mass[body] > 0) {
      link.inertial = {.pose = {Rotation(Row<4>(m_.body_iquat, body)),
                                Vector(Row<3>(m_.body_ipos, body)) - origin},
                       .mass_kg = m_.body_mass[body],
                       .moments = SpaceMatrix::Diagonal(Vector(Row<3>(m_.body_inertia, body)))};
    }
    for (int k = 0; k < m_.body_geomnum[body]; ++k) {
      const int geom = m_.body_geomadr[body] + k;
      const std::optional<std::string> form = FormOf(geom);
      if (!form) {
        Note(fmt::format("link '{}': a plane, height field or ellipsoid is left out", link.name));
        continue;
      }
      link.shapes.push_back(
          {.collides = m_.geom_contype[geom] != 0 || m_.geom_conaffinity[geom] != 0,
           .pose = {Rotation(Row<4>(m_.geom_quat, geom)),
                    Vector(Row<3>(m_.geom_pos, geom)) - origin},
           .form = *form});
    }
    urdf_.Add(link);
  }

  /// None, where a URDF has no such form.
  [[nodiscard]] std::optional<std::string> FormOf(int geom) const {
    const SpaceVector size = Vector(Row<3>(m_.geom_size, geom));
    switch (m_.geom_type[geom]) {
      case mjGEOM_SPHERE:
        return SphereForm(size.x());
      case mjGEOM_CAPSULE:
        return CapsuleForm(size.x(), 2 * size.y());
      case mjGEOM_CYLINDER:
        return CylinderForm(size.x(), 2 * size.y());
      case mjGEOM_BOX:
        return BoxForm(2 * size);
      case mjGEOM_MESH:
        return MeshForm(mj_id2name(&m_, mjOBJ_MESH, m_.geom_dataid[geom]));
      default:
        return std::nullopt;
    }
  }

  const mjModel& m_;
  std::optional<double> velocity_;
  UrdfWriter urdf_;
  std::vector<std::string> notes_;
  std::vector<SpaceVector> origins_;  // of each body's link, in the body's frame
};

}  // namespace

TranslatedRobot ReadMjcf(const std::string& path, std::optional<double> velocity) {
  static_cast<void>(ReadTextFile(path));  // says what is wrong with a file that is none
  const Model model = Load(path);
  return Converter(*model, velocity).Convert();
}

}  // namespace tumbler

#else

namespace tumbler {

TranslatedRobot ReadMjcf(const std::string& path, std::optional<double> /*velocity*/) {
  throw std::runtime_error(fmt::format(
      "{}: this build cannot read MJCF; build it where libmujoco-dev is installed, with "
      "-DTUMBLER_WITH_MUJOCO=ON",
      path));
}

}  // namespace tumbler

#endif
