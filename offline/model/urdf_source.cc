#include "offline/model/urdf_source.h"

#include <fmt/format.h>
#include <tinyxml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include "common/files/printable.h"
#include "common/files/toml_reader.h"
#include "offline/model/xml_tags.h"

namespace tumbler {
namespace {

/// An attribute that holds numbers.
struct NumericAttribute {
  std::string_view element;
  const char* attribute;
  int count;
  bool required;
  /// The largest magnitude allowed. No robot has larger numbers, and with them rounding would spoil
  /// sums and products.
  double largest = std::numeric_limits<double>::max();
  bool can_be_negative = true;
};
/// The largest mass [kg]. The largest moment of inertia has it at the distance `kLongest`.
constexpr double kHeaviest = 1e6;
/// The largest length of a shape [m].
constexpr double kLongest = 1e3;
constexpr double kLargestMoment = kHeaviest * kLongest * kLongest;
constexpr std::string_view kCapsule = "capsule";
constexpr std::array kNumericAttributes = {
    NumericAttribute{"mass", "value", 1, true, kHeaviest},
    NumericAttribute{"inertia", "ixx", 1, true, kLargestMoment},
    NumericAttribute{"inertia", "ixy", 1, true, kLargestMoment},
    NumericAttribute{"inertia", "ixz", 1, true, kLargestMoment},
    NumericAttribute{"inertia", "iyy", 1, true, kLargestMoment},
    NumericAttribute{"inertia", "iyz", 1, true, kLargestMoment},
    NumericAttribute{"inertia", "izz", 1, true, kLargestMoment},
    NumericAttribute{"origin", "xyz", 3, false},
    NumericAttribute{"origin", "rpy", 3, false, 1e3},
    NumericAttribute{"axis", "xyz", 3, true},
    NumericAttribute{"limit", "lower", 1, false},
    NumericAttribute{"limit", "upper", 1, false},
    NumericAttribute{"limit", "effort", 1, false},
    NumericAttribute{"limit", "velocity", 1, false},
    NumericAttribute{"dynamics", "damping", 1, false, 1e9},
    NumericAttribute{"dynamics", "friction", 1, false, 1e9},
    NumericAttribute{"mimic", "multiplier", 1, false, 1e6},
    NumericAttribute{"mimic", "offset", 1, false, 1e6},
    NumericAttribute{"sphere", "radius", 1, true, kLongest, false},
    NumericAttribute{"cylinder", "radius", 1, true, kLongest, false},
    NumericAttribute{"cylinder", "length", 1, true, kLongest, false},
    NumericAttribute{kCapsule, "radius", 1, true, kLongest, false},
    NumericAttribute{kCapsule, "length", 1, true, kLongest, false},
    NumericAttribute{"box", "size", 3, true, kLongest, false},
    NumericAttribute{"mesh", "scale", 3, false},
};

constexpr std::array<std::string_view, 4> kJointTypes = {"revolute", "continuous", "prismatic",
                                                         "fixed"};

constexpr std::array<std::string_view, 5> kGeometries = {"sphere", "cylinder", "box", "mesh",
                                                         kCapsule};

/// The link that files hang a robot on without having it.
constexpr const char* kWorld = "world";

/// No robot has more links, or elements nested deeper. Reading them would take for ever, or exhaust
/// the stack.
constexpr std::size_t kMostLinks = 1000;
constexpr int kDeepestElement = 100;

/// The line where XML is nested too deep, or 0. This also holds for text that is not well-formed:
/// the parser stops at the first mistake, and gets no deeper than the depth counted here.
std::uint32_t LineOfTooDeepElement(std::string_view text) {
  int depth = 0;
  XmlTags tags(text);
  for (XmlTag tag; tags.Next(tag);) {
    if (tag.opens && ++depth > kDeepestElement) {
      return 1 + static_cast<std::uint32_t>(std::count(
                     text.begin(), text.begin() + static_cast<std::ptrdiff_t>(tag.begin), '\n'));
    }
    if (tag.closes) depth = std::max(0, depth - 1);
  }
  return 0;
}

std::uint32_t RowOf(const TiXmlBase& element) {
  return static_cast<std::uint32_t>(std::max(element.Row(), 0));
}

/// The numbers in a text, if it holds nothing but numbers and white space.
std::optional<std::vector<double>> ToNumbers(std::string_view text) {
  std::vector<double> numbers;
  constexpr std::string_view kSpace = " \t\r\n";
  for (;;) {
    const std::size_t first = text.find_first_not_of(kSpace);
    if (first == std::string_view::npos) return numbers;
    text.remove_prefix(first);
    const std::size_t length = std::min(text.find_first_of(kSpace), text.size());
    std::string_view token = text.substr(0, length);
    text.remove_prefix(length);
    if (token.starts_with('+')) token.remove_prefix(1);
    double number = 0;
    const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), number);
    if (error != std::errc() || end != token.data() + token.size()) return std::nullopt;
    numbers.push_back(number);
  }
}

