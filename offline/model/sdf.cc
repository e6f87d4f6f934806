#include "offline/model/sdf.h"

#include <fmt/format.h>

#include <stdexcept>
#include <string_view>

#include "common/files/toml_reader.h"

namespace tumbler {

bool IsSdf(const std::string& path) {
  const std::string text = ReadTextFile(path);
  std::string_view rest = text;
  for (;;) {
    const std::size_t at = rest.find('<');
    if (at == std::string_view::npos) return false;
    rest.remove_prefix(at);
    const bool comment = rest.starts_with("<!--");
    if (!comment && !rest.starts_with("<?") && !rest.starts_with("<!")) break;
    const std::string_view end = comment ? "-->" : ">";
    const std::size_t after = rest.find(end);
    if (after == std::string_view::npos) return false;
    rest.remove_prefix(after + end.size());
  }
  return rest.starts_with("<sdf") && rest.find_first_of(" \t\r\n/>") == 4;
}

}  // namespace tumbler

#ifdef TUMBLER_WITH_SDFORMAT

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <sdf/sdf.hh>
#include <utility>
#include <vector>

#include "offline/model/pose.h"
#include "offline/model/sdf_file.h"

namespace tumbler {
namespace {

Pose InverseOf(const Pose& pose) {
  return {pose.rotation.transpose(), -pose.rotation.TransposeTimes(pose.translation)};
}

SpaceVector ToVector(const ignition::math::Vector3d& v) { return {v.X(), v.Y(), v.Z()}; }

/// Elements that a URDF has not, or a robot here.
constexpr std::array kSdfLeftOut = {
    std::pair{"plugin", "plugins"},
    std::pair{"sensor", "sensors"},
    std::pair{"light", "lights"},
    std::pair{"particle_emitter", "particle emitters"},
    std::pair{"projector", "projectors"},
    std::pair{"gripper", "grippers"},
    std::pair{"audio_source", "sources of sound"},
    std::pair{"battery", "batteries"},
    std::pair{"material", "materials"},
    std::pair{"surface", "surfaces of shapes (a task has the friction)"},
    std::pair{"velocity_decay", "dampings of links (velocity_decay)"},
    std::pair{"physics", "settings of the physics of joints"},
};

/// Numbers as large as these stand for no end, and no limit, in SDF.
constexpr double kNoEndInSdf = 1e15;

class SdfConverter {
 public:
  SdfConverter(SdfFile& file, std::optional<double> velocity)
      : file_(file), velocity_(velocity), urdf_(file.model().Name()) {}

  TranslatedRobot Convert() {
    const sdf::Model& model = file_.model();
    Collect(model, "", Pose{});
    const bool on_world = CheckTree();
    const sdf::ElementPtr at = model.Element();
    ignition::math::Pose3d in_world;
    CheckPose(model.SemanticPose().Resolve(in_world), at, "model");
    const Pose world = InverseOf(ToPose(in_world, at, "model"));
    if (on_world || model.Static()) urdf_.Add(UrdfLink{.name = kSdfWorld});
    for (const LinkOfSdf& link : links_) AddLink(link);
    if (model.Static() && !on_world) {
      const LinkOfSdf& root = links_[root_];
      urdf_.Add({.name = NewJointName(fmt::format("{}_mount", root.name)),
                 .parent = kSdfWorld,
                 .child = root.name,
                 .place = InverseOf(world) * root.frame});
    }
    if (model.Static() && !joints_.empty()) {
      Note(
          "the model is <static>, of which Gazebo moves nothing: here its root is fixed to the "
          "world, and its joints move");
    }
    for (const JointOfSdf& joint : joints_) {
      const Pose parent = joint.parent == kSdfWorld ? world : links_[index_.at(joint.parent)].frame;
      AddJoint(joint, InverseOf(parent) * joint.in_model);
    }
    NoteWhatIsLeftOut(at);
    for (const auto& [kind, names] : left_out_) {
      const std::string named = Named(names);
      Note(fmt::format("left out: {} ({}){}{}", kind, names.size(), named.empty() ? "" : ": ",
                       named));
    }
    for (const auto& [what, names] : defaults_)
      Note(fmt::format("without {}: {}", what, Named(names)));
    if (without_velocity_ > 0 && !velocity_) {
      Note(
          fmt::format("{} of {} joints have no limit of velocity, which a task needs: --velocity "
                      "gives it",
                      without_velocity_, joints_.size()));
    }
    if (without_effort_ > 0) {
      Note(
          fmt::format("{} of {} joints have no limit of effort, which a task needs: <effort> of "
                      "<limit> gives it",
                      without_effort_, joints_.size()));
    }
    return {urdf_.Finish(), std::move(file_.notes)};
  }

