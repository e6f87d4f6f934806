#include "common/primitive_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "common/primitive_hash.h"
#include "common/primitive_limits.h"
#include "common/toml_reader.h"

namespace tumbler {

namespace {

using Motion = JointMotion<double>;
using Spline = Motion::Spline;

constexpr std::string_view kFormat = "tumbler-primitive";

// A drive's velocity loop can follow a path with continuous acceleration. Cubic splines are that
// smooth.
constexpr int kMinPositionDegree = 3;
constexpr int kPositionSmoothness = 2;

// Margins are differences of numbers of 1 to 1000. A program that adds them in another order agrees
// to this.
constexpr double kMarginTolerance = 1e-9;

// Two numbers for a message, with as many digits as it takes to look different if they are.
std::pair<std::string, std::string> Distinct(double a, double b) {
  std::pair<std::string, std::string> texts{MessageNumber(a), MessageNumber(b)};
  if (texts.first == texts.second && a != b) texts = {ExactDecimal(a), ExactDecimal(b)};
  return texts;
}

// ---- Writing ------------------------------------------------------------------------------------

// Whether the bytes are UTF-8 (RFC 3629). TOML holds no other text.
bool IsUtf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const int extra = lead < 0x80 ? 0 : lead >= 0xf0 ? 3 : lead >= 0xe0 ? 2 : 1;
    if ((lead >= 0x80 && lead < 0xc2) || lead > 0xf4 ||
        text.size() - i <= static_cast<std::size_t>(extra)) {
      return false;
    }
    std::uint32_t code = extra == 0 ? lead : lead & (0x3fU >> extra);
    for (int k = 1; k <= extra; ++k) {
      const auto next = static_cast<unsigned char>(text[i + static_cast<std::size_t>(k)]);
      if ((next & 0xc0U) != 0x80) return false;
      code = code << 6 | (next & 0x3fU);
    }
    const bool overlong = (extra == 2 && code < 0x800) || (extra == 3 && code < 0x10000);
    if (overlong || code > 0x10ffff || (code >= 0xd800 && code <= 0xdfff)) return false;
    i += static_cast<std::size_t>(extra) + 1;
  }
  return true;
}

bool IsControl(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return byte < 0x20 || byte == 0x7f;
}

// The text as it stands between the quotes of a TOML basic string. `multiline` leaves line feeds as
// they are.
std::string Escaped(std::string_view text, bool multiline) {
  std::string result;
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      result += {'\\', c};
    } else if (IsControl(c) && !(multiline && c == '\n')) {
      result += fmt::format("\\u{:04X}", static_cast<unsigned char>(c));
    } else {
      result += c;
    }
  }
  return result;
}

// A TOML multi-line string that reads back exactly. It is a literal string, which people can read,
// unless the text holds something that a literal string cannot: quotes in a row, a quote at its
// end, carriage returns or other control characters.
std::string MultilineText(std::string_view text) {
  const bool literal = text.find("'''") == std::string_view::npos && !text.ends_with('\'') &&
                       std::none_of(text.begin(), text.end(),
                                    [](char c) { return IsControl(c) && c != '\n' && c != '\t'; });
  // The line feed right after the opening quotes is not part of the value.
  return literal ? fmt::format("'''\n{}'''", text)
                 : fmt::format("\"\"\"\n{}\"\"\"", Escaped(text, true));
}

class Writer {
 public:
  void Line(std::string_view line) { (text_ += line) += '\n'; }
  void Number(std::string_view key, double value) {
    if (!std::isfinite(value)) {
      throw std::invalid_argument(
          fmt::format("{} is {}; a primitive holds finite numbers", key, value));
    }
    Line(fmt::format("{} = {}", key, ExactDecimal(value)));
  }
  void Numbers(std::string_view key, std::span<const double> values) {
    constexpr std::size_t kPerLine = 4;
    std::string line = fmt::format("{} = [", key);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!std::isfinite(values[i])) {
        throw std::invalid_argument(
            fmt::format("{}[{}] is {}; a primitive holds finite numbers", key, i, values[i]));
      }
      if (values.size() > kPerLine && i % kPerLine == 0) line += "\n  ";
      line += ExactDecimal(values[i]);
      if (i + 1 < values.size()) line += (i + 1) % kPerLine == 0 ? "," : ", ";
    }
    Line(line + (values.size() > kPerLine ? "\n]" : "]"));
  }
  void Text(std::string_view key, std::string_view value) {
    RequireUtf8(key, value);
    Line(fmt::format("{} = \"{}\"", key, Escaped(value, false)));
  }
  void LongText(std::string_view key, std::string_view value) {
    RequireUtf8(key, value);
    Line(fmt::format("{} = {}", key, MultilineText(value)));
  }
  std::string Take() { return std::move(text_); }

 private:
  static void RequireUtf8(std::string_view key, std::string_view value) {
    if (!IsUtf8(value)) throw std::invalid_argument(fmt::format("{} is not UTF-8 text", key));
  }
  std::string text_;
};

