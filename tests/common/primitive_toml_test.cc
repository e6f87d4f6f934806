#include "common/files/primitive_toml.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <limits>
#include <random>
#include <stdexcept>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_limits.h"
#include "common/files/primitive_rounding.h"
#include "common/files/printable.h"
#include "common/files/share.h"
#include "common/files/toml_reader.h"
#include "tests/support/docs_tables.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using MotionSpline = JointMotion<double>::Spline;

MotionSpline MakeSpline(int degree, const std::vector<double>& interior_knots, double duration,
                        const std::vector<double>& points) {
  std::vector<double> knots(static_cast<std::size_t>(degree) + 1, 0.0);
  knots.insert(knots.end(), interior_knots.begin(), interior_knots.end());
  knots.insert(knots.end(), static_cast<std::size_t>(degree) + 1, duration);
  MotionSpline spline;
  EXPECT_EQ(spline.Assign(degree, knots, points), Status::kOk);
  return spline;
}

/// Sets everything in the file that follows from the motions.
void CompleteExample(PrimitiveFile& file) {
  file.entry.joint_positions_rad.clear();
  file.exit.joint_positions_rad.clear();
  for (const auto& motion : file.primitive.motions()) {
    file.entry.joint_positions_rad.push_back(motion.position.control_points().front());
    file.exit.joint_positions_rad.push_back(motion.position.control_points().back());
  }
  const LimitMargins margins = MarginsOf(file.primitive);
  file.certificate.position_margin_rad = margins.position_rad;
  file.certificate.velocity_margin_rad_s = margins.velocity_rad_s;
  file.certificate.acceleration_margin_rad_s2 = margins.acceleration_rad_s2;
  file.provenance.robot_hash = HashOfText(file.provenance.robot_urdf);
  file.provenance.task_hash = HashOfText(file.provenance.task_toml);
}

/// A primitive of two joints with numbers that are easy to find in the text.
PrimitiveFile Example() {
  PrimitiveFile file;
  Primitive<double>& primitive = file.primitive;
  primitive.name = FixedString<48>("wave");
  primitive.duration_s = 1.25;
  primitive.settle_s = 0.375;
  primitive.entry_tolerance_rad = 0.0625;
  primitive.following_tolerance_rad = 0.5;
  primitive.joint_count = 2;
  auto& left = primitive.joints[0];
  left.name = FixedString<32>("left");
  left.position =
      MakeSpline(5, {0.5, 0.75}, 1.25, {0.125, 0.125, 0.125, 0.3125, 0.25, 0.25, 0.25, 0.25});
  left.torque = MakeSpline(1, {0.625}, 1.25, {0.0, 1.5, -0.75});
  left.limits = {-1.0, 1.0, 10.0, 100.0, 2.0};
  auto& right = primitive.joints[1];
  right.name = FixedString<32>("right");
  right.position = MakeSpline(3, {0.625}, 1.25, {-0.5, -0.5, -0.4375, -0.5, -0.5});
  right.torque = MakeSpline(0, {}, 1.25, {0.375});
  right.limits = {-2.0, 2.0, 12.0, 120.0, 3.0};
  file.entry.root_z_m = 0.15;
  file.exit.root_pitch_rad = 1.5;
  file.contacts = {{"leg2/0", "ground", 0.0, 1.25, 31.5}, {"leg1/1", "ground", 0.0, 0.4375, 12.0}};
  file.purpose = {{{PurposeTarget::Of::kX, PurposeTarget::When::kEnd, 0.25, 0.03125}, 0.26},
                  {{PurposeTarget::Of::kSpeed, PurposeTarget::When::kLater, 0.0, 0.1}, 0.01},
                  {{PurposeTarget::Of::kPitch, PurposeTarget::When::kTime, 1.0, 0.05, 0.875}, 1.01},
                  {{PurposeTarget::Of::kPointZRate,
                    PurposeTarget::When::kSettled,
                    0.5,
                    0.1,
                    0,
                    "leg1_link",
                    {0.1875, -0.25}},
                   0.45}};
  file.certificate.peak_torque_nm = 1.5;
  file.certificate.settled_pitch_error_rad = -0.001;
  file.provenance.tool = "test 1.0";
  file.provenance.seed = 42;
  file.provenance.objective = 0.21;
  file.provenance.evaluations = 1234;
  file.provenance.robot_file = "robot.urdf";
  file.provenance.task_file = "task.toml";
  file.provenance.robot_urdf = "<robot name=\"r\">\n\t<link name='a'/>\n</robot>\n";
  file.provenance.task_toml = "[contact]\nstiffness = 1e4\n";
  CompleteExample(file);
  return file;
}

std::string Mutate(const std::string& text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << "the example holds no " << from;
  if (at == std::string::npos) return text;
  return text.substr(0, at) + to + text.substr(at + from.size());
}

void ExpectSameBits(double a, double b) {
  EXPECT_EQ(std::bit_cast<std::uint64_t>(a), std::bit_cast<std::uint64_t>(b)) << a << " and " << b;
}

void ExpectSameBits(std::span<const double> a, std::span<const double> b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) ExpectSameBits(a[i], b[i]);
}

void ExpectSame(const MotionSpline& a, const MotionSpline& b) {
  EXPECT_EQ(a.degree(), b.degree());
  ExpectSameBits(a.knots(), b.knots());
  ExpectSameBits(a.control_points(), b.control_points());
}

void ExpectSame(const PrimitivePose& a, const PrimitivePose& b) {
  ExpectSameBits(a.root_x_m, b.root_x_m);
  ExpectSameBits(a.root_z_m, b.root_z_m);
  ExpectSameBits(a.root_pitch_rad, b.root_pitch_rad);
  ExpectSameBits(a.joint_positions_rad, b.joint_positions_rad);
}