 private:
  static constexpr const char* kSdfWorld = "world";

  struct LinkOfSdf {
    const sdf::Link* link = nullptr;
    std::string name;
    Pose in_model;  ///< In the frame of the outermost model.
    Pose frame;     ///< Of the URDF's link, there: at the joint that carries it.
    const sdf::Joint* carrier = nullptr;
    std::string parent;
  };
  struct JointOfSdf {
    const sdf::Joint* joint = nullptr;
    std::string name, parent, child;
    Pose in_model;
  };

  void Note(std::string note) { file_.notes.push_back(std::move(note)); }

  /// A name that no joint has.
  [[nodiscard]] std::string NewJointName(std::string name) const {
    const auto has_name = [&name](const JointOfSdf& joint) { return joint.name == name; };
    while (std::any_of(joints_.begin(), joints_.end(), has_name)) name.push_back('_');
    return name;
  }

  /// The first names of a list; those that are empty are none.
  static std::string Named(std::vector<std::string> names) {
    constexpr std::size_t kShown = 8;
    names.erase(std::remove(names.begin(), names.end(), ""), names.end());
    const std::size_t shown = std::min(kShown, names.size()), more = names.size() - shown;
    names.resize(shown);
    if (names.empty()) return "";
    return fmt::format("'{}'{}", fmt::join(names, "', '"),
                       more > 0 ? fmt::format(" and {} more", more) : "");
  }

  void CheckPose(const sdf::Errors& errors, const sdf::ElementPtr& at,
                 const std::string& key) const {
    if (!errors.empty()) file_.Fail(at, key, errors.front().Message());
  }

  double Finite(double value, const sdf::ElementPtr& at, const std::string& key,
                const char* what) const {
    if (!std::isfinite(value))
      file_.Fail(at, key, fmt::format("{} is {}; allowed: a finite number", what, value));
    return value;
  }

  [[nodiscard]] Pose ToPose(const ignition::math::Pose3d& pose, const sdf::ElementPtr& at,
                            const std::string& key) const {
    const auto& q = pose.Rot();
    for (const double value :
         {pose.Pos().X(), pose.Pos().Y(), pose.Pos().Z(), q.X(), q.Y(), q.Z(), q.W()})
      Finite(value, at, key, "a number of a <pose>");
    return {Pose::RotationOf(q.X(), q.Y(), q.Z(), q.W()), ToVector(pose.Pos())};
  }

