#include "offline/scene/stepper.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "offline/scene/even_steps.h"
#include "offline/scene/integrator.h"

namespace tumbler {
namespace {

using State = MechanicalState<2>;

/// The start of two pendulums of 1 rad/s and 2 rad/s, without friction: q = cos(w t).
constexpr State kStart = {1, 1, 0, 0};
bool Slope(int /*stage*/, const State& y, double* k) {
  k[0] = y[2];
  k[1] = y[3];
  k[2] = -y[0];
  k[3] = -4 * y[1];
  return true;
}

/// The error of the pendulums after 1 s of equal steps.
template <class Step>
double ErrorOf(int steps, Step&& step) {
  State y = kStart;
  for (int i = 0; i < steps; ++i) step(y, 1.0 / steps);
  return std::abs(y[0] - std::cos(1)) + std::abs(y[1] - std::cos(2)) +
         std::abs(y[2] + std::sin(1)) + std::abs(y[3] + 2 * std::sin(2));
}

/// The number of powers of two by which the error shrinks when the step is halved.
template <class Step>
double OrderOf(Step&& step) {
  return std::log2(ErrorOf(64, step) / ErrorOf(128, step));
}

TEST(Stepper, SchemesHaveTheOrdersThatTheyPromise) {
  EXPECT_NEAR(OrderOf([](State& y, double h) { StepRungeKutta<kClassical>(y, 4, h, Slope); }), 4,
              0.1);
  EXPECT_NEAR(OrderOf([](State& y, double h) { StepRungeKutta<kMidpoint>(y, 4, h, Slope); }), 2,
              0.1);
  EXPECT_NEAR(OrderOf([](State& y, double h) { StepSemiImplicitEuler(y, 2, h, Slope); }), 1, 0.1);
}

TEST(Stepper, StagesAreAskedForInOrderAndTheFirstIsTheStateItself) {
  State y = kStart;
  std::vector<int> stages;
  StepRungeKutta<kClassical>(y, 4, 0.1, [&](int s, const State& y_s, double* k) {
    if (s == 0) {
      EXPECT_EQ(y_s, kStart);
    }
    stages.push_back(s);
    return Slope(s, y_s, k);
  });
  EXPECT_EQ(stages, (std::vector<int>{0, 1, 2, 3}));
}

TEST(Stepper, DormandAndPrincesStepIsOfOrderFive) {
  const auto error_of = [](double h) {
    State y = {1, 0};  // a pendulum
    StepRungeKutta<kDormandPrince>(y, 2, h, [](int, const State& y_s, double* k) {
      k[0] = y_s[1];
      k[1] = -y_s[0];
      return true;
    });
    return std::abs(y[0] - std::cos(h)) + std::abs(y[1] + std::sin(h));
  };
  // The error of one step falls with its sixth power.
  EXPECT_NEAR(error_of(0.2) / error_of(0.1), 64, 8);
}

TEST(Stepper, AStepThatIsGivenUpLeavesTheStateAsItWas) {
  for (const int at : {0, 2}) {
    State y = kStart;
    EXPECT_FALSE(StepRungeKutta<kClassical>(y, 4, 0.1, [&](int s, const State& y_s, double* k) {
      return Slope(s, y_s, k) && s != at;
    }));
    EXPECT_EQ(y, kStart);
  }
  State y = kStart;
  EXPECT_FALSE(StepSemiImplicitEuler(y, 2, 0.1, [](int, const State&, double*) { return false; }));
  EXPECT_EQ(y, kStart);
}

TEST(Stepper, WhatIsBeyondTheCoordinatesIsNotTouched) {
  State y = {1, 0, 7, 8};  // one coordinate: q, v, and two numbers that do not belong to it
  StepRungeKutta<kClassical>(y, 2, 0.1, [](int, const State& y_s, double* k) {
    k[0] = y_s[1];
    k[1] = -y_s[0];
    return true;
  });
  EXPECT_NEAR(y[0], std::cos(0.1), 1e-6);
  EXPECT_EQ(y[2], 7);
  EXPECT_EQ(y[3], 8);
}

TEST(Stepper, NumericalAirSlowsDown) {
  State y = {0, 0, 1, 0};
  const auto coast = [](int, const State&, double* k) {
    k[2] = k[3] = 0;
    return true;
  };
  for (int i = 0; i < 1000; ++i) StepSemiImplicitEuler(y, 2, 1e-3, coast, 5);
  EXPECT_NEAR(y[2], std::exp(-5), 1e-4);
}

TEST(EvenSteps, AreAsLongAsAllowedAndEndWithTheSpan) {
  EXPECT_EQ(EvenSteps(1, 0.3).count, 4);
  EXPECT_EQ(EvenSteps(1, 0.3).step_s, 0.25);
  EXPECT_EQ(EvenSteps(0.3, 0.1).count, 3) << "0.3 / 0.1 is above 3 by rounding";
  EXPECT_EQ(EvenSteps(0, 0.1).count, 0);
  EXPECT_EQ(EvenSteps(0, 0.1).step_s, 0.1);
  EXPECT_EQ(EvenSteps(0.01, 0.1, 1).count, 1);
}

/// The slope of the first pendulum, for an integrator.
void LongSlope(double /*t*/, const std::vector<double>& z, std::vector<double>& out) {
  out = {z[1], -z[0]};
}
std::uint64_t OnePiece(double /*t*/, const std::vector<double>& /*z*/) { return 0; }
double ErrorAfterASecond(const StepSettings& settings, IntegrationStatistics* taken = nullptr) {
  Integrator integrator(settings, 2, 2);
  integrator.state() = {1, 0};
  EXPECT_TRUE(integrator.Integrate(
      0, 1, LongSlope, [] {}, [](const auto&) { return true; }, OnePiece));
  if (taken != nullptr) *taken = integrator.statistics();
  return std::abs(integrator.state()[0] - std::cos(1));
}

TEST(Integrator, ChoosesItsStepsByTheirError) {
  IntegrationStatistics rough, fine;
  EXPECT_LT(ErrorAfterASecond({StepSettings::Scheme::kAdaptive, 1, 1e-4}, &rough), 1e-3);
  EXPECT_LT(ErrorAfterASecond({StepSettings::Scheme::kAdaptive, 1, 1e-12}, &fine), 1e-11);
  EXPECT_LT(rough.steps, fine.steps);
  EXPECT_EQ(fine.forced, 0);
}

TEST(Integrator, FixedStepsAreThoseOfTheStepper) {
  Integrator integrator({StepSettings::Scheme::kFixed, 0.1}, 2, 2);
  integrator.state() = {1, 0};
  int looks = 0;
  integrator.Integrate(
      0, 1, LongSlope, [&] { ++looks; }, [](const auto&) { return true; }, OnePiece);
  State y = kStart;
  for (int i = 0; i < 10; ++i) StepRungeKutta<kClassical>(y, 4, 0.1, Slope);
  EXPECT_NEAR(integrator.state()[0], y[0], 1e-15);
  EXPECT_EQ(looks, 10);
  EXPECT_EQ(integrator.statistics().evaluations, 40);
}

TEST(Integrator, StopsWhereTheStateIsNotPlausible) {
  Integrator integrator({StepSettings::Scheme::kFixed, 0.1}, 2, 2);
  integrator.state() = {1, 0};
  EXPECT_FALSE(integrator.Integrate(
      0, 1, LongSlope, [] {}, [](const auto& z) { return z[0] > 0.9; }, OnePiece));
  EXPECT_EQ(integrator.statistics().steps, 5) << "cos(0.5) is below 0.9";
}

/// A ball of 1 kg that falls onto a spring of 1 N/m from 1 m above it: z = (height, velocity).
/// It meets the spring at the time sqrt(2), with the speed sqrt(2), and is there for
/// pi + 2 atan(1 / sqrt(2)) s.
IntegrationStatistics BounceOnce(bool tells_pieces, double* error) {
  constexpr double kGravity = 1;
  Integrator integrator({StepSettings::Scheme::kAdaptive, 1, 1e-10}, 2, 2);
  integrator.state() = {1, 0};
  const double in_air = 2 * std::sqrt(2.0),
               on_spring = std::numbers::pi + 2 * std::atan(1 / std::sqrt(2.0));
  const auto slope = [](double, const std::vector<double>& z, std::vector<double>& out) {
    out = {z[1], -kGravity + std::max(0.0, -z[0])};
  };
  const auto pieces = [&](double, const std::vector<double>& z) {
    return std::uint64_t{tells_pieces && z[0] < 0 ? 1U : 0U};
  };
  EXPECT_TRUE(integrator.Integrate(
      0, in_air + on_spring, slope, [] {}, [](const auto&) { return true; }, pieces));
  *error = std::abs(integrator.state()[0] - 1) + std::abs(integrator.state()[1]);
  return integrator.statistics();
}

TEST(Integrator, StepsEndOnTheKinksThatItIsToldOf) {
  double error = 0, error_blind = 0;
  const IntegrationStatistics told = BounceOnce(true, &error),
                              blind = BounceOnce(false, &error_blind);
  EXPECT_LT(error, 1e-8);
  EXPECT_LT(error_blind, 1e-7);
  EXPECT_GE(told.kinks, 2) << "onto the spring, and off it";
  EXPECT_GT(told.looks, 20 * told.kinks);
  EXPECT_EQ(blind.kinks, 0);
  EXPECT_LT(told.rejected, blind.rejected / 2);
  EXPECT_LT(1.25 * static_cast<double>(told.evaluations), static_cast<double>(blind.evaluations));
}

TEST(Integrator, AKinkWhereTheSpanBeginsOrEndsDoesNotHoldItUp) {
  for (const double kink : {0.0, 1e-9, 0.5, 1 - 1e-9, 1.0}) {
    Integrator integrator({StepSettings::Scheme::kAdaptive, 1, 1e-12}, 1, 1);
    integrator.state() = {0};
    EXPECT_TRUE(integrator.Integrate(
        0, 1,
        [&](double t, const std::vector<double>&, std::vector<double>& out) {
          out = {std::abs(t - kink)};
        },
        [] {}, [](const auto&) { return true; },
        [&](double t, const std::vector<double>&) { return std::uint64_t{t < kink ? 1U : 0U}; }));
    EXPECT_NEAR(integrator.state()[0], 0.5 * (kink * kink + (1 - kink) * (1 - kink)), 1e-9);
    EXPECT_LT(integrator.statistics().evaluations, 400);
  }
}

}  // namespace
}  // namespace tumbler