/// Whether the element is in a `<geometry>`.
bool IsGeometry(const TiXmlElement& element) {
  const TiXmlElement* const parent =
      element.Parent() == nullptr ? nullptr : element.Parent()->ToElement();
  return parent != nullptr && parent->ValueStr() == "geometry";
}

/// Notes what is wrong with elements below one link or joint.
class ElementChecker {
 public:
  ElementChecker(std::vector<RobotFinding>& mistakes, std::string key)
      : mistakes_(mistakes), key_(std::move(key)) {}

  void Note(const TiXmlBase& where, const std::string& problem) const {
    mistakes_.push_back({RowOf(where), key_, problem});
  }

  void CheckNumbers(const TiXmlElement& element) const {
    for (const NumericAttribute& expected : kNumericAttributes) {
      if (element.ValueStr() != expected.element) continue;
      // Elsewhere a capsule may be another's, of which nothing is known.
      if (expected.element == kCapsule && !IsGeometry(element)) continue;
      const char* text = element.Attribute(expected.attribute);
      if (text == nullptr) {
        if (expected.required) {
          Note(element,
               fmt::format("<{}> lacks the attribute {}", expected.element, expected.attribute));
        }
        continue;
      }
      const std::optional<std::vector<double>> numbers = ToNumbers(text);
      const bool fits =
          numbers && numbers->size() == static_cast<std::size_t>(expected.count) &&
          std::all_of(numbers->begin(), numbers->end(), [&expected](double x) {
            return std::abs(x) <= expected.largest && (x >= 0 || expected.can_be_negative);
          });
      if (!fits) {
        Note(element, fmt::format("<{}> {} is '{}'; allowed: {}", expected.element,
                                  expected.attribute, text, Allowed(expected)));
      }
    }
    for (const TiXmlElement* e = element.FirstChildElement(); e != nullptr;
         e = e->NextSiblingElement()) {
      CheckNumbers(*e);
    }
  }

  void CheckOnlyOne(const TiXmlElement& parent, const char* name) const {
    const TiXmlElement* first = parent.FirstChildElement(name);
    const TiXmlElement* second = first == nullptr ? nullptr : first->NextSiblingElement(name);
    if (second != nullptr) Note(*second, fmt::format("there is a second <{}>; allowed: one", name));
  }

  /// The element; null, and noted, where there is none.
  const TiXmlElement* Required(const TiXmlElement& parent, const char* name) const {
    const TiXmlElement* element = parent.FirstChildElement(name);
    if (element == nullptr) Note(parent, fmt::format("lacks <{}>", name));
    return element;
  }

 private:
  static std::string Allowed(const NumericAttribute& attribute) {
    std::string range = attribute.can_be_negative ? "" : ", 0 or more";
    if (attribute.largest < std::numeric_limits<double>::max()) {
      range = attribute.can_be_negative ? fmt::format(", at most {:g} in size", attribute.largest)
                                        : fmt::format(" from 0 ... {:g}", attribute.largest);
    }
    if (attribute.count == 1) return fmt::format("a finite number{}", range);
    return fmt::format("{} finite numbers{}, separated by blanks", attribute.count, range);
  }

