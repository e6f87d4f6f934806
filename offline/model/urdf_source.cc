#include "offline/model/urdf_source.h"

#include <fmt/format.h>
#include <tinyxml.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "common/core/functions.h"
#include "common/files/printable.h"
#include "common/files/toml_reader.h"
#include "offline/model/urdf_elements.h"

namespace tumbler {
namespace {

/// The link that files hang a robot on without having it.
constexpr const char* kWorld = "world";
/// No robot has more links. Reading them would take for ever.
constexpr std::size_t kMostLinks = 1000;
constexpr double kRightAngle = std::numbers::pi / 2;

/// Adds the lines of all elements below `parent`. Of several elements of a name the first counts.
template <class Lines>
void AddLines(const TiXmlElement& parent, Lines& lines) {
  for (const TiXmlElement* e = parent.FirstChildElement(); e != nullptr;
       e = e->NextSiblingElement()) {
    lines.emplace(e->ValueStr(), LineOf(*e));
    AddLines(*e, lines);
  }
}

/// In words, such as `-3 pi/2`, for a multiple of pi/2 other than 0.
std::string RightAnglesInWords(int count) {
  const int whole = count % 2 == 0 ? count / 2 : count;
  const std::string factor = whole == 1 ? "" : whole == -1 ? "-" : fmt::format("{} ", whole);
  return factor + (count % 2 == 0 ? "pi" : "pi/2");
}

/// The multiple of pi/2, other than 0, that an angle is a rounded one of; else 0.
int RightAnglesMeant(double angle) {
  // With 13 digits or more, nobody has rounded.
  constexpr double kExact_rad = 1e-12;
  const double count = std::round(angle / kRightAngle);
  const double off = std::abs(angle - count * kRightAngle);
  return off > kRoundedBy_rad || off <= kExact_rad ? 0 : static_cast<int>(count);
}

// From here on elements were checked.

/// The numbers of an attribute; none where it is not there.
std::vector<double> Numbers(const TiXmlElement& element, const char* attribute) {
  std::optional<std::vector<double>> numbers = ToNumbers(TextOf(element, attribute));
  return std::move(numbers.value());
}

/// Notes the angles of the origins below an element that are rounded multiples of pi/2.
/// @param key  of the link or joint that holds them.
void NoteRightAngles(const TiXmlElement& element, const std::string& key,
                     std::vector<RoundedAngle>& rounded) {
  if (element.ValueStr() == "origin") {
    for (const double angle : Numbers(element, "rpy")) {
      if (const int count = RightAnglesMeant(angle); count != 0)
        rounded.push_back({LineOf(element), key, angle, RightAnglesInWords(count)});
    }
  }
  for (const TiXmlElement* e = element.FirstChildElement(); e != nullptr;
       e = e->NextSiblingElement())
    NoteRightAngles(*e, key, rounded);
}

/// The number of an attribute, or what stands for one that is not there.
double Number(const TiXmlElement& element, const char* attribute, double without = 0) {
  const std::vector<double> numbers = Numbers(element, attribute);
  return numbers.empty() ? without : numbers.front();
}

SpaceVector Vector(const TiXmlElement& element, const char* attribute, const SpaceVector& without) {
  const std::vector<double> numbers = Numbers(element, attribute);
  return numbers.empty() ? without : SpaceVector(numbers[0], numbers[1], numbers[2]);
}

/// The rotation by three angles, each about a fixed axis: x, then y, then z.
SpaceMatrix RotationOf(const SpaceVector& rpy) {
  const auto half = [&rpy](int i) {
    const int count = RightAnglesMeant(rpy[i]);
    const double angle = (count == 0 ? rpy[i] : count * kRightAngle) / 2;
    return std::pair(portable::Sin(angle), portable::Cos(angle));
  };
  const auto [sr, cr] = half(0);
  const auto [sp, cp] = half(1);
  const auto [sy, cy] = half(2);
  const double x = sr * cp * cy - cr * sp * sy, y = cr * sp * cy + sr * cp * sy;
  const double z = cr * cp * sy - sr * sp * cy, w = cr * cp * cy + sr * sp * sy;
  const double size = std::sqrt(x * x + y * y + z * z + w * w);
  return Pose::RotationOf(x / size, y / size, z / size, w / size);
}

/// That of the `<origin>` in an element.
Pose PoseIn(const TiXmlElement& parent) {
  const TiXmlElement* const origin = parent.FirstChildElement("origin");
  if (origin == nullptr) return {};
  const SpaceVector zero = SpaceVector::Zero();
  return {RotationOf(Vector(*origin, "rpy", zero)), Vector(*origin, "xyz", zero)};
}

RobotShape ReadShape(const TiXmlElement& element) {
  const TiXmlElement& form = *element.FirstChildElement("geometry")->FirstChildElement();
  const std::string& kind = form.ValueStr();
  RobotShape shape;
  shape.pose = PoseIn(element);
  shape.radius_m = Number(form, "radius");
  if (kind == "sphere") {
    shape.kind = RobotShape::Kind::kSphere;
  } else if (kind == "box") {
    shape.kind = RobotShape::Kind::kBox;
    shape.size_m = Vector(form, "size", SpaceVector::Zero());
  } else if (kind == "mesh") {
    shape.kind = RobotShape::Kind::kMesh;
    shape.mesh_file = TextOf(form, "filename");
    shape.mesh_scale = Vector(form, "scale", shape.mesh_scale);
  } else {
    shape.kind = RobotShape::Kind::kCylinder;
    shape.length_m = Number(form, "length");
    // A capsule's is that between the centres of its ends.
    if (kind == kCapsule) shape.length_m += 2 * shape.radius_m;
  }
  shape.mesh_point = TextOf(element, "name") == kMeshPoint && shape.radius_m == 0 &&
                     shape.kind == RobotShape::Kind::kSphere;
  return shape;
}

UrdfSource::Link ReadLink(const TiXmlElement& element, const std::string& name) {
  UrdfSource::Link link;
  link.name = name;
  if (const TiXmlElement* const inertial = element.FirstChildElement("inertial")) {
    const TiXmlElement& inertia = *inertial->FirstChildElement("inertia");
    const double xy = Number(inertia, "ixy"), xz = Number(inertia, "ixz");
    const double yz = Number(inertia, "iyz");
    link.inertial = {PoseIn(*inertial), Number(*inertial->FirstChildElement("mass"), "value"),
                     SpaceMatrix({Number(inertia, "ixx"), xy, xz}, {xy, Number(inertia, "iyy"), yz},
                                 {xz, yz, Number(inertia, "izz")})};
  }
  for (const auto& [kind, shapes] :
       {std::pair("collision", &link.collision_shapes), std::pair("visual", &link.visual_shapes)}) {
    for (const TiXmlElement* e = element.FirstChildElement(kind); e != nullptr;
         e = e->NextSiblingElement(kind)) {
      RobotShape shape = ReadShape(*e);
      shape.name = fmt::format("{}/{}", name, shapes->size());
      shape.link = name;
      shape.line = LineOf(element);
      shapes->push_back(std::move(shape));
    }
  }
  return link;
}

/// The limits of a joint that moves.
/// @param finding  about the joint, of which the problem is to be filled in.
void ReadLimits(const TiXmlElement& joint, RobotFinding finding, UrdfSource::Joint& out) {
  const TiXmlElement* const limit = joint.FirstChildElement("limit");
  const auto lack = [&](const std::string& problem) {
    finding.problem = problem;
    out.lacks.push_back(finding);
  };
  if (limit == nullptr) {
    if (out.type == UrdfSource::Joint::Type::kContinuous) return;
    lack("lacks <limit>");
    out.limits.emplace();  // Without ends, it can be looked at wherever it is.
    return;
  }
  // One so large is none.
  const auto read = [limit](const char* attribute, double without) {
    constexpr double kNoLimit = 1e300;
    const double given = Number(*limit, attribute, without);
    return std::abs(given) < kNoLimit
               ? given
               : std::copysign(std::numeric_limits<double>::infinity(), given);
  };
  finding.line = LineOf(*limit);
  for (const char* attribute : {"effort", "velocity"}) {
    if (limit->Attribute(attribute) == nullptr)
      lack(fmt::format("<limit> lacks the attribute {}", attribute));
  }
  const double none = RobotJointLimits{}.upper_rad;
  out.limits = {read("lower", 0), read("upper", 0), read("velocity", none), read("effort", none)};
}

UrdfSource::Joint ReadJoint(const TiXmlElement& element, const std::string& name,
                            const std::string& key) {
  UrdfSource::Joint joint;
  joint.name = name;
  const std::string type = TextOf(element, "type");
  const auto known = std::find(kJointTypes.begin(), kJointTypes.end(), type);
  if (known == kJointTypes.end()) {
    joint.held_because = fmt::format("its type is '{}'; allowed: {}, or lock it at 0", type,
                                     fmt::join(kJointTypes, ", "));
  } else {
    joint.type = static_cast<UrdfSource::Joint::Type>(known - kJointTypes.begin());
  }
  joint.parent = TextOf(*element.FirstChildElement("parent"), "link");
  joint.child = TextOf(*element.FirstChildElement("child"), "link");
  joint.pose = PoseIn(element);
  if (const TiXmlElement* const axis = element.FirstChildElement("axis"))
    joint.axis = Vector(*axis, "xyz", joint.axis);
  if (joint.type != UrdfSource::Joint::Type::kFixed)
    ReadLimits(element, {LineOf(element), key, ""}, joint);
  if (const TiXmlElement* const dynamics = element.FirstChildElement("dynamics")) {
    joint.damping = Number(*dynamics, "damping");
    joint.friction = Number(*dynamics, "friction");
  }
  if (const TiXmlElement* const mimic = element.FirstChildElement("mimic")) {
    joint.mimic = {TextOf(*mimic, "joint"), Number(*mimic, "multiplier", 1),
                   Number(*mimic, "offset")};
  }
  return joint;
}

}  // namespace

std::string Describe(const RoundedAngle& angle) {
  return fmt::format("origin rpy {} is taken as {}", ExactDecimal(angle.given), angle.taken_as);
}

/// Reads and checks the elements of a source.
class UrdfSource::Reader {
 public:
  Reader(UrdfSource& source, const std::string& text, const std::string& file)
      : source_(source), file_(file), robot_(ParseUrdfElements(text, file, document_)) {
    source_.name_ = TextOf(robot_, "name");
    CheckElements();
    if (links_named_) ReadEnds();
    if (links_named_ && connected_) CheckTree();
    if (links_.empty()) mistakes_.push_back({LineOf(robot_), "robot", "has no link"});
    if (!mistakes_.empty()) throw RobotFileError(file_, mistakes_);
    ReadElements();
  }

