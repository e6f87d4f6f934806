// What is known of one robot: its quantities, the robot that they make, and the file.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "common/files/toml_reader.h"
#include "offline/problem/posterior_toml.h"
#include "offline/problem/task_toml.h"
#include "tests/support/docs_tables.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

const Scene& HandstandScene() {
  static const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  return task.problem.scene;
}

/// A posterior of the handstand's robot that is not its prior.
PosteriorFile SomePosterior() {
  PosteriorFile file;
  file.posterior = PriorOf(HandstandScene());
  const std::size_t n = file.posterior.size();
  for (std::size_t i = 0; i < n; ++i)
    file.prior_deviations.push_back(file.posterior.DeviationOf(i));
  file.posterior.mean = file.posterior.Draw(1, 3, 4);
  for (std::size_t i = 0; i < n; ++i) {
    if (file.posterior.quantities[i].kind == RobotQuantity::Kind::kDry)
      file.posterior.mean[i] = std::abs(file.posterior.mean[i]);
  }
  file.posterior.covariance[1] = file.posterior.covariance[n] = 0.3 * file.posterior.covariance[0];
  file.chi = 0.1 + 0.2;
  file.chi_max = 1;
  file.weighed = true;
  file.records = {"a \"b\".rec"};
  return file;
}

TEST(Posterior, ARobotHasTheQuantitiesOfItsCoordinates) {
  using Kind = RobotQuantity::Kind;
  const Scene& scene = HandstandScene();
  const RobotPosterior prior = PriorOf(scene);
  for (std::uint64_t index = 0; index < 20; ++index) {
    const std::vector<double> z = prior.Draw(1, 5, index);
    const RobotVariation robot = VariationOf(scene, prior.quantities, z);
    const Scene varied = Varied(scene, robot);
    for (std::size_t i = 0; i < prior.size(); ++i) {
      const RobotQuantity& quantity = prior.quantities[i];
      if (quantity.kind == Kind::kSlope) {
        const Plane::Vector& g = varied.robot.tree.gravity;
        EXPECT_NEAR(std::atan2(-g.x(), -g.y()), z[i], 1e-12);
      } else if (quantity.kind == Kind::kZero) {
        EXPECT_EQ(robot.joints[quantity.of == "leg1" ? 0 : 1].zero_rad, z[i]);
      } else if (quantity.kind == Kind::kViscous) {
        const std::size_t joint = quantity.of == "leg1" ? 0 : 1;
        const double more =
            varied.robot.tree.dofs[varied.robot.DofOfJoint(joint)].damping_nm_s_per_rad;
        EXPECT_NEAR(kUsualViscousFriction_nm_s_per_rad + more, std::exp(z[i]), 1e-12);
      } else if (quantity.kind == Kind::kDry) {
        EXPECT_NEAR(CoordinateIn(varied, quantity), std::max(0.0, z[i]), 1e-12);
      } else {
        EXPECT_NEAR(CoordinateIn(varied, quantity), z[i], 1e-9) << NameOf(quantity);
      }
    }
  }
}

TEST(Posterior, ALengthLeavesTheCentreOfMassWhereItsOwnQuantityHasIt) {
  using Kind = RobotQuantity::Kind;
  const Scene& scene = HandstandScene();
  const RobotQuantity centre{Kind::kMassCentre, "leg1_link"};
  const double was = CoordinateIn(scene, centre);
  const std::vector<RobotQuantity> quantities = {{Kind::kLength, "leg1_link"}, centre};
  const RobotVariation robot =
      VariationOf(scene, quantities, std::vector<double>{std::log(1.02), was + 1e-3});
  EXPECT_NEAR(CoordinateIn(Varied(scene, robot), centre), was + 1e-3, 1e-12);
  EXPECT_EQ(robot.links[0].length, 1);
  EXPECT_NEAR(robot.links[1].length, 1.02, 1e-12);
}

