#include "runtime/bench/drive_scales.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "firmware_interface/devices/drive_models.h"

namespace tumbler {
namespace {

constexpr double kNs = 1e-9;
/// Scales whose logarithms differ by less than this, and by less than twice their errors more, are
/// the same: what models differ by is more, and current sensors are good for this.
constexpr double kSameScale = 0.08;

// ---- Least squares -----------------------------------------------------------------------------

constexpr std::size_t kColumnsMax = 7;
using Row = std::array<double, kColumnsMax>;

/// The sums of a linear regression. Those of parts of the samples add up, and can be taken away.
struct NormalSums {
  std::array<Row, kColumnsMax> squares{};
  Row products{};
  double y = 0;
  double y_squared = 0;
  double count = 0;

  void AddSample(const Row& x, double value) {
    for (std::size_t i = 0; i < kColumnsMax; ++i) {
      for (std::size_t k = 0; k <= i; ++k) squares[i][k] += x[i] * x[k];
      products[i] += x[i] * value;
    }
    y += value;
    y_squared += value * value;
    count += 1;
  }
  void AddSums(const NormalSums& other, double sign) {
    for (std::size_t i = 0; i < kColumnsMax; ++i) {
      for (std::size_t k = 0; k <= i; ++k) squares[i][k] += sign * other.squares[i][k];
      products[i] += sign * other.products[i];
    }
    y += sign * other.y;
    y_squared += sign * other.y_squared;
    count += sign * other.count;
  }
};

struct Solution {
  Row x{};
  double left = 0;   ///< Sum of the squares that remain,
  double whole = 0;  ///< and of what was to be explained.
};

/// Solves by Cholesky's decomposition. A column that hardly differs from others gets whatever fits;
/// its error, found by leaving samples out, is large then.
Solution Solve(const NormalSums& sums, std::size_t columns) {
  constexpr double kRidge = 1e-10;
  std::array<double, kColumnsMax> scale{};
  for (std::size_t i = 0; i < columns; ++i)
    scale[i] = 1 / std::sqrt(std::max(sums.squares[i][i], 1e-300));
  std::array<Row, kColumnsMax> lower{};
  for (std::size_t i = 0; i < columns; ++i) {
    for (std::size_t k = 0; k <= i; ++k) {
      double sum = sums.squares[i][k] * scale[i] * scale[k] + (i == k ? kRidge : 0);
      for (std::size_t j = 0; j < k; ++j) sum -= lower[i][j] * lower[k][j];
      lower[i][k] = i == k ? std::sqrt(std::max(sum, kRidge * kRidge)) : sum / lower[k][k];
    }
  }
  Row z{};
  for (std::size_t i = 0; i < columns; ++i) {
    double sum = sums.products[i] * scale[i];
    for (std::size_t j = 0; j < i; ++j) sum -= lower[i][j] * z[j];
    z[i] = sum / lower[i][i];
  }
  Solution solution;
  for (std::size_t i = columns; i-- > 0;) {
    double sum = z[i];
    for (std::size_t j = i + 1; j < columns; ++j) sum -= lower[j][i] * solution.x[j];
    solution.x[i] = sum / lower[i][i];
  }
  double explained = 0;
  for (std::size_t i = 0; i < columns; ++i) explained += z[i] * z[i];
  for (std::size_t i = 0; i < columns; ++i) solution.x[i] *= scale[i];
  solution.left = std::max(sums.y_squared - explained, 0.0);
  solution.whole = sums.count > 0 ? sums.y_squared - sums.y * sums.y / sums.count : 0;
  return solution;
}

/// A recording in parts of equal length, so that errors that stay for a while are seen as such.
constexpr std::size_t kParts = 10;
using PartSums = std::array<NormalSums, kParts>;

NormalSums Sum(const PartSums& parts) {
  NormalSums sum;
  for (const NormalSums& part : parts) sum.AddSums(part, 1);
  return sum;
}

/// A ratio of the solution, and its error by leaving out one part after the other.
template <typename RatioOf>
ScaleRatio WithError(const PartSums& parts, std::size_t columns, const RatioOf& ratio_of) {
  const NormalSums all = Sum(parts);
  const double ratio = ratio_of(Solve(all, columns).x);
  ScaleRatio result;
  if (!(std::abs(ratio) > 1e-3) || !(std::abs(ratio) < 1e3)) return result;
  result.reversed = ratio < 0;
  result.log = std::log(std::abs(ratio));
  std::array<double, kParts> logs{};
  double mean = 0;
  for (std::size_t i = 0; i < kParts; ++i) {
    NormalSums rest = all;
    rest.AddSums(parts[i], -1);
    const double without = ratio_of(Solve(rest, columns).x);
    if (!(without * ratio > 0)) return result;
    logs[i] = std::log(std::abs(without));
    mean += logs[i] / kParts;
  }
  double squares = 0;
  for (const double log : logs) squares += (log - mean) * (log - mean);
  result.error = std::sqrt(squares * (kParts - 1) / kParts);
  return result;
}

// ---- Signals -----------------------------------------------------------------------------------

/// Linear between samples, constant beyond the ends.
template <typename Sample, typename ValueOf>
double At(const std::vector<Sample>& samples, double time_ns, const ValueOf& value_of) {
  const auto after = std::upper_bound(
      samples.begin(), samples.end(), time_ns,
      [](double t, const Sample& sample) { return t < static_cast<double>(sample.time_ns); });
  if (after == samples.begin()) return value_of(samples.front());
  const Sample& before = *std::prev(after);
  if (after == samples.end()) return value_of(before);
  const double span = static_cast<double>(after->time_ns - before.time_ns);
  const double share = span > 0 ? (time_ns - static_cast<double>(before.time_ns)) / span : 0;
  return value_of(before) + share * (value_of(*after) - value_of(before));
}

double ValueAt(const std::vector<ReportedValue>& samples, double time_ns) {
  return At(samples, time_ns, [](const ReportedValue& sample) { return sample.value; });
}

/// The time of the last sample that had come by this time. What a drive sends together it has
/// measured together, though the frames follow each other.
double LastBefore(const std::vector<ReportedValue>& samples, double time_ns) {
  const auto after = std::upper_bound(samples.begin(), samples.end(), time_ns,
                                      [](double t, const ReportedValue& sample) {
                                        return t < static_cast<double>(sample.time_ns);
                                      });
  return static_cast<double>(after == samples.begin() ? after->time_ns : std::prev(after)->time_ns);
}

double WayOf(const std::vector<ReportedValue>& positions) {
  const auto [low, high] = std::minmax_element(
      positions.begin(), positions.end(),
      [](const ReportedValue& a, const ReportedValue& b) { return a.value < b.value; });
  return positions.empty() ? 0 : high->value - low->value;
}

struct VelocityFit {
  ScaleRatio ratio;
  /// By how much positions on both sides of the drive's zero are reported too near to it, because
  /// their steps are cut off towards zero.
  double cut_off_rad = 0;
};

double SideOf(double position_rad, double zero_rad) {
  return position_rad > zero_rad ? 1 : position_rad < zero_rad ? -1 : 0;
}

/// Reported velocity to differences of reported positions: positions are fitted to the integral of
/// velocities, which bears coarse steps of both. A constant error of the velocity is left out.
/// @param zero_rad  where steps of positions are cut off towards the drive's zero: where that is.
VelocityFit FitVelocity(const DriveRecording& recording, std::optional<double> zero_rad) {
  const auto& velocities = recording.velocities_rad_s;
  constexpr std::size_t kFewest = 10 * kParts;
  if (velocities.size() < kFewest || recording.positions_rad.empty()) return {};
  const double origin_rad = recording.positions_rad.front().value;
  const double begin_ns = static_cast<double>(velocities.front().time_ns);
  PartSums parts{};
  double integral_rad = 0;
  for (std::size_t i = 0; i < velocities.size(); ++i) {
    const double time_ns = static_cast<double>(velocities[i].time_ns);
    if (i > 0) {
      integral_rad += 0.5 * (velocities[i].value + velocities[i - 1].value) *
                      (time_ns - static_cast<double>(velocities[i - 1].time_ns)) * kNs;
    }
    const double position_rad = ValueAt(recording.positions_rad, time_ns);
    parts[i * kParts / velocities.size()].AddSample(
        {integral_rad, (time_ns - begin_ns) * kNs, 1,
         zero_rad ? -SideOf(position_rad, *zero_rad) : 0},
        position_rad - origin_rad);
  }
  const std::size_t columns = zero_rad ? 4 : 3;
  VelocityFit fit;
  fit.ratio = WithError(parts, columns, [](const Row& x) { return x[0]; });
  fit.ratio.log = -fit.ratio.log;
  if (zero_rad) fit.cut_off_rad = Solve(Sum(parts), columns).x[3];
  return fit;
}

/// Positions with the steps of their report smoothed, by the integral of velocities: what both say
/// over half a second is that of the positions.
std::vector<ReportedValue> Smoothed(const DriveRecording& recording, const ScaleRatio& velocity,
                                    double cut_off_rad, double zero_rad) {
  constexpr double kWindow_ns = 0.25e9;  // to each side
  std::vector<ReportedValue> positions = recording.positions_rad;
  for (ReportedValue& position : positions)
    position.value += cut_off_rad * SideOf(position.value, zero_rad);
  const double per_velocity = 1 / velocity.value();
  std::vector<double> integrals(positions.size());
  std::vector<double> sums(positions.size() + 1);  // of positions less integrals
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (i > 0) {
      const auto velocity_at = [&](std::size_t k) {
        return ValueAt(recording.velocities_rad_s, static_cast<double>(positions[k].time_ns));
      };
      integrals[i] = integrals[i - 1] +
                     0.5 * per_velocity * (velocity_at(i) + velocity_at(i - 1)) *
                         static_cast<double>(positions[i].time_ns - positions[i - 1].time_ns) * kNs;
    }
    sums[i + 1] = sums[i] + positions[i].value - integrals[i];
  }
  std::vector<ReportedValue> smoothed = positions;
  std::size_t first = 0, end = 0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const double time_ns = static_cast<double>(positions[i].time_ns);
    while (time_ns - static_cast<double>(positions[first].time_ns) > kWindow_ns) ++first;
    while (end < positions.size() &&
           static_cast<double>(positions[end].time_ns) - time_ns <= kWindow_ns) {
      ++end;
    }
    smoothed[i].value = integrals[i] + (sums[end] - sums[first]) / static_cast<double>(end - first);
  }
  return smoothed;
}