 private:
  /// An element with its name. Of the link `world` that the file lacks it is the end of a joint.
  struct Named {
    std::string name;
    const TiXmlElement* element;
  };
  /// A joint by the links that it connects.
  struct Edge {
    Named joint;
    const TiXmlElement *parent, *child;
  };

  static std::string KeyOf(const Named& of) {
    return fmt::format("{} '{}'", of.element->ValueStr(), of.name);
  }
  static Lines LinesOf(const TiXmlElement& element) {
    Lines lines{{"", LineOf(element)}};
    AddLines(element, lines);
    return lines;
  }

  void CheckElements() {
    for (const TiXmlElement* e = robot_.FirstChildElement(); e != nullptr;
         e = e->NextSiblingElement()) {
      const bool is_link = e->ValueStr() == "link";
      if (!is_link && e->ValueStr() != "joint") continue;
      const Named named{TextOf(*e, "name"), e};
      const ElementChecker check(mistakes_, KeyOf(named));
      std::vector<Named>& of_kind = is_link ? links_ : joints_;
      CheckName(named, is_link, of_kind.size(), check);
      of_kind.push_back(named);
      if (is_link) {
        if (links_.size() > kMostLinks) {
          check.Note(*e, fmt::format("the robot has more than {} links", kMostLinks));
          throw RobotFileError(file_, mistakes_);
        }
        check.CheckLink(*e);
      } else {
        check.CheckJoint(*e);
        const Edge edge{named, check.Required(*e, "parent"), check.Required(*e, "child")};
        if (edge.parent != nullptr && edge.child != nullptr) {
          edges_.push_back(edge);
        } else {
          connected_ = false;
        }
      }
    }
  }