void WriteSpline(Writer& writer, std::string_view coefficients_key, const Spline& spline) {
  writer.Line(fmt::format("degree = {}", spline.degree()));
  writer.Numbers("knots_s", spline.knots());
  writer.Numbers(coefficients_key, spline.control_points());
}

void WritePose(Writer& writer, std::string_view table, const PrimitivePose& pose) {
  writer.Line(fmt::format("\n[{}]", table));
  writer.Number("root_x_m", pose.root_x_m);
  writer.Number("root_z_m", pose.root_z_m);
  writer.Number("root_pitch_rad", pose.root_pitch_rad);
  writer.Numbers("joint_positions_rad", pose.joint_positions_rad);
}

std::string Write(const PrimitiveFile& file) {
  const Primitive<double>& primitive = file.primitive;
  Writer writer;
  writer.Line(
      "# A motion primitive: B-spline paths of a robot's joints, and what was verified about "
      "them.");
  writer.Line(
      "# Written by a program; a changed number makes the hashes disagree and the file is "
      "refused.");
  writer.Line(fmt::format("format = \"{}\"", kFormat));
  writer.Line(fmt::format("version = {}", kPrimitiveFileVersion));
  writer.Text("name", primitive.name.view());
  writer.Number("duration_s", primitive.duration_s);
  writer.Number("settle_s", primitive.settle_s);
  writer.Number("entry_tolerance_rad", primitive.entry_tolerance_rad);
  writer.Number("following_tolerance_rad", primitive.following_tolerance_rad);
  for (const Motion& motion : primitive.motions()) {
    writer.Line("\n[[joint]]");
    writer.Text("name", motion.name.view());
    writer.Line("[joint.limits]");
    writer.Number("position_min_rad", motion.limits.position_min_rad);
    writer.Number("position_max_rad", motion.limits.position_max_rad);
    writer.Number("velocity_max_rad_s", motion.limits.velocity_max_rad_s);
    writer.Number("acceleration_max_rad_s2", motion.limits.acceleration_max_rad_s2);
    writer.Number("torque_max_nm", motion.limits.torque_max_nm);
    writer.Line("[joint.position]");
    WriteSpline(writer, "coefficients_rad", motion.position);
    writer.Line("[joint.torque]  # feed-forward");
    WriteSpline(writer, "coefficients_nm", motion.torque);
  }
  WritePose(writer, "entry", file.entry);
  WritePose(writer, "exit", file.exit);
  for (const ContactInterval& contact : file.contacts) {
    writer.Line("\n[[contact]]");
    writer.Text("shape", contact.shape);
    writer.Text("obstacle", contact.obstacle);
    writer.Number("start_s", contact.start_s);
    writer.Number("end_s", contact.end_s);
    writer.Number("peak_normal_force_n", contact.peak_normal_force_n);
  }
  const Certificate& certificate = file.certificate;
  writer.Line("\n[certificate]");
  writer.Text("coefficients_hash", certificate.coefficients_hash);
  writer.Number("gradient_error", certificate.gradient_error);
  writer.Numbers("gradient_difference_steps_rad", certificate.gradient_difference_steps_rad);
  writer.Numbers("gradient_errors", certificate.gradient_errors);
  writer.Number("gradient_step_halving_change", certificate.gradient_step_halving_change);
  writer.Number("projected_gradient", certificate.projected_gradient);
  writer.Number("constraint_violation", certificate.constraint_violation);
  writer.Number("step_halving_error_rad", certificate.step_halving_error_rad);
  writer.Number("settled_pitch_error_rad", certificate.settled_pitch_error_rad);
  writer.Number("peak_torque_nm", certificate.peak_torque_nm);
  writer.Number("peak_penetration_m", certificate.peak_penetration_m);
  writer.Number("position_margin_rad", certificate.position_margin_rad);
  writer.Number("velocity_margin_rad_s", certificate.velocity_margin_rad_s);
  writer.Number("acceleration_margin_rad_s2", certificate.acceleration_margin_rad_s2);
  writer.Number("torque_margin_nm", certificate.torque_margin_nm);
  const Provenance& provenance = file.provenance;
  if (provenance.seed > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())) {
    throw std::invalid_argument(
        fmt::format("seed is {}; allowed: below 2^63, the integers of TOML", provenance.seed));
  }
  writer.Line("\n[provenance]");
  writer.Text("tool", provenance.tool);
  writer.Line(fmt::format("seed = {}", provenance.seed));
  writer.Number("objective", provenance.objective);
  writer.Line(fmt::format("evaluations = {}", provenance.evaluations));
  writer.Text("robot_file", provenance.robot_file);
  writer.Text("task_file", provenance.task_file);
  writer.Text("robot_hash", provenance.robot_hash);
  writer.Text("task_hash", provenance.task_hash);
  if (!provenance.start_file.empty()) {
    writer.Text("start_file", provenance.start_file);
    writer.Text("start_hash", provenance.start_hash);
  }
  writer.LongText("robot_urdf", provenance.robot_urdf);
  writer.LongText("task_toml", provenance.task_toml);
  return writer.Take();
}