void ExpectSame(const PrimitiveFile& a, const PrimitiveFile& b) {
  EXPECT_EQ(a.primitive.name.view(), b.primitive.name.view());
  ExpectSameBits(a.primitive.duration_s, b.primitive.duration_s);
  ExpectSameBits(a.primitive.settle_s, b.primitive.settle_s);
  ExpectSameBits(a.primitive.entry_tolerance_rad, b.primitive.entry_tolerance_rad);
  ExpectSameBits(a.primitive.following_tolerance_rad, b.primitive.following_tolerance_rad);
  ASSERT_EQ(a.primitive.joint_count, b.primitive.joint_count);
  for (std::size_t i = 0; i < a.primitive.motions().size(); ++i) {
    const auto& first = a.primitive.joints[i];
    const auto& second = b.primitive.joints[i];
    EXPECT_EQ(first.name.view(), second.name.view());
    ExpectSame(first.position, second.position);
    ExpectSame(first.torque, second.torque);
    ExpectSameBits(first.limits.position_min_rad, second.limits.position_min_rad);
    ExpectSameBits(first.limits.position_max_rad, second.limits.position_max_rad);
    ExpectSameBits(first.limits.velocity_max_rad_s, second.limits.velocity_max_rad_s);
    ExpectSameBits(first.limits.acceleration_max_rad_s2, second.limits.acceleration_max_rad_s2);
    ExpectSameBits(first.limits.torque_max_nm, second.limits.torque_max_nm);
  }
  ExpectSame(a.entry, b.entry);
  ExpectSame(a.exit, b.exit);
  ASSERT_EQ(a.contacts.size(), b.contacts.size());
  for (std::size_t i = 0; i < a.contacts.size(); ++i) {
    EXPECT_EQ(a.contacts[i].shape, b.contacts[i].shape);
    EXPECT_EQ(a.contacts[i].obstacle, b.contacts[i].obstacle);
    ExpectSameBits(a.contacts[i].start_s, b.contacts[i].start_s);
    ExpectSameBits(a.contacts[i].end_s, b.contacts[i].end_s);
    ExpectSameBits(a.contacts[i].peak_normal_force_n, b.contacts[i].peak_normal_force_n);
  }
  ASSERT_EQ(a.purpose.size(), b.purpose.size());
  for (std::size_t i = 0; i < a.purpose.size(); ++i) {
    EXPECT_EQ(a.purpose[i].of, b.purpose[i].of);
    EXPECT_EQ(a.purpose[i].when, b.purpose[i].when);
    ExpectSameBits(a.purpose[i].target, b.purpose[i].target);
    ExpectSameBits(a.purpose[i].tolerance, b.purpose[i].tolerance);
    ExpectSameBits(a.purpose[i].result, b.purpose[i].result);
    ExpectSameBits(a.purpose[i].time_s, b.purpose[i].time_s);
    EXPECT_EQ(a.purpose[i].link, b.purpose[i].link);
    EXPECT_EQ(a.purpose[i].point_m, b.purpose[i].point_m);
  }
  const Certificate& c = a.certificate;
  const Certificate& d = b.certificate;
  ExpectSameBits(c.gradient_error, d.gradient_error);
  for (std::size_t i = 0; i < 3; ++i) {
    ExpectSameBits(c.gradient_errors[i], d.gradient_errors[i]);
    ExpectSameBits(c.gradient_difference_steps_rad[i], d.gradient_difference_steps_rad[i]);
  }
  ExpectSameBits(c.gradient_step_halving_change, d.gradient_step_halving_change);
  ExpectSameBits(c.projected_gradient, d.projected_gradient);
  ExpectSameBits(c.constraint_violation, d.constraint_violation);
  ExpectSameBits(c.step_halving_error_rad, d.step_halving_error_rad);
  ExpectSameBits(c.settled_pitch_error_rad, d.settled_pitch_error_rad);
  ExpectSameBits(c.peak_torque_nm, d.peak_torque_nm);
  ExpectSameBits(c.peak_penetration_m, d.peak_penetration_m);
  ExpectSameBits(c.position_margin_rad, d.position_margin_rad);
  ExpectSameBits(c.velocity_margin_rad_s, d.velocity_margin_rad_s);
  ExpectSameBits(c.acceleration_margin_rad_s2, d.acceleration_margin_rad_s2);
  ExpectSameBits(c.torque_margin_nm, d.torque_margin_nm);
  const Provenance& p = a.provenance;
  const Provenance& q = b.provenance;
  EXPECT_EQ(p.tool, q.tool);
  EXPECT_EQ(p.seed, q.seed);
  ExpectSameBits(p.objective, q.objective);
  EXPECT_EQ(p.evaluations, q.evaluations);
  EXPECT_EQ(p.robot_file, q.robot_file);
  EXPECT_EQ(p.task_file, q.task_file);
  EXPECT_EQ(p.robot_hash, q.robot_hash);
  EXPECT_EQ(p.task_hash, q.task_hash);
  EXPECT_EQ(p.robot_urdf, q.robot_urdf);
  EXPECT_EQ(p.task_toml, q.task_toml);
  EXPECT_EQ(p.edited, q.edited);
}

/// A random finite double. All exponents are equally likely, denormals and both zeros included.
double AnyFinite(std::mt19937_64& random) {
  if (random() % 16 == 0)
    return random() % 2 == 0 ? -0.0 : std::bit_cast<double>(random() % 1000 + 1);
  for (;;) {
    const double value = std::bit_cast<double>(random());
    if (std::isfinite(value)) return value;
  }
}

double AnyNonNegative(std::mt19937_64& random) { return std::abs(AnyFinite(random)); }

/// A random double within [-limit, limit], of any magnitude.
double AnyWithin(std::mt19937_64& random, double limit) {
  for (;;) {
    const double value = AnyFinite(random);
    if (std::abs(value) <= limit) return value;
  }
}

std::string AnyText(std::mt19937_64& random) {
  static const std::vector<std::string> kPieces = {"'",        "''",           "'''",
                                                   "\"",       "\"\"\"",       "\\",
                                                   "\\u0041",  "\r",           "\r\n",
                                                   "\n",       "\t",           " ",
                                                   "a",        "key = 1",      "# no comment",
                                                   "[t]",      "\x01",         "\x7f",
                                                   "\xc3\xa9", "\xe2\x82\xac", "\xf0\x9f\xa4\x96"};
  std::string text;
  const std::size_t count = random() % 12;
  for (std::size_t i = 0; i < count; ++i) text += kPieces[random() % kPieces.size()];
  return text;
}

/// Of one line, without control characters.
std::string AnyLine(std::mt19937_64& random) {
  std::string text = AnyText(random);
  std::erase_if(text, [](char c) { return MistakeInName({&c, 1}) != nullptr; });
  return text;
}

MotionSpline AnySpline(std::mt19937_64& random, int min_degree, int max_interior_multiplicity,
                       double duration, double magnitude) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const int degree =
      min_degree + static_cast<int>(random() % static_cast<unsigned>(8 - min_degree));
  const int interior = static_cast<int>(random() % 10);
  std::vector<double> knots;
  for (int i = 0; i < interior; ++i) {
    const double knot = duration * (i + 0.1 + 0.8 * unit(random)) / interior;
    const int times =
        1 + static_cast<int>(random() % static_cast<unsigned>(std::max(
                                            std::min(degree - 2, max_interior_multiplicity), 1)));
    knots.insert(knots.end(), static_cast<std::size_t>(times), knot);
  }
  std::vector<double> points(knots.size() + static_cast<std::size_t>(degree) + 1);
  for (double& point : points) point = AnyWithin(random, magnitude);
  return MakeSpline(degree, knots, duration, points);
}

PrimitiveFile AnyPrimitive(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  PrimitiveFile file;
  Primitive<double>& primitive = file.primitive;
  primitive.name = FixedString<48>("any \"name\" \\ \xe2\x82\xac");
  primitive.duration_s = 0.5 + unit(random);
  primitive.settle_s = AnyNonNegative(random);
  primitive.entry_tolerance_rad = std::max(AnyNonNegative(random), 5e-324);
  primitive.following_tolerance_rad = std::max(AnyNonNegative(random), 5e-324);
  primitive.joint_count = 1 + static_cast<int>(random() % kMaxJoints);
  for (int i = 0; i < primitive.joint_count; ++i) {
    auto& motion = primitive.joints[static_cast<std::size_t>(i)];
    motion.name = FixedString<32>("joint" + std::to_string(i));
    motion.position = AnySpline(random, 3, 2, primitive.duration_s, 3.0);
    motion.torque = AnySpline(random, 0, 1, primitive.duration_s, 18.0);
    motion.limits = {-3.0 - unit(random), 3.0 + unit(random), 1e300, 1e301, 18.0 + unit(random)};
  }
  for (PrimitivePose* pose : {&file.entry, &file.exit}) {
    pose->root_x_m = AnyFinite(random);
    pose->root_z_m = AnyFinite(random);
    pose->root_pitch_rad = AnyFinite(random);
  }
  for (std::size_t i = random() % 4; i > 0; --i) {
    const double until_s = file.primitive.duration_s + file.primitive.settle_s;
    std::uniform_real_distribution<double> any(0, until_s);
    const double start = any(random);
    const double end = any(random);
    file.contacts.push_back({AnyLine(random), AnyLine(random), std::min(start, end),
                             std::max(start, end), AnyNonNegative(random)});
  }
  Certificate& certificate = file.certificate;
  certificate.gradient_error = AnyNonNegative(random);
  for (double& step : certificate.gradient_difference_steps_rad) step = AnyNonNegative(random);
  for (double& error : certificate.gradient_errors) error = AnyNonNegative(random);
  certificate.gradient_step_halving_change = AnyNonNegative(random);
  certificate.projected_gradient = AnyNonNegative(random);
  certificate.constraint_violation = AnyNonNegative(random);
  certificate.step_halving_error_rad = AnyFinite(random);
  certificate.settled_pitch_error_rad = AnyFinite(random);
  certificate.peak_torque_nm = AnyNonNegative(random);
  certificate.peak_penetration_m = AnyNonNegative(random);
  certificate.torque_margin_nm = AnyFinite(random);
  Provenance& provenance = file.provenance;
  provenance.tool = AnyLine(random);
  provenance.seed = random() >> 1;
  provenance.objective = AnyFinite(random);
  provenance.evaluations = static_cast<std::int64_t>(random() >> 1);
  provenance.robot_file = AnyLine(random);
  provenance.task_file = AnyLine(random);
  provenance.robot_urdf = AnyText(random);
  provenance.task_toml = AnyText(random);
  CompleteExample(file);
  return file;
}

