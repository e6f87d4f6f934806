#pragma once

#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// A figure of a certificate under its key in the file's `[certificate]`.
struct CertificateFigure {
  const char* key;
  std::variant<double, std::vector<double>, std::string> value;
};
/// All figures that a certificate has, in the file's order.
std::vector<CertificateFigure> FiguresOf(const Certificate& certificate);

/// Fills figures of a certificate into a text. `{KEY:SPEC}`, in fmt's syntax, stands for the figure
/// of that key; several numbers are separated by commas. More keys give millimetres:
/// `peak_penetration_mm`, `layer_mm`, the thickness of the compliant layer, and `self_clearance_mm`
/// where the certificate has this figure.
/// @param d_on_m  thickness of the compliant layer [m].
std::string FormatCertificate(const char* text, const Certificate& certificate, double d_on_m);

/// The lines that a report page shows of a certificate: for each a label and its figures.
std::vector<std::pair<std::string, std::string>> CertificateLines(const Certificate& certificate,
                                                                  double d_on_m);

/// What was found of a motion besides its paths, each by its name and with its bounds: the duration
/// and the root's velocities at the start, unless they were given.
/// @param problem  of that duration and start.
std::vector<std::pair<std::string, std::string>> FoundBesidesPaths(const Problem& problem);

}  // namespace tumbler