  void CheckName(const Named& named, bool is_link, std::size_t index, const ElementChecker& check) {
    if (const char* mistake = MistakeInName(named.name))
      check.Note(*named.element, std::string("the name ") + mistake);
    if (named.name.empty()) {
      check.Note(*named.element, "has no name; give it the attribute name");
      links_named_ = links_named_ && !is_link;
    }
    Places& places = is_link ? source_.link_places_ : source_.joint_places_;
    const auto [other, is_new] = places.emplace(named.name, Place{index, LinesOf(*named.element)});
    if (is_new || named.name.empty()) return;
    check.Note(*named.element,
               fmt::format("the name is taken by line {}", other->second.lines.at("")));
    links_named_ = links_named_ && !is_link;
  }

  /// Looks for the links that joints connect.
  void ReadEnds() {
    std::map<std::string, std::string> carried_by;
    for (const Edge& edge : edges_) {
      const ElementChecker check(mistakes_, KeyOf(edge.joint));
      for (const TiXmlElement* end : {edge.parent, edge.child}) {
        const std::string name = TextOf(*end, "link");
        if (source_.link_places_.count(name) != 0) continue;
        if (name == kWorld && end == edge.parent) {
          AddWorld(edge);
          continue;
        }
        check.Note(*end, fmt::format("<{}> is the link '{}', which is not in the file",
                                     end->ValueStr(), name));
        connected_ = false;
      }
      const std::string child = TextOf(*edge.child, "link");
      if (const auto [other, is_new] = carried_by.emplace(child, edge.joint.name); !is_new) {
        check.Note(*edge.child,
                   fmt::format("its <child> '{}' is already that of joint '{}'; a link hangs on "
                               "one joint only",
                               child, other->second));
        connected_ = false;
        continue;
      }
      parents_.emplace(child, TextOf(*edge.parent, "link"));
    }
  }