TEST(PrimitiveToml, RoundTripsRandomPrimitivesBitForBit) {
  std::mt19937_64 random(2004);
  for (int trial = 0; trial < 300 && !::testing::Test::HasFailure(); ++trial) {
    const PrimitiveFile file = AnyPrimitive(random);
    const std::string text = ToToml(file);
    const PrimitiveFile read = ParsePrimitive(text, "random.toml");
    ExpectSame(read, file);
    EXPECT_EQ(ToToml(read), text);
  }
}

TEST(PrimitiveToml, RoundTripsEverySingleByteThatTextsMayHold) {
  for (int byte = 0; byte < 0x80; ++byte) {
    PrimitiveFile file = Example();
    const std::string c(1, static_cast<char>(byte));
    file.provenance.robot_urdf = c;
    file.provenance.task_toml = fmt::format("a{0}{0}{0}b\n{0}\n", c);
    file.provenance.tool = "a tool";
    if (Printable(c) == c && c != "\n" && c != "\t") file.provenance.tool = c;
    CompleteExample(file);
    const PrimitiveFile read = ParsePrimitive(ToToml(file), "bytes.toml");
    EXPECT_EQ(read.provenance.robot_urdf, file.provenance.robot_urdf) << byte;
    EXPECT_EQ(read.provenance.task_toml, file.provenance.task_toml) << byte;
    EXPECT_EQ(read.provenance.tool, file.provenance.tool) << byte;
  }
}

TEST(PrimitiveToml, KeepsOrdinaryTextsReadableInPlace) {
  const PrimitiveFile file = Example();
  EXPECT_THAT(ToToml(file), HasSubstr("'''\n" + file.provenance.robot_urdf + "'''"));
}

TEST(PrimitiveToml, LoadsAFileAndNamesAMissingOne) {
  const PrimitiveFile file = Example();
  const std::string path = ::testing::TempDir() + "tumbler_primitive_toml_test.toml";
  std::ofstream(path, std::ios::binary) << ToToml(file);
  ExpectSame(LoadPrimitive(path), file);
  std::remove(path.c_str());
  try {
    LoadPrimitive(path);
    FAIL();
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr(path));
  }
}

TEST(PrimitiveToml, HashOfTextIsFnv1a) {
  // These vectors are those of the reference implementation (Fowler, Noll, Vo; test_fnv.c).
  EXPECT_EQ(HashOfText(""), "fnv1a64:cbf29ce484222325");
  EXPECT_EQ(HashOfText("a"), "fnv1a64:af63dc4c8601ec8c");
  EXPECT_EQ(HashOfText("foobar"), "fnv1a64:85944171f73967e8");
}

// ---- The hash of the content --------------------------------------------------------------------

/// The places of a text's values as `[begin, end)`: numbers, and the insides of strings. A comment
/// or a key holds none.
std::vector<std::pair<std::size_t, std::size_t>> ValuesOf(const std::string& text) {
  std::vector<std::pair<std::size_t, std::size_t>> values;
  bool value = false;  // Whether the text stands right of an equals sign.
  int open = 0;        // brackets of an array
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '#') {
      i = text.find('\n', i);
      value = value && open > 0;
    } else if (!value) {
      value = c == '=';
    } else if (c == '[' || c == ']') {
      open += c == '[' ? 1 : -1;
    } else if (c == '\n') {
      value = open > 0;
    } else if (c == '"' || c == '\'') {
      const bool lines = text.compare(i, 3, std::string(3, c)) == 0;
      const std::size_t begin = i + (lines ? 4 : 1);
      const std::size_t end = text.find(lines ? std::string(3, c) : std::string(1, c), begin);
      values.emplace_back(begin, end);
      i = end + (lines ? 2 : 0);
    } else if (c != ' ' && c != ',') {
      const std::size_t end = text.find_first_of(",]\n ", i);
      values.emplace_back(i, end);
      i = end - 1;
    }
  }
  return values;
}

/// The words and numbers of a value: runs of letters, digits and what belongs to a number.
std::vector<std::pair<std::size_t, std::size_t>> TokensOf(
    const std::string& text, std::pair<std::size_t, std::size_t> value) {
  const auto in_token = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '-' || c == '_';
  };
  std::vector<std::pair<std::size_t, std::size_t>> tokens;
  for (std::size_t i = value.first; i < value.second; ++i) {
    if (!in_token(text[i])) continue;
    const std::size_t begin = i;
    while (i < value.second && in_token(text[i])) ++i;
    if (std::any_of(text.begin() + static_cast<std::ptrdiff_t>(begin),
                    text.begin() + static_cast<std::ptrdiff_t>(i),
                    [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; })) {
      tokens.emplace_back(begin, i);
    }
  }
  return tokens;
}

/// The text with one digit or letter of the token changed: of a number the last digit that changes
/// its double, so that what follows from the number hardly moves.
std::string WithTokenChanged(const std::string& text, std::pair<std::size_t, std::size_t> token) {
  const std::string was = text.substr(token.first, token.second - token.first);
  char* end = nullptr;
  const double number = std::strtod(was.c_str(), &end);
  const bool is_number = *end == '\0';
  for (std::size_t i = was.size(); i-- > 0;) {
    if (std::isalnum(static_cast<unsigned char>(was[i])) == 0) continue;
    std::string is = was;
    is[i] = static_cast<char>(is[i] + (is[i] == '9' || is[i] == 'z' || is[i] == 'Z' ? -1 : 1));
    if (is_number && (was[i] == 'e' || std::strtod(is.c_str(), nullptr) == number)) continue;
    return text.substr(0, token.first) + is + text.substr(token.second);
  }
  return text;
}

class ShippedPrimitive : public ::testing::TestWithParam<const char*> {
 protected:
  const std::string text_ =
      ReadTextFile(testing::SourcePath(std::string("primitives/") + GetParam() + ".toml"));
};

TEST_P(ShippedPrimitive, IsRefusedWhenAnyNumberOrWordOfItIsEdited) {
  ASSERT_NO_THROW(ParsePrimitive(text_, "p.toml"));
  int edits = 0;
  for (const auto& value : ValuesOf(text_)) {
    for (const auto& token : TokensOf(text_, value)) {
      const std::string edited = WithTokenChanged(text_, token);
      ASSERT_NE(edited, text_);
      ++edits;
      EXPECT_THROW(ParsePrimitive(edited, "p.toml"), FileError)
          << text_.substr(token.first, token.second - token.first) << " became "
          << edited.substr(token.first, token.second - token.first) << " near "
          << text_.substr(token.first - std::min<std::size_t>(token.first, 60), 60);
    }
  }
  EXPECT_GT(edits, 700) << "of numbers and words";
}

