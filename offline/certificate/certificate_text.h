#pragma once

#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/primitive_toml.h"

namespace tumbler {

/// A figure of a certificate under its key in the file's `[certificate]`.
struct CertificateFigure {
  const char* key;
  std::variant<double, std::vector<double>, std::string> value;
};
/// All of them, in the file's order.
std::vector<CertificateFigure> FiguresOf(const Certificate& certificate);

/// A text with figures of a certificate: `{KEY:SPEC}`, in fmt's syntax, is the figure of that key,
/// of several numbers with commas in between. Besides, in millimetres: `peak_penetration_mm`, and
/// `layer_mm`, the thickness of the compliant layer.
/// @param d_on_m  of the contact law.
std::string FormatCertificate(const char* text, const Certificate& certificate, double d_on_m);

/// What the report page shows of a certificate, line by line: of what, and the figures.
std::vector<std::pair<std::string, std::string>> CertificateLines(const Certificate& certificate,
                                                                  double d_on_m);

}  // namespace tumbler