// ---- The drive's law ---------------------------------------------------------------------------

/// Which terms of the law are fitted by themselves. Where positions (velocities) are asked for and
/// reported in one and the same scale, only their difference is.
struct LawTerms {
  bool positions_apart = true;
  bool velocities_apart = true;
  bool integral = false;  ///< Of drives with loops of their own, whose velocity loop has one.
};
struct LawDelays {
  double setpoint_s = 0;  ///< From a setpoint's frame to the torque that it causes,
  double torque_s = 0;    ///< and from a torque to its report.
  double position_s = 0;  ///< What a position takes besides; some drives interpolate it.
};

/// The sums of the regression. Columns: kp (position - q), kd (velocity - qdot), feed-forward, 1,
/// and as the terms say kp q, kd qdot, the integral.
/// @param stride  every so many samples are taken.
PartSums SumLaw(const DriveEntry& entry, const DriveRecording& recording, const LawTerms& terms,
                const LawDelays& delays, std::size_t stride = 1) {
  const bool carried = CarriesGains(entry.config);
  const double origin_rad = recording.positions_rad.front().value;
  PartSums parts{};
  double integral_nm_s = 0;
  double before_nm = 0;
  const auto& torques = recording.torques_nm;
  for (std::size_t i = 0; i < torques.size(); i += stride) {
    const double came_ns = static_cast<double>(torques[i].time_ns);
    const double before_ns = delays.torque_s / kNs;
    const double time_ns = LastBefore(recording.positions_rad, came_ns) - before_ns;
    const double asked_ns = time_ns - delays.setpoint_s / kNs;
    const auto asked = [&](float DriveSetpoint::*member, double later_s = 0) {
      return At(recording.asked, asked_ns - later_s / kNs,
                [member](const AskedSetpoint& of) { return double{of.setpoint.*member}; });
    };
    const double kp = carried ? asked(&DriveSetpoint::kp_nm_per_rad) : double{entry.kp_nm_per_rad};
    const double kd =
        carried ? asked(&DriveSetpoint::kd_nm_s_per_rad) : double{entry.kd_nm_s_per_rad};
    const double q = ValueAt(recording.positions_rad, time_ns) - origin_rad;
    const double qdot = ValueAt(recording.velocities_rad_s,
                                LastBefore(recording.velocities_rad_s, came_ns) - before_ns);
    const double position_nm =
        kp * (asked(&DriveSetpoint::position_rad, delays.position_s) - origin_rad - q);
    const double velocity_nm = kd * (asked(&DriveSetpoint::velocity_rad_s) - qdot);
    if (i > 0) {
      integral_nm_s += 0.5 * (position_nm + velocity_nm + before_nm) *
                       static_cast<double>(torques[i].time_ns - torques[i - stride].time_ns) * kNs;
    }
    before_nm = position_nm + velocity_nm;
    Row row{position_nm, velocity_nm, asked(&DriveSetpoint::torque_nm), 1};
    std::size_t column = 4;
    if (terms.positions_apart) row[column++] = kp * q;
    if (terms.velocities_apart) row[column++] = kd * qdot;
    if (terms.integral) row[column++] = integral_nm_s;
    parts[i * kParts / torques.size()].AddSample(row, torques[i].value);
  }
  return parts;
}