TEST_P(ShippedPrimitive, IsReadAfterItsCommentsWhiteSpaceAndNotationChanged) {
  std::string text = text_;
  text = Mutate(text, "# feed-forward", "# the feed-forward");
  text = Mutate(text, "\n[entry]\n", "\n\n# the start\n[entry]\n\n");
  text = Mutate(text, "velocity_max_rad_s = 20.0", "velocity_max_rad_s=20");
  text = Mutate(text, "torque_max_nm = 8.0", "torque_max_nm = 0.8e+1");
  EXPECT_EQ(ContentHash(ParsePrimitive(text, "p.toml")),
            ContentHash(ParsePrimitive(text_, "p.toml")));
}

TEST_P(ShippedPrimitive, HasTheHashThatItsContentHas) {
  const PrimitiveFile file = ParsePrimitive(text_, "p.toml");
  EXPECT_THAT(text_, HasSubstr("\ncontent_hash = \"" + ContentHash(file) + "\"\n"));
  EXPECT_EQ(ToToml(file), text_);
}

INSTANTIATE_TEST_SUITE_P(PrimitiveToml, ShippedPrimitive,
                         ::testing::Values("handstand", "downstand", "roll"),
                         [](const auto& instance) { return std::string(instance.param); });

TEST(PrimitiveToml, TheGainsOfItsDrivesAreKeptWithAllTheirBitsAndBounded) {
  PrimitiveFile file = Example();
  EXPECT_EQ(ParsePrimitive(ToToml(file), "p.toml").drives, std::nullopt);
  file.drives = DriveGains{61.3, 0.1};
  EXPECT_EQ(ParsePrimitive(ToToml(file), "p.toml").drives, file.drives);
  for (const DriveGains& gains : {DriveGains{-1, 5}, DriveGains{60, -0.1}, DriveGains{1e5, 5}}) {
    file.drives = gains;
    EXPECT_THROW(ToToml(file), std::invalid_argument);
  }
  file.drives = DriveGains{60, 5};
  EXPECT_THROW(ParsePrimitive(Mutate(ToToml(file), "kp_nm_per_rad = 60.0", "kp_nm_per_rad = 61.0"),
                              "p.toml"),
               FileError)
      << "without a new hash";
}

TEST(PrimitiveToml, TheHashOfTheContentIsThatOfTheCanonicalText) {
  const std::string text = ToToml(Example());
  const std::string canonical = TomlTable::Parse(text, "p.toml").CanonicalText("content_hash");
  for (const char* line : {"version = 2\n", "name = 4:wave\n", "joint = [2]\n", "joint[0] = {4}\n",
                           "joint[0].limits.position_min_rad = -1\n", "joint[0].name = 4:left\n",
                           "provenance.seed = 42\n", "duration_s = 0x3ff4000000000000\n",
                           "entry.joint_positions_rad[1] = 0xbfe0000000000000\n",
                           "provenance.task_toml = 26:[contact]\nstiffness = 1e4\n"}) {
    EXPECT_THAT(canonical, HasSubstr(line));
  }
  EXPECT_THAT(canonical, ::testing::Not(HasSubstr("content_hash")));
  EXPECT_EQ(ContentHash(Example()), HashOfText(canonical));
}

TEST(PrimitiveToml, AChangeByHandIsReadOnceItIsSignedAndTheFileSaysSo) {
  const std::string original = ToToml(Example());
  const std::string edited = Mutate(original, "-0.4375", "-0.4376");
  EXPECT_THROW(ParsePrimitive(edited, "p.toml"), FileError);
  const std::string text = SignEdited(edited, "p.toml", "a little wider");
  const PrimitiveFile file = ParsePrimitive(text, "p.toml");
  EXPECT_EQ(file.provenance.edited, "a little wider");
  EXPECT_THAT(MakerOf(file.provenance), HasSubstr("changed by hand since: a little wider"));
  EXPECT_EQ(file.primitive.joints[1].position.control_points()[2], -0.4376);
  EXPECT_EQ(file.certificate.velocity_margin_rad_s, MarginsOf(file.primitive).velocity_rad_s);
  EXPECT_NE(ContentHash(file), ContentHash(Example()));
  const std::string twice =
      SignEdited(Mutate(text, "settle_s = 0.375", "settle_s = 0.5"), "p.toml", "calmer");
  EXPECT_EQ(ParsePrimitive(twice, "p.toml").provenance.edited, "a little wider; calmer");
  EXPECT_THROW(ParsePrimitive(Mutate(text, "a little", "a lot"), "p.toml"), FileError);
}

RobustnessFigure ExampleFigure() {
  RobustnessFigure figure;
  figure.motion = "wave";
  figure.stand = 97;
  figure.robots = 100;
  const Share share = ShareOf(97, 100);
  figure.share_95_low = share.low;
  figure.share_95_high = share.high;
  figure.seed = 5;
  figure.spreads = "--mass 0.05";
  figure.drives_file = "drives.toml";
  figure.drives_hash = HashOfText("drives");
  return figure;
}

TEST(PrimitiveToml, AFigureOfRobotsIsReadBackAndPartOfTheHash) {
  PrimitiveFile file = Example();
  file.robustness = {ExampleFigure()};
  const PrimitiveFile read = ParsePrimitive(ToToml(file), "p.toml");
  ASSERT_EQ(read.robustness.size(), 1U);
  EXPECT_EQ(read.robustness[0].stand, 97);
  EXPECT_EQ(read.robustness[0].seed, 5U);
  EXPECT_EQ(read.robustness[0].share_95_low, file.robustness[0].share_95_low);
  EXPECT_EQ(ToText(read.robustness[0]),
            "wave: 97 of 100 robots: 97.0 % (95 %: 91.5 ... 99.0 %); scale 1 (--mass 0.05), seed "
            "5, in the twin, drives.toml");
  EXPECT_NE(ContentHash(file), ContentHash(Example()));
  EXPECT_THROW(ParsePrimitive(Mutate(ToToml(file), "seed = 5", "seed = 6"), "p.toml"), FileError);
}

TEST(PrimitiveToml, AFigureOfRobotsThatContradictsItselfIsRefused) {
  const auto refusal = [](const RobustnessFigure& figure) {
    PrimitiveFile file = Example();
    file.robustness = {figure};
    try {
      ToToml(file);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  EXPECT_EQ(refusal(ExampleFigure()), "taken");
  RobustnessFigure more = ExampleFigure();
  more.stand = 101;
  EXPECT_THAT(refusal(more), HasSubstr("stand: is 101; allowed: up to robots, which is 100"));
  RobustnessFigure better = ExampleFigure();
  better.share_95_low = 0.96;
  EXPECT_THAT(refusal(better), HasSubstr("share_95_low: is 0.96, but the interval of stand"));
  RobustnessFigure none = ExampleFigure();
  none.robots = 0;
  EXPECT_THAT(refusal(none), HasSubstr("robots: is 0"));
  RobustnessFigure nameless = ExampleFigure();
  nameless.drives_file = "";
  EXPECT_THAT(refusal(nameless), HasSubstr("drives_hash"));
}

TEST(PrimitiveToml, AChangeByHandTakesTheFiguresOfRobotsAway) {
  PrimitiveFile file = Example();
  file.robustness = {ExampleFigure()};
  const std::string edited = Mutate(ToToml(file), "-0.4375", "-0.4376");
  EXPECT_TRUE(ParsePrimitive(SignEdited(edited, "p.toml", "wider"), "p.toml").robustness.empty());
}

GroundWindow ExampleWindow() {
  GroundWindow window;
  window.mu = {0.12, 0.61};
  window.mu_scanned = {0.05, 2};
  window.stiffness_n_per_m = {1250, 31000};
  window.stiffness_scanned_n_per_m = {1250, 5e5};
  window.damping_n_s_per_m = {5, 2000};
  window.damping_scanned_n_s_per_m = {5, 2000};
  window.hold_s = 2;
  return window;
}

TEST(PrimitiveToml, AWindowOfTheGroundIsReadBackAndPartOfTheHash) {
  PrimitiveFile file = Example();
  EXPECT_FALSE(ParsePrimitive(ToToml(file), "p.toml").window) << "nobody has to look";
  file.window = ExampleWindow();
  const PrimitiveFile read = ParsePrimitive(ToToml(file), "p.toml");
  ASSERT_TRUE(read.window);
  EXPECT_EQ(read.window->mu, file.window->mu);
  EXPECT_EQ(read.window->damping_scanned_n_s_per_m, file.window->damping_scanned_n_s_per_m);
  EXPECT_EQ(read.window->where, RobustnessFigure::Where::kLanes);
  EXPECT_NE(ContentHash(file), ContentHash(Example()));
  EXPECT_THROW(ParsePrimitive(Mutate(ToToml(file), "0.61", "0.62"), "p.toml"), FileError);
}

TEST(PrimitiveToml, AnEndOfAWindowAtTheScansLimitIsSaidToReachAtLeastSoFar) {
  const auto lines = WindowLines(ExampleWindow());
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0].second, "0.12 to 0.61; in lanes, default drives");
  EXPECT_EQ(lines[1].second, "1250 or less to 31000 N/m; in lanes, default drives");
  EXPECT_EQ(lines[2].second, "5 or less to 2000 or more N s/m; in lanes, default drives");
}