// ---- Reading ------------------------------------------------------------------------------------

template <std::size_t kCapacity>
FixedString<kCapacity> ReadName(TomlTable& table) {
  const std::string name = table.String("name");
  if (name.empty() || !FixedString<kCapacity>::fits(name)) {
    table.Fail("name", fmt::format("is '{}', {} bytes; allowed: from 1 ... {}", name, name.size(),
                                   kCapacity));
  }
  return FixedString<kCapacity>(name);
}

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
Spline ReadSpline(TomlTable table, std::string_view coefficients_key, int min_degree,
                  int continuity, double duration_s) {
  const int degree = static_cast<int>(table.Integer("degree", min_degree, Spline::kMaxDegree));
  const std::vector<double> coefficients = table.Numbers(coefficients_key, Range::Any());
  const int count = static_cast<int>(coefficients.size());
  if (coefficients.size() > kMaxControlPoints || count < degree + 1) {
    table.Fail(coefficients_key,
               fmt::format("holds {} numbers; allowed: from {} (degree + 1) ... {}",
                           coefficients.size(), degree + 1, kMaxControlPoints));
  }
  const std::vector<double> knots = table.Numbers("knots_s", Range::Any());
  if (static_cast<int>(knots.size()) != count + degree + 1) {
    table.Fail("knots_s", fmt::format("holds {} numbers; {} coefficients of degree {} need {}",
                                      knots.size(), count, degree, count + degree + 1));
  }
  CheckKnots(table, knots, degree, std::max(degree - continuity, 1), duration_s);
  Spline spline;
  const Status status = spline.Assign(degree, knots, coefficients);
  if (status != Status::kOk) {
    table.Fail("", fmt::format("does not describe a spline: {}", ToString(status)));
  }
  return spline;
}

JointLimits<double> ReadLimits(TomlTable table) {
  JointLimits<double> limits;
  limits.position_min_rad = table.Number("position_min_rad", Range::Any());
  limits.position_max_rad = table.Number("position_max_rad", Range::Any());
  if (!(limits.position_min_rad < limits.position_max_rad)) {
    const auto [max, min] = Distinct(limits.position_max_rad, limits.position_min_rad);
    table.Fail("position_max_rad",
               fmt::format("is {}; allowed: above position_min_rad, which is {}", max, min));
  }
  limits.velocity_max_rad_s = table.Number("velocity_max_rad_s", Range::Positive());
  limits.acceleration_max_rad_s2 = table.Number("acceleration_max_rad_s2", Range::Positive());
  limits.torque_max_nm = table.Number("torque_max_nm", Range::Positive());
  return limits;
}

void CheckLimits(TomlTable& joint, const Motion& motion) {
  for (const Bound<double>& bound : BoundsOf(motion)) {
    for (std::size_t i = 0; i < bound.points.size(); ++i) {
      const double point = bound.points[i];
      if (point >= bound.min && point <= bound.max) continue;
      const bool is_torque = bound.points.data() == motion.torque.control_points(0).data();
      const double limit = point > bound.max ? bound.max : bound.min;
      const auto [value, allowed] = Distinct(point, limit);
      joint.Table(is_torque ? "torque" : "position")
          .Fail(is_torque ? "coefficients_nm" : "coefficients_rad",
                fmt::format(
                    "joint '{}': control point {} of {} is {} {}; allowed: {} {} {} (limits.{})",
                    motion.name.view(), i, bound.name, value, bound.unit,
                    point > bound.max ? "<=" : ">=", allowed, bound.unit, bound.limit_key));
    }
  }
}