  /// Links and joints of a model, and of those in it.
  void Collect(const sdf::Model& model,  // NOLINT(misc-no-recursion)
               const std::string& prefix, const Pose& in_top) {
    for (std::uint64_t k = 0; k < model.LinkCount(); ++k) {
      const sdf::Link& link = *model.LinkByIndex(k);
      const std::string name = prefix + link.Name(), key = fmt::format("link '{}'", name);
      ignition::math::Pose3d pose;
      CheckPose(link.SemanticPose().Resolve(pose, "__model__"), link.Element(), key);
      const Pose at = in_top * ToPose(pose, link.Element(), key);
      index_.emplace(name, links_.size());
      links_.push_back({&link, name, at, at, nullptr, ""});
    }
    for (std::uint64_t k = 0; k < model.JointCount(); ++k) {
      const sdf::Joint& joint = *model.JointByIndex(k);
      const std::string name = prefix + joint.Name(), key = fmt::format("joint '{}'", name);
      ignition::math::Pose3d pose;
      std::string parent, child;
      CheckPose(joint.SemanticPose().Resolve(pose, "__model__"), joint.Element(), key);
      CheckPose(joint.ResolveParentLink(parent), joint.Element(), key);
      CheckPose(joint.ResolveChildLink(child), joint.Element(), key);
      if (parent != kSdfWorld) parent.insert(0, prefix);
      joints_.push_back(
          {&joint, name, parent, prefix + child, in_top * ToPose(pose, joint.Element(), key)});
    }
    for (std::uint64_t k = 0; k < model.ModelCount(); ++k) {
      const sdf::Model& inner = *model.ModelByIndex(k);
      const std::string key = fmt::format("model '{}'", inner.Name());
      ignition::math::Pose3d pose;
      CheckPose(inner.SemanticPose().Resolve(pose, "__model__"), inner.Element(), key);
      Collect(inner, fmt::format("{}{}::", prefix, inner.Name()),
              in_top * ToPose(pose, inner.Element(), key));
    }
  }

  /// Finds what carries each link, and the root. Returns whether that is the world.
  bool CheckTree() {
    bool on_world = false;
    for (const JointOfSdf& joint : joints_) {
      const std::string key = fmt::format("joint '{}'", joint.name);
      const auto child = index_.find(joint.child);
      if (child == index_.end() ||
          (joint.parent != kSdfWorld && index_.find(joint.parent) == index_.end())) {
        file_.Fail(
            joint.joint->Element(), key,
            fmt::format("'{}' is no link of the model; allowed: any link of it, or 'world' as the "
                        "parent",
                        child == index_.end() ? joint.child : joint.parent));
      }
      on_world = on_world || joint.parent == kSdfWorld;
      LinkOfSdf& link = links_[child->second];
      if (link.carrier != nullptr) {
        file_.Fail(
            joint.joint->Element(), key,
            fmt::format("its <child> '{}' is already that of joint '{}' (line {}); allowed: a "
                        "tree, in which a link hangs on one joint. Take out the joint that closes "
                        "a loop, or swap the <parent> and <child> of one that is the wrong way "
                        "round",
                        link.name, link.carrier->Name(), SdfFile::LineOf(link.carrier->Element())));
      }
      link.carrier = joint.joint;
      link.parent = joint.parent;
      link.frame = joint.in_model;
    }
    CheckRoots(on_world);
    return on_world;
  }

  /// There is one root, and every link leads up to it.
  void CheckRoots(bool on_world) {
    std::string root = on_world ? kSdfWorld : "";
    for (std::size_t k = 0; k < links_.size(); ++k) {
      const LinkOfSdf& link = links_[k];
      if (link.carrier != nullptr) continue;
      if (root.empty()) {
        root = link.name;
        root_ = k;
        continue;
      }
      file_.Fail(link.link->Element(), fmt::format("link '{}'", link.name),
                 fmt::format("no joint carries it, and {}; a robot has one such root link. Give it "
                             "a joint, or take it out",
                             on_world ? "others hang on the world"
                                      : fmt::format("none carries '{}'", root)));
    }
    for (const LinkOfSdf& link : links_) {
      const LinkOfSdf* at = &link;
      for (std::size_t steps = 0; at->carrier != nullptr && at->parent != kSdfWorld; ++steps) {
        if (steps > links_.size()) {
          file_.Fail(at->link->Element(), fmt::format("link '{}'", at->name),
                     "the joints above it lead back to itself; allowed: a tree");
        }
        at = &links_[index_.at(at->parent)];
      }
    }
  }