  std::vector<RobotFinding>& mistakes_;
  std::string key_;
};

void CheckLink(const TiXmlElement& link, const ElementChecker& check) {
  check.CheckNumbers(link);
  for (const char* kind : {"collision", "visual"}) {
    for (const TiXmlElement* shape = link.FirstChildElement(kind); shape != nullptr;
         shape = shape->NextSiblingElement(kind)) {
      for (const char* part : {"origin", "geometry"}) check.CheckOnlyOne(*shape, part);
      const TiXmlElement* const geometry = check.Required(*shape, "geometry");
      if (geometry == nullptr) continue;
      const TiXmlElement* form = geometry->FirstChildElement();
      if (form == nullptr || std::find(kGeometries.begin(), kGeometries.end(), form->ValueStr()) ==
                                 kGeometries.end()) {
        check.Note(*geometry,
                   fmt::format("<geometry> holds {}; allowed: one of {}",
                               form == nullptr ? "nothing" : "<" + form->ValueStr() + ">",
                               fmt::join(kGeometries, ", ")));
      }
    }
  }
  check.CheckOnlyOne(link, "inertial");
  if (const TiXmlElement* inertial = link.FirstChildElement("inertial")) {
    for (const char* part : {"origin", "mass", "inertia"}) check.CheckOnlyOne(*inertial, part);
    static_cast<void>(check.Required(*inertial, "mass"));
    static_cast<void>(check.Required(*inertial, "inertia"));
  }
}

bool IsKnownType(std::string_view type) {
  return std::find(kJointTypes.begin(), kJointTypes.end(), type) != kJointTypes.end();
}

std::string TypeOf(const TiXmlElement& joint) {
  const char* const type = joint.Attribute("type");
  return type == nullptr ? "" : type;
}

void CheckJoint(const TiXmlElement& joint, const ElementChecker& check) {
  check.CheckNumbers(joint);
  for (const char* part : {"parent", "child", "origin", "axis", "limit", "dynamics", "mimic"})
    check.CheckOnlyOne(joint, part);
  if (const TiXmlElement* dynamics = joint.FirstChildElement("dynamics")) {
    const char* const text = dynamics->Attribute("friction");
    const std::optional<std::vector<double>> friction =
        text == nullptr ? std::nullopt : ToNumbers(text);
    if (friction && friction->size() == 1 && friction->front() < 0)
      check.Note(*dynamics, fmt::format("dynamics friction = {}; allowed: >= 0", text));
  }
}

[[noreturn]] void FailFile(const std::string& file, std::uint32_t line, const std::string& key,
                           const std::string& problem) {
  throw RobotFileError(file, {{line, key, problem}});
}

/// The first element below one that is xacro's; null: there is none.
const TiXmlElement* FindXacro(const TiXmlElement& parent) {
  for (const TiXmlElement* e = parent.FirstChildElement(); e != nullptr;
       e = e->NextSiblingElement()) {
    if (e->ValueStr().starts_with("xacro:")) return e;
    if (const TiXmlElement* const below = FindXacro(*e)) return below;
  }
  return nullptr;
}

/// @throws FileError when the text is not XML.
void ParseXml(const std::string& text, const std::string& file, TiXmlDocument& document) {
  if (const std::size_t at = text.find('\0'); at != std::string::npos) {
    const auto lines =
        std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
    FailFile(file, static_cast<std::uint32_t>(lines) + 1, "",
             "not valid XML: there is a byte 0, so this is no text");
  }
  if (const std::uint32_t line = LineOfTooDeepElement(text); line > 0) {
    throw FileError(
        file, line, "",
        fmt::format("elements are nested more than {} deep; a URDF needs 5", kDeepestElement));
  }
  if (text.find('<') == std::string::npos) {
    FailFile(file, 0, "",
             fmt::format("not valid XML: {}",
                         text.empty() ? "the file is empty" : "there is no element in it"));
  }
  document.Parse(text.c_str(), nullptr, TIXML_ENCODING_UTF8);
  if (document.Error()) {
    FailFile(file, static_cast<std::uint32_t>(std::max(document.ErrorRow(), 0)), "",
             fmt::format("not valid XML: {}", document.ErrorDesc()));
  }
}