std::size_t ColumnsOf(const LawTerms& terms) {
  return 4U + (terms.positions_apart ? 1U : 0U) + (terms.velocities_apart ? 1U : 0U) +
         (terms.integral ? 1U : 0U);
}

/// The delays with which the law explains most. A joint with little inertia on a stiff drive has
/// torques that are small differences of large terms, so that tenths of a period matter.
/// @param explained  gets the share that it explains.
LawDelays FindDelays(const DriveEntry& entry, const DriveRecording& recording,
                     const LawTerms& terms, double period_s, double& explained) {
  constexpr int kPeriodsMax = 4;
  constexpr double kEarliest_s = -0.001, kLatest_s = 0.005;
  constexpr std::size_t kEnough = 1000;  // samples
  const std::size_t stride = std::max<std::size_t>(recording.torques_nm.size() / kEnough, 1);
  LawDelays best;
  double least = std::numeric_limits<double>::infinity();
  const auto try_delays = [&](const LawDelays& delays) {
    if (delays.setpoint_s < 0 || delays.setpoint_s > kPeriodsMax * period_s ||
        delays.torque_s < kEarliest_s || delays.torque_s > kLatest_s ||
        std::abs(delays.position_s) > 2 * period_s) {
      return false;
    }
    const Solution solution =
        Solve(Sum(SumLaw(entry, recording, terms, delays, stride)), ColumnsOf(terms));
    if (!(solution.left < least)) return false;
    least = solution.left;
    best = delays;
    explained = solution.whole > 0 ? 1 - solution.left / solution.whole : 0;
    return true;
  };
  for (const double torque_s : {0.0, 0.001, 0.003}) {
    for (int periods = 0; periods <= kPeriodsMax; ++periods)
      try_delays({periods * period_s, torque_s});
  }
  for (double step_s = 0.5 * period_s; step_s > 0.01 * period_s;) {
    const LawDelays from = best;
    bool better = false;
    for (const double sign : {-1.0, 1.0}) {
      const double step = sign * step_s;
      LawDelays next = from;
      next.setpoint_s += step;
      better = try_delays(next) || better;
      next.torque_s -= step;
      better = try_delays(next) || better;
      next.setpoint_s = from.setpoint_s;
      better = try_delays(next) || better;
      if (CarriesGains(entry.config)) continue;
      next = from;
      next.position_s += step;
      better = try_delays(next) || better;
      next.setpoint_s -= step;
      better = try_delays(next) || better;
    }
    if (!better) step_s *= 0.5;
  }
  return best;
}

/// A ratio of the law's damping. What is left of delays turns stiffness into damping, which
/// leaving samples out does not show.
ScaleRatio OfDamping(ScaleRatio ratio) {
  constexpr double kDelayError = 0.05;
  ratio.error = std::hypot(ratio.error, kDelayError);
  return ratio;
}