TEST(PrimitiveToml, AWindowThatContradictsItselfIsRefused) {
  const auto refusal = [](const std::function<void(GroundWindow&)>& change) {
    PrimitiveFile file = Example();
    file.window = ExampleWindow();
    change(*file.window);
    try {
      ToToml(file);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  EXPECT_EQ(refusal([](GroundWindow&) {}), "taken");
  EXPECT_THAT(refusal([](GroundWindow& window) { window.mu[1] = 2.5; }),
              HasSubstr("window.mu: goes from 0.12 to 2.5; allowed: upwards, within what was "
                        "scanned, which is 0.05 to 2"));
  EXPECT_THAT(refusal([](GroundWindow& window) { std::swap(window.mu[0], window.mu[1]); }),
              HasSubstr("window.mu: goes from 0.61 to 0.12"));
  EXPECT_THAT(refusal([](GroundWindow& window) { window.stiffness_n_per_m[0] = 1000; }),
              HasSubstr("window.stiffness_n_per_m: goes from 1000"));
  EXPECT_THAT(refusal([](GroundWindow& window) { window.damping_n_s_per_m[0] = 0; }),
              HasSubstr("damping_n_s_per_m"));
  EXPECT_THAT(refusal([](GroundWindow& window) { window.drives_file = "drives.toml"; }),
              HasSubstr("window.drives_hash"));
}

TEST(PrimitiveToml, AChangeByHandTakesTheWindowAway) {
  PrimitiveFile file = Example();
  file.window = ExampleWindow();
  const std::string edited = Mutate(ToToml(file), "-0.4375", "-0.4376");
  EXPECT_FALSE(ParsePrimitive(SignEdited(edited, "p.toml", "wider"), "p.toml").window);
}

TEST(PrimitiveToml, SigningTakesNothingThatTheLoaderRefusesForAnotherReason) {
  const std::string original = ToToml(Example());
  EXPECT_THROW(SignEdited(original, "p.toml", "nothing"), FileError) << "nothing was changed";
  EXPECT_THROW(SignEdited(Mutate(original, "0.3125,", "2.3125,"), "p.toml", "beyond a limit"),
               FileError);
  EXPECT_THROW(SignEdited(Mutate(original, "degree = 5", "degree = 5\nx = 1"), "p.toml", "a key"),
               FileError);
  EXPECT_THROW(SignEdited(Mutate(original, "-0.4375", "-0.4376"), "p.toml", ""),
               std::invalid_argument);
  EXPECT_THROW(SignEdited(Mutate(original, "-0.4375", "-0.4376"), "p.toml", "a \x1b[2J screen"),
               std::invalid_argument);
}

TEST(PrimitiveToml, MarginsAreDistancesOfThePathsToTheLimits) {
  const Primitive<double> primitive = Example().primitive;
  const LimitMargins margins = MarginsOf(primitive);
  LimitMargins sampled{1e9, 1e9, 1e9, 1e9};
  for (const auto& motion : primitive.motions()) {
    const JointLimits<double>& limits = motion.limits;
    for (int i = 0; i <= 10000; ++i) {
      const double t = primitive.duration_s * i / 10000;
      const auto sample = motion.position.Evaluate(t);
      const auto take = [](double& margin, double now) { margin = std::min(margin, now); };
      take(sampled.position_rad, limits.position_max_rad - sample.value);
      take(sampled.position_rad, sample.value - limits.position_min_rad);
      take(sampled.velocity_rad_s, limits.velocity_max_rad_s - std::abs(sample.first));
      take(sampled.acceleration_rad_s2, limits.acceleration_max_rad_s2 - std::abs(sample.second));
      take(sampled.torque_nm, limits.torque_max_nm - std::abs(motion.torque.Evaluate(t).value));
    }
  }
  EXPECT_NEAR(margins.position_rad, sampled.position_rad, 1e-6);
  EXPECT_NEAR(margins.velocity_rad_s, sampled.velocity_rad_s, 1e-6);
  EXPECT_NEAR(margins.acceleration_rad_s2, sampled.acceleration_rad_s2, 1e-3);
  EXPECT_NEAR(margins.torque_nm, sampled.torque_nm, 1e-6);
}

TEST(PrimitiveToml, AMarginOfControlPointsAsEarlierVersionsWroteItIsTaken) {
  PrimitiveFile file = Example();
  const LimitMargins least = HullMarginsOf(file.primitive);
  ASSERT_LT(least.velocity_rad_s, MarginsOf(file.primitive).velocity_rad_s - 1e-3);
  file.certificate.position_margin_rad = least.position_rad;
  file.certificate.velocity_margin_rad_s = least.velocity_rad_s;
  file.certificate.acceleration_margin_rad_s2 = least.acceleration_rad_s2;
  EXPECT_NO_THROW(ParsePrimitive(ToToml(file), "p.toml"));
  file.certificate.velocity_margin_rad_s = least.velocity_rad_s - 1e-3;
  EXPECT_THROW(ToToml(file), std::invalid_argument);  // The writer reads what it writes.
  file.certificate.velocity_margin_rad_s = MarginsOf(file.primitive).velocity_rad_s + 1e-3;
  EXPECT_THROW(ToToml(file), std::invalid_argument);
}

// ---- Refusals -----------------------------------------------------------------------------------

struct Refusal {
  const char* name;
  std::string from;  // must occur in the text
  std::string to;
  std::vector<std::string> fragments;
};

class PrimitiveRefusal : public ::testing::TestWithParam<Refusal> {};

TEST_P(PrimitiveRefusal, NamesFileLineKeyAndCause) {
  const Refusal& refusal = GetParam();
  const std::string text = Mutate(ToToml(Example()), refusal.from, refusal.to);
  try {
    ParsePrimitive(text, "p.toml");
    FAIL() << "was accepted";
  } catch (const FileError& error) {
    const std::string message = error.what();
    EXPECT_THAT(message, ::testing::MatchesRegex("p\\.toml:[0-9]+: .+"));
    for (const std::string& fragment : refusal.fragments) EXPECT_THAT(message, HasSubstr(fragment));
  }
}

const std::string kLeftPoints = "0.125, 0.125, 0.125, 0.3125,\n  0.25, 0.25, 0.25, 0.25\n]";
const std::string kLeftKnots =
    "0.0, 0.0, 0.0, 0.0,\n  0.0, 0.0, 0.5, 0.75,\n  1.25, 1.25, 1.25, 1.25,\n  1.25, 1.25\n]";

INSTANTIATE_TEST_SUITE_P(
    PrimitiveToml, PrimitiveRefusal,
    ::testing::Values(
        Refusal{"Format",
                "tumbler-primitive",
                "tumbler-gait",
                {"format: is 'tumbler-gait'", "'tumbler-primitive'"}},
        Refusal{"NewerVersion",
                "version = 2",
                "version = 3",
                {"p.toml:4: version: is 3", "reads version 2", "newer program"}},
        Refusal{"VersionOne",
                "version = 2",
                "version = 1",
                {"version: is 1", "hash is of the whole file",
                 "make the file again with tumbler optimize"}},
        Refusal{"ToolWithAnEscape",
                "tool = \"",
                "tool = \"\\u001b[31m",
                {"tool: has an escape character, which would command the terminal"}},
        Refusal{"VersionText",
                "version = 2",
                "version = \"2\"",
                {"version: is a string; expected an integer"}},
        Refusal{"NoVersion", "version = 2", "", {"version: is missing"}},
        Refusal{"EmptyName", "name = \"wave\"", "name = \"\"", {"name: is ''", "from 1 ... 48"}},
        Refusal{"LongName",
                "name = \"wave\"",
                "name = \"" + std::string(49, 'x') + "\"",
                {"name: is", "49 bytes"}},
        Refusal{"ZeroDuration",
                "duration_s = 1.25",
                "duration_s = 0.0",
                {"duration_s: is 0; allowed: > 0"}},
        Refusal{"NanDuration",
                "duration_s = 1.25",
                "duration_s = nan",
                {"duration_s: is nan; allowed: > 0"}},
        Refusal{"OtherDuration",
                "duration_s = 1.25",
                "duration_s = 1.5",
                {"joint[0].position.knots_s: ends at 1.25", "duration_s, which is 1.5"}},
        Refusal{"NegativeSettle",
                "settle_s = 0.375",
                "settle_s = -1.0",
                {"settle_s: is -1; allowed: >= 0"}},
        Refusal{"ZeroEntryTolerance",
                "entry_tolerance_rad = 0.0625",
                "entry_tolerance_rad = 0.0",
                {"entry_tolerance_rad: is 0; allowed: > 0"}},
        Refusal{"ZeroFollowingTolerance",
                "following_tolerance_rad = 0.5",
                "following_tolerance_rad = 0.0",
                {"following_tolerance_rad: is 0; allowed: > 0"}},
        Refusal{"NoJoints", "[[joint]]", "[[joimt]]", {"joint"}},
        Refusal{"SameJointTwice",
                "name = \"right\"",
                "name = \"left\"",
                {"joint[1].name: is 'left'", "earlier joint"}},
        Refusal{"LongJointName",
                "name = \"left\"",
                "name = \"" + std::string(33, 'x') + "\"",
                {"joint[0].name: is", "33 bytes"}},
        Refusal{"LimitsInverted",
                "position_max_rad = 1.0",
                "position_max_rad = -1.0",
                {"joint[0].limits.position_max_rad: is -1", "above position_min_rad"}},
        Refusal{"ZeroVelocityLimit",
                "velocity_max_rad_s = 10.0",
                "velocity_max_rad_s = 0.0",
                {"joint[0].limits.velocity_max_rad_s: is 0; allowed: > 0"}},
        Refusal{"InfiniteAccelerationLimit",
                "acceleration_max_rad_s2 = 100.0",
                "acceleration_max_rad_s2 = inf",
                {"acceleration_max_rad_s2: is inf"}},
        Refusal{"NegativeTorqueLimit",
                "torque_max_nm = 2.0",
                "torque_max_nm = -2.0",
                {"joint[0].limits.torque_max_nm: is -2"}},
        Refusal{"DegreeTooLow",
                "degree = 5",
                "degree = 2",
                {"joint[0].position.degree: is 2; allowed: from 3 ... 7"}},
        Refusal{"DegreeTooHigh",
                "degree = 5",
                "degree = 8",
                {"joint[0].position.degree: is 8; allowed: from 3 ... 7"}},
        Refusal{"DegreeDoesNotFitKnots",
                "degree = 5",
                "degree = 4",
                {"joint[0].position.knots_s: holds 14 numbers", "need 13"}},
        Refusal{"TooFewCoefficients",
                kLeftPoints,
                "0.125, 0.125]",
                {"joint[0].position.coefficients_rad: holds 2 numbers", "from 6 (degree + 1)"}},
        Refusal{"TooManyCoefficients",
                kLeftPoints,
                [] {
                  std::string s;
                  for (int i = 0; i < 65; ++i) s += "0.1,";
                  return s + "]";
                }(),
                {"coefficients_rad: holds 65 numbers", "... 64"}},
        Refusal{"OneCoefficientMissing",
                kLeftPoints,
                "0.125, 0.125, 0.125, 0.3125, 0.25, 0.25, 0.25]",
                {"knots_s: holds 14 numbers; 7 coefficients of degree 5 need 13"}},
        Refusal{
            "NanCoefficient", "0.3125", "nan", {"joint[0].position.coefficients_rad[3]: is nan"}},
        Refusal{"InfiniteKnot", "0.5, 0.75", "0.5, inf", {"joint[0].position.knots_s[7]: is inf"}},
        Refusal{"TextCoefficient",
                "0.3125",
                "\"0.3125\"",
                {"coefficients_rad[3]: is a string; expected a number"}},
        Refusal{"KnotsDecrease",
                "0.5, 0.75",
                "0.75, 0.5",
                {"joint[0].position.knots_s: knot 7 is 0.5, less than knot 6"}},
        Refusal{"KnotsStartLate",
                kLeftKnots,
                "0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.5, 0.75, 1.25, 1.25, 1.25, 1.25, 1.25, 1.25]",
                {"knots_s: starts at 0.1; a motion starts at 0"}},
        Refusal{"KnotsNotClamped",
                kLeftKnots,
                "0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.5, 0.75, 1.25, 1.25, 1.25, 1.25, 1.25, 1.25]",
                {"knots_s: must begin and end with 6 equal knots"}},
        Refusal{
            "KnotAtTheEnd", "0.5, 0.75", "0.5, 1.25", {"knots_s: knot 7, 1.25, occurs too often"}},
        Refusal{"KnotRepeatedTooOften",
                "[joint.position]\ndegree = 3\nknots_s = [\n  0.0, 0.0, 0.0, 0.0,\n  0.625, 1.25, "
                "1.25, 1.25,\n  1.25\n]\ncoefficients_rad = [\n  -0.5, -0.5,",
                "[joint.position]\ndegree = 3\nknots_s = [0.0, 0.0, 0.0, 0.0, 0.625, 0.625, 1.25, "
                "1.25, 1.25, 1.25]\ncoefficients_rad = [-0.5, -0.5, -0.5,",
                {"joint[1].position.knots_s: knot 5, 0.625, occurs too often", "1 times"}},
        Refusal{"PositionAboveLimit",
                "position_max_rad = 1.0",
                "position_max_rad = 0.25",
                {"joint[0].position.coefficients_rad: joint 'left': position is 0.259443",
                 " rad at ", " s; allowed: <= 0.25 rad"}},
        Refusal{"PositionBelowLimit",
                "position_min_rad = -1.0",
                "position_min_rad = 0.2",
                {"joint 'left': position is 0.125 rad at 0 s; allowed: >= 0.2 rad"}},
        Refusal{"VelocityAboveLimit",
                "velocity_max_rad_s = 10.0",
                "velocity_max_rad_s = 0.2",
                {"joint 'left': velocity is 0.353091", " rad/s at ",
                 " s; allowed: <= 0.2 rad/s (limits.velocity_max_rad_s)"}},
        Refusal{
            "AccelerationAboveLimit",
            "acceleration_max_rad_s2 = 100.0",
            "acceleration_max_rad_s2 = 1.0",
            {"joint 'left': acceleration is ", "rad/s^2 at ", "limits.acceleration_max_rad_s2"}},
        Refusal{"TorqueAboveLimit",
                "torque_max_nm = 2.0",
                "torque_max_nm = 1.0",
                {"joint[0].torque.coefficients_nm: joint 'left': feed-forward torque is 1.5 N m at "
                 "0.625 s; allowed: <= 1 N m"}},
        Refusal{"TorqueEndsEarly",
                "0.0, 0.0, 0.625, 1.25,\n  1.25",
                "0.0, 0.0, 0.625, 1.0,\n  1.0",
                {"joint[0].torque.knots_s: ends at 1.0"}},
        Refusal{"EntryElsewhere",
                "joint_positions_rad = [0.125, -0.5]",
                "joint_positions_rad = [0.126, -0.5]",
                {"entry.joint_positions_rad: joint 'left' is at 0.126 rad; its spline starts at "
                 "0.125 rad"}},
        Refusal{"ExitElsewhere",
                "joint_positions_rad = [0.25, -0.5]",
                "joint_positions_rad = [0.25, -0.4]",
                {"exit.joint_positions_rad: joint 'right' is at -0.4 rad; its spline ends at -0.5 "
                 "rad"}},
        Refusal{"EntryOfOneJoint",
                "joint_positions_rad = [0.125, -0.5]",
                "joint_positions_rad = [0.125]",
                {"entry.joint_positions_rad: holds 1 numbers; expected 2"}},
        Refusal{"NanPose", "root_z_m = 0.15", "root_z_m = nan", {"entry.root_z_m: is nan"}},
        Refusal{"ContactEndsFirst",
                "end_s = 0.4375",
                "end_s = -0.0625",
                {"contact[1].end_s: is -0.0625"}},
        Refusal{"ContactReversed",
                "start_s = 0.0\nend_s = 0.4375",
                "start_s = 0.5\nend_s = 0.4375",
                {"contact[1].end_s: is 0.4375; allowed: >= start_s, which is 0.5"}},
        Refusal{"ContactAfterTheMotion",
                "end_s = 0.4375",
                "end_s = 1.75",
                {"contact[1].end_s: is 1.75; allowed: up to the end of the settle phase, 1.625"}},
        Refusal{"PurposeMissed",
                "result = 0.26",
                "result = 0.3125",
                {"purpose[0].result: is 0.3125, 0.0625 from the target; allowed: the tolerance, "
                 "0.03125"}},
        Refusal{"PurposeWithoutAResult", "result = 0.26", "result = nan", {"purpose[0].result"}},
        Refusal{"PurposeOfNothing",
                "of = \"speed\"",
                "of = \"haste\"",
                {"purpose[1].of: is 'haste'; allowed: x, z, pitch, x_rate, z_rate, pitch_rate, "
                 "speed"}},
        Refusal{"PurposeAtNoTime", "time_s = 0.875\n", "", {"purpose[2].time_s: is missing"}},
        Refusal{"PurposeAtTwoTimes",
                "when = \"later\"",
                "when = \"later\"\ntime_s = 0.5",
                {"purpose[1].time_s: is not a key that this file can hold"}},
        Refusal{"PurposeOfAPointOfNoLink",
                "link = \"leg1_link\"\n",
                "",
                {"purpose[3].link: is missing"}},
        Refusal{"PurposeWithoutTolerance",
                "tolerance = 0.03125",
                "tolerance = 0.0",
                {"purpose[0].tolerance: is 0; allowed: > 0"}},
        Refusal{"NegativeForce",
                "peak_normal_force_n = 31.5",
                "peak_normal_force_n = -31.5",
                {"contact[0].peak_normal_force_n: is -31.5"}},
        Refusal{"CoefficientChanged",
                "-0.4375",
                "-0.4376",
                {"p.toml:5: content_hash: is 'fnv1a64:", "all keys and values in this file hash to",
                 "changed after it was written", "make it again with tumbler optimize",
                 "sign the change with tumbler sign"}},
        Refusal{"SettleChanged", "settle_s = 0.375", "settle_s = 0.376", {"content_hash"}},
        Refusal{"ContentHashChanged",
                "content_hash = \"fnv1a64:",
                "content_hash = \"fnv1a64:0",
                {"content_hash: is 'fnv1a64:0"}},
        Refusal{"PositionMarginClaimed",
                "position_margin_rad = 0.7",
                "position_margin_rad = 0.8",
                {"certificate.position_margin_rad: is 0.84",
                 "but the coefficients leave a margin of 0.74"}},
        Refusal{"VelocityMarginClaimed",
                "velocity_margin_rad_s = ",
                "velocity_margin_rad_s = 1",
                {"certificate.velocity_margin_rad_s: is 1"}},
        Refusal{"AccelerationMarginClaimed",
                "acceleration_margin_rad_s2 = ",
                "acceleration_margin_rad_s2 = 1",
                {"certificate.acceleration_margin_rad_s2: is 1"}},
        Refusal{"TwoGradientErrors",
                "gradient_errors = [0.0, 0.0, 0.0]",
                "gradient_errors = [0.0, 0.0]",
                {"certificate.gradient_errors: holds 2 numbers; expected 3"}},
        Refusal{"NegativePeakTorque",
                "peak_torque_nm = 1.5",
                "peak_torque_nm = -1.5",
                {"certificate.peak_torque_nm: is -1.5"}},
        Refusal{"RobotChanged",
                "<link name='a'/>",
                "<link name='b'/>",
                {"provenance.robot_hash", "the bytes of robot_urdf"}},
        Refusal{"TaskChanged",
                "stiffness = 1e4",
                "stiffness = 1e5",
                {"provenance.task_hash", "the bytes of task_toml"}},
        Refusal{"NegativeSeed", "seed = 42", "seed = -42", {"provenance.seed: is -42"}},
        Refusal{"UnknownKey",
                "settle_s = 0.375",
                "settle_s = 0.375\nsettle_ms = 375",
                {"settle_ms: is not a key that this file can hold"}},
        Refusal{"UnknownJointKey",
                "name = \"right\"",
                "name = \"right\"\ncolour = \"red\"",
                {"joint[1].colour: is not a key"}},
        Refusal{"UnknownSplineKey",
                "degree = 5",
                "degree = 5\nweights = [1.0]",
                {"joint[0].position.weights: is not a key"}},
        Refusal{"DuplicateKey",
                "settle_s = 0.375",
                "settle_s = 0.375\nsettle_s = 0.375",
                {"not valid TOML"}}),
    [](const auto& instance) { return instance.param.name; });

TEST(PrimitiveToml, SaysMoreDigitsWhenALimitIsMissedByOneBit) {
  PrimitiveFile file = Example();
  file.primitive.joints[0].limits.position_min_rad = 0.125;  // where it starts
  CompleteExample(file);
  EXPECT_NO_THROW(ToToml(file));
  const std::string text =
      Mutate(ToToml(file), "  0.125, 0.125, 0.125,", "  0.12499999999999999, 0.125, 0.125,");
  try {
    ParsePrimitive(text, "p.toml");
    FAIL();
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("is 0.12499999999999999 rad at 0 s; allowed: >= 0.125 rad"));
  }
}

TEST(PrimitiveToml, NeverLoadsATruncatedFile) {
  const std::string text = ToToml(Example());
  int loaded = 0;
  for (std::size_t size = 0; size + 1 < text.size(); size += 50) {
    try {
      ParsePrimitive(text.substr(0, size), "cut.toml");
      ++loaded;
      ADD_FAILURE() << "loaded " << size << " of " << text.size() << " bytes";
    } catch (const FileError& error) {
      EXPECT_THAT(error.what(), ::testing::StartsWith("cut.toml"));
    }
  }
  EXPECT_EQ(loaded, 0);
  // The last bytes are cut off one by one. Only the line feed at the very end may be missing.
  for (std::size_t size = text.size() - 20; size + 1 < text.size(); ++size) {
    EXPECT_THROW(ParsePrimitive(text.substr(0, size), "cut.toml"), FileError) << size;
  }
}

TEST(PrimitiveToml, SurvivesRandomDamage) {
  std::mt19937_64 random(5);
  const std::string original = ToToml(Example());
  int accepted = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    std::string text = original;
    for (std::size_t k = 1 + random() % 3; k > 0; --k)
      text[random() % text.size()] = static_cast<char>(random());
    try {
      // An accepted text must be consistent in itself: it can be written and read again.
      ParsePrimitive(ToToml(ParsePrimitive(text, "damaged.toml")), "again.toml");
      ++accepted;
    } catch (const FileError&) {
      continue;  // as most are
    }
  }
  // Only comments and white space may be damaged: about a tenth of the text.
  EXPECT_LT(accepted, 300);
}

