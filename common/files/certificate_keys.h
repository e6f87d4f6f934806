#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "common/files/file_keys.h"
#include "common/files/primitive_toml.h"

namespace tumbler {

/// A figure of the certificate. The primitive file, the report page, JSON and docs/method.md take
/// it from here.
struct CertificateKey {
  FileKey<Certificate> key;  ///< Its meaning says how the figure is obtained.
  int page_line = 0;       ///< Number of the figure's line on the report page, from 1 on; 0: none.
  const char* label = "";  ///< Name of the figure on that line.
  const char* text = "";   ///< Text of that line, for FormatCertificate of offline/certify.
};

/// All figures, in the order of the file.
inline constexpr std::array kCertificateKeys = {
    CertificateKey{
        KeyOf<&Certificate::gradient_error>(
            "gradient_error", Range::NonNegative(),
            "the best of `gradient_errors`; above 1e-3 the program warns, because the cost does "
            "not follow its slope over 1e-5 rad: a cliff is near"),
        1, "gradient error against central differences",
        "{gradient_error:.2e} (relative); {gradient_errors:.2e} with steps of "
        "{gradient_difference_steps_rad:.0e} rad"},
    CertificateKey{KeyOf<&Certificate::gradient_difference_steps_rad>(
        "gradient_difference_steps_rad", Range::NonNegative(),
        "analytic gradient of the whole rollout against central differences of the cost at three "
        "steps along four directions, near the optimum (at it, the gradient is zero), through "
        "contact")},
    CertificateKey{KeyOf<&Certificate::gradient_errors>(
        "gradient_errors", Range::NonNegative(),
        "analytic gradient of the whole rollout against central differences of the cost at three "
        "steps along four directions, near the optimum (at it, the gradient is zero), through "
        "contact")},
    CertificateKey{KeyOf<&Certificate::gradient_step_halving_change>(
                       "gradient_step_halving_change", Range::NonNegative(),
                       "relative change of the gradient at that point when the step is halved"),
                   2, "gradient when the step is halved",
                   "changes by {gradient_step_halving_change:.2e} (relative)"},
    CertificateKey{KeyOf<&Certificate::projected_gradient>(
                       "projected_gradient", Range::NonNegative(), "see above, cost per rad"),
                   3, "projected gradient", "{projected_gradient:.2e} (cost per rad)"},
    CertificateKey{
        KeyOf<&Certificate::constraint_violation>(
            "constraint_violation", Range::NonNegative(),
            "by how much the worst limit is exceeded, relative to it (positions in rad), computed "
            "from the splines and the simulation alone; zero when all hold, and "
            "no primitive is written above 1e-6, whatever the solver says"),
        4, "constraint violation", "{constraint_violation:.2e} (scaled)"},
    CertificateKey{
        KeyOf<&Certificate::step_halving_error_rad>(
            "step_halving_error_rad", "change of the final pitch when the step is halved"),
        5, "final pitch when the step is halved", "changes by {step_halving_error_rad:.2e} rad"},
    CertificateKey{KeyOf<&Certificate::settled_pitch_error_rad>(
                       "settled_pitch_error_rad",
                       "pitch 2 s after the end, joints held, less the pitch that was asked for; "
                       "0 where none was"),
                   6, "pitch 2 s after the end",
                   "off its target by {settled_pitch_error_rad:.2e} rad"},
    CertificateKey{
        KeyOf<&Certificate::peak_torque_nm>("peak_torque_nm", Range::NonNegative(),
                                            "at every integration step, up to 2 s after the end"),
        7, "peak torque", "{peak_torque_nm:.3f} N m"},
    CertificateKey{KeyOf<&Certificate::peak_penetration_m>(
                       "peak_penetration_m", Range::NonNegative(), "likewise, into the layer"),
                   12, "peak penetration", "{peak_penetration_mm:.2f} mm of {layer_mm:.2f} mm"},
    CertificateKey{KeyOf<&Certificate::position_margin_rad>(
                       "position_margin_rad",
                       "of the paths, for all t; the loader computes them again and refuses a file "
                       "that disagrees"),
                   9, "margin to the position limits", "{position_margin_rad:.3f} rad (all t)"},
    CertificateKey{KeyOf<&Certificate::velocity_margin_rad_s>(
                       "velocity_margin_rad_s",
                       "of the paths, for all t; the loader computes them again and refuses a file "
                       "that disagrees"),
                   10, "margin to the velocity limit", "{velocity_margin_rad_s:.3f} rad/s (all t)"},
    CertificateKey{KeyOf<&Certificate::acceleration_margin_rad_s2>(
                       "acceleration_margin_rad_s2",
                       "of the paths, for all t; the loader computes them again and refuses a file "
                       "that disagrees"),
                   11, "margin to the acceleration limit",
                   "{acceleration_margin_rad_s2:.1f} rad/s\u00b2 (all t)"},
    CertificateKey{
        KeyOf<&Certificate::torque_margin_nm>(
            "torque_margin_nm",
            "smallest limit at a motor's speed less its torque, at every integration step"),
        8, "margin to the torque limit", "{torque_margin_nm:.3f} N m (dense samples)"},
    CertificateKey{
        KeyOf<&Certificate::self_clearance_m>(
            "self_clearance_m",
            "smallest [distance between the robot's own shapes](#self-contact), at every "
            "integration step of motion and settle phase; missing where it has none that "
            "are to stay apart"),
        13, "nearest approach of own shapes", "{self_clearance_mm:.1f} mm"},
    CertificateKey{
        KeyOf<&Certificate::kkt_residual>(
            "kkt_residual", {0, 1},
            "the projected gradient relative to what it is made of, by sensitivities whose "
            "integration is 100 times finer than the solver's; at a minimum 1e-4 or less. By the "
            "solver's own where that is more than 100 times as much as is asked for. Missing in "
            "motions for robots that differ"),
        14, "Kuhn-Tucker residual", "{kkt_residual:.1e} (relative)"},
};

/// The keys alone, for ReadKeys and WriteKeys. All but the last two are required.
inline constexpr auto kCertificateFileKeys = [] {
  std::array<FileKey<Certificate>, kCertificateKeys.size()> keys;
  for (std::size_t i = 0; i < keys.size(); ++i) keys[i] = kCertificateKeys[i].key;
  keys = AllRequired(keys);
  for (FileKey<Certificate>& key : std::span(keys).last(2)) key.text.required = false;
  return keys;
}();

}  // namespace tumbler