/// @throws FileError when the document is not a URDF.
const TiXmlElement& RobotOf(const TiXmlDocument& document, const std::string& file) {
  const TiXmlElement* robot = document.RootElement();
  if (robot != nullptr && (robot->ValueStr() == "sdf" || robot->ValueStr() == "mujoco")) {
    FailFile(file, RowOf(*robot), fmt::format("<{}>", robot->ValueStr()),
             fmt::format("this is {}; make a URDF of it, and take that: tumbler model urdf {} > "
                         "robot.urdf",
                         robot->ValueStr() == "sdf" ? "SDF, of Gazebo" : "MJCF, of MuJoCo", file));
  }
  if (robot == nullptr || robot->ValueStr() != "robot") {
    FailFile(file, robot == nullptr ? 0U : RowOf(*robot), "",
             "not a URDF: the outermost element must be <robot>");
  }
  if (const TiXmlElement* const xacro = FindXacro(*robot)) {
    FailFile(file, RowOf(*xacro), fmt::format("<{}>", xacro->ValueStr()),
             fmt::format("this is xacro, which makes a URDF; expand it, and take what comes of it: "
                         "xacro {} > robot.urdf (of ROS, or `pip install xacro`)",
                         file));
  }
  const char* name = robot->Attribute("name");
  if (name == nullptr || *name == '\0')
    FailFile(file, RowOf(*robot), "robot", "has no name; give it the attribute name");
  return *robot;
}

/// Adds the lines of all elements below `parent`. Of several elements of a name the first counts.
template <class Lines>
void AddLines(const TiXmlElement& parent, Lines& lines) {
  for (const TiXmlElement* e = parent.FirstChildElement(); e != nullptr;
       e = e->NextSiblingElement()) {
    lines.emplace(e->ValueStr(), RowOf(*e));
    AddLines(*e, lines);
  }
}

/// A joint by the links that it connects.
struct Edge {
  std::string joint, parent, child;
  const TiXmlElement* parent_element;
  const TiXmlElement* child_element;
};

/// None, and noted, where an end is missing.
std::optional<Edge> ReadEdge(const std::string& name, const TiXmlElement& joint,
                             const ElementChecker& check) {
  Edge edge;
  edge.joint = name;
  edge.parent_element = check.Required(joint, "parent");
  edge.child_element = check.Required(joint, "child");
  if (edge.parent_element == nullptr || edge.child_element == nullptr) return std::nullopt;
  const auto link_of = [](const TiXmlElement& element) {
    const char* link = element.Attribute("link");
    return std::string(link == nullptr ? "" : link);
  };
  edge.parent = link_of(*edge.parent_element);
  edge.child = link_of(*edge.child_element);
  return edge;
}

/// In words, such as `-3 pi/2`, for a multiple of pi/2 other than 0.
std::string RightAnglesInWords(int count) {
  const int whole = count % 2 == 0 ? count / 2 : count;
  const std::string factor = whole == 1 ? "" : whole == -1 ? "-" : fmt::format("{} ", whole);
  return factor + (count % 2 == 0 ? "pi" : "pi/2");
}