/// Fits the torque to the terms of the law, with the delays that explain it best.
void FitLaw(const DriveEntry& entry, const DriveRecording& recording, double period_s,
            DriveScales& scales) {
  constexpr std::size_t kFewest = 10 * kParts;
  scales.torque_reported = !recording.torques_nm.empty();
  if (recording.torques_nm.size() < kFewest || recording.asked.empty() ||
      recording.positions_rad.empty() || recording.velocities_rad_s.empty()) {
    return;
  }
  LawTerms terms;
  // A joint that hardly moves shows nothing of what is reported of its motion.
  const bool moves = scales.velocity.told();
  terms.positions_apart = terms.velocities_apart = scales.gains_carried && moves;
  terms.integral = !scales.gains_carried;
  const LawDelays delays = FindDelays(entry, recording, terms, period_s, scales.explained);
  if (scales.explained < DriveScales::kExplainedMin) return;
  PartSums parts = SumLaw(entry, recording, terms, delays);
  const auto ratio = [&](const auto& of) { return WithError(parts, ColumnsOf(terms), of); };
  if (scales.gains_carried && moves) {
    // The coefficient of kp q is that of positions as asked for less that of positions as reported.
    scales.position_asked = ratio([](const Row& x) { return x[0] / (x[0] - x[4]); });
    scales.velocity_asked = OfDamping(ratio([](const Row& x) { return x[1] / (x[1] - x[5]); }));
    const auto differ = [](const ScaleRatio& of) {
      return of.told() && (of.reversed || std::abs(of.log) > kSameScale + 2 * of.error);
    };
    terms.positions_apart = differ(scales.position_asked);
    terms.velocities_apart = differ(scales.velocity_asked);
    parts = SumLaw(entry, recording, terms, delays);
  }
  scales.torque_asked = ratio([](const Row& x) { return x[2]; });
  // Loops of the drive's own are stiff: the torque of a light joint is a small difference of their
  // terms, and all coefficients suffer alike from errors of these. There what is asked for and what
  // is reported have one scale by the protocol, so that the feed-forward is the yardstick.
  const bool yardstick = !scales.gains_carried;
  if (yardstick && !scales.torque_asked.told()) return;
  const std::size_t velocity_column = terms.positions_apart ? 5 : 4;
  scales.stiffness = ratio([&](const Row& x) {
    return (x[0] - (terms.positions_apart ? x[4] : 0)) / (yardstick ? x[2] : 1);
  });
  scales.damping = OfDamping(ratio([&](const Row& x) {
    return (x[1] - (terms.velocities_apart ? x[velocity_column] : 0)) / (yardstick ? x[2] : 1);
  }));
}

// ---- Explanations ------------------------------------------------------------------------------

enum class ModelTable : std::uint8_t { kNone, kVelocity, kTorque, kMotor };

/// A value of the drives file whose error would scale something.
struct ScaleTerm {
  std::string key;  ///< As the file has it.
  double in_file = 0;
  bool range = true;      ///< Whether it is an end of a range,
  bool from_zero = true;  ///< and that of one that begins at zero.
  bool inverse = false;   ///< Whether the drive's value is the file's divided by the ratio.
  ModelTable table = ModelTable::kNone;
  ScaleRatio ratio;  ///< True scale to the file's, relative to the other terms of its family.
};

ScaleTerm RangeTerm(std::string key, const DriveRange& range, ModelTable table,
                    const ScaleRatio& ratio) {
  return {std::move(key), double{range.max}, true, false, false, table, ratio};
}
/// Of the term that the others of its family are relative to.
constexpr ScaleRatio kYardstick{0, 0, false};

/// Terms that are judged together, because only ratios of their scales are measured.
struct ScaleFamily {
  std::vector<ScaleTerm> terms;
  /// Logarithm of the true scale to which the ratios are relative; nothing: not known, so that each
  /// of the terms may be the one that is right.
  std::optional<double> reference;
};

/// A gain of a drive's law.
struct LawGain {
  const char* key;                     ///< In the drives file.
  const char* term;                    ///< Its term of the law.
  DriveRange ImpedanceRanges::*range;  ///< Where the protocol carries it,
  float DriveEntry::*of_drive;         ///< and where it is the drive's own.
};
constexpr LawGain kStiffness{"kp_nm_per_rad", "kp (position - q)", &ImpedanceRanges::kp_nm_per_rad,
                             &DriveEntry::kp_nm_per_rad};
constexpr LawGain kDamping{"kd_nm_s_per_rad", "kd (velocity - qdot)",
                           &ImpedanceRanges::kd_nm_s_per_rad, &DriveEntry::kd_nm_s_per_rad};

/// Whether a ratio is told to be another than that with this logarithm, whatever its sign.
bool IsOff(const ScaleRatio& ratio, double log = 0) {
  return ratio.told() && std::abs(ratio.log - log) > kSameScale + 2 * ratio.error;
}

/// Terms that are not as the file says, with the logarithms of true scale to the file's.
struct Explanation {
  std::vector<std::pair<std::size_t, double>> wrong;
};

/// The explanations with the fewest wrong terms.
std::vector<Explanation> Explain(const ScaleFamily& family) {
  const std::vector<ScaleTerm>& terms = family.terms;
  std::vector<double> references;
  if (family.reference) {
    references.push_back(*family.reference);
  } else {
    for (const ScaleTerm& term : terms) references.push_back(-term.ratio.log);
  }
  std::vector<Explanation> best;
  for (const double of : references) {
    Explanation one;
    for (std::size_t i = 0; i < terms.size(); ++i) {
      const double log = terms[i].ratio.log + of;
      if (std::abs(log) > kSameScale + 2 * terms[i].ratio.error) one.wrong.emplace_back(i, log);
    }
    if (!best.empty() && one.wrong.size() > best.front().wrong.size()) continue;
    if (!best.empty() && one.wrong.size() < best.front().wrong.size()) best.clear();
    const auto same_terms = [&one](const Explanation& other) {
      return std::ranges::equal(one.wrong, other.wrong, {}, &std::pair<std::size_t, double>::first,
                                &std::pair<std::size_t, double>::first);
    };
    if (std::ranges::none_of(best, same_terms)) best.push_back(one);
  }
  return best;
}

/// What can be wrong of one drive.
class ScaleJudge {
 public:
  ScaleJudge(const std::string& drive, const DriveEntry& entry, const DriveScales& scales,
             const KnownScales& known)
      : drive_(drive), entry_(entry), scales_(scales), known_(known) {
    if (std::holds_alternative<MitConfig>(entry.config)) {
      models_ = MitModels();
    } else if (std::holds_alternative<AkV3Config>(entry.config)) {
      models_ = AkV3Models();
    }
  }