TEST(PrimitiveToml, WriterRefusesWhatNoProgramWouldLoad) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::function<void(PrimitiveFile&)>> damages = {
      [nan](auto& f) { f.entry.root_x_m = nan; },
      [](auto& f) { f.exit.root_z_m = std::numeric_limits<double>::infinity(); },
      [nan](auto& f) { f.certificate.torque_margin_nm = nan; },
      [](auto& f) { f.primitive.joint_count = 0; },
      [](auto& f) { f.primitive.joint_count = kMaxJoints + 1; },
      [](auto& f) { f.primitive.joint_count = 1; },
      [](auto& f) { f.entry.joint_positions_rad.pop_back(); },
      [](auto& f) { f.exit.joint_positions_rad[0] += 1; },
      [](auto& f) { f.certificate.velocity_margin_rad_s += 1e-6; },
      [](auto& f) { f.provenance.robot_urdf += " "; },
      [](auto& f) { f.provenance.seed = 1ULL << 63; },
      [](auto& f) { f.provenance.tool = "\xff"; },
      [](auto& f) { f.provenance.tool = "red \x1b[31m on a terminal"; },
      [](auto& f) { f.contacts[0].obstacle = "two\nlines"; },
      [](auto& f) { f.provenance.task_toml = "\xc0\x80"; },
      [](auto& f) { f.contacts[0].obstacle = "\xed\xa0\x80"; }};
  for (std::size_t i = 0; i < damages.size(); ++i) {
    PrimitiveFile file = Example();
    damages[i](file);
    EXPECT_THROW(ToToml(file), std::invalid_argument) << i;
  }
}

