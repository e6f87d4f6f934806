#include "offline/model/urdf_mass.h"

#include <fmt/format.h>
#include <tinyxml.h>

#include <array>
#include <string_view>

#include "common/files/toml_reader.h"
#include "offline/model/urdf_source.h"

namespace tumbler {
namespace {

void Multiply(TiXmlElement* element, const char* attribute, double factor) {
  double value = 0;
  if (element == nullptr || element->QueryDoubleAttribute(attribute, &value) != TIXML_SUCCESS)
    return;
  element->SetAttribute(attribute, fmt::format("{}", factor * value).c_str());
}

}  // namespace

std::string WithMassTimes(double factor, const std::string& link, const std::string& urdf,
                          const std::string& file) {
  static_cast<void>(UrdfSource(urdf, file));  // refuses what is no URDF
  TiXmlDocument document;
  document.Parse(urdf.c_str(), nullptr, TIXML_ENCODING_UTF8);
  std::string links;
  bool found = false;
  for (TiXmlElement* element = document.RootElement()->FirstChildElement("link");
       element != nullptr; element = element->NextSiblingElement("link")) {
    TiXmlElement* const inertial = element->FirstChildElement("inertial");
    const char* const name = element->Attribute("name");
    if (inertial == nullptr || name == nullptr) continue;
    links += (links.empty() ? "" : ", ") + std::string(name);
    if (!link.empty() && link != name) continue;
    found = true;
    Multiply(inertial->FirstChildElement("mass"), "value", factor);
    for (const char* attribute : std::array{"ixx", "ixy", "ixz", "iyy", "iyz", "izz"})
      Multiply(inertial->FirstChildElement("inertia"), attribute, factor);
  }
  if (!found) {
    throw FileError(file, 0, link.empty() ? "mass" : link,
                    fmt::format("is no link with a mass; those of the robot: {}", links));
  }
  TiXmlPrinter printer;
  document.Accept(&printer);
  return printer.Str();
}

}  // namespace tumbler