  void AddLink(const LinkOfSdf& from) {
    UrdfLink link{.name = from.name};
    const std::string key = fmt::format("link '{}'", from.name);
    const sdf::ElementPtr at = from.link->Element();
    const Pose placed = InverseOf(from.frame) * from.in_model;
    const auto& inertial = from.link->Inertial();
    const auto moments = inertial.MassMatrix().Moi();
    NoteDefaults(from);
    UrdfInertial& made = link.inertial.emplace();
    made.pose = placed * ToPose(inertial.Pose(), at, key);
    made.mass_kg = Finite(inertial.MassMatrix().Mass(), at, key, "its mass");
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        made.moments(row, column) =
            Finite(moments(static_cast<std::size_t>(row), static_cast<std::size_t>(column)), at,
                   key, "a moment of inertia");
      }
    }
    for (std::uint64_t k = 0; k < from.link->CollisionCount(); ++k)
      AddShape(*from.link->CollisionByIndex(k), true, placed, key, link);
    for (std::uint64_t k = 0; k < from.link->VisualCount(); ++k)
      AddShape(*from.link->VisualByIndex(k), false, placed, key, link);
    if (at->HasElement("gravity") && !at->Get<bool>("gravity"))
      Note(fmt::format("{} has no <gravity> in Gazebo; here all links have", key));
    if (at->HasElement("kinematic") && at->Get<bool>("kinematic"))
      Note(fmt::format("{} is <kinematic> in Gazebo; here it moves as the others do", key));
    urdf_.Add(link);
  }

  /// Remembers what the library has put in for what an inertial has not.
  void NoteDefaults(const LinkOfSdf& link) {
    const auto given = [](const sdf::ElementPtr& in, const std::string& name) -> sdf::ElementPtr {
      if (!in->HasElement(name)) return nullptr;
      sdf::ElementPtr found = in->FindElement(name);
      return found->GetExplicitlySetInFile() ? found : nullptr;
    };
    const auto note = [&](const std::string& name, const char* value) {
      defaults_[fmt::format("<{}>, for which SDF has {}", name, value)].push_back(link.name);
    };
    const sdf::ElementPtr inertial = given(link.link->Element(), "inertial");
    if (inertial == nullptr) {
      note("inertial", "1 kg and 1 kg m^2");
      return;
    }
    if (given(inertial, "mass") == nullptr) note("mass", "1 kg");
    const sdf::ElementPtr inertia = given(inertial, "inertia");
    if (inertia == nullptr) {
      note("inertia", "1 kg m^2");
      return;
    }
    for (const char* const moment : {"ixx", "iyy", "izz"}) {
      if (given(inertia, moment) == nullptr) note(moment, "1 kg m^2");
    }
    for (const char* const product : {"ixy", "ixz", "iyz"}) {
      if (given(inertia, product) != nullptr) continue;
      defaults_["<ixy>, <ixz> or <iyz>, for which SDF has 0"].push_back(link.name);
      break;
    }
  }

  template <class Shape>
  void AddShape(const Shape& shape, bool collides, const Pose& placed, const std::string& key,
                UrdfLink& link) {
    const sdf::ElementPtr at = shape.Element();
    ignition::math::Pose3d pose;
    CheckPose(shape.SemanticPose().Resolve(pose), at, key);
    const std::optional<std::string> form = FormOf(*shape.Geom(), at, key);
    if (!form) {
      const sdf::ElementPtr what =
          shape.Geom()->Element() == nullptr ? nullptr : shape.Geom()->Element()->GetFirstElement();
      Note(fmt::format("{}: the shape '{}' is left out: a URDF has no <{}>", key, shape.Name(),
                       what == nullptr ? "geometry" : what->GetName()));
      return;
    }
    link.shapes.push_back(
        {.collides = collides, .pose = placed * ToPose(pose, at, key), .form = *form});
  }