// ---- Rounding -----------------------------------------------------------------------------------

TEST(PrimitiveToRuntime, RoundsEveryNumberToTheNearestFloat) {
  const Primitive<double> primitive = Example().primitive;
  const Primitive<float> runtime = ToRuntime(primitive);
  EXPECT_EQ(runtime.name.view(), "wave");
  EXPECT_EQ(runtime.duration_s, 1.25F);
  EXPECT_EQ(runtime.settle_s, 0.375F);
  ASSERT_EQ(runtime.joint_count, 2);
  for (std::size_t j = 0; j < 2; ++j) {
    const auto points = primitive.joints[j].position.control_points();
    ASSERT_EQ(runtime.joints[j].position.control_points().size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_EQ(runtime.joints[j].position.control_points()[i], static_cast<float>(points[i]));
    }
    EXPECT_EQ(runtime.joints[j].position.end_s(), runtime.duration_s);
    EXPECT_EQ(runtime.joints[j].torque.end_s(), runtime.duration_s);
  }
}

TEST(PrimitiveToRuntime, ResultHoldsItsOwnLimitsAndWidensThemByRoundingOnly) {
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> angle(-3.0, 3.0);
  int widened = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Primitive<double> primitive;
    primitive.duration_s = 1.2;
    primitive.entry_tolerance_rad = primitive.following_tolerance_rad = 0.1;
    primitive.joint_count = 1;
    auto& motion = primitive.joints[0];
    motion.name = FixedString<32>("a");
    std::vector<double> points(14);
    for (double& point : points) point = angle(random);
    std::vector<double> interior;
    for (int i = 1; i < 9; ++i) interior.push_back(1.2 * i / 9);
    motion.position = MakeSpline(5, interior, 1.2, points);
    motion.torque = MakeSpline(0, {}, 1.2, {0.1});
    // Every limit is active, as in an optimum.
    const auto magnitude = [&motion](int d) {
      const Extent extent = ExtentOf(motion.position, d);
      return std::max(std::abs(extent.min), std::abs(extent.max));
    };
    const auto position = motion.position.Bounds(0);
    motion.limits = {position.min, position.max, magnitude(1), magnitude(2), 0.1};
    const Primitive<float> runtime = ToRuntime(primitive);
    const auto& rounded = runtime.joints[0];
    const auto& limits = rounded.limits;
    EXPECT_EQ(limits.position_min_rad, static_cast<float>(position.min));
    EXPECT_EQ(limits.position_max_rad, static_cast<float>(position.max));
    EXPECT_GE(rounded.position.Bounds(0).min, limits.position_min_rad);
    EXPECT_LE(rounded.position.Bounds(0).max, limits.position_max_rad);
    EXPECT_LE(rounded.torque.Bounds(0).max, limits.torque_max_nm);
    const std::array<float, 2> limit = {limits.velocity_max_rad_s, limits.acceleration_max_rad_s2};
    for (int d = 1; d <= 2; ++d) {
      const float now = limit[static_cast<std::size_t>(d - 1)];
      for (int i = 0; i <= 2000; ++i) {
        const auto sample = rounded.position.Evaluate(1.2F * static_cast<float>(i) / 2000.0F);
        EXPECT_LE(std::abs(d == 1 ? sample.first : sample.second), now);
      }
      EXPECT_LE(now, magnitude(d) * (1 + 1e-5));
      EXPECT_GE(now, static_cast<float>(magnitude(d)));
      if (now > static_cast<float>(magnitude(d))) ++widened;
    }
  }
  EXPECT_GT(widened, 20);  // With fewer, the checks above tested nothing.
}

