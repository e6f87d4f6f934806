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

#include "common/printable.h"
#include "common/toml_reader.h"

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
    NumericAttribute{"limit", "effort", 1, true},
    NumericAttribute{"limit", "velocity", 1, true},
    NumericAttribute{"dynamics", "damping", 1, false, 1e9},
    NumericAttribute{"dynamics", "friction", 1, false},
    NumericAttribute{"sphere", "radius", 1, true, kLongest, false},
    NumericAttribute{"cylinder", "radius", 1, true, kLongest, false},
    NumericAttribute{"cylinder", "length", 1, true, kLongest, false},
    NumericAttribute{"box", "size", 3, true, kLongest, false},
    NumericAttribute{"mesh", "scale", 3, false},
};

constexpr std::array<std::string_view, 4> kJointTypes = {"revolute", "continuous", "prismatic",
                                                         "fixed"};

constexpr std::array<std::string_view, 4> kGeometries = {"sphere", "cylinder", "box", "mesh"};

/// No robot has more links, or elements nested deeper. Reading them would take for ever, or exhaust
/// the stack.
constexpr std::size_t kMostLinks = 1000;
constexpr int kDeepestElement = 100;

bool StartsName(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' ||
         static_cast<unsigned char>(c) >= 127;
}

/// The line where XML is nested too deep, or 0. This also holds for text that is not well-formed:
/// the parser stops at the first mistake, and gets no deeper than the depth counted here.
std::uint32_t LineOfTooDeepElement(std::string_view text) {
  int depth = 0;
  const auto skip_past = [&text](std::size_t from, std::string_view end) {
    const std::size_t at = text.find(end, from);
    return at == std::string_view::npos ? text.size() : at + end.size();
  };
  for (std::size_t i = text.find('<'); i < text.size(); i = text.find('<', i)) {
    const std::string_view rest = text.substr(i);
    if (rest.starts_with("<!--")) {
      i = skip_past(i + 4, "-->");
    } else if (rest.starts_with("<![CDATA[")) {
      i = skip_past(i, "]]>");
    } else if (rest.starts_with("</")) {
      depth = std::max(0, depth - 1);
      i = skip_past(i, ">");
    } else if (rest.size() < 2 || !StartsName(rest[1])) {
      i = skip_past(i, ">");
    } else {
      if (++depth > kDeepestElement) {
        return 1 + static_cast<std::uint32_t>(std::count(
                       text.begin(), text.begin() + static_cast<std::ptrdiff_t>(i), '\n'));
      }
      char quote = 0;
      for (++i; i < text.size() && (quote != 0 || text[i] != '>'); ++i) {
        if (quote == 0 && (text[i] == '"' || text[i] == '\'')) {
          quote = text[i];
        } else if (text[i] == quote) {
          quote = 0;
        }
      }
      if (i < text.size() && text[i - 1] == '/') --depth;
    }
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

/// Checks elements below one link or joint.
class ElementChecker {
 public:
  ElementChecker(const std::string& file, std::string key) : file_(file), key_(std::move(key)) {}

  [[noreturn]] void Fail(const TiXmlBase& where, const std::string& problem) const {
    throw FileError(file_, RowOf(where), key_, problem);
  }

  void CheckNumbers(const TiXmlElement& element) const {
    for (const NumericAttribute& expected : kNumericAttributes) {
      if (element.ValueStr() != expected.element) continue;
      const char* text = element.Attribute(expected.attribute);
      if (text == nullptr) {
        if (expected.required) {
          Fail(element,
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
        Fail(element, fmt::format("<{}> {} is '{}'; allowed: {}", expected.element,
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
    if (second != nullptr) Fail(*second, fmt::format("there is a second <{}>; allowed: one", name));
  }

  const TiXmlElement& Required(const TiXmlElement& parent, const char* name) const {
    const TiXmlElement* element = parent.FirstChildElement(name);
    if (element == nullptr) Fail(parent, fmt::format("lacks <{}>", name));
    return *element;
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

  const std::string& file_;
  std::string key_;
};

void CheckLink(const TiXmlElement& link, const ElementChecker& check) {
  check.CheckNumbers(link);
  for (const char* kind : {"collision", "visual"}) {
    for (const TiXmlElement* shape = link.FirstChildElement(kind); shape != nullptr;
         shape = shape->NextSiblingElement(kind)) {
      for (const char* part : {"origin", "geometry"}) check.CheckOnlyOne(*shape, part);
      const TiXmlElement& geometry = check.Required(*shape, "geometry");
      const TiXmlElement* form = geometry.FirstChildElement();
      if (form == nullptr || std::find(kGeometries.begin(), kGeometries.end(), form->ValueStr()) ==
                                 kGeometries.end()) {
        check.Fail(geometry, fmt::format("<geometry> holds {}; allowed: one of {}",
                                         form == nullptr ? "nothing" : "<" + form->ValueStr() + ">",
                                         fmt::join(kGeometries, ", ")));
      }
    }
  }
  check.CheckOnlyOne(link, "inertial");
  if (const TiXmlElement* inertial = link.FirstChildElement("inertial")) {
    for (const char* part : {"origin", "mass", "inertia"}) check.CheckOnlyOne(*inertial, part);
    check.Required(*inertial, "mass");
    check.Required(*inertial, "inertia");
  }
}

void CheckJoint(const TiXmlElement& joint, const ElementChecker& check) {
  check.CheckNumbers(joint);
  for (const char* part : {"parent", "child", "origin", "axis", "limit", "dynamics"}) {
    check.CheckOnlyOne(joint, part);
  }
  const char* type = joint.Attribute("type");
  if (std::find(kJointTypes.begin(), kJointTypes.end(), type == nullptr ? "" : type) ==
      kJointTypes.end()) {
    check.Fail(joint, fmt::format("its type is '{}'; allowed: {}", type == nullptr ? "" : type,
                                  fmt::join(kJointTypes, ", ")));
  }
  const std::string_view given = type;
  if (given == "revolute" || given == "prismatic") check.Required(joint, "limit");
  if (const TiXmlElement* dynamics = joint.FirstChildElement("dynamics")) {
    const char* friction = dynamics->Attribute("friction");
    // The attribute was checked above, so it holds a number.
    if (friction != nullptr && ToNumbers(friction)->front() != 0) {
      check.Fail(*dynamics, fmt::format("dynamics friction = {}: dry friction of a joint is not "
                                        "modelled; allowed: 0 (damping can be given)",
                                        friction));
    }
  }
}

/// @throws FileError when the text is not XML.
void ParseXml(const std::string& text, const std::string& file, TiXmlDocument& document) {
  if (const std::size_t at = text.find('\0'); at != std::string::npos) {
    const auto lines =
        std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
    throw FileError(file, static_cast<std::uint32_t>(lines) + 1, "",
                    "not valid XML: there is a byte 0, so this is no text");
  }
  if (const std::uint32_t line = LineOfTooDeepElement(text); line > 0) {
    throw FileError(
        file, line, "",
        fmt::format("elements are nested more than {} deep; a URDF needs 5", kDeepestElement));
  }
  if (text.find('<') == std::string::npos) {
    throw FileError(file, 0, "",
                    fmt::format("not valid XML: {}",
                                text.empty() ? "the file is empty" : "there is no element in it"));
  }
  document.Parse(text.c_str(), nullptr, TIXML_ENCODING_UTF8);
  if (document.Error()) {
    throw FileError(file, static_cast<std::uint32_t>(std::max(document.ErrorRow(), 0)), "",
                    fmt::format("not valid XML: {}", document.ErrorDesc()));
  }
}

/// @throws FileError when the document is not a URDF.
const TiXmlElement& RobotOf(const TiXmlDocument& document, const std::string& file) {
  const TiXmlElement* robot = document.RootElement();
  if (robot == nullptr || robot->ValueStr() != "robot") {
    throw FileError(file, robot == nullptr ? 0U : RowOf(*robot), "",
                    "not a URDF: the outermost element must be <robot>");
  }
  const char* name = robot->Attribute("name");
  if (name == nullptr || *name == '\0')
    throw FileError(file, RowOf(*robot), "robot", "has no name; give it the attribute name");
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

Edge ReadEdge(const std::string& name, const TiXmlElement& joint, const ElementChecker& check) {
  Edge edge;
  edge.joint = name;
  const auto end = [&](const char* which, const TiXmlElement*& element) {
    element = &check.Required(joint, which);
    const char* link = element->Attribute("link");
    return std::string(link == nullptr ? "" : link);
  };
  edge.parent = end("parent", edge.parent_element);
  edge.child = end("child", edge.child_element);
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

UrdfSource::UrdfSource(const std::string& text, const std::string& file) {
  TiXmlDocument document;
  ParseXml(text, file, document);
  const TiXmlElement& robot = RobotOf(document, file);
  std::vector<Edge> edges;
  std::vector<std::string> link_order;
  for (const TiXmlElement* e = robot.FirstChildElement(); e != nullptr;
       e = e->NextSiblingElement()) {
    const std::string& kind = e->ValueStr();
    if (kind != "link" && kind != "joint") continue;
    const char* attribute = e->Attribute("name");
    const std::string name = attribute == nullptr ? "" : attribute;
    const ElementChecker check(file, fmt::format("{} '{}'", kind, name));
    if (const char* mistake = MistakeInName(name))
      check.Fail(*e, std::string("the name ") + mistake);
    if (name.empty()) check.Fail(*e, "has no name; give it the attribute name");
    Lines lines{{"", RowOf(*e)}};
    AddLines(*e, lines);
    Index& index = kind == "link" ? links_ : joints_;
    if (const auto [other, is_new] = index.emplace(name, std::move(lines)); !is_new) {
      check.Fail(*e, fmt::format("the name is taken by line {}", other->second.at("")));
    }
    if (kind == "link") {
      link_order.push_back(name);
      if (link_order.size() > kMostLinks)
        check.Fail(*e, fmt::format("the robot has more than {} links", kMostLinks));
      CheckLink(*e, check);
    } else {
      joint_order_.push_back(name);
      CheckJoint(*e, check);
      edges.push_back(ReadEdge(name, *e, check));
    }
  }

  std::map<std::string, const Edge*> carried_by;
  for (const Edge& edge : edges) {
    const ElementChecker check(file, fmt::format("joint '{}'", edge.joint));
    for (const auto& [name, element] :
         {std::pair(edge.parent, edge.parent_element), std::pair(edge.child, edge.child_element)}) {
      if (links_.count(name) == 0) {
        check.Fail(*element, fmt::format("<{}> is the link '{}', which is not in the file",
                                         element->ValueStr(), name));
      }
    }
    if (const auto [other, is_new] = carried_by.emplace(edge.child, &edge); !is_new) {
      check.Fail(*edge.child_element,
                 fmt::format("its <child> '{}' is already that of joint '{}'; a link hangs on one "
                             "joint only",
                             edge.child, other->second->joint));
    }
  }
  std::map<std::string, std::string> parents;
  for (const auto& [link, edge] : carried_by) parents.emplace(link, edge->parent);
  CheckTree(link_order, parents, file);
  if (link_order.empty()) throw FileError(file, RowOf(robot), "robot", "has no link");

  for (TiXmlElement* e = document.RootElement()->FirstChildElement(); e != nullptr;
       e = e->NextSiblingElement()) {
    if (e->ValueStr() == "link" || e->ValueStr() == "joint") {
      TakeRightAngles(*e, fmt::format("{} '{}'", e->ValueStr(), e->Attribute("name")),
                      rounded_angles_);
    }
  }
  text_ = text;
  if (!rounded_angles_.empty()) {
    TiXmlPrinter printer;
    document.Accept(&printer);
    text_ = printer.Str();
  }
}

void UrdfSource::CheckTree(const std::vector<std::string>& links,
                           const std::map<std::string, std::string>& parents,
                           const std::string& file) const {
  std::string root;
  for (const std::string& link : links) {
    if (parents.count(link) != 0) continue;
    if (!root.empty()) {
      throw FileError(file, LineOfLink(link, ""), fmt::format("link '{}'", link),
                      fmt::format("no joint carries it, and none carries '{}'; a robot has one "
                                  "such root link",
                                  root));
    }
    root = link;
  }
  // From each link the way up the tree must lead to the root.
  std::set<std::string> below_root;
  for (const std::string& link : links) {
    std::string at = link;
    std::set<std::string> seen;
    while (parents.count(at) != 0 && below_root.count(at) == 0) {
      if (!seen.insert(at).second) {
        throw FileError(file, LineOfLink(at, ""), fmt::format("link '{}'", at),
                        "the joints above it lead back to itself; allowed: a tree");
      }
      at = parents.at(at);
    }
    below_root.merge(seen);
  }
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