/// Replaces each angle of the origins below an element that is a rounded multiple of pi/2.
/// @param key  of the link or joint that holds them.
void TakeRightAngles(TiXmlElement& element, const std::string& key,
                     std::vector<RoundedAngle>& rounded) {
  constexpr double kRightAngle = std::numbers::pi / 2;
  // With 13 digits or more, nobody has rounded.
  constexpr double kExact_rad = 1e-12;
  const char* rpy = element.ValueStr() == "origin" ? element.Attribute("rpy") : nullptr;
  if (rpy != nullptr) {
    std::vector<double> angles = ToNumbers(rpy).value();  // They were checked.
    const std::size_t before = rounded.size();
    for (double& angle : angles) {
      const double count = std::round(angle / kRightAngle);
      const double off = std::abs(angle - count * kRightAngle);
      if (count == 0 || off > kRoundedBy_rad || off <= kExact_rad) continue;
      rounded.push_back({RowOf(element), key, angle, RightAnglesInWords(static_cast<int>(count))});
      angle = count * kRightAngle;
    }
    if (rounded.size() > before) {
      element.SetAttribute("rpy", fmt::format("{} {} {}", ExactDecimal(angles[0]),
                                              ExactDecimal(angles[1]), ExactDecimal(angles[2]))
                                      .c_str());
    }
  }
  for (TiXmlElement* e = element.FirstChildElement(); e != nullptr; e = e->NextSiblingElement())
    TakeRightAngles(*e, key, rounded);
}

}  // namespace

std::string Describe(const RoundedAngle& angle) {
  return fmt::format("origin rpy {} is taken as {}", ExactDecimal(angle.given), angle.taken_as);
}

/// Reads the document of a source, and makes of it what a parser knows.
class UrdfSource::Reader {
 public:
  Reader(UrdfSource& source, const std::string& text, const std::string& file)
      : source_(source), file_(file) {
    ParseXml(text, file, document_);
    static_cast<void>(RobotOf(document_, file));
    ReadElements();
    if (links_named_) ReadEnds();
    if (links_named_ && connected_) CheckTree();
    if (link_order_.empty()) mistakes_.push_back({RowOf(robot()), "robot", "has no link"});
    if (!mistakes_.empty()) throw RobotFileError(file_, mistakes_);
    Translate();
    source_.text_ = text;
    if (!changed_ && source_.rounded_angles_.empty()) return;
    TiXmlPrinter printer;
    document_.Accept(&printer);
    source_.text_ = printer.Str();
  }

 private:
  TiXmlElement& robot() { return *document_.RootElement(); }

  static std::string KeyOf(const TiXmlElement& element, const std::string& name) {
    return fmt::format("{} '{}'", element.ValueStr(), name);
  }

  void ReadElements() {
    for (const TiXmlElement* e = robot().FirstChildElement(); e != nullptr;
         e = e->NextSiblingElement()) {
      const std::string& kind = e->ValueStr();
      if (kind != "link" && kind != "joint") continue;
      const char* attribute = e->Attribute("name");
      const std::string name = attribute == nullptr ? "" : attribute;
      const ElementChecker check(mistakes_, KeyOf(*e, name));
      if (const char* mistake = MistakeInName(name))
        check.Note(*e, std::string("the name ") + mistake);
      if (name.empty()) {
        check.Note(*e, "has no name; give it the attribute name");
        links_named_ = links_named_ && kind != "link";
      }
      Lines lines{{"", RowOf(*e)}};
      AddLines(*e, lines);
      Index& index = kind == "link" ? source_.links_ : source_.joints_;
      if (const auto [other, is_new] = index.emplace(name, std::move(lines));
          !is_new && !name.empty()) {
        check.Note(*e, fmt::format("the name is taken by line {}", other->second.at("")));
        links_named_ = links_named_ && kind != "link";
      }
      if (kind == "link") {
        link_order_.push_back(name);
        if (link_order_.size() > kMostLinks) {
          check.Note(*e, fmt::format("the robot has more than {} links", kMostLinks));
          throw RobotFileError(file_, mistakes_);
        }
        CheckLink(*e, check);
      } else {
        source_.joint_order_.push_back(name);
        CheckJoint(*e, check);
        if (const std::optional<Edge> edge = ReadEdge(name, *e, check)) {
          edges_.push_back(*edge);
        } else {
          connected_ = false;
        }
      }
    }
  }