  /// None, where a URDF has no such form.
  [[nodiscard]] std::optional<std::string> FormOf(const sdf::Geometry& shape,
                                                  const sdf::ElementPtr& at,
                                                  const std::string& key) {
    const auto size = [&](double value) { return Finite(value, at, key, "a size of a shape"); };
    const auto sizes = [&](const ignition::math::Vector3d& v) {
      return SpaceVector(size(v.X()), size(v.Y()), size(v.Z()));
    };
    switch (shape.Type()) {
      case sdf::GeometryType::SPHERE:
        return SphereForm(size(shape.SphereShape()->Radius()));
      case sdf::GeometryType::CYLINDER:
        return CylinderForm(size(shape.CylinderShape()->Radius()),
                            size(shape.CylinderShape()->Length()));
      case sdf::GeometryType::CAPSULE:
        return CapsuleForm(size(shape.CapsuleShape()->Radius()),
                           size(shape.CapsuleShape()->Length()));
      case sdf::GeometryType::BOX:
        return BoxForm(sizes(shape.BoxShape()->Size()));
      case sdf::GeometryType::MESH: {
        const sdf::Mesh& mesh = *shape.MeshShape();
        if (!mesh.Submesh().empty()) {
          Note(fmt::format("{}: of a mesh its part '{}' is named; the URDF has the whole", key,
                           mesh.Submesh()));
        }
        return MeshForm(MeshFile(mesh), sizes(mesh.Scale()));
      }
      default:
        return std::nullopt;
    }
  }

  /// A URDF beside the SDF finds it.
  [[nodiscard]] std::string MeshFile(const sdf::Mesh& mesh) const {
    constexpr std::string_view kModel = "model://";
    std::string uri = mesh.Uri();
    if (uri.starts_with(kModel)) return "package://" + uri.substr(kModel.size());
    const std::filesystem::path folder = std::filesystem::path(mesh.FilePath()).parent_path();
    const bool relative = uri.find("://") == std::string::npos && !uri.starts_with('/');
    if (!relative || folder.empty() || folder == file_.absolute().parent_path()) return uri;
    return (folder / uri).string();
  }

  void AddJoint(const JointOfSdf& from, const Pose& place) {
    const std::string key = fmt::format("joint '{}'", from.name);
    const sdf::ElementPtr at = from.joint->Element();
    UrdfJoint made{.name = from.name, .parent = from.parent, .child = from.child, .place = place};
    switch (from.joint->Type()) {
      case sdf::JointType::REVOLUTE:
      case sdf::JointType::CONTINUOUS:
      case sdf::JointType::PRISMATIC:
        made.motion = MotionOf(*from.joint, key);
        break;
      case sdf::JointType::FIXED:
        break;
      default:
        made.type = at->Get<std::string>("type");
        Note(fmt::format("{} is of the type {}, of which a robot here has none: it is held", key,
                         made.type));
    }
    urdf_.Add(made);
  }

  UrdfMotion MotionOf(const sdf::Joint& joint, const std::string& key) {
    const sdf::JointAxis* const axis = joint.Axis();
    if (axis == nullptr) file_.Fail(joint.Element(), key, "lacks <axis>");
    const sdf::ElementPtr at = axis->Element();
    ignition::math::Vector3d xyz;
    CheckPose(axis->ResolveXyz(xyz), at, key);
    UrdfMotion motion{.slides = joint.Type() == sdf::JointType::PRISMATIC, .axis = ToVector(xyz)};
    for (int i = 0; i < 3; ++i) Finite(motion.axis[i], at, key, "a number of <xyz>");
    motion.range = RangeOf(joint, *axis, key);
    const auto limit = [&](double value, const char* what) -> std::optional<double> {
      if (std::isnan(value)) Finite(value, at, key, what);
      if (value >= kNoEndInSdf) return std::nullopt;
      return value;
    };
    motion.effort = limit(axis->Effort(), "<effort>");
    if (!motion.effort) ++without_effort_;
    motion.velocity = limit(axis->MaxVelocity(), "<velocity>");
    if (!motion.velocity) {
      ++without_velocity_;
      motion.velocity = velocity_;
    }
    motion.damping = Finite(axis->Damping(), at, key, "<damping>");
    motion.friction = Finite(axis->Friction(), at, key, "<friction>");
    if (at->HasElement("mimic"))
      Note(fmt::format("{}: its <mimic> is left out: the joint moves for itself", key));
    if (axis->SpringStiffness() != 0) {
      Note(fmt::format("{}: its spring of {} is left out ([passive] has springs)", key,
                       axis->SpringStiffness()));
    }
    return motion;
  }

