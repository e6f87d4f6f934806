#ifdef TUMBLER_WITH_SDFORMAT

#include "offline/model/sdf_source.h"

#include <fmt/format.h>
#include <tinyxml2.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

using tinyxml2::XMLElement;

constexpr std::string_view kSpaces = " \t\r\n";

/// Versions that libsdformat 12 turns into its own.
constexpr int kOldestMinor = 2, kNewestMinor = 9;
constexpr const char* kVersions = "1.2 to 1.9";

/// An element whose text is numbers.
struct SdfNumbers {
  std::string_view parent, name;
  std::size_t count = 1;
  bool positive = false;
};
constexpr std::array kSdfNumbers = {
    SdfNumbers{"inertial", "mass"},
    SdfNumbers{"inertia", "ixx"},
    SdfNumbers{"inertia", "ixy"},
    SdfNumbers{"inertia", "ixz"},
    SdfNumbers{"inertia", "iyy"},
    SdfNumbers{"inertia", "iyz"},
    SdfNumbers{"inertia", "izz"},
    SdfNumbers{"axis", "xyz", 3},
    SdfNumbers{"limit", "lower"},
    SdfNumbers{"limit", "upper"},
    SdfNumbers{"limit", "effort"},
    SdfNumbers{"limit", "velocity"},
    SdfNumbers{"dynamics", "damping"},
    SdfNumbers{"dynamics", "friction"},
    SdfNumbers{"dynamics", "spring_stiffness"},
    SdfNumbers{"sphere", "radius", 1, true},
    SdfNumbers{"cylinder", "radius", 1, true},
    SdfNumbers{"cylinder", "length", 1, true},
    SdfNumbers{"capsule", "radius", 1, true},
    SdfNumbers{"capsule", "length", 1, true},
    SdfNumbers{"box", "size", 3, true},
    SdfNumbers{"mesh", "scale", 3},
    SdfNumbers{"world", "gravity", 3},
};

constexpr std::array<std::string_view, 9> kSdfJointTypes = {"revolute",  "continuous", "prismatic",
                                                            "fixed",     "ball",       "screw",
                                                            "universal", "revolute2",  "gearbox"};

/// Elements with frames of their own. The library's time grows with the square of their number.
constexpr std::array<std::string_view, 4> kSdfFrames = {"link", "joint", "frame", "model"};

std::string_view NameOf(const XMLElement& element) { return element.Name(); }

std::vector<std::string_view> WordsOf(std::string_view text) {
  std::vector<std::string_view> words;
  for (;;) {
    const std::size_t first = text.find_first_not_of(kSpaces);
    if (first == std::string_view::npos) return words;
    text.remove_prefix(first);
    words.push_back(text.substr(0, text.find_first_of(kSpaces)));
    text.remove_prefix(words.back().size());
  }
}

