#include "offline/model/urdf_edit.h"

#include <fmt/format.h>
#include <tinyxml.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <sstream>
#include <utility>

#include "common/core/index.h"
#include "common/files/toml_reader.h"
#include "offline/model/robot.h"
#include "offline/model/xml_tags.h"

namespace tumbler {
namespace {

TiXmlElement* LinkNamed(TiXmlElement& robot, const std::string& link) {
  for (TiXmlElement* e = robot.FirstChildElement("link"); e != nullptr;
       e = e->NextSiblingElement("link")) {
    const char* name = e->Attribute("name");
    if (name != nullptr && name == link) return e;
  }
  return nullptr;
}

void Multiply(TiXmlElement& element, const char* attribute, double factor) {
  const char* text = element.Attribute(attribute);
  if (text == nullptr || factor == 1) return;
  element.SetAttribute(attribute, fmt::format("{}", factor * std::strtod(text, nullptr)));
}

void ShiftX(TiXmlElement& inertial, double by_m) {
  if (by_m == 0) return;
  TiXmlElement* origin = inertial.FirstChildElement("origin");
  if (origin == nullptr) {
    TiXmlElement made("origin");
    origin = inertial.InsertBeforeChild(inertial.FirstChild(), made)->ToElement();
  }
  std::array<double, 3> at{};
  if (const char* xyz = origin->Attribute("xyz"); xyz != nullptr) {
    const char* rest = xyz;
    for (double& value : at) {
      char* end = nullptr;
      value = std::strtod(rest, &end);
      rest = end;
    }
  }
  origin->SetAttribute("xyz", fmt::format("{} {} {}", at[0] + by_m, at[1], at[2]));
}

/// Where the collision shapes of each link are in the text, in the order of links and shapes.
std::vector<std::vector<std::pair<std::size_t, std::size_t>>> CollisionsOf(std::string_view urdf) {
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> links;
  constexpr int kInRobot = 1, kInLink = 2;
  int depth = 0;
  bool in_link = false;
  std::size_t begin = 0;
  XmlTags tags(urdf);
  for (XmlTag tag; tags.Next(tag);) {
    if (tag.opens) {
      if (depth == kInRobot) {
        in_link = tag.name == "link";
        if (in_link) links.emplace_back();
      }
      if (depth == kInLink) begin = tag.begin;
      ++depth;
    }
    if (tag.closes) {
      --depth;
      if (depth == kInLink && in_link && tag.name == "collision")
        links.back().emplace_back(begin, tag.end);
    }
  }
  return links;
}

std::string PointText(const SpaceVector& point) {
  // Without -0.
  return fmt::format(
      R"(<collision name="{}"><origin xyz="{} {} {}"/><geometry><sphere radius="0"/></geometry></collision>)",
      kMeshPoint, point.x() + 0.0, point.y() + 0.0, point.z() + 0.0);
}

}  // namespace

std::string WithInertias(const std::string& urdf, const std::string& name,
                         std::span<const LinkInertia> links) {
  TiXmlDocument document;
  document.Parse(urdf.c_str(), nullptr, TIXML_ENCODING_UTF8);
  TiXmlElement* robot = document.RootElement();
  if (document.Error() || robot == nullptr) throw FileError(name, 0, "", "is no XML");
  for (const LinkInertia& wanted : links) {
    TiXmlElement* link = LinkNamed(*robot, wanted.link);
    TiXmlElement* inertial = link == nullptr ? nullptr : link->FirstChildElement("inertial");
    TiXmlElement* mass = inertial == nullptr ? nullptr : inertial->FirstChildElement("mass");
    TiXmlElement* inertia = inertial == nullptr ? nullptr : inertial->FirstChildElement("inertia");
    if (mass == nullptr || inertia == nullptr) {
      throw FileError(name, 0, wanted.link,
                      "has no <inertial> with <mass> and <inertia> that could be changed");
    }
    Multiply(*mass, "value", wanted.mass_factor);
    for (const char* moment : {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"})
      Multiply(*inertia, moment, wanted.mass_factor * wanted.moment_factor);
    ShiftX(*inertial, wanted.centre_shift_m);
  }
  TiXmlPrinter printer;
  printer.SetIndent("  ");
  document.Accept(&printer);
  return printer.CStr();
}

std::string WithPoints(const std::string& urdf, const std::string& name,
                       std::span<const ShapeAsPoints> shapes) {
  TiXmlDocument document;
  document.Parse(urdf.c_str(), nullptr, TIXML_ENCODING_UTF8);
  const TiXmlElement* robot = document.RootElement();
  if (document.Error() || robot == nullptr) throw FileError(name, 0, "", "is no XML");
  std::map<std::string, std::size_t> places;
  for (const TiXmlElement* e = robot->FirstChildElement("link"); e != nullptr;
       e = e->NextSiblingElement("link")) {
    const char* link = e->Attribute("name");
    places.emplace(link == nullptr ? "" : link, places.size());
  }
  const auto collisions = CollisionsOf(urdf);
  std::map<std::size_t, std::pair<std::size_t, std::string>>
      edits;  // from where to where, and what
  for (const ShapeAsPoints& shape : shapes) {
    const auto place = places.find(shape.link);
    if (place == places.end() || place->second >= collisions.size() ||
        shape.index >= collisions[place->second].size()) {
      throw FileError(name, 0, fmt::format("link '{}'", shape.link),
                      fmt::format("has no collision shape {} that could be found", shape.index));
    }
    const auto& of_link = collisions[place->second];
    const auto [begin, end] = of_link[shape.index];
    std::string rest;
    for (std::size_t i = 1; i < shape.points.size(); ++i) rest += PointText(shape.points[i]);
    const auto lines = std::count(urdf.begin() + static_cast<std::ptrdiff_t>(begin),
                                  urdf.begin() + static_cast<std::ptrdiff_t>(end), '\n');
    const std::string in_place =
        PointText(shape.points.front()) + std::string(static_cast<std::size_t>(lines), '\n');
    edits.insert_or_assign(begin, std::pair(end, in_place));
    // Behind the last, which may be this one: an edit that takes nothing away begins there.
    auto& [after, added] = edits[of_link.back().second];
    after = of_link.back().second;
    added += rest;
  }
  std::string text;
  std::size_t at = 0;
  for (const auto& [begin, edit] : edits) {
    text += urdf.substr(at, begin - at) + edit.second;
    at = edit.first;
  }
  return text + urdf.substr(at);
}

}  // namespace tumbler