  void AddWorld(const Edge& edge) {
    const std::uint32_t line = LineOf(*edge.parent);
    source_.link_places_.emplace(kWorld, Place{links_.size(), {{"", line}}});
    links_.push_back({kWorld, edge.parent});
    source_.notes_.push_back(
        {line, KeyOf(edge.joint),
         "<parent> is 'world', which is not in the file: taken as a link without mass"});
  }

  /// Some files have a `world` that no joint has anything to do with.
  void LeaveOutWorld() {
    const auto world = std::ranges::find(links_, kWorld, &Named::name);
    if (world == links_.end() || links_.size() == 1 || parents_.count(kWorld) > 0) return;
    for (const auto& [child, parent] : parents_) {
      if (parent == kWorld) return;
    }
    if (world->element->FirstChildElement() != nullptr) return;  // There is something in it.
    source_.notes_.push_back(
        {LineOf(*world->element), KeyOf(*world), "no joint has anything to do with it: left out"});
    source_.link_places_.erase(kWorld);
    for (auto& [name, place] : source_.link_places_)
      if (place.index > static_cast<std::size_t>(world - links_.begin())) --place.index;
    links_.erase(world);
  }

  /// There is at most one root, and every link leads up to it.
  void CheckTree() {
    const auto note = [this](const std::string& link, const std::string& problem) {
      mistakes_.push_back({source_.LineOfLink(link, ""), fmt::format("link '{}'", link), problem});
    };
    LeaveOutWorld();
    std::string& root = source_.root_;
    for (const Named& link : links_) {
      if (parents_.count(link.name) != 0) continue;
      if (!root.empty()) {
        note(link.name, fmt::format("no joint carries it, and none carries '{}'; a robot has one "
                                    "such root link",
                                    root));
        continue;
      }
      root = link.name;
    }
    // From each link the way up the tree must lead to the root.
    std::set<std::string> below_root;
    for (const Named& link : links_) {
      std::string at = link.name;
      std::set<std::string> seen;
      while (parents_.count(at) != 0 && below_root.count(at) == 0) {
        if (!seen.insert(at).second) {
          note(at, "the joints above it lead back to itself; allowed: a tree");
          return;
        }
        at = parents_.at(at);
      }
      below_root.merge(seen);
    }
  }