  Judgement Run() {
    JudgeMotion();
    JudgeTorque();
    return std::move(judgement_);
  }

 private:
  void Judged(const std::string& what) { judgement_.judged.push_back(drive_ + ": " + what); }
  void NotTold(const std::string& what) { judgement_.not_told.push_back(drive_ + ": " + what); }
  [[nodiscard]] std::string ModelsWith(ModelTable table, double value) const;
  [[nodiscard]] std::string Describe(const ScaleTerm& term, double log) const;
  void Report(const ScaleFamily& family, const std::vector<Explanation>& explanations,
              const std::string& evidence);
  [[nodiscard]] static std::string Instead(const std::vector<ScaleTerm>& terms, std::size_t wrong,
                                           double log);
  void JudgeMotion();
  [[nodiscard]] ScaleFamily ReportedMotion(const ScaleRatio& velocity) const;
  void AddAskedMotion(const ScaleRatio& velocity, ScaleFamily& family, std::string& evidence);
  bool JudgeOtherWay(const ScaleFamily& family, const std::string& evidence,
                     const Explanation& ranges);
  void JudgeTorque();
  bool TorqueTells();
  ScaleFamily ReportedTorque();
  void AddAskedTorque(ScaleFamily& family, std::vector<std::string>& evidence);
  void AddGain(const LawGain& gain, const ScaleRatio& ratio, double error_log, ScaleFamily& family,
               std::vector<std::string>& evidence);
  [[nodiscard]] bool torque_asked_told() const {
    return scales_.torque_asked.told() && !scales_.torque_asked.reversed;
  }
  void Reversed(const std::string& what) {
    judgement_.findings.push_back(
        {"wrong-sign", entry_.joint,
         fmt::format("{}: {}: look at how its motor and encoder are set up", drive_, what)});
  }

  const std::string& drive_;
  const DriveEntry& entry_;
  const DriveScales& scales_;
  const KnownScales& known_;
  std::vector<DriveModel> models_;
  Judgement judgement_;
  double position_log_ = 0;  // true scale of reported positions to the file's, as explained
  double velocity_log_ = 0;
};

std::string ScaleJudge::ModelsWith(ModelTable table, double value) const {
  constexpr double kFits = 0.05;
  std::vector<std::string_view> names;
  for (const DriveModel& model : models_) {
    const double of_model = table == ModelTable::kVelocity ? model.velocity_rad_s
                            : table == ModelTable::kTorque ? model.torque_nm
                            : table == ModelTable::kMotor  ? model.pole_pairs_and_gear
                                                           : 0;
    if (of_model > 0 && std::abs(std::log(value / of_model)) <= kFits) names.push_back(model.name);
  }
  return names.empty() ? "" : fmt::format(", as {} is delivered", fmt::join(names, " or "));
}

std::string ScaleJudge::Describe(const ScaleTerm& term, double log) const {
  const double factor = std::exp(term.inverse ? -log : log);
  const double value = term.in_file * factor;
  const char* const sign = term.from_zero ? "" : "+-";
  return fmt::format(
      "{} is {}{:.3g} in the drives file, and about {}{:.3g} in the drive{}, {:.2f} "
      "times as much",
      term.key, sign, term.in_file, sign, value, ModelsWith(term.table, value), factor);
}

/// What would be wrong in place of one term of a family of which only ratios are known.
std::string ScaleJudge::Instead(const std::vector<ScaleTerm>& terms, std::size_t wrong,
                                double log) {
  std::vector<std::string> keys;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (i != wrong) keys.push_back(terms[i].key);
  }
  return fmt::format(
      "; unless it is right, and the scales of {} are all {:.2f} times the file's, which is not "
      "told by these measurements",
      fmt::join(keys, " and "), std::exp(-log));
}

void ScaleJudge::Report(const ScaleFamily& family, const std::vector<Explanation>& explanations,
                        const std::string& evidence) {
  const std::vector<ScaleTerm>& terms = family.terms;
  const bool relative = !family.reference;
  if (explanations.empty() || explanations.front().wrong.empty()) return;
  const auto kind = [&](const Explanation& of) {
    const bool range =
        std::ranges::all_of(of.wrong, [&](const auto& wrong) { return terms[wrong.first].range; });
    return range ? "other-range" : "other-constant";
  };
  if (explanations.size() == 1) {
    for (const auto& [i, log] : explanations.front().wrong) {
      judgement_.findings.push_back(
          {terms[i].range ? "other-range" : "other-constant", entry_.joint,
           fmt::format(
               "{}: {}: {}{}", drive_, evidence, Describe(terms[i], log),
               relative && explanations.front().wrong.size() == 1 ? Instead(terms, i, log) : "")});
    }
    return;
  }
  std::vector<std::string> all;
  for (const Explanation& one : explanations) {
    std::vector<std::string> parts;
    for (const auto& [i, log] : one.wrong) parts.push_back(Describe(terms[i], log));
    all.push_back(fmt::format("{}", fmt::join(parts, ", and ")));
  }
  judgement_.findings.push_back(
      {kind(explanations.front()), entry_.joint,
       fmt::format("{}: {}: either {}; which of these is not told by these measurements", drive_,
                   evidence, fmt::join(all, "; or "))});
}