  /// Looks for the links that joints connect.
  void ReadEnds() {
    std::map<std::string, std::string> carried_by;
    for (const Edge& edge : edges_) {
      const ElementChecker check(mistakes_, fmt::format("joint '{}'", edge.joint));
      for (const auto& [name, element] : {std::pair(edge.parent, edge.parent_element),
                                          std::pair(edge.child, edge.child_element)}) {
        if (source_.links_.count(name) != 0) continue;
        if (name == kWorld && element == edge.parent_element) {
          AddWorld(edge);
          continue;
        }
        check.Note(*element, fmt::format("<{}> is the link '{}', which is not in the file",
                                         element->ValueStr(), name));
        connected_ = false;
      }
      if (const auto [other, is_new] = carried_by.emplace(edge.child, edge.joint); !is_new) {
        check.Note(*edge.child_element,
                   fmt::format("its <child> '{}' is already that of joint '{}'; a link hangs on "
                               "one joint only",
                               edge.child, other->second));
        connected_ = false;
        continue;
      }
      parents_.emplace(edge.child, edge.parent);
    }
  }

  void AddWorld(const Edge& edge) {
    const std::uint32_t line = RowOf(*edge.parent_element);
    source_.links_.emplace(kWorld, Lines{{"", line}});
    link_order_.emplace_back(kWorld);
    TiXmlElement world("link");
    world.SetAttribute("name", kWorld);
    new_links_.push_back(world);
    source_.notes_.push_back(
        {line, fmt::format("joint '{}'", edge.joint),
         "<parent> is 'world', which is not in the file: taken as a link without mass"});
  }

  /// Some files have a `world` that no joint has anything to do with.
  void LeaveOutWorld() {
    const auto world = std::find(link_order_.begin(), link_order_.end(), kWorld);
    if (world == link_order_.end() || link_order_.size() == 1 || parents_.count(kWorld) > 0) return;
    for (const auto& [child, parent] : parents_) {
      if (parent == kWorld) return;
    }
    for (TiXmlElement* e = robot().FirstChildElement("link"); e != nullptr;
         e = e->NextSiblingElement("link")) {
      const char* const name = e->Attribute("name");
      if (name == nullptr || name != std::string_view(kWorld)) continue;
      if (e->FirstChildElement() != nullptr) return;  // There is something in it.
      source_.notes_.push_back(
          {RowOf(*e), KeyOf(*e, kWorld), "no joint has anything to do with it: left out"});
      robot().RemoveChild(e);
      changed_ = true;
      break;
    }
    source_.links_.erase(kWorld);
    link_order_.erase(world);
  }