TEST(Posterior, DrawsHaveItsMeanAndCovariance) {
  RobotPosterior two;
  two.quantities = {{RobotQuantity::Kind::kSlope, ""}, {RobotQuantity::Kind::kFriction, ""}};
  two.mean = {1, -2};
  two.covariance = {4, 1.5, 1.5, 1};
  double sum[2] = {0, 0}, square[3] = {0, 0, 0};
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    const std::vector<double> z = two.Draw(1, 9, static_cast<std::uint64_t>(i));
    const double a = z[0] - 1, b = z[1] + 2;
    sum[0] += a;
    sum[1] += b;
    square[0] += a * a;
    square[1] += a * b;
    square[2] += b * b;
  }
  EXPECT_NEAR(sum[0] / kDraws, 0, 0.05);
  EXPECT_NEAR(sum[1] / kDraws, 0, 0.03);
  EXPECT_NEAR(square[0] / kDraws, 4, 0.15);
  EXPECT_NEAR(square[1] / kDraws, 1.5, 0.06);
  EXPECT_NEAR(square[2] / kDraws, 1, 0.04);
}

TEST(PosteriorFile, ReadsBackAsItWasWritten) {
  const PosteriorFile file = SomePosterior();
  const PosteriorFile read = ParsePosterior(ToToml(file), "posterior.toml");
  EXPECT_EQ(read.posterior.quantities, file.posterior.quantities);
  EXPECT_EQ(read.posterior.mean, file.posterior.mean);
  EXPECT_EQ(read.posterior.covariance, file.posterior.covariance);
  EXPECT_EQ(read.prior_deviations, file.prior_deviations);
  EXPECT_EQ(read.effective, file.effective);
  EXPECT_EQ(read.chi, file.chi);
  EXPECT_EQ(read.weighed, file.weighed);
  EXPECT_EQ(read.records, file.records);
}

TEST(PosteriorFile, KeepsWhatAFitOfFurtherRecordsNeeds) {
  PosteriorFile file = SomePosterior();
  const std::size_t n = file.posterior.size();
  file.information.centre = file.posterior.mean;
  file.information.centre[3] += 0.1;
  file.information.hessian = file.information.gradient_covariance = file.posterior.covariance;
  file.information.hessian[0] *= 1.0 / 3;
  file.information.gradient_covariance[n * n - 1] *= 1e20;
  file.weight_kg = 1.8;
  file.fingerprints = {"fnv1a64:0"};
  file.drives.rate_hz = 1000;
  file.drives.of_joint = {{"leg1", "mit", 40, 5, -1, 1, 0.1}};
  const PosteriorFile read = ParsePosterior(ToToml(file), "posterior.toml");
  EXPECT_EQ(read.information, file.information);
  EXPECT_EQ(read.weight_kg, file.weight_kg);
  EXPECT_EQ(read.fingerprints, file.fingerprints);
  EXPECT_EQ(read.drives, file.drives);
}

TEST(PosteriorFile, WhatNoRobotHasIsRefusedByLineKeyValueAndRange) {
  const auto message = [](const std::string& quantity) -> std::string {
    try {
      ParsePosterior(
          "format = \"tumbler-posterior\"\nversion = 1\neffective = false\nchi = 1\n"
          "chi_max = 1\nweighed = false\ncovariance = [1e-4]\n[[quantity]]\n" +
              quantity + "\n",
          "p.toml", &HandstandScene());
    } catch (const FileError& error) {
      return error.what();
    }
    return "";
  };
  const std::string mass = "kind = \"mass\"\nprior_deviation = 0.1\n";
  EXPECT_EQ(message(mass + "of = \"middle\"\nmean = 0.1"), "");
  using ::testing::AllOf;
  using ::testing::HasSubstr;
  EXPECT_THAT(message(mass + "of = \"middle\"\nmean = 40"),
              AllOf(HasSubstr("p.toml:12"), HasSubstr("mean"), HasSubstr("40 (of 2.354e+17 kg)"),
                    HasSubstr("to 11.5129 (of 1e+05 kg)")));
  EXPECT_THAT(message(mass + "mean = 0"), AllOf(HasSubstr("of"), HasSubstr("is missing")));
  EXPECT_THAT(message(mass + "of = \"arm\"\nmean = 0"),
              AllOf(HasSubstr("p.toml:11"), HasSubstr("'arm'"), HasSubstr("middle, leg1_link")));
  EXPECT_THAT(message("kind = \"friction\"\nof = \"leg1\"\nprior_deviation = 1\nmean = 0"),
              HasSubstr("leave the key out"));
  EXPECT_THAT(message("kind = \"dry_friction\"\nof = \"leg1\"\nprior_deviation = 1\nmean = -0.1"),
              AllOf(HasSubstr("mean"), HasSubstr("-0.1"), HasSubstr("0 to 5")));
  EXPECT_THAT(message("kind = \"zero\"\nof = \"leg1\"\nprior_deviation = 99\nmean = 0"),
              AllOf(HasSubstr("prior_deviation"), HasSubstr("99"), HasSubstr("to 6.4")));
  EXPECT_NE(message("kind = \"zero\"\nof = \"leg1\"\nprior_deviation = 0\nmean = 0"), "");
  EXPECT_NE(message("kind = \"zero\"\nof = \"leg1\"\nprior_deviation = 1\nmean = nan"), "");
}