  /// Ends of a joint; none: it has no end.
  std::optional<std::pair<double, double>> RangeOf(const sdf::Joint& joint,
                                                   const sdf::JointAxis& axis,
                                                   const std::string& key) {
    constexpr double kFarEnd = 1000;
    double lower = axis.Lower(), upper = axis.Upper();
    if (std::isnan(lower) || std::isnan(upper))
      file_.Fail(axis.Element(), key, "an end of <limit> is NaN; allowed: a number");
    const bool has_lower = lower > -kNoEndInSdf, has_upper = upper < kNoEndInSdf;
    if (joint.Type() == sdf::JointType::CONTINUOUS || (!has_lower && !has_upper))
      return std::nullopt;
    if (!has_lower) lower = std::min(0.0, upper) - kFarEnd;
    if (!has_upper) upper = std::max(0.0, lower) + kFarEnd;
    if (!has_lower || !has_upper) {
      Note(fmt::format("{}: its <limit> has no {} end: {} is written", key,
                       has_lower ? "upper" : "lower", has_lower ? upper : lower));
    }
    if (lower > upper) {
      file_.Fail(axis.Element(), key,
                 fmt::format("<lower> is {} and <upper> is {}; allowed: an upper end that is not "
                             "below the lower one",
                             lower, upper));
    }
    return std::pair(lower, upper);
  }

  void NoteWhatIsLeftOut(const sdf::ElementPtr& element) {  // NOLINT(misc-no-recursion)
    for (sdf::ElementPtr e = element->GetFirstElement(); e != nullptr; e = e->GetNextElement()) {
      const auto kind = std::find_if(kSdfLeftOut.begin(), kSdfLeftOut.end(),
                                     [&](const auto& row) { return e->GetName() == row.first; });
      if (kind == kSdfLeftOut.end()) {
        NoteWhatIsLeftOut(e);
      } else if (e->GetExplicitlySetInFile()) {
        left_out_[kind->second].push_back(e->HasAttribute("name") ? e->Get<std::string>("name")
                                                                  : "");
      }
    }
  }

  SdfFile& file_;
  std::optional<double> velocity_;
  UrdfWriter urdf_;
  std::vector<LinkOfSdf> links_;
  std::map<std::string, std::size_t> index_;  // of links, by name
  std::vector<JointOfSdf> joints_;
  std::size_t root_ = 0;  // the link that nothing carries, where the world is not the root
  std::size_t without_velocity_ = 0, without_effort_ = 0;
  std::map<std::string, std::vector<std::string>> left_out_;  // names, by kind
  std::map<std::string, std::vector<std::string>> defaults_;  // names of links, by what they lack
};

}  // namespace

TranslatedRobot ReadSdf(const std::string& path, std::optional<double> velocity) {
  static_cast<void>(ReadTextFile(path));  // says what is wrong with a file that is none
  SdfFile file(path);
  return SdfConverter(file, velocity).Convert();
}

}  // namespace tumbler

#else

namespace tumbler {

TranslatedRobot ReadSdf(const std::string& path, std::optional<double> /*velocity*/) {
  throw std::runtime_error(fmt::format(
      "{}: this build cannot read SDF; build it where libsdformat-dev is installed, with "
      "-DTUMBLER_WITH_SDFORMAT=ON",
      path));
}

}  // namespace tumbler

#endif