TEST(PrimitiveToRuntime, RefusesWhatRoundingWouldDistort) {
  PrimitiveFile file = Example();
  auto& motion = file.primitive.joints[0];
  // As floats, knots 1e-9 s apart are equal.
  motion.position =
      MakeSpline(5, {0.5, 0.5 + 1e-9}, 1.25, {0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1});
  try {
    ToRuntime(file.primitive);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("joint 'left'"), HasSubstr("same time")));
  }
  // With knots 1 us apart, an acceleration has two or three right digits.
  motion.position =
      MakeSpline(3, {0.7, 0.700001, 0.700002}, 1.25, {1.3, 1.3, 1.3, 1.3000003, 1.3, 1.3, 1.3});
  const auto bounds = motion.position.Bounds(2);
  motion.limits = {-2, 2, 100, std::max(-bounds.min, bounds.max), 2};
  try {
    ToRuntime(file.primitive);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("joint 'left'"), HasSubstr("acceleration"),
                                    HasSubstr("rad/s^2 beyond")));
  }
  file = Example();
  file.primitive.entry_tolerance_rad = 1e-300;
  EXPECT_THROW(ToRuntime(file.primitive), std::invalid_argument);
}

TEST(PrimitiveToml, TheTablesOfTheDocumentsAreThoseOfTheCode) {
  testing::ExpectTables("docs/formats.md", PrimitiveKeyTables());
  testing::ExpectTables("docs/method.md", std::vector<KeyTable>{CertificateKeyTable()});
}

}  // namespace
}  // namespace tumbler
