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
#include "common/files/printable.h"
#include "common/files/toml_reader.h"
#include "tests/support/complete_primitive.h"
#include "tests/support/docs_tables.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::MotionSpline;

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
  return testing::MakeSpline(degree, knots, duration, points);
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
  testing::CompletePrimitive(file);
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
    PrimitiveFile file = testing::PrimitiveExample();
    const std::string c(1, static_cast<char>(byte));
    file.provenance.robot_urdf = c;
    file.provenance.task_toml = fmt::format("a{0}{0}{0}b\n{0}\n", c);
    file.provenance.tool = "a tool";
    if (Printable(c) == c && c != "\n" && c != "\t") file.provenance.tool = c;
    testing::CompletePrimitive(file);
    const PrimitiveFile read = ParsePrimitive(ToToml(file), "bytes.toml");
    EXPECT_EQ(read.provenance.robot_urdf, file.provenance.robot_urdf) << byte;
    EXPECT_EQ(read.provenance.task_toml, file.provenance.task_toml) << byte;
    EXPECT_EQ(read.provenance.tool, file.provenance.tool) << byte;
  }
}

TEST(PrimitiveToml, KeepsOrdinaryTextsReadableInPlace) {
  const PrimitiveFile file = testing::PrimitiveExample();
  EXPECT_THAT(ToToml(file), HasSubstr("'''\n" + file.provenance.robot_urdf + "'''"));
}

TEST(PrimitiveToml, LoadsAFileAndNamesAMissingOne) {
  const PrimitiveFile file = testing::PrimitiveExample();
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
  text = testing::Replaced(text, "# feed-forward", "# the feed-forward");
  text = testing::Replaced(text, "\n[entry]\n", "\n\n# the start\n[entry]\n\n");
  text = testing::Replaced(text, "velocity_max_rad_s = 20.0", "velocity_max_rad_s=20");
  text = testing::Replaced(text, "torque_max_nm = 8.0", "torque_max_nm = 0.8e+1");
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
  PrimitiveFile file = testing::PrimitiveExample();
  EXPECT_EQ(ParsePrimitive(ToToml(file), "p.toml").drives, std::nullopt);
  file.drives = DriveGains{61.3, 0.1};
  EXPECT_EQ(ParsePrimitive(ToToml(file), "p.toml").drives, file.drives);
  for (const DriveGains& gains : {DriveGains{-1, 5}, DriveGains{60, -0.1}, DriveGains{1e5, 5}}) {
    file.drives = gains;
    EXPECT_THROW(ToToml(file), std::invalid_argument);
  }
  file.drives = DriveGains{60, 5};
  EXPECT_THROW(ParsePrimitive(
                   testing::Replaced(ToToml(file), "kp_nm_per_rad = 60.0", "kp_nm_per_rad = 61.0"),
                   "p.toml"),
               FileError)
      << "without a new hash";
}

TEST(PrimitiveToml, TheHashOfTheContentIsThatOfTheCanonicalText) {
  const std::string text = ToToml(testing::PrimitiveExample());
  const std::string canonical = TomlTable::Parse(text, "p.toml").CanonicalText("content_hash");
  for (const char* line : {"version = 2\n", "name = 4:wave\n", "joint = [2]\n", "joint[0] = {4}\n",
                           "joint[0].limits.position_min_rad = -1\n", "joint[0].name = 4:left\n",
                           "provenance.seed = 42\n", "duration_s = 0x3ff4000000000000\n",
                           "entry.joint_positions_rad[1] = 0xbfe0000000000000\n",
                           "provenance.task_toml = 26:[contact]\nstiffness = 1e4\n"}) {
    EXPECT_THAT(canonical, HasSubstr(line));
  }
  EXPECT_THAT(canonical, ::testing::Not(HasSubstr("content_hash")));
  EXPECT_EQ(ContentHash(testing::PrimitiveExample()), HashOfText(canonical));
}

