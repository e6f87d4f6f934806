#include "offline/model/urdf_elements.h"

#include <fmt/format.h>
#include <tinyxml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

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

/// No URDF has elements nested deeper. Reading them would exhaust the stack.
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

std::string Allowed(const NumericAttribute& attribute) {
  std::string range = attribute.can_be_negative ? "" : ", 0 or more";
  if (attribute.largest < std::numeric_limits<double>::max()) {
    range = attribute.can_be_negative ? fmt::format(", at most {:g} in size", attribute.largest)
                                      : fmt::format(" from 0 ... {:g}", attribute.largest);
  }
  if (attribute.count == 1) return fmt::format("a finite number{}", range);
  return fmt::format("{} finite numbers{}, separated by blanks", attribute.count, range);
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

[[noreturn]] void FailFile(const std::string& file, std::uint32_t line, const std::string& key,
                           const std::string& problem) {
  throw RobotFileError(file, {{line, key, problem}});
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
    FailFile(file, line, "",
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

}  // namespace

TiXmlElement& ParseUrdfElements(const std::string& text, const std::string& file,
                                TiXmlDocument& document) {
  ParseXml(text, file, document);
  TiXmlElement* robot = document.RootElement();
  if (robot != nullptr && (robot->ValueStr() == "sdf" || robot->ValueStr() == "mujoco")) {
    FailFile(file, LineOf(*robot), fmt::format("<{}>", robot->ValueStr()),
             fmt::format("this is {}; make a URDF of it, and take that: tumbler model urdf {} > "
                         "robot.urdf",
                         robot->ValueStr() == "sdf" ? "SDF, of Gazebo" : "MJCF, of MuJoCo", file));
  }
  if (robot == nullptr || robot->ValueStr() != "robot") {
    FailFile(file, robot == nullptr ? 0U : LineOf(*robot), "",
             "not a URDF: the outermost element must be <robot>");
  }
  if (const TiXmlElement* const xacro = FindXacro(*robot)) {
    FailFile(file, LineOf(*xacro), fmt::format("<{}>", xacro->ValueStr()),
             fmt::format("this is xacro, which makes a URDF; expand it, and take what comes of it: "
                         "xacro {} > robot.urdf (of ROS, or `pip install xacro`)",
                         file));
  }
  if (TextOf(*robot, "name").empty())
    FailFile(file, LineOf(*robot), "robot", "has no name; give it the attribute name");
  const char* const version = robot->Attribute("version");
  if (version != nullptr && std::string_view(version) != "1.0") {
    FailFile(file, LineOf(*robot), "robot",
             fmt::format("version is '{}'; allowed: 1.0, or none", version));
  }
  return *robot;
}

std::uint32_t LineOf(const TiXmlElement& element) {
  return static_cast<std::uint32_t>(std::max(element.Row(), 0));
}

std::string TextOf(const TiXmlElement& element, const char* attribute) {
  const char* const text = element.Attribute(attribute);
  return text == nullptr ? "" : text;
}

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

bool IsGeometry(const TiXmlElement& element) {
  const TiXmlElement* const parent =
      element.Parent() == nullptr ? nullptr : element.Parent()->ToElement();
  return parent != nullptr && parent->ValueStr() == "geometry";
}

ElementChecker::ElementChecker(std::vector<RobotFinding>& mistakes, std::string key)
    : mistakes_(mistakes), key_(std::move(key)) {}

void ElementChecker::Note(const TiXmlElement& where, const std::string& problem) const {
  mistakes_.push_back({LineOf(where), key_, problem});
}

void ElementChecker::CheckNumbers(const TiXmlElement& element) const {
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

void ElementChecker::CheckOnlyOne(const TiXmlElement& parent, const char* name) const {
  const TiXmlElement* first = parent.FirstChildElement(name);
  const TiXmlElement* second = first == nullptr ? nullptr : first->NextSiblingElement(name);
  if (second != nullptr) Note(*second, fmt::format("there is a second <{}>; allowed: one", name));
}

const TiXmlElement* ElementChecker::Required(const TiXmlElement& parent, const char* name) const {
  const TiXmlElement* element = parent.FirstChildElement(name);
  if (element == nullptr) Note(parent, fmt::format("lacks <{}>", name));
  return element;
}

void ElementChecker::CheckShape(const TiXmlElement& shape) const {
  for (const char* part : {"origin", "geometry"}) CheckOnlyOne(shape, part);
  const TiXmlElement* const geometry = Required(shape, "geometry");
  if (geometry == nullptr) return;
  const TiXmlElement* form = geometry->FirstChildElement();
  if (form == nullptr ||
      std::find(kGeometries.begin(), kGeometries.end(), form->ValueStr()) == kGeometries.end()) {
    Note(*geometry, fmt::format("<geometry> holds {}; allowed: one of {}",
                                form == nullptr ? "nothing" : "<" + form->ValueStr() + ">",
                                fmt::join(kGeometries, ", ")));
  } else if (form->ValueStr() == "mesh" && form->Attribute("filename") == nullptr) {
    Note(*form, "<mesh> lacks the attribute filename");
  }
}

void ElementChecker::CheckLink(const TiXmlElement& link) const {
  CheckNumbers(link);
  for (const char* kind : {"collision", "visual"}) {
    for (const TiXmlElement* shape = link.FirstChildElement(kind); shape != nullptr;
         shape = shape->NextSiblingElement(kind))
      CheckShape(*shape);
  }
  CheckOnlyOne(link, "inertial");
  if (const TiXmlElement* inertial = link.FirstChildElement("inertial")) {
    for (const char* part : {"origin", "mass", "inertia"}) CheckOnlyOne(*inertial, part);
    static_cast<void>(Required(*inertial, "mass"));
    static_cast<void>(Required(*inertial, "inertia"));
  }
}

void ElementChecker::CheckJoint(const TiXmlElement& joint) const {
  CheckNumbers(joint);
  for (const char* part : {"parent", "child", "origin", "axis", "limit", "dynamics", "mimic"})
    CheckOnlyOne(joint, part);
  if (const TiXmlElement* dynamics = joint.FirstChildElement("dynamics")) {
    const std::string text = TextOf(*dynamics, "friction");
    const std::optional<std::vector<double>> friction = ToNumbers(text);
    if (friction && friction->size() == 1 && friction->front() < 0)
      Note(*dynamics, fmt::format("dynamics friction = {}; allowed: >= 0", text));
  }
  const TiXmlElement* const mimic = joint.FirstChildElement("mimic");
  if (mimic != nullptr && mimic->Attribute("joint") == nullptr)
    Note(*mimic, "<mimic> lacks the attribute joint");
}

}  // namespace tumbler