TEST(PosteriorFile, AnEffectiveModelSaysSo) {
  PosteriorFile file = SomePosterior();
  EXPECT_EQ(ToToml(file).find("EFFECTIVE"), std::string::npos);
  file.effective = true;
  const std::string text = ToToml(file);
  EXPECT_NE(text.find("EFFECTIVE"), std::string::npos);
  EXPECT_TRUE(ParsePosterior(text, "posterior.toml").effective);
}

TEST(PosteriorFile, AModelThatDoesNotExplainItsRecordsIsNotBelievedToBeOneThatDoes) {
  PosteriorFile file = SomePosterior();
  file.chi = 1.01 * file.chi_max;
  const std::string text = ToToml(file);
  try {
    ParsePosterior(text, "p.toml");
    FAIL() << "chi is above its limit";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), ::testing::AllOf(::testing::HasSubstr("p.toml:4: effective"),
                                               ::testing::HasSubstr("chi is 1.01")));
  }
  file.effective = true;
  EXPECT_NO_THROW(ParsePosterior(ToToml(file), "p.toml"));
  // One that is not to be trusted for other reasons may explain them.
  file.chi = 0.5;
  EXPECT_NO_THROW(ParsePosterior(ToToml(file), "p.toml"));
  // Without a limit nothing is above it.
  file.effective = false;
  file.chi = 7;
  file.chi_max = 0;
  EXPECT_NO_THROW(ParsePosterior(ToToml(file), "p.toml"));
  const std::string none = testing::Replaced(text, "chi_max = 1.0\n", "");
  EXPECT_NE(none, text);
  EXPECT_EQ(ParsePosterior(none, "p.toml").chi_max, 0);
}

TEST(PosteriorFile, ACovarianceThatIsNoneIsRefused) {
  const std::string start =
      "format = \"tumbler-posterior\"\nversion = 1\neffective = false\nchi = 1\n"
      "chi_max = 1\nweighed = false\n";
  const std::string two =
      "[[quantity]]\nkind = \"slope\"\nmean = 0\nprior_deviation = 1\n"
      "[[quantity]]\nkind = \"friction\"\nmean = 0\nprior_deviation = 1\n";
  const auto message = [&](const std::string& covariance) -> std::string {
    try {
      ParsePosterior(start + "covariance = " + covariance + "\n" + two, "p.toml");
    } catch (const FileError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message("[1, 0, 0, 1]"), "");
  EXPECT_NE(message("[1, 2, 2, 1]").find("positive"), std::string::npos);
  EXPECT_NE(message("[1, 0.5, 0.4, 1]").find("symmetric"), std::string::npos);
  EXPECT_NE(message("[1, 0, 1]").find("covariance"), std::string::npos);
}

TEST(PosteriorFile, TheTablesOfTheDocumentAreThoseOfTheReader) {
  testing::ExpectTables("docs/formats.md", PosteriorKeyTables());
}

}  // namespace
}  // namespace tumbler
