// Elementary functions: their errors, their special values, and their bits, which are the same on
// every machine.

#include "common/core/exponential.h"
#include "common/core/functions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>

#include "tests/common/portable_bits.h"

namespace tumbler::portable {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// The largest error of a function over many arguments, in units in the last place, against the
/// C library's function of more digits.
template <class Function, class Reference, class Argument>
double LargestError(Function function, Reference reference, Argument argument) {
  std::mt19937_64 random(1);
  double largest = 0;
  for (int i = 0; i < 100'000; ++i) {
    const double x = argument(static_cast<double>(random() >> 11U) * 0x1p-52 - 1);
    const long double exact = reference(static_cast<long double>(x));
    const double near = std::abs(static_cast<double>(exact));
    const long double unit = std::nextafter(near, kInfinity) - near;
    largest = std::max(largest, static_cast<double>(std::abs(function(x) - exact) / unit));
  }
  return largest;
}

auto Times(double scale) {
  return [scale](double x) { return scale * x; };
}
double AllPositive(double x) { return std::exp(700 * x); }

TEST(PortableFunctions, AreWithinOneUnitInTheLastPlace) {
  const auto sine = [](long double x) { return std::sin(x); };
  const auto cosine = [](long double x) { return std::cos(x); };
  const auto power = [](long double x) { return std::exp(x); };
  const auto less = [](long double x) { return std::expm1(x); };
  const auto log = [](long double x) { return std::log(x); };
  const auto more = [](long double x) { return std::log1p(x); };
  for (const double range : {1.0, 10.0, 99'999.0}) {
    EXPECT_LT(LargestError(Sin, sine, Times(range)), 1);
    EXPECT_LT(LargestError(Cos, cosine, Times(range)), 1);
  }
  for (const double range : {1e-6, 1.0, 40.0, 700.0}) {
    EXPECT_LT(LargestError(Exp, power, Times(range)), 1);
    EXPECT_LT(LargestError(Expm1, less, Times(range)), 1);
  }
  EXPECT_LT(LargestError(Log, log, AllPositive), 1);
  EXPECT_LT(LargestError(Log, log, [](double x) { return 1 + 0.9 * x; }), 1);
  EXPECT_LT(LargestError(Log1p, more, AllPositive), 1);
  for (const double range : {1e-9, 1e-3, 0.999})
    EXPECT_LT(LargestError(Log1p, more, Times(range)), 1);
}

TEST(PortableFunctions, ThoseOfLanesHaveTheBitsOfTheOthersWhereTheyAreFor) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 100'000; ++i) {
    const double part = static_cast<double>(random() >> 11U) * 0x1p-53;
    EXPECT_EQ(ExpBelowZero(-708 * part), Exp(-708 * part));
    EXPECT_EQ(ExpBelowZero(-part), Exp(-part));
    EXPECT_EQ(Expm1BelowOne(part), Expm1(part));
    EXPECT_EQ(Log1pBelowOne(part), Log1p(part));
    const double small = Exp(-36 * part);
    EXPECT_EQ(Expm1BelowOne(small), Expm1(small));
    EXPECT_EQ(Log1pBelowOne(small), Log1p(small));
  }
  for (const double end : {0.0, 1.0, 0.5 * std::numbers::ln2, std::numbers::sqrt2 - 1}) {
    EXPECT_EQ(ExpBelowZero(-end), Exp(-end));
    EXPECT_EQ(Expm1BelowOne(end), Expm1(end));
    EXPECT_EQ(Log1pBelowOne(end), Log1p(end));
  }
}

TEST(PortableFunctions, TheAngleOfAVectorIsWithinOneAndAHalf) {
  for (const double x : {1.0, -1.0, 0.7, -1e-3, 0.0}) {
    for (const double range : {1e-3, 3.0, 1e6}) {
      EXPECT_LT(
          LargestError([x](double y) { return Atan2(y, x); },
                       [x](long double y) { return std::atan2(y, static_cast<long double>(x)); },
                       Times(range)),
          1.5)
          << x << ' ' << range;
    }
  }
}

TEST(PortableFunctions, HaveTheValuesAtTheEndsThatTheLibraryHas) {
  EXPECT_EQ(Exp(0), 1);
  EXPECT_EQ(Exp(710), kInfinity);
  EXPECT_EQ(Exp(-kInfinity), 0);
  EXPECT_EQ(Exp(-745), std::exp(-745)) << "the smallest number";
  EXPECT_TRUE(std::isnan(Exp(kNaN)));
  EXPECT_EQ(Expm1(0), 0);
  EXPECT_EQ(Expm1(kInfinity), kInfinity);
  EXPECT_EQ(Expm1(-kInfinity), -1);
  EXPECT_TRUE(std::isnan(Expm1(kNaN)));
  EXPECT_EQ(Log(1), 0);
  EXPECT_EQ(Log(0), -kInfinity);
  EXPECT_EQ(Log(kInfinity), kInfinity);
  EXPECT_NEAR(Log(5e-324), std::log(5e-324), 1e-12);
  EXPECT_TRUE(std::isnan(Log(-1)));
  EXPECT_TRUE(std::isnan(Log(kNaN)));
  EXPECT_EQ(Log1p(-1), -kInfinity);
  EXPECT_EQ(Log1p(kInfinity), kInfinity);
  EXPECT_TRUE(std::isnan(Log1p(-1.5)));
  EXPECT_TRUE(std::isnan(Log1p(kNaN)));
  for (const double y : {0.0, -0.0, 1.0, -1.0, kInfinity, -kInfinity}) {
    for (const double x : {0.0, -0.0, 1.0, -1.0, kInfinity, -kInfinity}) {
      EXPECT_DOUBLE_EQ(Atan2(y, x), std::atan2(y, x)) << y << ' ' << x;
      EXPECT_EQ(std::signbit(Atan2(y, x)), std::signbit(y));
    }
  }
  EXPECT_TRUE(std::isnan(Atan2(kNaN, 1)));
  EXPECT_TRUE(std::isnan(Atan2(1, kNaN)));
  EXPECT_EQ(Sin(0), 0);
  EXPECT_EQ(Cos(0), 1);
  for (const double none : {kInfinity, -kInfinity, kNaN}) {
    EXPECT_TRUE(std::isnan(Sin(none)));
    EXPECT_TRUE(std::isnan(Cos(none)));
  }
  for (const double x : {1e5, 3e7, -1e12}) {
    EXPECT_NEAR(Sin(x), std::sin(x), 1e-16 * std::abs(x) + 1e-15);
    EXPECT_NEAR(Cos(x), std::cos(x), 1e-16 * std::abs(x) + 1e-15);
  }
  EXPECT_DOUBLE_EQ(Power(2, 0.5), std::numbers::sqrt2);
  EXPECT_EQ(Power(0, -0.2), kInfinity);
  EXPECT_EQ(Power(0, 0.5), 0);
  EXPECT_EQ(Length(3, -4), 5);
}

TEST(PortableFunctions, OfAMillionArgumentsHaveTheBitsThatTheyHaveEverywhere) {
  EXPECT_EQ(HashOfFunctions(), kHashOfFunctions);
}

}  // namespace
}  // namespace tumbler::portable