  /// Takes links and joints from elements that were checked.
  void ReadElements() {
    for (const Named& link : links_) source_.links_.push_back(ReadLink(*link.element, link.name));
    for (const Named& joint : joints_) {
      const std::size_t index = source_.joints_.size();
      source_.joints_.push_back(ReadJoint(*joint.element, joint.name, KeyOf(joint)));
      source_.on_link_[source_.joints_.back().parent].emplace(joint.name, index);
    }
    for (const TiXmlElement* e = robot_.FirstChildElement(); e != nullptr;
         e = e->NextSiblingElement()) {
      if (e->ValueStr() == "link" || e->ValueStr() == "joint")
        NoteRightAngles(*e, KeyOf({TextOf(*e, "name"), e}), source_.rounded_angles_);
    }
  }

  UrdfSource& source_;
  const std::string& file_;
  TiXmlDocument document_;
  const TiXmlElement& robot_;
  std::vector<RobotFinding> mistakes_;
  std::vector<Named> links_, joints_;
  std::vector<Edge> edges_;
  std::map<std::string, std::string> parents_;  // the link that carries each link
  /// Whether every link has a name of its own, and every joint its two ends. Without, ends and tree
  /// would lack what is only misspelt.
  bool links_named_ = true, connected_ = true;
};

UrdfSource::UrdfSource(const std::string& text, const std::string& file) {
  Reader(*this, text, file);
}

std::vector<const UrdfSource::Joint*> UrdfSource::JointsOn(const std::string& link) const {
  std::vector<const UrdfSource::Joint*> joints;
  if (const auto on = on_link_.find(link); on != on_link_.end()) {
    for (const auto& [name, index] : on->second) joints.push_back(&joints_[index]);
  }
  return joints;
}

const UrdfSource::Link* UrdfSource::FindLink(const std::string& name) const {
  const auto place = link_places_.find(name);
  return place == link_places_.end() ? nullptr : &links_[place->second.index];
}

const UrdfSource::Joint* UrdfSource::FindJoint(const std::string& name) const {
  const auto place = joint_places_.find(name);
  return place == joint_places_.end() ? nullptr : &joints_[place->second.index];
}

std::uint32_t UrdfSource::LineIn(const Places& places, const std::string& name,
                                 std::string_view element) {
  const auto place = places.find(name);
  if (place == places.end()) return 0;
  const Lines& lines = place->second.lines;
  const auto line = lines.find(element);
  return line == lines.end() ? lines.at("") : line->second;
}

std::uint32_t UrdfSource::LineOfLink(const std::string& link, std::string_view element) const {
  return LineIn(link_places_, link, element);
}

std::uint32_t UrdfSource::LineOfJoint(const std::string& joint, std::string_view element) const {
  return LineIn(joint_places_, joint, element);
}

}  // namespace tumbler