// Positions and velocities. Logarithms are relative to the scale of reported positions.
void ScaleJudge::JudgeMotion() {
  if (!scales_.velocity.told()) {
    NotTold(fmt::format("the scale of its velocity, since its joint moved by {:.4f} rad only",
                        scales_.way_rad));
    return;
  }
  Judged("reported velocity against differences of reported positions");
  if (scales_.velocity.reversed) {
    Reversed("it reports velocities against the motion of its positions");
    return;
  }
  // True scale of reported velocities to that of reported positions.
  const ScaleRatio velocity{-scales_.velocity.log, scales_.velocity.error, false};
  ScaleFamily family = ReportedMotion(velocity);
  std::string evidence = fmt::format(
      "velocities are reported {:.3f} times as fast as positions change", scales_.velocity.value());
  if (scales_.gains_carried) AddAskedMotion(velocity, family, evidence);
  if (!family.reference) {
    NotTold(
        "whether positions and velocities are off by one and the same factor, since its joint "
        "was not turned through a known way");
  }
  const std::vector<Explanation> explanations = Explain(family);
  const bool only_way = std::abs(family.reference.value_or(0)) > kSameScale &&
                        !IsOff(scales_.position_asked) && !IsOff(velocity);
  if (only_way && !JudgeOtherWay(family, evidence, explanations.front())) {
    position_log_ = velocity_log_ = 0;
    return;
  }
  if (!only_way) Report(family, explanations, evidence);
  // Several explanations may be as good; the torque is judged by the first.
  position_log_ = family.reference.value_or(0);
  for (const auto& [i, log] : explanations.front().wrong) {
    if (!family.reference && i == 0) position_log_ = log;
  }
  velocity_log_ = velocity.log + position_log_;
}

/// What scales the positions (first) and velocities that are reported, by the protocol.
/// @param velocity  true scale of reported velocities to that of reported positions.
ScaleFamily ScaleJudge::ReportedMotion(const ScaleRatio& velocity) const {
  ScaleFamily family;
  if (known_.position) family.reference = std::log(*known_.position);
  if (const auto* mit = std::get_if<MitConfig>(&entry_.config)) {
    const bool positions_apart = IsOff(scales_.position_asked);
    const bool velocities_apart = IsOff(scales_.velocity_asked);
    family.terms = {
        RangeTerm(positions_apart ? "reply_range.position_rad" : "range.position_rad",
                  mit->reply.position_rad, ModelTable::kNone, kYardstick),
        RangeTerm(velocities_apart ? "reply_range.velocity_rad_s" : "range.velocity_rad_s",
                  mit->reply.velocity_rad_s, ModelTable::kVelocity, velocity)};
  } else if (const auto* ak = std::get_if<AkV3Config>(&entry_.config)) {
    // Positions are reported in tenths of degrees by the protocol.
    family.reference = 0;
    family.terms = {{"pole_pairs x gear_inside", ak->pole_pairs * double{ak->gear_inside}, false,
                     true, true, ModelTable::kMotor, velocity}};
  } else if (const auto* cia402 = std::get_if<Cia402Config>(&entry_.config)) {
    family.terms = {{"position_units_per_turn", double{cia402->position_units_per_turn}, false,
                     true, true, ModelTable::kNone, kYardstick},
                    {"velocity_units_per_turn_s", double{cia402->velocity_units_per_turn_s}, false,
                     true, true, ModelTable::kNone, velocity}};
  } else {
    // Both are turns by the protocol.
    family.reference = 0;
    family.terms = {{"the scale of the velocity that the drive itself estimates", 1, false, true,
                     false, ModelTable::kNone, velocity}};
  }
  return family;
}

/// Adds the ranges of positions and velocities that are asked for, where they are not those of the
/// reports.
void ScaleJudge::AddAskedMotion(const ScaleRatio& velocity, ScaleFamily& family,
                                std::string& evidence) {
  // What it reports has no range.
  const bool always_apart = std::holds_alternative<AkV3Config>(entry_.config);
  const auto is_apart = [always_apart](const ScaleRatio& ratio) {
    return IsOff(ratio) || (always_apart && ratio.told());
  };
  const ShaftRanges ranges = CommandRanges(entry_.config);
  const ScaleRatio& position_asked = scales_.position_asked;
  if (position_asked.told()) {
    Judged("positions asked for against reported ones");
    evidence += fmt::format(", positions asked for are {:.3f} times those reported",
                            position_asked.value());
  } else {
    NotTold("positions asked for against reported ones");
  }
  if (is_apart(position_asked)) {
    family.terms.push_back(
        RangeTerm("range.position_rad", ranges.position_rad, ModelTable::kNone, position_asked));
  }
  const ScaleRatio& velocity_asked = scales_.velocity_asked;
  if (velocity_asked.told()) {
    Judged("velocities asked for against reported ones");
    evidence += fmt::format(", velocities asked for {:.3f} times", velocity_asked.value());
  } else {
    NotTold("velocities asked for against reported ones");
  }
  if (is_apart(velocity_asked)) {
    family.terms.push_back(RangeTerm("range.velocity_rad_s", ranges.velocity_rad_s,
                                     ModelTable::kVelocity,
                                     {velocity_asked.log + velocity.log,
                                      std::hypot(velocity_asked.error, velocity.error), false}));
  }
}

/// Judges a way by hand that is not that of the limits, where velocities fit positions: other
/// stops, another gear, or both ranges. The torque tells ranges from the others, if its own are
/// right.
/// @returns whether it is the ranges.
bool ScaleJudge::JudgeOtherWay(const ScaleFamily& family, const std::string& evidence,
                               const Explanation& ranges) {
  const auto torque_is = [this](double log) {
    return std::ranges::all_of(std::array{&scales_.stiffness, &scales_.damping},
                               [log](const ScaleRatio* ratio) {
                                 return ratio->told() && !ratio->reversed && !IsOff(*ratio, log);
                               });
  };
  if (torque_is(family.reference.value_or(0))) {
    Report(family, {ranges}, evidence + ", and the way by hand and the torque fit neither");
    return true;
  }
  if (torque_is(0)) {
    Judged(
        "the way by hand, which is another gear_ratio or other stops, since ranges of positions "
        "and velocities that are wrong would show in the torque");
    return false;
  }
  std::vector<std::string> parts;
  for (const auto& [i, log] : ranges.wrong) parts.push_back(Describe(family.terms[i], log));
  judgement_.findings.push_back(
      {"other-range", entry_.joint,
       fmt::format(
           "{}: {}, and the way by hand is another: either {}, or gear_ratio is another, or "
           "its stops are not its limits; which of these is not told by these measurements",
           drive_, evidence, fmt::join(parts, ", and "))});
  return false;
}