TEST(PrimitiveToml, AChangeByHandIsReadOnceItIsSignedAndTheFileSaysSo) {
  const std::string original = ToToml(testing::PrimitiveExample());
  const std::string edited = testing::Replaced(original, "-0.4375", "-0.4376");
  EXPECT_THROW(ParsePrimitive(edited, "p.toml"), FileError);
  const std::string text = SignEdited(edited, "p.toml", "a little wider");
  const PrimitiveFile file = ParsePrimitive(text, "p.toml");
  EXPECT_EQ(file.provenance.edited, "a little wider");
  EXPECT_THAT(MakerOf(file.provenance), HasSubstr("changed by hand since: a little wider"));
  EXPECT_EQ(file.primitive.joints[1].position.control_points()[2], -0.4376);
  EXPECT_EQ(file.certificate.velocity_margin_rad_s, MarginsOf(file.primitive).velocity_rad_s);
  EXPECT_NE(ContentHash(file), ContentHash(testing::PrimitiveExample()));
  const std::string twice =
      SignEdited(testing::Replaced(text, "settle_s = 0.375", "settle_s = 0.5"), "p.toml", "calmer");
  EXPECT_EQ(ParsePrimitive(twice, "p.toml").provenance.edited, "a little wider; calmer");
  EXPECT_THROW(ParsePrimitive(testing::Replaced(text, "a little", "a lot"), "p.toml"), FileError);
}

TEST(PrimitiveToml, SigningTakesNothingThatTheLoaderRefusesForAnotherReason) {
  const std::string original = ToToml(testing::PrimitiveExample());
  EXPECT_THROW(SignEdited(original, "p.toml", "nothing"), FileError) << "nothing was changed";
  EXPECT_THROW(
      SignEdited(testing::Replaced(original, "0.3125,", "2.3125,"), "p.toml", "beyond a limit"),
      FileError);
  EXPECT_THROW(
      SignEdited(testing::Replaced(original, "degree = 5", "degree = 5\nx = 1"), "p.toml", "a key"),
      FileError);
  EXPECT_THROW(SignEdited(testing::Replaced(original, "-0.4375", "-0.4376"), "p.toml", ""),
               std::invalid_argument);
  EXPECT_THROW(
      SignEdited(testing::Replaced(original, "-0.4375", "-0.4376"), "p.toml", "a \x1b[2J screen"),
      std::invalid_argument);
}

TEST(PrimitiveToml, MarginsAreDistancesOfThePathsToTheLimits) {
  const Primitive<double> primitive = testing::PrimitiveExample().primitive;
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
  PrimitiveFile file = testing::PrimitiveExample();
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

TEST(PrimitiveToml, SaysMoreDigitsWhenALimitIsMissedByOneBit) {
  PrimitiveFile file = testing::PrimitiveExample();
  file.primitive.joints[0].limits.position_min_rad = 0.125;  // where it starts
  testing::CompletePrimitive(file);
  EXPECT_NO_THROW(ToToml(file));
  const std::string text = testing::Replaced(ToToml(file), "  0.125, 0.125, 0.125,",
                                             "  0.12499999999999999, 0.125, 0.125,");
  try {
    ParsePrimitive(text, "p.toml");
    FAIL();
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("is 0.12499999999999999 rad at 0 s; allowed: >= 0.125 rad"));
  }
}

TEST(PrimitiveToml, NeverLoadsATruncatedFile) {
  const std::string text = ToToml(testing::PrimitiveExample());
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
  const std::string original = ToToml(testing::PrimitiveExample());
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
    PrimitiveFile file = testing::PrimitiveExample();
    damages[i](file);
    EXPECT_THROW(ToToml(file), std::invalid_argument) << i;
  }
}

TEST(PrimitiveToml, TheTablesOfTheDocumentsAreThoseOfTheCode) {
  testing::ExpectTables("docs/formats.md", PrimitiveKeyTables());
  testing::ExpectTables("docs/method.md", std::vector<KeyTable>{CertificateKeyTable()});
}

}  // namespace
}  // namespace tumbler
