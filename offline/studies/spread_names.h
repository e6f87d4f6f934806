#pragma once

#include <array>
#include <string>
#include <variant>

#include "common/files/json.h"
#include "offline/scene/variation.h"
#include "offline/studies/trial.h"

namespace tumbler {

/// A spread with its name in files and on the command line.
struct SpreadName {
  std::variant<double Spreads::*, GroundSpread Spreads::*> member;
  const char* key;     ///< Of JSON.
  const char* option;  ///< Of the command line.
  const char* help;
  double max;                   ///< Of the number.
  GroundSpreadLimits limits{};  ///< Of the ground's.

  /// In the notation of command lines.
  [[nodiscard]] std::string TextOf(const Spreads& spreads) const;
  /// A number, or an object with the keys of a task's `[robust]`.
  [[nodiscard]] Json JsonOf(const Spreads& spreads) const;
  /// Whether robots do not differ in it.
  [[nodiscard]] bool none(const Spreads& spreads) const;
  /// Sets a number. It may be out of range.
  void Set(double value, Spreads& spreads) const;
};

inline constexpr std::array<SpreadName, 14> kSpreadNames = {{
    {&Spreads::mass, "mass", "--mass", "Spread of each link's mass and inertia [part of it]", 1},
    {&Spreads::inertia, "inertia", "--inertia",
     "Spread of each link's inertia, besides [part of it]", 1},
    {&Spreads::mass_centre_m, "mass_centre_m", "--mass-centre",
     "Spread of each centre of mass along x [m]", 1},
    {&Spreads::length, "length", "--length", "Spread of each link's length [part of it]", 1},
    {&Spreads::friction, "friction", "--friction",
     "Spread of the ground's friction: part of it, values of mu as 0.15..1, or a factor either way "
     "as x3; 0.2 if left out",
     1, kFrictionSpreadLimits},
    {&Spreads::stiffness, "stiffness", "--stiffness",
     "Spread of the ground's stiffness: part of it, values as 1e4..1e6 [N/m], or a factor either "
     "way as x10; 0.2 if left out",
     1, kStiffnessSpreadLimits},
    {&Spreads::damping, "damping", "--damping",
     "Spread of the ground's damping: likewise [N s/m]; 0.2 if left out", 1, kDampingSpreadLimits},
    {&Spreads::gain, "gain", "--gain", "Spread of each joint's gains [part of them]", 1},
    {&Spreads::torque_limit, "torque_limit", "--torque-limit",
     "Spread of each motor's limit [part of it]", 1},
    {&Spreads::slope_rad, "slope_rad", "--slope", "Spread of the ground's slope [rad]", 1},
    {&Spreads::delay_s, "delay_s", "--delay",
     "Of setpoints: magnitude of a normal number of this spread [s]", 0.01},
    {&Spreads::zero_rad, "zero_rad", "--zero", "Spread of each encoder's zero [rad]", 1},
    {&Spreads::start_rad, "start_rad", "--start",
     "Spread of each joint's position when the first motion begins [rad]", 1},
    {&Spreads::start_rate_rad_s, "start_rate_rad_s", "--start-rate",
     "Spread of the rates of pitch and joints, likewise [rad/s]", 10},
}};

/// All verdicts, in the order in which they are reported.
inline constexpr std::array kVerdicts = {
    TrialOutcome::Verdict::kStands,   TrialOutcome::Verdict::kAmiss, TrialOutcome::Verdict::kFell,
    TrialOutcome::Verdict::kOverlap,  TrialOutcome::Verdict::kFault, TrialOutcome::Verdict::kGotUp,
    TrialOutcome::Verdict::kNotJudged};

}  // namespace tumbler
