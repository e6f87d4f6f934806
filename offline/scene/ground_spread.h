#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>

namespace tumbler {

/// By how much robots differ in a property of their ground: friction, stiffness or damping. The
/// three ways are those in which people know a floor.
class GroundSpread {
 public:
  /// Values of the property itself, from one to the other: mu, N/m or N s/m.
  struct Between {
    double from = 0, to = 0;
    bool operator==(const Between&) const = default;
  };
  /// A factor of the model's value, from 1 / most to most, uniform in its logarithm.
  struct EitherWay {
    double most = 1;
    bool operator==(const EitherWay&) const = default;
  };

  /// Standard deviation of a normal factor of the model's value.
  // It is implicit, so that a number is what it is of every other spread.
  constexpr GroundSpread(double deviation) : how_(deviation) {}  // NOLINT
  constexpr GroundSpread(Between between) : how_(between) {}     // NOLINT
  constexpr GroundSpread(EitherWay either) : how_(either) {}     // NOLINT

  /// The standard deviation; null for a range.
  [[nodiscard]] const double* deviation() const { return std::get_if<double>(&how_); }
  [[nodiscard]] const Between* between() const { return std::get_if<Between>(&how_); }
  [[nodiscard]] const EitherWay* either_way() const { return std::get_if<EitherWay>(&how_); }
  /// Whether robots do not differ in it.
  [[nodiscard]] bool none() const { return deviation() != nullptr && *deviation() == 0; }

  bool operator==(const GroundSpread&) const = default;

 private:
  std::variant<double, Between, EitherWay> how_;
};

/// What ranges of a property may say, for files, command lines and Python alike.
struct GroundSpreadLimits {
  double most_value;                          ///< Of `Between`, whose values are above 0.
  double most_factor = 100;                   ///< Of `EitherWay`, above 1.
  double most_deviation = 1;                  ///< At least 0.
  [[nodiscard]] std::string Allowed() const;  ///< In words.
};
/// Those of the three properties, as `[contact]` of a task has them.
inline constexpr GroundSpreadLimits kFrictionSpreadLimits{.most_value = 10};
inline constexpr GroundSpreadLimits kStiffnessSpreadLimits{.most_value = 1e8};
inline constexpr GroundSpreadLimits kDampingSpreadLimits{.most_value = 1e6};

/// What is wrong with a spread; empty: nothing.
std::string MistakeIn(const GroundSpread& spread, const GroundSpreadLimits& limits);

/// In the notation of command lines: `0.2`, `0.15..1`, `x10`.
std::string ToText(const GroundSpread& spread);
/// Reads that notation; empty where it is none.
std::optional<GroundSpread> ParseGroundSpread(std::string_view text);

}  // namespace tumbler
