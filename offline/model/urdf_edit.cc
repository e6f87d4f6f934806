#include "offline/model/urdf_edit.h"

#include <fmt/format.h>
#include <tinyxml.h>

#include <array>
#include <cstdlib>
#include <sstream>

#include "common/files/toml_reader.h"

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

}  // namespace tumbler
