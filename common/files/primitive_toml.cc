#include "common/files/primitive_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_keys.h"
#include "common/files/primitive_limits.h"
#include "common/files/printable.h"
#include "common/files/share.h"

namespace tumbler {

namespace {

using Motion = JointMotion<double>;

// A drive's velocity loop can follow a path with continuous acceleration.
constexpr int kPositionSmoothness = 2;

// Margins are differences of numbers of 1 to 1000. A program that adds them in another order agrees
// to this.
constexpr double kMarginTolerance = 1e-9;

// Throws unless the knots are as BSpline requires them, with a message for each way of being wrong.
void CheckKnots(const TomlTable& table, std::span<const double> knots, int degree,
                int max_multiplicity, double duration_s) {
  const std::string_view key = "knots_s";
  const auto at = [&knots](std::size_t i) { return knots[i]; };
  for (std::size_t i = 1; i < knots.size(); ++i) {
    if (at(i) < at(i - 1)) {
      table.Fail(
          key, fmt::format("knot {} is {}, less than knot {}, which is {}; knots must not decrease",
                           i, ExactDecimal(at(i)), i - 1, ExactDecimal(at(i - 1))));
    }
  }
  const std::size_t ends = static_cast<std::size_t>(degree) + 1;
  if (at(0) != 0)
    table.Fail(key, fmt::format("starts at {}; a motion starts at 0", ExactDecimal(at(0))));
  if (knots.back() != duration_s) {
    table.Fail(key, fmt::format("ends at {}; every spline ends at duration_s, which is {}",
                                ExactDecimal(knots.back()), ExactDecimal(duration_s)));
  }
  if (at(ends - 1) != at(0) || at(knots.size() - ends) != knots.back()) {
    table.Fail(key, fmt::format("must begin and end with {} equal knots (degree + 1)", ends));
  }
  std::size_t run = 1;
  for (std::size_t i = ends; i < knots.size() - ends; ++i) {
    run = i > ends && at(i) == at(i - 1) ? run + 1 : 1;
    if (!(at(i) > 0 && at(i) < duration_s) || run > static_cast<std::size_t>(max_multiplicity)) {
      table.Fail(key, fmt::format("knot {}, {}, occurs too often; allowed inside: {} times", i,
                                  ExactDecimal(at(i)), max_multiplicity));
    }
  }
}

// `continuity` is the number of derivatives that must be continuous, or -1 if the value itself may
// jump.
template <std::size_t kCount>
Motion::Spline ReadSpline(TomlTable table, const std::array<FileKey<SplineEntry>, kCount>& keys,
                          int continuity, double duration_s) {
  SplineEntry entry;
  ReadKeys(table, keys, entry);
  const auto count = static_cast<int>(entry.coefficients.size());
  if (count > kMaxControlPoints || count < entry.degree + 1) {
    table.Fail(keys.back().text.name,
               fmt::format("holds {} numbers; allowed: from {} (degree + 1) ... {}", count,
                           entry.degree + 1, kMaxControlPoints));
  }
  if (static_cast<int>(entry.knots_s.size()) != count + entry.degree + 1) {
    table.Fail("knots_s",
               fmt::format("holds {} numbers; {} coefficients of degree {} need {}",
                           entry.knots_s.size(), count, entry.degree, count + entry.degree + 1));
  }
  CheckKnots(table, entry.knots_s, entry.degree, std::max(entry.degree - continuity, 1),
             duration_s);
  Motion::Spline spline;
  const Status status = spline.Assign(entry.degree, entry.knots_s, entry.coefficients);
  if (status != Status::kOk) {
    table.Fail("", fmt::format("does not describe a spline: {}", ToString(status)));
  }
  return spline;
}

JointLimits<double> ReadLimits(TomlTable table) {
  JointLimits<double> limits;
  ReadKeys(table, kJointLimitKeys, limits);
  if (!(limits.position_min_rad < limits.position_max_rad)) {
    const auto [max, min] = DistinctNumbers(limits.position_max_rad, limits.position_min_rad);
    table.Fail("position_max_rad",
               fmt::format("is {}; allowed: above position_min_rad, which is {}", max, min));
  }
  return limits;
}

void CheckLimits(TomlTable& joint, const Motion& motion) {
  const auto bounds = BoundsOf(motion, motion.limits);
  for (const Bound& bound : bounds) {
    if (bound.Holds()) continue;
    const bool is_torque = &bound == &bounds.back();
    joint.Table(is_torque ? "torque" : "position")
        .Fail(is_torque ? "coefficients_nm" : "coefficients_rad",
              fmt::format("joint '{}': {} (limits.{})", motion.name.view(), ToText(bound),
                          bound.limit_key));
  }
}

Motion ReadJoint(TomlTable& table, double duration_s) {
  Motion motion;
  ReadKeys(table, kJointKeys, motion);
  motion.limits = ReadLimits(table.Table("limits"));
  motion.position =
      ReadSpline(table.Table("position"), kPositionKeys, kPositionSmoothness, duration_s);
  motion.torque = ReadSpline(table.Table("torque"), kTorqueKeys, 0, duration_s);
  CheckLimits(table, motion);
  return motion;
}

Primitive<double> ReadMotions(TomlTable& root) {
  Primitive<double> primitive;
  ReadKeys(root, kPrimitiveKeys, primitive);
  std::vector<TomlTable> joints = root.Tables("joint");
  if (joints.empty() || joints.size() > kMaxJoints) {
    root.Fail("joint",
              fmt::format("has {} entries; allowed: from 1 ... {}", joints.size(), kMaxJoints));
  }
  for (TomlTable& joint : joints) {
    const Motion motion = ReadJoint(joint, primitive.duration_s);
    for (const Motion& earlier : primitive.motions()) {
      if (earlier.name == motion.name) {
        joint.Fail("name", fmt::format("is '{}', as of an earlier joint; each joint moves once",
                                       motion.name.view()));
      }
    }
    primitive.joints[static_cast<std::size_t>(primitive.joint_count++)] = motion;
  }
  return primitive;
}

void ReadGainKnots(const TomlTable& table, const FeedbackEntry& entry, double duration_s,
                   Feedback<double>& feedback) {
  const std::vector<double>& knots = entry.knots_s;
  if (knots.size() < 2 || knots.size() > kMaxGainKnots) {
    table.Fail("knots_s", fmt::format("holds {} numbers; allowed: from 2 ... {}", knots.size(),
                                      kMaxGainKnots));
  }
  for (std::size_t i = 1; i < knots.size(); ++i) {
    if (knots[i] > knots[i - 1]) continue;
    table.Fail("knots_s", fmt::format("knot {} is {}; allowed: above knot {}, which is {}", i,
                                      ExactDecimal(knots[i]), i - 1, ExactDecimal(knots[i - 1])));
  }
  if (knots.front() != 0 || knots.back() < duration_s) {
    table.Fail("knots_s", fmt::format("goes from {} to {}; allowed: from 0 to duration_s or later, "
                                      "which is {}",
                                      ExactDecimal(knots.front()), ExactDecimal(knots.back()),
                                      ExactDecimal(duration_s)));
  }
  feedback.knot_count = static_cast<int>(knots.size());
  std::copy(knots.begin(), knots.end(), feedback.knots_s.begin());
}

void ReadGains(const TomlTable& table, std::string_view key, std::span<const double> gains,
               std::size_t knots, std::array<double, kMaxGainKnots>& into) {
  if (gains.size() != knots) {
    table.Fail(key, fmt::format("holds {} numbers; expected {}, one for each of knots_s",
                                gains.size(), knots));
  }
  std::copy(gains.begin(), gains.end(), into.begin());
}

void ReadJointFeedback(TomlTable& table, const Motion& motion, std::size_t knots,
                       JointFeedback<double>& joint) {
  JointFeedbackEntry entry;
  ReadKeys(table, kJointFeedbackKeys, entry);
  if (entry.name != motion.name.view()) {
    table.Fail("name", fmt::format("is '{}'; allowed: '{}' (the joints in the order of [[joint]])",
                                   entry.name, motion.name.view()));
  }
  ReadGains(table, "angle_gains_rad_per_rad", entry.angle_gains, knots, joint.angle_gain);
  ReadGains(table, "rate_gains_rad_per_rad_s", entry.rate_gains, knots, joint.rate_gain);
  joint.correction_max_rad = entry.correction_max_rad;
  joint.correction_rate_max_rad_s = entry.correction_rate_max_rad_s;
}

LinkChain ReadChain(TomlTable& table, std::size_t joints, std::span<const LinkChain> earlier) {
  LinkChain chain;
  ReadKeys(table, kLinkChainKeys, chain);
  if (chain.link.empty() || !FixedString<32>::fits(chain.link))
    table.Fail("link", fmt::format("is '{}'; allowed: 1 to 32 bytes", chain.link));
  for (const LinkChain& other : earlier) {
    if (other.link == chain.link)
      table.Fail("link", fmt::format("is '{}', as of an earlier chain", chain.link));
  }
  if (chain.joints.size() != joints) {
    table.Fail("joints", fmt::format("holds {} numbers; expected {}", chain.joints.size(), joints));
  }
  for (const double sign : chain.joints) {
    if (sign != 0 && sign != 1 && sign != -1)
      table.Fail("joints", fmt::format("holds {}; allowed: 1, -1 or 0", MessageNumber(sign)));
  }
  return chain;
}

void ReadFeedback(TomlTable table, PrimitiveFile& file) {
  Primitive<double>& primitive = file.primitive;
  Feedback<double>& feedback = primitive.feedback;
  FeedbackEntry entry;
  ReadKeys(table, kFeedbackKeys, entry);
  if (entry.start_error_max_rad > entry.error_max_rad) {
    table.Fail(
        "start_error_max_rad",
        fmt::format("is {}; allowed: above 0, to error_max_rad, which is {}",
                    MessageNumber(entry.start_error_max_rad), MessageNumber(entry.error_max_rad)));
  }
  const auto require_order = [&table](const char* lower, double smaller, const char* upper,
                                      double larger) {
    if (smaller <= larger) return;
    table.Fail(lower, fmt::format("is {}; allowed: 0 to {}, which is {}", MessageNumber(smaller),
                                  upper, MessageNumber(larger)));
  };
  require_order("error_full_rad", entry.error_full_rad, "error_max_rad", entry.error_max_rad);
  require_order("error_min_rad", entry.error_min_rad, "error_full_rad", entry.error_full_rad);
  feedback.error_min_rad = entry.error_min_rad;
  feedback.error_full_rad = entry.error_full_rad;
  feedback.error_max_rad = entry.error_max_rad;
  feedback.start_error_max_rad = entry.start_error_max_rad;
  feedback.fade_in_s = entry.fade_in_s;
  feedback.fade_out_s = entry.fade_out_s;
  ReadGainKnots(table, entry, primitive.duration_s, feedback);
  feedback.angle = ReadSpline(table.Table("angle"), kFeedbackAngleKeys, 1, primitive.duration_s);
  const auto joints = static_cast<std::size_t>(primitive.joint_count);
  std::vector<TomlTable> tables = table.Tables("joint");
  if (tables.size() != joints) {
    table.Fail("joint", fmt::format("has {} entries; expected {}, one for each joint",
                                    tables.size(), joints));
  }
  for (std::size_t j = 0; j < joints; ++j) {
    ReadJointFeedback(tables[j], primitive.joints[j], entry.knots_s.size(), feedback.joints[j]);
  }
  for (TomlTable& chain : table.Tables("chain"))
    file.chains.push_back(ReadChain(chain, joints, file.chains));
  const auto found = std::find_if(file.chains.begin(), file.chains.end(),
                                  [&](const LinkChain& chain) { return chain.link == entry.link; });
  if (found == file.chains.end()) {
    table.Fail("link", fmt::format("is '{}'; allowed: a link of [[feedback.chain]]", entry.link));
  }
  feedback.link = FixedString<32>(entry.link);
  for (std::size_t j = 0; j < joints; ++j) feedback.joints[j].chain = found->joints[j];
}

AbortSpan<double> ReadAbort(TomlTable& table, const Primitive<double>& primitive, double from_s) {
  AbortEntry entry;
  ReadKeys(table, kAbortKeys, entry);
  if (entry.from_s != from_s) {
    table.Fail("from_s", fmt::format("is {}; allowed: {}, where the span before ends",
                                     ExactDecimal(entry.from_s), ExactDecimal(from_s)));
  }
  if (!(entry.to_s > from_s && entry.to_s <= primitive.duration_s)) {
    table.Fail("to_s",
               fmt::format("is {}; allowed: above from_s, which is {}, and up to duration_s, which "
                           "is {}",
                           ExactDecimal(entry.to_s), ExactDecimal(from_s),
                           ExactDecimal(primitive.duration_s)));
  }
  AbortSpan<double> span;
  span.until_s = entry.to_s;
  span.way = entry.way;
  if (entry.way == AbortWay::kRollOut) {
    ReadKeys(table, kRollOutKeys, entry);
    span.late_max_s = entry.late_max_s;
  }
  if (entry.way != AbortWay::kFold) return span;
  ReadKeys(table, kFoldKeys, entry);
  span.limits_share = entry.limits_share;
  const auto joints = static_cast<std::size_t>(primitive.joint_count);
  if (entry.joint_positions_rad.size() != joints) {
    table.Fail("joint_positions_rad", fmt::format("holds {} numbers; expected {}",
                                                  entry.joint_positions_rad.size(), joints));
  }
  for (std::size_t j = 0; j < joints; ++j) {
    const Motion& motion = primitive.joints[j];
    const double position = entry.joint_positions_rad[j];
    if (position < motion.limits.position_min_rad || position > motion.limits.position_max_rad) {
      table.Fail("joint_positions_rad",
                 fmt::format("joint '{}' is at {} rad; allowed: {} ... {} rad (its limits)",
                             motion.name.view(), ExactDecimal(position),
                             MessageNumber(motion.limits.position_min_rad),
                             MessageNumber(motion.limits.position_max_rad)));
    }
    span.position_rad[j] = position;
  }
  return span;
}

/// A mean square is no larger than the largest.
void CheckLargest(const TomlTable& table, const char* key, double largest, double mean) {
  if (largest >= mean) return;
  const auto [value, least] = DistinctNumbers(largest, mean);
  table.Fail(key, fmt::format("is {}; allowed: at least the mean, {}", value, least));
}

AbortFigure ReadAbortFigure(TomlTable& table) {
  AbortFigure figure;
  ReadKeys(table, kAbortFigureKeys, figure);
  CheckLargest(table, "impact_max_m_s", figure.impact_max_m_s, figure.impact_m_s);
  CheckLargest(table, "damped_impact_max_m_s", figure.damped_impact_max_m_s,
               figure.damped_impact_m_s);
  return figure;
}

void ReadAborts(TomlTable& root, PrimitiveFile& file) {
  Primitive<double>& primitive = file.primitive;
  std::vector<TomlTable> tables = root.OptionalTables("abort");
  if (tables.empty()) return;
  if (std::optional<TomlTable> figure = root.OptionalTable("abort_figure"))
    file.abort_figure = ReadAbortFigure(*figure);
  if (tables.size() > kMaxAbortSpans) {
    root.Fail("abort",
              fmt::format("has {} entries; allowed: up to {}", tables.size(), kMaxAbortSpans));
  }
  AbortTable<double>& aborts = primitive.aborts;
  double from_s = 0;
  for (TomlTable& table : tables) {
    const AbortSpan<double> span = ReadAbort(table, primitive, from_s);
    from_s = span.until_s;
    aborts.span_storage[static_cast<std::size_t>(aborts.span_count++)] = span;
  }
  if (from_s != primitive.duration_s) {
    tables.back().Fail("to_s",
                       fmt::format("is {}; the last span ends at duration_s, which is {}",
                                   ExactDecimal(from_s), ExactDecimal(primitive.duration_s)));
  }
}

void CheckQuaternion(TomlTable& table, const PrimitivePose& pose) {
  double square = 0;
  for (const double part : pose.root_quaternion) square += part * part;
  if (pose.root_pitch_rad != 0) {
    table.Fail("root_pitch_rad", fmt::format("is {} beside root_quaternion, which says how the "
                                             "root is turned; allowed: 0",
                                             pose.root_pitch_rad));
  }
  if (std::abs(square - 1) <= 1e-9) return;
  table.Fail("root_quaternion", fmt::format("has the length {}; allowed: 1", std::sqrt(square)));
}

PrimitivePose ReadPose(TomlTable table, const Primitive<double>& primitive, bool at_end) {
  PrimitivePose pose;
  ReadKeys(table, kPoseKeys, pose);
  ReadKeys(table, kSpacePoseKeys, pose);
  if (pose.is_in_space()) CheckQuaternion(table, pose);
  ReadKeys(table, kPoseRateKeys, pose);
  ReadKeys(table, kPassivePoseKeys, pose);
  const auto joints = static_cast<std::size_t>(primitive.joint_count);
  if (pose.joint_positions_rad.size() != joints) {
    table.Fail("joint_positions_rad", fmt::format("holds {} numbers; expected {}",
                                                  pose.joint_positions_rad.size(), joints));
  }
  for (std::size_t i = 0; i < pose.joint_positions_rad.size(); ++i) {
    const Motion& motion = primitive.joints[i];
    const std::span<const double> points = motion.position.control_points();
    const double expected = at_end ? points.back() : points.front();
    if (pose.joint_positions_rad[i] == expected) continue;
    const auto [value, allowed] = DistinctNumbers(pose.joint_positions_rad[i], expected);
    table.Fail("joint_positions_rad",
               fmt::format("joint '{}' is at {} rad; its spline {} at {} rad", motion.name.view(),
                           value, at_end ? "ends" : "starts", allowed));
  }
  return pose;
}

/// Of a contact, which is looked for until the end of the settle phase at `end_s`.
ContactInterval ReadContact(TomlTable& table, double end_s) {
  ContactInterval contact;
  ReadKeys(table, kContactKeys, contact);
  if (contact.end_s < contact.start_s) {
    const auto [end, start] = DistinctNumbers(contact.end_s, contact.start_s);
    table.Fail("end_s", fmt::format("is {}; allowed: >= start_s, which is {}", end, start));
  }
  // The times of steps add up to the end but for rounding.
  if (contact.end_s > end_s + 1e-9) {
    table.Fail("end_s", fmt::format("is {}; allowed: up to the end of the settle phase, {}",
                                    contact.end_s, end_s));
  }
  return contact;
}

void CheckUnit(TomlTable& table, std::string_view key, const std::array<double, 3>& v) {
  const double square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  if (std::abs(square - 1) <= 1e-9) return;
  table.Fail(key, fmt::format("has the length {}; allowed: a unit vector", std::sqrt(square)));
}

PurposeFigure ReadPurpose(TomlTable& table) {
  PurposeFigure figure;
  ReadKeys(table, kPurposeKeys, figure);
  if (figure.at_time()) ReadKeys(table, kPurposeTimeKeys, figure);
  if (figure.is_in_space()) {
    ReadKeys(table, kPurposeSpaceKeys, figure);
    CheckUnit(table, "along", figure.along);
    if (figure.of_axis()) CheckUnit(table, "in_space", figure.in_space);
  }
  if (figure.of_point()) ReadKeys(table, kPurposePointKeys, figure);
  // A motion that misses its purpose is never written.
  if (!figure.met()) {
    const double off = std::abs(figure.result - figure.target);
    const auto [distance, allowed] = DistinctNumbers(off, figure.tolerance);
    table.Fail("result", fmt::format("is {}, {} from the target; allowed: the tolerance, {}",
                                     figure.result, distance, allowed));
  }
  return figure;
}

/// What to do with a file that is not as it was written.
constexpr const char* kRemedy =
    "the file was changed after it was written, and what was verified may not hold any more; make "
    "it "
    "again with tumbler optimize, or sign the change with tumbler sign";

void CheckHash(const TomlTable& table, std::string_view key, const std::string& stored,
               const std::string& actual, std::string_view of) {
  if (stored == actual) return;
  table.Fail(key, fmt::format("is '{}', but {} in this file hash to '{}': {}", stored, of, actual,
                              kRemedy));
}

/// A margin may be that of the path, or less: files that were written by earlier versions have that
/// of its control points, which no path exceeds.
/// @param least  of the control points.
void CheckMargin(const TomlTable& table, std::string_view key, double stored, double least,
                 double actual) {
  if (stored >= least - kMarginTolerance && stored <= actual + kMarginTolerance) return;
  const auto [value, expected] = DistinctNumbers(stored, actual);
  table.Fail(key, fmt::format("is {}, but the coefficients leave a margin of {}: {}", value,
                              expected, kRemedy));
}

/// Whether what follows from the rest of the file has to agree with it. It does not in a file that
/// was changed by hand, and is to be signed.
enum class Derived { kChecked, kIgnored };

Certificate ReadCertificate(TomlTable table, const Primitive<double>& primitive, Derived derived) {
  Certificate certificate;
  ReadKeys(table, kCertificateFileKeys, certificate);
  if (derived == Derived::kIgnored) return certificate;
  const LimitMargins margins = MarginsOf(primitive);
  const LimitMargins least = HullMarginsOf(primitive);
  CheckMargin(table, "position_margin_rad", certificate.position_margin_rad, least.position_rad,
              margins.position_rad);
  CheckMargin(table, "velocity_margin_rad_s", certificate.velocity_margin_rad_s,
              least.velocity_rad_s, margins.velocity_rad_s);
  CheckMargin(table, "acceleration_margin_rad_s2", certificate.acceleration_margin_rad_s2,
              least.acceleration_rad_s2, margins.acceleration_rad_s2);
  return certificate;
}

void CheckDrivesNames(const TomlTable& table, const std::string& file, const std::string& hash) {
  if (file.empty() == hash.empty()) return;
  table.Fail("drives_hash",
             "and drives_file are both empty, or neither is; allowed: both names "
             "of the drives file, or both empty for the default drives");
}

RobustnessFigure ReadRobustness(TomlTable& table) {
  RobustnessFigure figure;
  ReadKeys(table, kRobustnessKeys, figure);
  if (figure.stand > figure.robots) {
    table.Fail("stand", fmt::format("is {}; allowed: up to robots, which is {}", figure.stand,
                                    figure.robots));
  }
  const Share share = ShareOf(figure.stand, figure.robots);
  const auto check = [&table](std::string_view key, double stored, double actual) {
    if (std::abs(stored - actual) <= kMarginTolerance) return;
    const auto [value, expected] = DistinctNumbers(stored, actual);
    table.Fail(key, fmt::format("is {}, but the interval of stand and robots ends at {}: {}", value,
                                expected, kRemedy));
  };
  check("share_95_low", figure.share_95_low, share.low);
  check("share_95_high", figure.share_95_high, share.high);
  CheckDrivesNames(table, figure.drives_file, figure.drives_hash);
  return figure;
}

GroundWindow ReadWindow(TomlTable table) {
  GroundWindow window;
  ReadKeys(table, kWindowKeys, window);
  const auto check = [&table](std::string_view key, const GroundWindow::Ends& ends,
                              const GroundWindow::Ends& scanned) {
    if (scanned[0] <= ends[0] && ends[0] <= ends[1] && ends[1] <= scanned[1]) return;
    table.Fail(key, fmt::format("goes from {} to {}; allowed: upwards, within what was scanned, "
                                "which is {} to {}",
                                MessageNumber(ends[0]), MessageNumber(ends[1]),
                                MessageNumber(scanned[0]), MessageNumber(scanned[1])));
  };
  check("mu", window.mu, window.mu_scanned);
  check("stiffness_n_per_m", window.stiffness_n_per_m, window.stiffness_scanned_n_per_m);
  check("damping_n_s_per_m", window.damping_n_s_per_m, window.damping_scanned_n_s_per_m);
  CheckDrivesNames(table, window.drives_file, window.drives_hash);
  return window;
}

Provenance ReadProvenance(TomlTable table, Derived derived) {
  Provenance provenance;
  ReadKeys(table, kProvenanceKeys, provenance);
  if (table.Has("start_file") || table.Has("start_hash")) {
    ReadKeys(table, kStartFileKeys, provenance);
    if (provenance.start_file.empty()) {
      table.Fail("start_file",
                 "is empty; allowed: the file whose exit this motion starts at, or no "
                 "such key");
    }
  }
  if (table.Has("guess_file") || table.Has("guess_hash")) {
    ReadKeys(table, kGuessFileKeys, provenance);
    if (provenance.guess_file.empty()) {
      table.Fail("guess_file",
                 "is empty; allowed: the file whose paths this motion was solved from, or no such "
                 "key");
    }
  }
  if (table.Has("complement_files") || table.Has("complement_hashes")) {
    ReadKeys(table, kComplementFileKeys, provenance);
    const std::size_t files = provenance.complement_files.size();
    const std::size_t hashes = provenance.complement_hashes.size();
    if (files == 0 || files != hashes) {
      table.Fail("complement_files",
                 fmt::format("has {} names, and complement_hashes {} hashes; allowed: as many, and "
                             "one at least, or neither key",
                             files, hashes));
    }
  }
  if (table.Has("edited")) {
    ReadKeys(table, kEditedKeys, provenance);
    if (provenance.edited.empty())
      table.Fail("edited", "is empty; allowed: why the file was changed, or no such key");
  }
  ReadKeys(table, kSourceTextKeys, provenance);
  if (derived == Derived::kIgnored) return provenance;
  CheckHash(table, "robot_hash", provenance.robot_hash, HashOfText(provenance.robot_urdf),
            "the bytes of robot_urdf");
  CheckHash(table, "task_hash", provenance.task_hash, HashOfText(provenance.task_toml),
            "the bytes of task_toml");
  return provenance;
}

std::string ContentHashOf(const TomlTable& root) {
  return HashOfText(root.CanonicalText(kContentHashKeys[0].text.name));
}

void CheckVersion(TomlTable& root) {
  if (const std::string format = root.String("format"); format != kPrimitiveHeader.format) {
    root.Fail("format",
              fmt::format("is '{}'; a primitive says '{}'", format, kPrimitiveHeader.format));
  }
  const std::int64_t version = root.Integer("version", std::numeric_limits<std::int64_t>::min(),
                                            std::numeric_limits<std::int64_t>::max());
  if (version > kPrimitiveFileVersion) {
    root.Fail("version", fmt::format("is {}; this program reads version {}: use a newer program",
                                     version, kPrimitiveFileVersion));
  }
  if (version < kPrimitiveFileVersion) {
    root.Fail("version",
              fmt::format("is {}; this program reads version {}, whose hash is of the whole file: "
                          "make the file again with tumbler optimize",
                          version, kPrimitiveFileVersion));
  }
}

PrimitiveFile Read(TomlTable root, Derived derived = Derived::kChecked) {
  CheckVersion(root);
  ContentHashEntry hash;
  ReadKeys(root, kContentHashKeys, hash);
  PrimitiveFile file;
  file.primitive = ReadMotions(root);
  if (std::optional<TomlTable> feedback = root.OptionalTable("feedback"))
    ReadFeedback(*feedback, file);
  ReadAborts(root, file);
  if (std::optional<TomlTable> drives = root.OptionalTable("drives"))
    ReadKeys(*drives, kDriveGainsKeys, file.drives.emplace());
  file.entry = ReadPose(root.Table("entry"), file.primitive, false);
  TomlTable exit = root.Table("exit");
  file.exit = ReadPose(exit, file.primitive, true);
  if (file.exit.is_in_space() != file.entry.is_in_space()) {
    exit.Fail("root_quaternion", fmt::format("is {}, unlike the entry's; allowed: in both, of a "
                                             "robot in space, or in none",
                                             file.exit.is_in_space() ? "there" : "missing"));
  }
  const double settled_s = file.primitive.duration_s + file.primitive.settle_s;
  for (TomlTable& contact : root.OptionalTables("contact"))
    file.contacts.push_back(ReadContact(contact, settled_s));
  for (TomlTable& purpose : root.OptionalTables("purpose"))
    file.purpose.push_back(ReadPurpose(purpose));
  file.certificate = ReadCertificate(root.Table("certificate"), file.primitive, derived);
  for (TomlTable& robustness : root.OptionalTables("robustness"))
    file.robustness.push_back(ReadRobustness(robustness));
  if (std::optional<TomlTable> window = root.OptionalTable("window"))
    file.window = ReadWindow(*std::move(window));
  file.provenance = ReadProvenance(root.Table("provenance"), derived);
  root.RejectUnknownKeys();
  if (derived == Derived::kChecked) {
    CheckHash(root, kContentHashKeys[0].text.name, hash.content_hash, ContentHashOf(root),
              "all keys and values");
  }
  return file;
}

}  // namespace

PrimitiveFile ParsePrimitive(std::string_view text, const std::string& name) {
  return Read(TomlTable::Parse(text, name));
}

PrimitiveFile LoadPrimitive(const std::string& path) { return Read(TomlTable::ParseFile(path)); }

std::string SignEdited(std::string_view text, const std::string& name, const std::string& reason) {
  if (reason.empty()) throw std::invalid_argument("the reason of the change is empty");
  if (const char* const mistake = MistakeInName(reason))
    throw std::invalid_argument(fmt::format("the reason of the change {}", mistake));
  const TomlTable root = TomlTable::Parse(text, name);
  PrimitiveFile file = Read(root, Derived::kIgnored);
  if (TomlTable copy = root; copy.String(kContentHashKeys[0].text.name) == ContentHashOf(root)) {
    root.Fail(kContentHashKeys[0].text.name,
              "is that of the file: nothing was changed, and there is nothing to sign");
  }
  const LimitMargins margins = MarginsOf(file.primitive);
  file.certificate.position_margin_rad = margins.position_rad;
  file.certificate.velocity_margin_rad_s = margins.velocity_rad_s;
  file.certificate.acceleration_margin_rad_s2 = margins.acceleration_rad_s2;
  file.robustness.clear();    // It was of another motion,
  file.window.reset();        // as this was,
  file.abort_figure.reset();  // or of another table.
  Provenance& provenance = file.provenance;
  provenance.robot_hash = HashOfText(provenance.robot_urdf);
  provenance.task_hash = HashOfText(provenance.task_toml);
  provenance.edited += provenance.edited.empty() ? reason : "; " + reason;
  return ToToml(file);
}

std::string ToText(const RobustnessFigure& figure) {
  return fmt::format("{}{}: {} of {} robots: {}; scale {} ({}), seed {}, {}, {}", figure.motion,
                     figure.cycles > 0 ? fmt::format(", {} cycles", figure.cycles) : "",
                     figure.stand, figure.robots, ToText(ShareOf(figure.stand, figure.robots)),
                     figure.scale, figure.spreads, figure.seed,
                     figure.where == RobustnessFigure::Where::kLanes ? "in lanes" : "in the twin",
                     figure.drives_file.empty() ? "default drives" : figure.drives_file);
}

std::string GroundValueText(double value) {
  if (!(value >= 1000) || std::isinf(value)) return fmt::format("{:.3g}", value);
  double unit = 1;
  while (value >= 1000 * unit) unit *= 10;
  return fmt::format("{:.0f}", unit * std::round(value / unit));
}

std::string WindowText(const GroundWindow::Ends& window, const GroundWindow::Ends& scanned) {
  return fmt::format("{}{} to {}{}", GroundValueText(window[0]),
                     window[0] == scanned[0] ? " or less" : "", GroundValueText(window[1]),
                     window[1] == scanned[1] ? " or more" : "");
}

std::vector<std::pair<std::string, std::string>> WindowLines(const GroundWindow& window) {
  const std::string how = fmt::format(
      "{}, {}", window.where == RobustnessFigure::Where::kLanes ? "in lanes" : "in the twin",
      window.drives_file.empty() ? "default drives" : window.drives_file);
  return {
      {"as asked with friction",
       fmt::format("{}; {}", WindowText(window.mu, window.mu_scanned), how)},
      {"as asked with stiffness",
       fmt::format("{} N/m; {}",
                   WindowText(window.stiffness_n_per_m, window.stiffness_scanned_n_per_m), how)},
      {"as asked with damping",
       fmt::format("{} N s/m; {}",
                   WindowText(window.damping_n_s_per_m, window.damping_scanned_n_s_per_m), how)}};
}

std::string MakerOf(const Provenance& provenance) {
  return provenance.edited.empty()
             ? provenance.tool
             : fmt::format("{}, changed by hand since: {}", provenance.tool, provenance.edited);
}

}  // namespace tumbler