Motion ReadJoint(TomlTable& table, double duration_s) {
  Motion motion;
  motion.name = ReadName<32>(table);
  motion.limits = ReadLimits(table.Table("limits"));
  motion.position = ReadSpline(table.Table("position"), "coefficients_rad", kMinPositionDegree,
                               kPositionSmoothness, duration_s);
  motion.torque = ReadSpline(table.Table("torque"), "coefficients_nm", 0, 0, duration_s);
  CheckLimits(table, motion);
  return motion;
}

Primitive<double> ReadMotions(TomlTable& root) {
  Primitive<double> primitive;
  primitive.name = ReadName<48>(root);
  primitive.duration_s = root.Number("duration_s", Range::Positive());
  primitive.settle_s = root.Number("settle_s", Range::NonNegative());
  primitive.entry_tolerance_rad = root.Number("entry_tolerance_rad", Range::Positive());
  primitive.following_tolerance_rad = root.Number("following_tolerance_rad", Range::Positive());
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

PrimitivePose ReadPose(TomlTable table, const Primitive<double>& primitive, bool at_end) {
  PrimitivePose pose;
  pose.root_x_m = table.Number("root_x_m", Range::Any());
  pose.root_z_m = table.Number("root_z_m", Range::Any());
  pose.root_pitch_rad = table.Number("root_pitch_rad", Range::Any());
  pose.joint_positions_rad = table.Numbers("joint_positions_rad", Range::Any(),
                                           static_cast<std::size_t>(primitive.joint_count));
  for (std::size_t i = 0; i < pose.joint_positions_rad.size(); ++i) {
    const Motion& motion = primitive.joints[i];
    const std::span<const double> points = motion.position.control_points();
    const double expected = at_end ? points.back() : points.front();
    if (pose.joint_positions_rad[i] == expected) continue;
    const auto [value, allowed] = Distinct(pose.joint_positions_rad[i], expected);
    table.Fail("joint_positions_rad",
               fmt::format("joint '{}' is at {} rad; its spline {} at {} rad", motion.name.view(),
                           value, at_end ? "ends" : "starts", allowed));
  }
  return pose;
}

ContactInterval ReadContact(TomlTable& table) {
  ContactInterval contact;
  contact.shape = table.String("shape");
  contact.obstacle = table.String("obstacle");
  contact.start_s = table.Number("start_s", Range::NonNegative());
  contact.end_s = table.Number("end_s", Range::NonNegative());
  if (contact.end_s < contact.start_s) {
    const auto [end, start] = Distinct(contact.end_s, contact.start_s);
    table.Fail("end_s", fmt::format("is {}; allowed: >= start_s, which is {}", end, start));
  }
  contact.peak_normal_force_n = table.Number("peak_normal_force_n", Range::NonNegative());
  return contact;
}

void CheckHash(const TomlTable& table, std::string_view key, const std::string& stored,
               const std::string& actual, std::string_view of) {
  if (stored == actual) return;
  table.Fail(
      key,
      fmt::format(
          "is '{}', but {} in this file hash to '{}': the file was changed after it was written; "
          "make it again",
          stored, of, actual));
}

double ReadMargin(TomlTable& table, std::string_view key, double actual) {
  const double stored = table.Number(key, Range::Any());
  if (!(std::abs(stored - actual) <= kMarginTolerance)) {
    const auto [value, expected] = Distinct(stored, actual);
    table.Fail(key,
               fmt::format("is {}, but the coefficients leave a margin of {}; make the file again",
                           value, expected));
  }
  return stored;
}

std::array<double, 3> ReadThree(TomlTable& table, std::string_view key) {
  const std::vector<double> values = table.Numbers(key, Range::NonNegative(), 3);
  return {values[0], values[1], values[2]};
}

Certificate ReadCertificate(TomlTable table, const Primitive<double>& primitive) {
  const LimitMargins margins = MarginsOf(primitive);
  Certificate certificate;
  certificate.coefficients_hash = table.String("coefficients_hash");
  CheckHash(table, "coefficients_hash", certificate.coefficients_hash,
            HashOfCoefficients(primitive), "the joints and their limits");
  certificate.gradient_error = table.Number("gradient_error", Range::NonNegative());
  certificate.gradient_difference_steps_rad = ReadThree(table, "gradient_difference_steps_rad");
  certificate.gradient_errors = ReadThree(table, "gradient_errors");
  certificate.gradient_step_halving_change =
      table.Number("gradient_step_halving_change", Range::NonNegative());
  certificate.projected_gradient = table.Number("projected_gradient", Range::NonNegative());
  certificate.constraint_violation = table.Number("constraint_violation", Range::NonNegative());
  certificate.step_halving_error_rad = table.Number("step_halving_error_rad", Range::Any());
  certificate.settled_pitch_error_rad = table.Number("settled_pitch_error_rad", Range::Any());
  certificate.peak_torque_nm = table.Number("peak_torque_nm", Range::NonNegative());
  certificate.peak_penetration_m = table.Number("peak_penetration_m", Range::NonNegative());
  certificate.position_margin_rad = ReadMargin(table, "position_margin_rad", margins.position_rad);
  certificate.velocity_margin_rad_s =
      ReadMargin(table, "velocity_margin_rad_s", margins.velocity_rad_s);
  certificate.acceleration_margin_rad_s2 =
      ReadMargin(table, "acceleration_margin_rad_s2", margins.acceleration_rad_s2);
  certificate.torque_margin_nm = table.Number("torque_margin_nm", Range::Any());
  return certificate;
}

Provenance ReadProvenance(TomlTable table) {
  constexpr std::int64_t kLargest = std::numeric_limits<std::int64_t>::max();
  Provenance provenance;
  provenance.tool = table.String("tool");
  provenance.seed = static_cast<std::uint64_t>(table.Integer("seed", 0, kLargest));
  provenance.objective = table.Number("objective", Range::Any());
  provenance.evaluations = table.Integer("evaluations", 0, kLargest);
  provenance.robot_file = table.String("robot_file");
  provenance.task_file = table.String("task_file");
  provenance.robot_hash = table.String("robot_hash");
  provenance.task_hash = table.String("task_hash");
  if (table.Has("start_file") || table.Has("start_hash")) {
    provenance.start_file = table.String("start_file");
    provenance.start_hash = table.String("start_hash");
    if (provenance.start_file.empty()) {
      table.Fail("start_file",
                 "is empty; allowed: the file whose exit this motion starts at, or no "
                 "such key");
    }
  }
  provenance.robot_urdf = table.String("robot_urdf");
  provenance.task_toml = table.String("task_toml");
  CheckHash(table, "robot_hash", provenance.robot_hash, HashOfText(provenance.robot_urdf),
            "the bytes of robot_urdf");
  CheckHash(table, "task_hash", provenance.task_hash, HashOfText(provenance.task_toml),
            "the bytes of task_toml");
  return provenance;
}

PrimitiveFile Read(TomlTable root) {
  if (const std::string format = root.String("format"); format != kFormat) {
    root.Fail("format", fmt::format("is '{}'; a primitive says '{}'", format, kFormat));
  }
  const std::int64_t version = root.Integer("version", std::numeric_limits<std::int64_t>::min(),
                                            std::numeric_limits<std::int64_t>::max());
  if (version > kPrimitiveFileVersion) {
    root.Fail("version",
              fmt::format("is {}; this program reads versions up to {}: use a newer program",
                          version, kPrimitiveFileVersion));
  }
  if (version < 1) root.Fail("version", fmt::format("is {}; the first version is 1", version));
  PrimitiveFile file;
  file.primitive = ReadMotions(root);
  file.entry = ReadPose(root.Table("entry"), file.primitive, false);
  file.exit = ReadPose(root.Table("exit"), file.primitive, true);
  for (TomlTable& contact : root.OptionalTables("contact"))
    file.contacts.push_back(ReadContact(contact));
  file.certificate = ReadCertificate(root.Table("certificate"), file.primitive);
  file.provenance = ReadProvenance(root.Table("provenance"));
  root.RejectUnknownKeys();
  return file;
}

}  // namespace

std::string ToToml(const PrimitiveFile& file) {
  const int count = file.primitive.joint_count;
  if (count < 1 || count > kMaxJoints) {
    throw std::invalid_argument(
        fmt::format("a primitive has {} joints; allowed: from 1 ... {}", count, kMaxJoints));
  }
  std::string text = Write(file);
  try {
    // A text that no program would load must not be written.
    ParsePrimitive(text, std::string(file.primitive.name.view()));
  } catch (const FileError& error) {
    throw std::invalid_argument(fmt::format("the primitive is inconsistent: {}", error.what()));
  }
  return text;
}

PrimitiveFile ParsePrimitive(std::string_view text, const std::string& name) {
  return Read(TomlTable::Parse(text, name));
}

PrimitiveFile LoadPrimitive(const std::string& path) { return Read(TomlTable::ParseFile(path)); }

}  // namespace tumbler
