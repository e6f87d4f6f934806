#include "offline/certify/certificate_text.h"

#include <fmt/args.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <type_traits>

#include "common/files/certificate_keys.h"

namespace tumbler {

std::vector<CertificateFigure> FiguresOf(const Certificate& certificate) {
  Certificate copy = certificate;  // which keys could write to
  std::vector<CertificateFigure> figures;
  for (const CertificateKey& described : kCertificateKeys) {
    const KeyValue value = described.key.value(copy);
    const auto* const* optional = std::get_if<std::optional<double>*>(&value);
    if (optional != nullptr && !**optional) continue;
    CertificateFigure& figure = figures.emplace_back();
    figure.key = described.key.text.name.data();  // a literal
    if (const auto* const* number = std::get_if<double*>(&value)) {
      figure.value = **number;
    } else if (optional != nullptr) {
      figure.value = ***optional;
    } else if (const auto* numbers = std::get_if<std::span<double>>(&value)) {
      figure.value = std::vector<double>(numbers->begin(), numbers->end());
    } else {
      figure.value = *std::get<std::string*>(value);
    }
  }
  return figures;
}

std::string FormatCertificate(const char* text, const Certificate& certificate, double d_on_m) {
  const std::vector<CertificateFigure> figures = FiguresOf(certificate);
  fmt::dynamic_format_arg_store<fmt::format_context> arguments;
  for (const CertificateFigure& figure : figures) {
    if (const auto* numbers = std::get_if<std::vector<double>>(&figure.value)) {
      arguments.push_back(fmt::arg(figure.key, fmt::join(*numbers, ", ")));
    } else if (const auto* number = std::get_if<double>(&figure.value)) {
      arguments.push_back(fmt::arg(figure.key, *number));
    } else {
      arguments.push_back(fmt::arg(figure.key, std::get<std::string>(figure.value)));
    }
  }
  arguments.push_back(fmt::arg("peak_penetration_mm", 1e3 * certificate.peak_penetration_m));
  arguments.push_back(fmt::arg("layer_mm", 1e3 * d_on_m));
  if (certificate.self_clearance_m)
    arguments.push_back(fmt::arg("self_clearance_mm", 1e3 * *certificate.self_clearance_m));
  return fmt::vformat(text, arguments);
}

std::vector<std::pair<std::string, std::string>> CertificateLines(const Certificate& certificate,
                                                                  double d_on_m) {
  const std::vector<CertificateFigure> figures = FiguresOf(certificate);
  std::vector<const CertificateKey*> shown;
  for (const CertificateKey& described : kCertificateKeys) {
    const bool present =
        std::ranges::any_of(figures, [&described](const CertificateFigure& figure) {
          return described.key.text.name == figure.key;
        });
    if (present && described.page_line > 0) shown.push_back(&described);
  }
  std::sort(shown.begin(), shown.end(), [](const CertificateKey* a, const CertificateKey* b) {
    return a->page_line < b->page_line;
  });
  std::vector<std::pair<std::string, std::string>> lines;
  lines.reserve(shown.size());
  for (const CertificateKey* described : shown)
    lines.emplace_back(described->label, FormatCertificate(described->text, certificate, d_on_m));
  return lines;
}

std::vector<std::pair<std::string, std::string>> FoundBesidesPaths(const Problem& problem) {
  std::vector<std::pair<std::string, std::string>> found;
  const auto add = [&found](const char* name, double value, const char* unit, double least,
                            double most) {
    // Rounded alike, it is not shown beyond its bounds.
    found.emplace_back(
        name, fmt::format("{:.6g} {}, found between {:.6g} and {:.6g}", value, unit, least, most));
  };
  if (problem.free_duration) {
    add("duration", problem.duration_s, "s", problem.free_duration->min_s,
        problem.free_duration->max_s);
  }
  constexpr std::array kNames = {"x rate at the start", "z rate at the start",
                                 "pitch rate at the start"};
  constexpr std::array kUnits = {"m/s", "m/s", "rad/s"};
  for (const std::size_t i : problem.free_start_coordinates()) {
    const auto& [least, most] = *problem.free_start_rates[i];
    add(kNames[i], problem.start_root_rates[i], kUnits[i], least, most);
  }
  return found;
}

}  // namespace tumbler
