#include "runtime/bench/drive_scales.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

namespace tumbler {
namespace {

constexpr double kNs = 1e-9;

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
      return of.told() && (of.reversed || std::abs(of.log) > ScaleRatio::kSame + 2 * of.error);
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

// ---- Measurement -------------------------------------------------------------------------------

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

}  // namespace tumbler