  /// There is at most one root, and every link leads up to it.
  void CheckTree() {
    const auto note = [this](const std::string& link, const std::string& problem) {
      mistakes_.push_back({source_.LineOfLink(link, ""), fmt::format("link '{}'", link), problem});
    };
    LeaveOutWorld();
    std::string root;
    for (const std::string& link : link_order_) {
      if (parents_.count(link) != 0) continue;
      if (!root.empty()) {
        note(link, fmt::format("no joint carries it, and none carries '{}'; a robot has one such "
                               "root link",
                               root));
        continue;
      }
      root = link;
    }
    // From each link the way up the tree must lead to the root.
    std::set<std::string> below_root;
    for (const std::string& link : link_order_) {
      std::string at = link;
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

  /// Makes of what a parser does not know what it does.
  void Translate() {
    for (const TiXmlElement& link : new_links_) robot().InsertEndChild(link);
    changed_ = changed_ || !new_links_.empty();
    RemoveMaterials(robot());
    for (TiXmlElement* e = robot().FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
      if (e->ValueStr() != "link" && e->ValueStr() != "joint") continue;
      const std::string name = e->Attribute("name");
      TakeRightAngles(*e, KeyOf(*e, name), source_.rounded_angles_);
      if (e->ValueStr() == "joint") {
        TranslateJoint(*e, name);
      } else {
        TranslateCapsules(*e);
      }
    }
  }

  /// Colours count for nothing here, and files repeat their names.
  void RemoveMaterials(TiXmlElement& parent) {
    for (TiXmlElement* e = parent.FirstChildElement(); e != nullptr;) {
      TiXmlElement* const next = e->NextSiblingElement();
      if (e->ValueStr() == "material") {
        parent.RemoveChild(e);
        changed_ = true;
      } else {
        RemoveMaterials(*e);
      }
      e = next;
    }
  }

  void TranslateCapsules(TiXmlElement& parent) {
    for (TiXmlElement* e = parent.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
      TranslateCapsules(*e);
      if (e->ValueStr() != kCapsule || !IsGeometry(*e)) continue;
      // Its length is that between the centres of its ends.
      const double radius = ToNumbers(e->Attribute("radius")).value().front();
      const double length = ToNumbers(e->Attribute("length")).value().front();
      e->SetValue("cylinder");
      e->SetAttribute("length", ExactDecimal(length + 2 * radius).c_str());
      changed_ = true;
    }
  }

  void TranslateJoint(TiXmlElement& joint, const std::string& name) {
    const std::string type = TypeOf(joint);
    if (!IsKnownType(type)) {
      source_.held_.emplace(name, fmt::format("its type is '{}'; allowed: {}, or lock it at 0",
                                              type, fmt::join(kJointTypes, ", ")));
      joint.SetAttribute("type", "fixed");
      changed_ = true;
    }
    if (type != "revolute" && type != "prismatic" && type != "continuous") return;
    const std::string key = KeyOf(joint, name);
    TiXmlElement* limit = joint.FirstChildElement("limit");
    if (limit == nullptr && type == "continuous") return;
    if (limit == nullptr) {
      source_.lacks_.emplace(name, RobotFinding{RowOf(joint), key, "lacks <limit>"});
      limit = joint.InsertEndChild(TiXmlElement("limit"))->ToElement();
      // Without ends, it can be looked at wherever it is.
      for (const auto& [attribute, value] :
           {std::pair("lower", -kNoLimit), std::pair("upper", kNoLimit),
            std::pair("effort", kNoLimit), std::pair("velocity", kNoLimit)})
        limit->SetAttribute(attribute, ExactDecimal(value).c_str());
      changed_ = true;
      return;
    }
    for (const char* attribute : {"effort", "velocity"}) {
      if (limit->Attribute(attribute) != nullptr) continue;
      source_.lacks_.emplace(
          name, RobotFinding{RowOf(*limit), key,
                             fmt::format("<limit> lacks the attribute {}", attribute)});
      limit->SetAttribute(attribute, ExactDecimal(kNoLimit).c_str());
      changed_ = true;
    }
  }

  UrdfSource& source_;
  const std::string& file_;
  TiXmlDocument document_;
  std::vector<RobotFinding> mistakes_;
  std::vector<std::string> link_order_;
  std::vector<Edge> edges_;
  std::map<std::string, std::string> parents_;  // the link that carries each link
  std::vector<TiXmlElement> new_links_;
  /// Whether every link has a name of its own, and every joint its two ends. Without, ends and tree
  /// would lack what is only misspelt.
  bool links_named_ = true, connected_ = true;
  bool changed_ = false;
};

UrdfSource::UrdfSource(const std::string& text, const std::string& file) {
  Reader(*this, text, file);
}

std::uint32_t UrdfSource::LineOf(const Index& index, const std::string& name,
                                 std::string_view element) {
  const auto lines = index.find(name);
  if (lines == index.end()) return 0;
  const auto line = lines->second.find(element);
  return line == lines->second.end() ? lines->second.at("") : line->second;
}

std::uint32_t UrdfSource::LineOfLink(const std::string& link, std::string_view element) const {
  return LineOf(links_, link, element);
}

std::uint32_t UrdfSource::LineOfJoint(const std::string& joint, std::string_view element) const {
  return LineOf(joints_, joint, element);
}

}  // namespace tumbler