// Torques and gains. Logarithms are relative to the scale of reported torques.
void ScaleJudge::JudgeTorque() {
  if (!TorqueTells()) return;
  ScaleFamily family = ReportedTorque();
  std::vector<std::string> evidence;
  AddAskedTorque(family, evidence);
  AddGain(kStiffness, scales_.stiffness, position_log_, family, evidence);
  AddGain(kDamping, scales_.damping, velocity_log_, family, evidence);
  if (evidence.empty()) return;
  std::string against = "reported torque against ";
  if (torque_asked_told()) against += "feed-forward, ";
  Judged(against + "gains and error");
  if (!family.reference) {
    NotTold(
        "whether torque and gains are all off by one and the same factor: only a known load "
        "tells");
  }
  Report(family, Explain(family),
         fmt::format("the torque that it reports is {}", fmt::join(evidence, ", ")));
}

/// Whether a torque is reported that the law explains.
bool ScaleJudge::TorqueTells() {
  const bool current_only = std::holds_alternative<AkV3Config>(entry_.config);
  if (!scales_.torque_reported) {
    NotTold(
        current_only
            ? "the scales of torque and gains: torque_constant_nm_per_a is 0, so that its torque "
              "is not known"
            : "the scales of torque and gains: it reports no torque");
    return false;
  }
  if (scales_.explained < DriveScales::kExplainedMin) {
    NotTold(
        fmt::format("the scales of torque and gains: only {:.0f} % of the torque that it "
                    "reports is explained by kp, kd and feed-forward{}",
                    100 * std::max(scales_.explained, 0.0),
                    current_only ? ", as where the current comes without its sign" : ""));
    return false;
  }
  return true;
}

/// What scales the torque that is reported, by the protocol.
ScaleFamily ScaleJudge::ReportedTorque() {
  ScaleFamily family;
  if (known_.torque) family.reference = std::log(*known_.torque);
  if (const auto* mit = std::get_if<MitConfig>(&entry_.config)) {
    const bool apart = torque_asked_told() && IsOff(scales_.torque_asked);
    family.terms = {RangeTerm(apart ? "reply_range.torque_nm" : "range.torque_nm",
                              mit->reply.torque_nm, ModelTable::kTorque, kYardstick)};
  } else if (const auto* ak = std::get_if<AkV3Config>(&entry_.config)) {
    family.terms = {{"torque_constant_nm_per_a", double{ak->torque_constant_nm_per_a}, false, true,
                     false, ModelTable::kNone, kYardstick}};
  } else if (const auto* cia402 = std::get_if<Cia402Config>(&entry_.config)) {
    family.terms = {{"rated_torque_nm", double{cia402->rated_torque_nm}, false, true, false,
                     ModelTable::kNone, kYardstick}};
  } else {
    // The drive counts its gains and what it reports in the same newton metres.
    family.reference = 0;
    NotTold("the torque constant that the drive itself is set to: only a known load tells");
  }
  return family;
}

/// Adds the range of the torque that is asked for, where it is not that of the reports.
void ScaleJudge::AddAskedTorque(ScaleFamily& family, std::vector<std::string>& evidence) {
  if (!torque_asked_told()) {
    NotTold("the torque that it is asked for against the one that it reports");
    return;
  }
  if (!scales_.gains_carried) return;
  const ScaleRatio& asked = scales_.torque_asked;
  evidence.push_back(fmt::format("{:.3f} times its feed-forward", asked.value()));
  if (IsOff(asked) || std::holds_alternative<AkV3Config>(entry_.config)) {
    family.terms.push_back(RangeTerm("range.torque_nm", CommandRanges(entry_.config).torque_nm,
                                     ModelTable::kTorque, asked));
  }
}

/// Adds a gain.
/// @param ratio      reported torque to the gain's term of the law.
/// @param error_log  logarithm of the true scale of what the gain is multiplied by in that term.
void ScaleJudge::AddGain(const LawGain& gain, const ScaleRatio& ratio, double error_log,
                         ScaleFamily& family, std::vector<std::string>& evidence) {
  if (!ratio.told()) {
    NotTold(fmt::format("the scale of {}", gain.key));
    return;
  }
  if (ratio.reversed) {
    Reversed(fmt::format("it reports torques against {}", gain.term));
    return;
  }
  evidence.push_back(fmt::format("{:.3f} times {}", ratio.value(), gain.term));
  const auto* mit = std::get_if<MitConfig>(&entry_.config);
  const auto* ak = std::get_if<AkV3Config>(&entry_.config);
  const ImpedanceRanges* const ranges = mit != nullptr  ? &mit->command
                                        : ak != nullptr ? &ak->range
                                                        : nullptr;
  const ScaleRatio relative{ratio.log - error_log, ratio.error, false};
  if (ranges != nullptr) {
    family.terms.push_back({std::string("range.") + gain.key, double{(ranges->*gain.range).max},
                            true, true, false, ModelTable::kNone, relative});
  } else {
    family.terms.push_back(
        {gain.key, double{entry_.*gain.of_drive}, false, true, false, ModelTable::kNone, relative});
  }
}

/// Whether the steps of reported positions, tenths of degrees, are much of a small motion.
bool IsCoarse(const DriveConfig& config) { return std::holds_alternative<AkV3Config>(config); }
double ZeroOf(const DriveConfig& config) { return double{JointOf(config).zero_offset_rad}; }