template <class Value>
std::optional<Value> WholeNumber(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  Value value{};
  const auto [end, problem] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (problem != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return value;
}

class SdfSourceReader {
 public:
  SdfSourceReader(const std::string& name, SdfTaken taken) : name_(name), taken_(taken) {}

  SdfSource Read(const XMLElement& root) {
    const bool is_sdf = NameOf(root) == "sdf";
    if (is_sdf) CheckVersion(root);
    Look(root, is_sdf ? taken_ : SdfTaken::kNone);
    return std::move(source_);
  }

 private:
  static std::uint32_t LineOf(const XMLElement& at) {
    return static_cast<std::uint32_t>(std::max(0, at.GetLineNum()));
  }

  [[noreturn]] void Fail(const XMLElement& at, const std::string& problem) const {
    std::string key = fmt::format("<{}>", at.Name());
    for (const tinyxml2::XMLNode* node = &at; node != nullptr; node = node->Parent()) {
      const XMLElement* const element = node->ToElement();
      if (element == nullptr) continue;
      const std::string_view kind = NameOf(*element);
      if (kind == "link" || kind == "joint" || kind == "model" || kind == "frame") {
        const char* const name = element->Attribute("name");
        key = fmt::format("{} '{}'", kind, name == nullptr ? "" : name);
        break;
      }
    }
    throw FileError(name_, LineOf(at), key, problem);
  }

  void CheckVersion(const XMLElement& root) {
    const char* const given = root.Attribute("version");
    if (given == nullptr)
      Fail(root, fmt::format("lacks 'version'; allowed: {}, such as 1.9", kVersions));
    const std::string_view text = given;
    const std::size_t point = std::min(text.find('.'), text.size());
    const auto major = WholeNumber<int>(text.substr(0, point));
    const auto minor = WholeNumber<int>(text.substr(std::min(point + 1, text.size())));
    if (!major || !minor || *major < 1 || *minor < 0 || (*major == 1 && *minor < kOldestMinor)) {
      Fail(root, fmt::format("version = '{}'; allowed: {}. Turn an older file into one of these "
                             "by the tools of its time, and its axes will be where they were",
                             text, kVersions));
    }
    if (*major > 1 || *minor > kNewestMinor) source_.newer_version = text;
  }

  static bool HasJoints(const XMLElement& model) {  // NOLINT(misc-no-recursion)
    for (const XMLElement* e = model.FirstChildElement(); e != nullptr;
         e = e->NextSiblingElement()) {
      const std::string_view kind = NameOf(*e);
      if (kind == "joint" || kind == "include" || (kind == "model" && HasJoints(*e))) return true;
    }
    return false;
  }

  /// @param taken  whether it is part of the robot.
  void Look(const XMLElement& element, SdfTaken taken) {  // NOLINT(misc-no-recursion)
    const std::string_view kind = NameOf(element);
    // Whatever these have is their own.
    if (kind == "plugin" || kind == "state") return;
    source_.frames += static_cast<int>(std::count(kSdfFrames.begin(), kSdfFrames.end(), kind));
    if (kind == "include") AddInclude(element, taken);
    if (kind == "model" && taken == SdfTaken::kWithJoints)
      taken = HasJoints(element) ? SdfTaken::kFirst : SdfTaken::kNone;
    if (taken == SdfTaken::kFirst) Check(element);
    const bool many = kind == "sdf" || kind == "world";  // Of their models one is taken.
    const bool passed = kind == "sdf" && element.FirstChildElement("model") != nullptr;
    for (const XMLElement* e = element.FirstChildElement(); e != nullptr;
         e = e->NextSiblingElement()) {
      const bool is_model = NameOf(*e) == "model" || NameOf(*e) == "include";
      const bool other = (many && is_model && had_model_) || (passed && NameOf(*e) == "world");
      if (many && is_model) had_model_ = true;
      Look(*e, other && taken == SdfTaken::kFirst ? SdfTaken::kWithJoints : taken);
    }
  }

  void AddInclude(const XMLElement& element, SdfTaken taken) {
    const XMLElement* const uri = element.FirstChildElement("uri");
    if (uri == nullptr || uri->GetText() == nullptr) return;
    std::string_view text = uri->GetText();
    const std::size_t first = text.find_first_not_of(kSpaces);
    if (first == std::string_view::npos) return;
    text = text.substr(first, text.find_last_not_of(kSpaces) + 1 - first);
    source_.includes.push_back({LineOf(*uri), std::string(text), taken});
  }

  void Check(const XMLElement& element) const {
    const std::string_view kind = NameOf(element);
    const XMLElement* const above =
        element.Parent() == nullptr ? nullptr : element.Parent()->ToElement();
    if (above == nullptr) return;
    if (kind == "pose") CheckPose(element);
    if (kind == "inertial") CheckInertial(element);
    if (kind == "joint" && NameOf(*above) == "model") CheckJoint(element);
    const auto row = std::find_if(kSdfNumbers.begin(), kSdfNumbers.end(), [&](const auto& r) {
      return r.parent == NameOf(*above) && r.name == kind;
    });
    if (row != kSdfNumbers.end()) CheckNumbers(element, *row);
  }

  /// The library may want six or seven, and says so.
  void CheckPose(const XMLElement& pose) const {
    const std::string_view text = pose.GetText() == nullptr ? "" : pose.GetText();
    for (const std::string_view word : WordsOf(text)) {
      if (!WholeNumber<double>(word))
        Fail(pose, fmt::format("<pose> is '{}'; allowed: numbers, which '{}' is not", text, word));
    }
  }

  void CheckInertial(const XMLElement& inertial) const {
    const char* const by_itself = inertial.Attribute("auto");
    if (by_itself == nullptr) return;
    const std::string_view value = by_itself;
    if (value == "false" || value == "0") return;
    Fail(inertial, fmt::format("<inertial auto='{}'>: masses are not found from shapes and "
                               "densities here. Give <mass> and <inertia>, and take 'auto' out",
                               value));
  }

  /// The library says where a type is missing; parameters of an include need not have it.
  void CheckJoint(const XMLElement& joint) const {
    const char* const type = joint.Attribute("type");
    if (type == nullptr ||
        std::find(kSdfJointTypes.begin(), kSdfJointTypes.end(), type) != kSdfJointTypes.end())
      return;
    Fail(joint,
         fmt::format("its type is '{}'; allowed: {}", type, fmt::join(kSdfJointTypes, ", ")));
  }

  void CheckNumbers(const XMLElement& element, const SdfNumbers& row) const {
    const std::string_view text = element.GetText() == nullptr ? "" : element.GetText();
    const auto fail = [&](const std::string& allowed) {
      Fail(element, fmt::format("<{}> is '{}'; allowed: {}", row.name, text, allowed));
    };
    std::vector<double> values;
    for (const std::string_view word : WordsOf(text)) {
      const auto value = WholeNumber<double>(word);
      if (!value) fail(row.count == 1 ? "a number" : fmt::format("{} numbers", row.count));
      values.push_back(value.value_or(0));
    }
    if (values.size() != row.count)
      fail(row.count == 1 ? "a number" : fmt::format("{} numbers", row.count));
    if (row.positive && std::any_of(values.begin(), values.end(), [](double v) { return v <= 0; }))
      fail("sizes above 0");
    if (row.name == "xyz") CheckDirection(values, fail);
  }

  template <class FailFunction>
  static void CheckDirection(const std::vector<double>& xyz, const FailFunction& fail) {
    // What the library takes for zero, and whose square has no room in a number.
    constexpr double kShortest = 1e-3, kLongest = 1e100;
    double largest = 0;
    for (const double x : xyz) largest = std::max(largest, std::abs(x));
    if (largest <= kShortest || largest > kLongest) {
      fail(fmt::format("a direction, whose largest number is above {} and at most {} in size",
                       kShortest, kLongest));
    }
  }

  const std::string& name_;
  SdfTaken taken_;
  bool had_model_ = false;
  SdfSource source_;
};

}  // namespace

SdfSource ReadSdfSource(const std::string& file, const std::string& name, SdfTaken taken) {
  const std::string text = ReadTextFile(file);
  tinyxml2::XMLDocument document;
  const bool is_xml = document.Parse(text.data(), text.size()) == tinyxml2::XML_SUCCESS;
  const XMLElement* const root = document.RootElement();
  if (!is_xml || root == nullptr) return {};
  return SdfSourceReader(name, taken).Read(*root);
}

}  // namespace tumbler

#endif