/// @param cut_off_rad  that of VelocityFit.
DriveScales FitMotion(const DriveEntry& entry, const DriveRecording& recording,
                      double& cut_off_rad) {
  // With less motion, the steps of encoders are most of it.
  constexpr double kWayMin_rad = 0.02;
  DriveScales scales;
  scales.gains_carried = CarriesGains(entry.config);
  scales.way_rad = WayOf(recording.positions_rad);
  if (scales.way_rad < kWayMin_rad) return scales;
  std::optional<double> zero_rad;
  if (IsCoarse(entry.config)) zero_rad = ZeroOf(entry.config);
  const VelocityFit fit = FitVelocity(recording, zero_rad);
  scales.velocity = fit.ratio;
  cut_off_rad = fit.cut_off_rad;
  return scales;
}

}  // namespace

double ScaleRatio::value() const { return (reversed ? -1 : 1) * std::exp(log); }

DriveScales FitMotion(const DriveEntry& entry, const DriveRecording& recording) {
  double cut_off_rad = 0;
  return FitMotion(entry, recording, cut_off_rad);
}

DriveScales FitScales(const DriveEntry& entry, const DriveRecording& recording, double period_s) {
  double cut_off_rad = 0;
  DriveScales scales = FitMotion(entry, recording, cut_off_rad);
  if (IsCoarse(entry.config) && scales.velocity.told()) {
    DriveRecording smoothed = recording;
    smoothed.positions_rad =
        Smoothed(recording, scales.velocity, cut_off_rad, ZeroOf(entry.config));
    FitLaw(entry, smoothed, period_s, scales);
  } else {
    FitLaw(entry, recording, period_s, scales);
  }
  return scales;
}

DriveScales MeasureScales(BenchSession& session, std::size_t drive) {
  constexpr double kTime_s = 8, kSettle_s = 0.5;
  constexpr double kPosition_hz = 0.9, kVelocity_hz = 5.3, kTorque_hz = 3.7;
  constexpr double kFirst = 0.25, kLook_s = 1, kSlew_per_s = 1;
  const BenchBounds& bounds = session.bounds();
  const DriveEntry& entry = session.entry(drive);
  const double kd =
      CarriesGains(entry.config) ? bounds.kd_nm_s_per_rad : double{entry.kd_nm_s_per_rad};
  const double turns = 2 * std::numbers::pi;
  // What the setpoints are at most, so that the bounds hardly cut any.
  const double way_rad =
      std::min(0.45 * bounds.amplitude_rad, 0.55 * bounds.speed_rad_s / (turns * kPosition_hz));
  const double speed_rad_s =
      std::min(0.4 * bounds.speed_rad_s, 0.2 * bounds.torque_nm / std::max(kd, 1e-9));
  const double push_nm = 0.2 * bounds.torque_nm;
  session.Enable(drive);
  const double origin_rad = session.position_rad(drive);
  session.Record();
  double size = 0, aim = kFirst, farthest_rad = 0;
  const std::int64_t begin_ns = session.now_ns();
  std::int64_t looked_ns = begin_ns;
  for (double t = 0; t < kTime_s;) {
    t = static_cast<double>(session.now_ns() - begin_ns) * kNs;
    const double step = kSlew_per_s * session.period_s();
    size = std::clamp(aim, size - step, size + step);
    const double phase = turns * kPosition_hz * t;
    session.Follow(origin_rad + size * way_rad * std::sin(phase),
                   size * (way_rad * turns * kPosition_hz * std::cos(phase) +
                           speed_rad_s * std::sin(turns * kVelocity_hz * t + 1)),
                   size * push_nm * std::sin(turns * kTorque_hz * t + 2));
    const double off_rad = std::abs(session.position_rad(drive) - origin_rad);
    farthest_rad = std::max(farthest_rad, off_rad);
    if (off_rad > bounds.amplitude_rad) {
      aim = 0.5 * std::min(aim, size);
      size = aim;
      farthest_rad = off_rad;
      looked_ns = session.now_ns();
    } else if (static_cast<double>(session.now_ns() - looked_ns) * kNs >= kLook_s) {
      // Twice as much is within the amplitude.
      if (2 * farthest_rad <= bounds.amplitude_rad) aim = std::min(2 * aim, 1.0);
      farthest_rad = 0;
      looked_ns = session.now_ns();
    }
  }
  DriveRecording recording = session.TakeRecording();
  const std::int64_t settle_ns = session.now_ns() + std::llround(kSettle_s / kNs);
  while (session.now_ns() < settle_ns) session.Follow(origin_rad, 0);
  session.TorqueOff();
  return FitScales(entry, recording, session.period_s());
}

Json ToJson(const DriveScales& scales) {
  const auto of = [](const ScaleRatio& ratio) {
    return ratio.told() ? Json(ratio.value()) : Json(nullptr);
  };
  return {{"velocity", of(scales.velocity)},
          {"position_asked", of(scales.position_asked)},
          {"velocity_asked", of(scales.velocity_asked)},
          {"torque_asked", of(scales.torque_asked)},
          {"stiffness", of(scales.stiffness)},
          {"damping", of(scales.damping)},
          {"way_rad", scales.way_rad}};
}

std::string Describe(const DriveScales& scales) {
  const auto of = [](const ScaleRatio& ratio) {
    return ratio.told() ? fmt::format("{:.3f}", ratio.value()) : std::string("not told");
  };
  return fmt::format(
      "velocity to differences of positions {}; torque to feed-forward {}, to kp (position - q) "
      "{}, "
      "to kd (velocity - qdot) {}",
      of(scales.velocity), of(scales.torque_asked), of(scales.stiffness), of(scales.damping));
}

Judgement JudgeScales(const std::string& drive, const DriveEntry& entry, const DriveScales& scales,
                      const KnownScales& known) {
  return ScaleJudge(drive, entry, scales, known).Run();
}

}  // namespace tumbler
