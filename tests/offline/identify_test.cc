// From records to a robot. Hidden robots are played by the executor over a simulated bus, with
// drives, quantisation and the twin's physics, none of which the fit shares.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <map>

#include "common/files/program.h"
#include "common/files/result_file.h"
#include "firmware_interface/devices/drives_toml.h"
#include "offline/certify/task_result.h"
#include "offline/problem/posterior_toml.h"
#include "offline/solve/guess.h"
#include "offline/solve/robot_loss.h"
#include "offline/studies/excitation.h"
#include "offline/studies/gate.h"
#include "offline/studies/identified_drives.h"
#include "offline/studies/identified_model.h"
#include "offline/studies/identify_page.h"
#include "offline/studies/robot_fit.h"
#include "tests/support/files.h"
#include "tests/support/hidden_robot.h"
#include "tests/support/identification.h"

namespace tumbler {
namespace {

/// The drives of all runs.
const std::string kDrives = testing::SourcePath("primitives/robots/tumbler_drives.toml");

/// @param generations  of the search for better ones; 0: they are only drawn.
const std::vector<testing::HiddenRuns>& Excitations(int generations = 0) {
  static std::map<int, std::vector<testing::HiddenRuns>> known;
  std::vector<testing::HiddenRuns>& runs = known[generations];
  if (runs.empty()) {
    for (const std::string& file : testing::ExcitationFiles(generations))
      runs.emplace_back(file, kDrives);
  }
  return runs;
}

std::vector<RecordedMotion> RecordsOf(const testing::HiddenRobot& robot, int generations = 0) {
  return testing::RecordsOf(Excitations(generations), robot);
}

/// Of excitations that tell zeros and lags, as those of the guide do.
constexpr int kSearched = 6;

double MeanOf(const FitOutcome& fit, RobotQuantity::Kind kind, const std::string& of = "") {
  for (std::size_t i = 0; i < fit.posterior.size(); ++i) {
    if (fit.posterior.quantities[i] == RobotQuantity{kind, of}) return fit.posterior.mean[i];
  }
  ADD_FAILURE() << "there is no such quantity";
  return 0;
}

using Kind = RobotQuantity::Kind;

PosteriorFile FileOf(const RobotPosterior& posterior) {
  PosteriorFile file;
  file.posterior = posterior;
  file.prior_deviations.assign(posterior.size(), 1);
  return file;
}

TEST(HiddenRobot, IsToldByTwoExcitations) {
  const Scene& scene = Excitations().front().scene();
  const testing::HiddenRobot robot = testing::DrawHiddenRobot(scene, 11, 2);
  const std::vector<RecordedMotion> records = RecordsOf(robot, kSearched);
  const FitOutcome fit = FitRobot(records, PriorOfRecords(records, false), {});
  EXPECT_FALSE(fit.effective) << fit.chi;
  const Scene varied = Varied(scene, robot.variation);
  for (const char* link : {"middle", "leg1_link", "leg2_link"}) {
    EXPECT_NEAR(MeanOf(fit, Kind::kMass, link), CoordinateIn(varied, {Kind::kMass, link}), 0.06)
        << link;
  }
  EXPECT_NEAR(MeanOf(fit, Kind::kFriction), CoordinateIn(varied, {Kind::kFriction, ""}), 0.02);
  EXPECT_NEAR(MeanOf(fit, Kind::kStiffness), CoordinateIn(varied, {Kind::kStiffness, ""}), 0.08);
  EXPECT_NEAR(MeanOf(fit, Kind::kSlope), robot.variation.slope_rad, 1e-3);
  EXPECT_NEAR(MeanOf(fit, Kind::kZero, "leg1"), robot.variation.joints[0].zero_rad, 1e-3);
  EXPECT_LT(MeanOf(fit, Kind::kVelocityLag), 2e-4);
  // The page is whole, and names what cannot be known.
  const std::string page = IdentifyPage(fit, {}, {});
  EXPECT_NE(page.find("not identifiable"), std::string::npos);
  EXPECT_NE(page.find("was not weighed"), std::string::npos);
  EXPECT_EQ(page.find("http"), std::string::npos);
  EXPECT_NE(page.find("</html>"), std::string::npos);
}

TEST(HiddenRobot, IsToldByAMotionThatLeadsAstrayWhoKnowsNothingOfTheRobot) {
  const testing::HiddenRobot robot = testing::DrawHiddenRobot(Excitations().front().scene(), 11, 4);
  std::vector<RecordedMotion> records = RecordsOf(robot, kSearched);
  const testing::TemporaryFolder folder;
  const testing::HiddenRuns sway(testing::SourcePath("tests/data/identify/wild_sway.toml"),
                                 kDrives);
  ASSERT_TRUE(sway.Record(robot, folder / "sway.rec"));
  records.push_back(ReadRecordedMotion(folder / "sway.rec"));
  FitSettings settings;
  settings.starts = 1;
  const FitOutcome fit = FitRobot(records, PriorOfRecords(records, false), settings);
  EXPECT_FALSE(fit.effective) << fit.chi;
  EXPECT_EQ(fit.starts, 2) << "begun with all records at once it is found, too";
  const Scene varied = Varied(Excitations().front().scene(), robot.variation);
  EXPECT_NEAR(MeanOf(fit, Kind::kMass, "middle"), CoordinateIn(varied, {Kind::kMass, "middle"}),
              0.04);
}

TEST(Identify, AWeightTellsTheTorqueConstant) {
  const Scene& scene = Excitations().front().scene();
  testing::HiddenRobot robot = testing::DrawHiddenRobot(scene, 11, 3);
  robot.torque_factor = 1.03;
  const std::vector<RecordedMotion> records = RecordsOf(robot);
  FitSettings settings;
  const Scene varied = Varied(scene, robot.variation);
  for (const auto& dof : varied.robot.tree.dofs) settings.weight_kg += dof.mass_kg;
  const FitOutcome fit = FitRobot(records, PriorOfRecords(records, true), settings);
  EXPECT_FALSE(fit.effective);
  EXPECT_NEAR(MeanOf(fit, Kind::kTorque), std::log(1.03), 0.012);
  // Without a weight nothing tells: masses come out smaller by as much, and the fit is as good.
  const FitOutcome believed = FitRobot(records, PriorOfRecords(records, false), {});
  EXPECT_FALSE(believed.effective);
  EXPECT_NEAR(MeanOf(believed, Kind::kMass, "middle") - MeanOf(fit, Kind::kMass, "middle"),
              -std::log(1.03), 0.015);
}

TEST(Identify, AVelocityFilterIsFound) {
  testing::HiddenRobot robot = testing::DrawHiddenRobot(Excitations().front().scene(), 11, 4);
  robot.velocity_filter_s = 3e-3;
  const std::vector<RecordedMotion> records = RecordsOf(robot);
  const FitOutcome fit = FitRobot(records, PriorOfRecords(records, false), {});
  EXPECT_FALSE(fit.effective) << fit.chi;
  EXPECT_NEAR(MeanOf(fit, Kind::kVelocityLag), 3e-3, 2e-4);
}

TEST(Identify, ALagOfTheCurrentLoopIsFound) {
  for (const double lag_s : {0.3e-3, 0.8e-3}) {
    testing::HiddenRobot robot = testing::DrawHiddenRobot(Excitations().front().scene(), 11, 6);
    robot.torque_lag_s = lag_s;
    const std::vector<RecordedMotion> records = RecordsOf(robot, kSearched);
    const FitOutcome fit = FitRobot(records, PriorOfRecords(records, false), {});
    EXPECT_FALSE(fit.effective) << fit.chi;
    EXPECT_NEAR(MeanOf(fit, Kind::kTorqueLag), lag_s, 0.1e-3);
  }
}

TEST(HiddenRobot, HasLengthsThatAreKnownToBeUncertain) {
  const Scene& scene = Excitations().front().scene();
  testing::HiddenRobot robot = testing::DrawHiddenRobot(scene, 11, 8);
  robot.variation.links[0].length = 1.01;
  robot.variation.links[1].length = 0.99;
  const std::vector<RecordedMotion> records = RecordsOf(robot);
  const FitOutcome fit = FitRobot(records, PriorOfRecords(records, false), {});
  EXPECT_FALSE(fit.effective) << fit.chi;
  for (std::size_t i = 0; i < fit.posterior.size(); ++i) {
    const RobotQuantity& quantity = fit.posterior.quantities[i];
    if (quantity.kind != Kind::kZero && quantity.kind != Kind::kLength) continue;
    const double truth = quantity.kind == Kind::kZero
                             ? robot.variation.joints[quantity.of == "leg1" ? 0 : 1].zero_rad
                         : quantity.of == "middle"    ? std::log(1.01)
                         : quantity.of == "leg1_link" ? std::log(0.99)
                                                      : 0;
    EXPECT_NEAR(fit.posterior.mean[i], truth, 3 * fit.posterior.DeviationOf(i)) << NameOf(quantity);
  }
}

TEST(HiddenRobot, IsWithinItsIntervalsWhereARecordBendsWithWhatItDependsOn) {
  // The sway turns robots by 0.34 rad: a foot that lifts a little earlier changes what follows.
  const Scene& scene = Excitations().front().scene();
  const testing::TemporaryFolder folder;
  const testing::HiddenRuns sway(testing::SourcePath("tests/data/identify/wild_sway.toml"),
                                 kDrives);
  for (const std::uint64_t number : {0U, 6U}) {
    const testing::HiddenRobot robot = testing::DrawHiddenRobot(scene, 11, number);
    std::vector<RecordedMotion> records = RecordsOf(robot, kSearched);
    const std::string file = folder / (std::to_string(number) + ".rec");
    ASSERT_TRUE(sway.Record(robot, file));
    records.push_back(ReadRecordedMotion(file));
    FitSettings settings;
    settings.starts = 1;
    const FitOutcome fit = FitRobot(records, PriorOfRecords(records, false), settings);
    EXPECT_FALSE(fit.effective) << fit.chi;
    const Scene varied = Varied(scene, robot.variation);
    for (std::size_t i = 0; i < fit.posterior.size(); ++i) {
      const RobotQuantity& quantity = fit.posterior.quantities[i];
      if (quantity.kind != Kind::kMass && quantity.kind != Kind::kMassCentre) continue;
      EXPECT_NEAR(fit.posterior.mean[i], CoordinateIn(varied, quantity),
                  3 * fit.posterior.DeviationOf(i))
          << number << ": " << NameOf(quantity);
    }
  }
}

TEST(HiddenRobot, IsWithinItsIntervalsWhetherItWasSetDownByItsEncodersOrInTruth) {
  // Feet that creep slowly rest where they were put: where joints were then, no reading tells.
  const Scene& scene = Excitations().front().scene();
  for (const bool by_encoders : {false, true}) {
    testing::HiddenRobot robot = testing::DrawHiddenRobot(scene, 11, 3);
    robot.variation.joints[0].zero_rad = 12e-3;
    robot.variation.joints[1].zero_rad = -15e-3;
    robot.variation.creep_speed = 0.3;
    robot.by_encoders = by_encoders;
    const std::vector<RecordedMotion> records = RecordsOf(robot);
    FitSettings settings;
    settings.starts = 1;
    const FitOutcome fit = FitRobot(records, PriorOfRecords(records, false), settings);
    EXPECT_FALSE(fit.effective) << fit.chi;
    const Scene varied = Varied(scene, robot.variation);
    for (std::size_t i = 0; i < fit.posterior.size(); ++i) {
      const RobotQuantity& quantity = fit.posterior.quantities[i];
      const auto is = [&](auto... kinds) { return ((quantity.kind == kinds) || ...); };
      if (!is(Kind::kMass, Kind::kFriction, Kind::kStiffness, Kind::kZero, Kind::kLength)) continue;
      const double truth = is(Kind::kLength) ? 0
                           : is(Kind::kZero)
                               ? robot.variation.joints[quantity.of == "leg1" ? 0 : 1].zero_rad
                               : CoordinateIn(varied, quantity);
      EXPECT_NEAR(fit.posterior.mean[i], truth, 3 * fit.posterior.DeviationOf(i))
          << NameOf(quantity) << (by_encoders ? ", by encoders" : ", in truth");
    }
  }
}

TEST(HiddenRobot, IsToldByAHostThatIsLateByHalfAPeriod) {
  // The last reply to a tick's setpoints comes after the next tick.
  testing::HiddenRobot robot = testing::DrawHiddenRobot(Excitations().front().scene(), 11, 2);
  robot.variation.delay_s = 0.56e-3;
  const std::vector<RecordedMotion> records = RecordsOf(robot);
  EXPECT_NEAR(records.front().late_s, 0.56e-3, 1e-5);
  FitSettings settings;
  settings.starts = 1;
  const FitOutcome fit = FitRobot(records, PriorOfRecords(records, false), settings);
  EXPECT_FALSE(fit.effective) << fit.chi;
}

TEST(Excitation, IsBetterWhereItIsSearchedForAndKnowsWhatAnotherTells) {
  const testing::TemporaryFolder folder;
  const std::string task = testing::SourcePath("primitives/tasks/stand.toml");
  ExcitationSettings settings;
  settings.candidates = 4;
  settings.generations = 0;
  settings.robots = 8;
  const auto friction = [](const Excitation& found) {
    for (std::size_t i = 0; i < found.quantities.size(); ++i)
      if (found.quantities[i].kind == Kind::kFriction) return found.deviations[i];
    ADD_FAILURE() << "its friction is not told";
    return 0.0;
  };
  const Excitation drawn = MakeExcitation(task, settings);
  ASSERT_TRUE(drawn.file) << drawn.cause;
  settings.generations = 2;
  const Excitation searched = MakeExcitation(task, settings);
  ASSERT_TRUE(searched.file) << searched.cause;
  EXPECT_GT(searched.tried, drawn.tried);
  EXPECT_LT(searched.criterion, drawn.criterion);
  const std::string first = folder / "first.toml";
  PendingFile(first, ToToml(*drawn.file)).Commit();
  settings.generations = 0;
  settings.after = {first};
  const Excitation second = MakeExcitation(task, settings);
  ASSERT_TRUE(second.file) << second.cause;
  EXPECT_LT(friction(second), friction(drawn));
}

TEST(Identify, RecordsOneAfterTheOtherTellWhatTheyTellTogether) {
  const std::vector<RecordedMotion> records =
      RecordsOf(testing::DrawHiddenRobot(Excitations().front().scene(), 11, 7));
  const FitPrior prior = PriorOfRecords(records, false);
  const FitOutcome together = FitRobot(records, prior, {});
  const FitOutcome first = FitRobot(std::span(records).first(1), prior, {});
  FitPrior earlier{first.posterior, first.information, first.first_deviations};
  const FitOutcome then = FitRobot(std::span(records).last(1), earlier, {});
  double squares = 0;
  const std::size_t n = together.posterior.size();
  for (std::size_t i = 0; i < n; ++i) {
    const std::string name = NameOf(together.posterior.quantities[i]);
    const double deviation = together.posterior.DeviationOf(i);
    const double apart = (then.posterior.mean[i] - together.posterior.mean[i]) / deviation;
    EXPECT_LT(std::abs(apart), 1.96) << name;
    squares += apart * apart;
    EXPECT_NEAR(std::log(then.posterior.DeviationOf(i) / deviation), 0, std::log(1.6)) << name;
    EXPECT_EQ(then.first_deviations[i], together.first_deviations[i]) << name;
  }
  EXPECT_LT(std::sqrt(squares / static_cast<double>(n)), 0.7);
  EXPECT_FALSE(then.strays()) << then.moved;
  // Where the earlier records are said to be of quite another ground, the later one is explained
  // all the same, far from there. Nothing says what the earlier ones are worth then.
  for (std::size_t i = 0; i < n; ++i) {
    if (first.posterior.quantities[i].kind == Kind::kFriction)
      earlier.earlier.centre[i] += 12 / std::sqrt(earlier.earlier.hessian[i * n + i]);
    if (first.posterior.quantities[i].kind == Kind::kStiffness)
      earlier.earlier.centre[i] -= 12 / std::sqrt(earlier.earlier.hessian[i * n + i]);
  }
  const FitOutcome far = FitRobot(std::span(records).last(1), earlier, {});
  EXPECT_GT(far.moved, far.moved_max);
  EXPECT_TRUE(far.effective);
}

TEST(Identify, RepliesOfATickLaterMakeAnEffectiveModel) {
  std::vector<RecordedMotion> records =
      RecordsOf(testing::DrawHiddenRobot(Excitations().front().scene(), 11, 5));
  for (RecordedMotion& record : records) {
    for (std::size_t k = record.ticks.size() - 1; k > 0; --k) {
      for (std::size_t j = 0; j < record.joint_count(); ++j)
        record.ticks[k][j].reading_rad = record.ticks[k - 1][j].reading_rad;
    }
  }
  records.back().rested = false;
  FitSettings settings;
  settings.starts = 1;
  const FitOutcome fit = FitRobot(records, PriorOfRecords(records, false), settings);
  EXPECT_TRUE(fit.effective || MeanOf(fit, Kind::kLag) < -5e-4) << fit.chi;
  // Where a record is not explained whose robot may not have rested, that is said.
  ASSERT_EQ(fit.causes.size(), fit.chi > settings.chi_max ? 1U : 0U);
  if (fit.chi > settings.chi_max) {
    EXPECT_THAT(IdentifyPage(fit, settings, {}),
                ::testing::HasSubstr("does not show that the robot rested"));
  }
}

TEST(Identify, AnEffectiveModelFailsWhereTheRobotDid) {
  std::vector<RecordedMotion> records =
      RecordsOf(testing::DrawHiddenRobot(Excitations().front().scene(), 11, 5));
  records.resize(1);
  for (std::size_t k = 0; k < records[0].ticks.size(); ++k) {  // what no robot does
    for (std::size_t j = 0; j < records[0].joint_count(); ++j)
      records[0].ticks[k][j].reading_rad += 1e-3 * std::sin(0.3 * static_cast<double>(k));
  }
  const FitPrior prior = PriorOfRecords(records, false);
  FitSettings settings;
  settings.starts = 1;
  settings.per_tick = settings.per_tick_rough;
  const FitOutcome any = FitRobot(records, prior, settings);
  ASSERT_TRUE(any.effective) << any.chi;
  // Let robots fail whose friction is less than what was found by a standard deviation.
  const auto friction = static_cast<std::size_t>(
      std::ranges::find(prior.known.quantities, Kind::kFriction, &RobotQuantity::kind) -
      prior.known.quantities.begin());
  const double limit = any.posterior.mean[friction] - any.posterior.DeviationOf(friction);
  settings.fails = [&](const std::vector<double>& z) { return z[friction] < limit; };
  const FitOutcome fit = FitRobot(records, prior, settings);
  EXPECT_LT(fit.posterior.mean[friction], limit);
  EXPECT_LT(fit.chi, 2 * any.chi) << "it explains the record nearly as well";
  // Where no robot does, it is as without.
  settings.fails = [](const std::vector<double>&) { return false; };
  EXPECT_EQ(FitRobot(records, prior, settings).posterior.mean, any.posterior.mean);
}

TEST(Identify, AnInterruptEndsAFitWhereverItComes) {
  std::vector<RecordedMotion> records =
      RecordsOf(testing::DrawHiddenRobot(Excitations().front().scene(), 11, 5));
  for (std::size_t k = 0; k < records[0].ticks.size(); ++k)
    records[0].ticks[k][0].reading_rad += 3e-3 * std::sin(0.3 * static_cast<double>(k));
  records.resize(1);
  const FitPrior prior = PriorOfRecords(records, false);
  std::atomic<bool> interrupt = false;
  FitSettings settings;
  settings.starts = 1;
  settings.per_tick = settings.per_tick_rough = 2;
  // Far from a minimum, so that an effective model is sought in more than one round.
  settings.annealing = {1000};
  settings.iterations = 1;
  settings.interrupt = &interrupt;
  int lines = 0;
  settings.say = [&](const std::string&) { ++lines; };
  ASSERT_TRUE(FitRobot(records, prior, settings).effective);
  const int all = lines;
  for (int last = 0; last < all; ++last) {
    lines = 0;
    interrupt = last == 0;
    settings.say = [&](const std::string&) { interrupt = ++lines >= last; };
    EXPECT_TRUE(FitRobot(records, prior, settings).interrupted) << last << " of " << all;
  }
}

TEST(Identify, ARecordThatIsCutIsUsedAsFarAsItGoes) {
  const testing::TemporaryFolder folder;
  const std::string whole = folder / "whole.rec", cut = folder / "cut.rec";
  const testing::HiddenRuns run(testing::SourcePath("primitives/handstand.toml"), kDrives);
  run.Record(testing::DrawHiddenRobot(run.scene(), 1, 1, 0), whole);
  const std::size_t ticks = ReadRecordedMotion(whole).ticks.size();
  const std::string bytes = testing::ReadFile(whole);
  std::ofstream(cut, std::ios::binary) << bytes.substr(0, bytes.size() / 10);
  const RecordedMotion record = ReadRecordedMotion(cut);
  EXPECT_LT(record.ticks.size(), ticks);
  EXPECT_TRUE(std::ranges::any_of(record.remarks, [](const std::string& remark) {
    return remark.find("is cut in the motion") != std::string::npos;
  }));
}

TEST(Identify, ARecordWithoutMotionIsRefused) {
  const testing::TemporaryFolder folder;
  const std::string file = folder / "stand.rec";
  const testing::HiddenRuns run(testing::SourcePath("primitives/stand.toml"), kDrives);
  run.Record(testing::DrawHiddenRobot(run.scene(), 1, 1, 0), file);
  try {
    ReadRecordedMotion(file);
    FAIL() << "nothing can be learnt of it";
  } catch (const RecordError& error) {
    EXPECT_NE(std::string(error.what()).find("no joint moved"), std::string::npos) << error.what();
  }
}

TEST(Gate, PlaysWhatTheRobotFailedInWithTheZerosWithWhichItFailed) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  PosteriorFile file = FileOf(PriorOf(task.problem.scene));
  for (double& value : file.posterior.covariance) value *= 1e-6;
  for (std::size_t i = 0; i < file.posterior.size(); ++i)
    if (file.posterior.quantities[i].kind == Kind::kZero) file.posterior.mean[i] = 0.05;
  const DrivesConfig drives = LoadDrives(kDrives);
  file.drives = FactsOf(drives);
  const testing::TemporaryFolder folder;
  const std::string corrected = folder / "drives.toml";
  testing::WriteFile(corrected, CorrectedDrives(testing::ReadFile(kDrives), kDrives, drives, file));
  GateSettings settings;
  settings.draws = 1;
  settings.margins = {0, 0};
  const std::string motion = testing::SourcePath("primitives/handstand.toml");
  settings.failed = {motion};
  EXPECT_FALSE(PassGate(motion, kDrives, file, settings).open());
  const GateOutcome outcome = PassGate(motion, corrected, file, settings);
  EXPECT_TRUE(outcome.credible()) << "it failed since its encoders' zeros were wrong";
  EXPECT_TRUE(outcome.open()) << "and stands where they are corrected";
}

TEST(Gate, IsOpenForTheModelAndClosedOnIce) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  PosteriorFile file;
  RobotPosterior& known = file.posterior;
  known = PriorOf(task.problem.scene);
  for (double& value : known.covariance) value *= 1e-4;
  GateSettings settings;
  settings.draws = 1;
  settings.margins = {0, 0};
  EXPECT_TRUE(
      PassGate(testing::SourcePath("primitives/handstand.toml"), kDrives, file, settings).open());
  for (std::size_t i = 0; i < known.size(); ++i)
    if (known.quantities[i].kind == Kind::kFriction) known.mean[i] = std::log(0.04);
  const GateOutcome ice =
      PassGate(testing::SourcePath("primitives/handstand.toml"), kDrives, file, settings);
  EXPECT_FALSE(ice.open());
  EXPECT_EQ(ice.robots.size(), 2U);
}

TEST(Gate, IsClosedWhereTheModelStandsInWhatTheRobotFailedIn) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  PosteriorFile file = FileOf(PriorOf(task.problem.scene));
  for (double& value : file.posterior.covariance) value *= 1e-6;
  const std::string motion = testing::SourcePath("primitives/stand.toml");
  GateSettings settings;
  settings.draws = 1;
  settings.margins = {0, 0};
  settings.failed = {testing::SourcePath("primitives/handstand.toml")};
  const GateOutcome stands = PassGate(motion, kDrives, file, settings);
  EXPECT_FALSE(stands.credible());
  EXPECT_FALSE(stands.open());
  ASSERT_EQ(stands.failed.size(), 1U);
  EXPECT_FALSE(stands.failed[0].mean_fails);
  // On ice it fails in the handstand, too.
  for (std::size_t i = 0; i < file.posterior.size(); ++i) {
    if (file.posterior.quantities[i].kind == RobotQuantity::Kind::kFriction)
      file.posterior.mean[i] = std::log(0.04);
  }
  const GateOutcome falls = PassGate(motion, kDrives, file, settings);
  EXPECT_TRUE(falls.credible());
  EXPECT_TRUE(falls.open());
}

/// The shipped task's model with a ground that is too slippery for the handstand in the mean, and
/// for about half of the robots at two deviations.
PosteriorFile OnSlipperyGround(double friction) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  PosteriorFile file = FileOf(PriorOf(task.problem.scene));
  RobotPosterior& known = file.posterior;
  const std::size_t n = known.size();
  for (double& value : known.covariance) value *= 1e-6;
  for (std::size_t i = 0; i < n; ++i) {
    if (known.quantities[i].kind != RobotQuantity::Kind::kFriction) continue;
    known.mean[i] = std::log(friction);
    known.covariance[i * n + i] = 0.01;
  }
  return file;
}

TEST(Gate, LeavesOutDrawsThatStandWhereTheRobotFailed) {
  GateSettings settings;
  settings.draws = 4;
  settings.margins = {0, 0};
  settings.failed = {testing::SourcePath("primitives/handstand.toml")};
  const GateOutcome outcome = PassGate(testing::SourcePath("primitives/stand.toml"), kDrives,
                                       OnSlipperyGround(0.1), settings);
  EXPECT_TRUE(outcome.failed.at(0).mean_fails);
  EXPECT_GT(outcome.left_out(), 0);
  EXPECT_LE(outcome.left_out(), 4);
  EXPECT_EQ(outcome.robots.size(), 5U);
  EXPECT_TRUE(outcome.open());
}

TEST(Gate, BelievesNoPosteriorOfWhichMostDrawsStandWhereTheRobotFailed) {
  GateSettings settings;
  settings.draws = 1;
  settings.margins = {0, 0};
  settings.failed = {testing::SourcePath("primitives/handstand.toml")};
  // Of so many seeds one draws two robots in a row that stand.
  for (settings.seed = 1; settings.seed <= 20; ++settings.seed) {
    const GateOutcome outcome = PassGate(testing::SourcePath("primitives/stand.toml"), kDrives,
                                         OnSlipperyGround(0.104), settings);
    EXPECT_TRUE(outcome.failed.at(0).mean_fails);
    if (outcome.left_out() < 2) continue;
    EXPECT_EQ(outcome.robots.size(), 1U);
    EXPECT_FALSE(outcome.credible());
    EXPECT_FALSE(outcome.open());
    return;
  }
  FAIL() << "no seed draws such robots";
}

TEST(Gate, StaysClosedWhereAnInterruptLeavesRobotsUnplayed) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  PosteriorFile file = FileOf(PriorOf(task.problem.scene));
  for (double& value : file.posterior.covariance) value *= 1e-6;
  std::atomic<bool> interrupt = true;
  GateSettings settings;
  settings.draws = 0;
  settings.interrupt = &interrupt;
  const std::string motion = testing::SourcePath("primitives/stand.toml");
  const GateOutcome ended = PassGate(motion, kDrives, file, settings);
  EXPECT_TRUE(ended.interrupted);
  EXPECT_TRUE(ended.robots.empty());
  EXPECT_FALSE(ended.open());
  interrupt = false;
  EXPECT_TRUE(PassGate(motion, kDrives, file, settings).open());
}

TEST(Gate, PlaysMoreRobotsOfAnEffectiveModel) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  PosteriorFile file = FileOf(PriorOf(task.problem.scene));
  for (double& value : file.posterior.covariance) value *= 1e-6;
  const std::string motion = testing::SourcePath("primitives/stand.toml");
  EXPECT_EQ(PassGate(motion, kDrives, file, {}).robots.size(), 4U);
  file.effective = true;
  EXPECT_EQ(PassGate(motion, kDrives, file, {}).robots.size(), 13U);
}

TEST(Gate, TakesNoSequenceThatGoesOnForEver) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  EXPECT_THROW(PassGate(testing::SourcePath("primitives/gait.toml"), kDrives,
                        FileOf(PriorOf(task.problem.scene)), GateSettings{}),
               Refused);
}

TEST(Gate, DrawsDifferInWhatNoRecordTells) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  PosteriorFile file = FileOf(PriorOf(task.problem.scene));
  for (double& value : file.posterior.covariance) value *= 1e-6;
  GateSettings settings;
  settings.draws = 1;
  const GateOutcome outcome =
      PassGate(testing::SourcePath("primitives/handstand.toml"), kDrives, file, settings);
  ASSERT_EQ(outcome.robots.size(), 2U);
  EXPECT_EQ(outcome.robots[0].variation.delay_s, 0);
  const RobotVariation& draw = outcome.robots[1].variation;
  EXPECT_GT(std::abs(draw.joints[0].torque_limit - 1), 1e-4);
  EXPECT_GT(draw.delay_s, 0);
}

TEST(IdentifiedModel, TheTaskOfAnIdentifiedRobotHasItsLinksAndGround) {
  const Task given = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  PosteriorFile file;
  file.posterior = PriorOf(given.problem.scene);
  file.posterior.mean = file.posterior.Draw(1, 2, 7);
  file.prior_deviations.assign(file.posterior.size(), 1);
  Task known = IdentifiedTask(given, file);
  EXPECT_EQ(known.robot_change, "as identified") << "which a motion's file says";
  for (std::size_t i = 0; i < file.posterior.size(); ++i) {
    const RobotQuantity& quantity = file.posterior.quantities[i];
    if (quantity.kind > Kind::kCreepSpeed) continue;  // what neither URDF nor task has
    EXPECT_NEAR(CoordinateIn(known.problem.scene, quantity), file.posterior.mean[i], 1e-9)
        << NameOf(quantity);
  }
  TuneTo(file, {}, known);
  const RobotVariation mean =
      DrawRobot(known.problem.scene, known.problem.robust->spreads, 0, 1, 1);
  EXPECT_NEAR(mean.links[0].mass, 1, 1e-9) << "the model is the mean of its robots";
  const RobotVariation draw =
      DrawRobot(known.problem.scene, known.problem.robust->spreads, 2, 1, 1);
  EXPECT_GT(std::abs(draw.joints[0].torque_limit - 1), 1e-4)
      << "its robots differ in what no record tells, as those of the gate";
  EXPECT_GT(draw.delay_s, 0);
}

/// What is known of a robot: the model but for the masses of its legs and its friction, and that
/// well.
PosteriorFile WellKnown(const Task& task, double leg1_kg, double leg2_kg, double mu) {
  PosteriorFile file = FileOf(PriorOf(task.problem.scene));
  RobotPosterior& known = file.posterior;
  for (double& value : known.covariance) value *= 1e-4;
  for (std::size_t i = 0; i < known.size(); ++i) {
    const RobotQuantity& of = known.quantities[i];
    if (of.kind == Kind::kFriction) known.mean[i] = std::log(mu);
    if (of == RobotQuantity{Kind::kMass, "leg1_link"}) known.mean[i] = std::log(leg1_kg);
    if (of == RobotQuantity{Kind::kMass, "leg2_link"}) known.mean[i] = std::log(leg2_kg);
  }
  return file;
}

/// The handstand's task for an identified robot, from a shipped motion.
Task TunedTask(const PosteriorFile& file, const std::string& guess,
               const TuningSettings& settings = {}) {
  Task task =
      IdentifiedTask(LoadTask(testing::SourcePath("primitives/tasks/handstand.toml")), file);
  TuneTo(file, settings, task);
  TakeGuess(task, LoadPrimitive(testing::SourcePath(guess)), guess);
  return task;
}

WorkSettings Quietly() {
  WorkSettings settings;
  settings.quiet = true;
  return settings;
}

TEST(Tuning, EndsAtOnceWhereAllRobotsStandInTheGuess) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  const Task tuned = TunedTask(WellKnown(task, 0.4, 0.4, 0.3), "primitives/handstand.toml");
  const TaskResult result = WorkOn(tuned, Quietly());
  ASSERT_TRUE(result.file) << result.cause;
  EXPECT_THAT(result.file->provenance.robot_file,
              ::testing::EndsWith("tumbler.urdf as identified"));
  EXPECT_EQ(result.best.x, tuned.guess);
  EXPECT_LT(result.outcome.evaluations, 20) << "motions";
}

TEST(Tuning, FindsAMotionThatTheGateLetsThroughWhereItRefusesTheGuess) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  const PosteriorFile file = WellKnown(task, 0.35, 0.46, 0.25);
  const std::string shipped = testing::SourcePath("primitives/handstand.toml");
  EXPECT_FALSE(PassGate(shipped, kDrives, file, {}).open());
  // Of two guesses the first does: the second is not tried.
  const TaskResult result = WorkOnGuesses({TunedTask(file, "primitives/handstand.toml"),
                                           TunedTask(file, "primitives/handstand_wide.toml")},
                                          Quietly());
  ASSERT_TRUE(result.file) << result.cause;
  const testing::TemporaryFolder folder;
  const std::string motion = folder / "handstand.toml";
  PendingFile(motion, ToToml(*result.file)).Commit();
  EXPECT_TRUE(PassGate(motion, kDrives, file, {}).open());
}

TEST(Tuning, LeadsAGuessThatIsFarOff) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/handstand.toml"));
  // On ground on which the guess falls far from the pose, and no small change of it does not.
  const PosteriorFile file = WellKnown(task, 0.4, 0.4, 1.5);
  TuningSettings settings;
  settings.robots = 16;
  Task tuned = TunedTask(file, "primitives/handstand.toml", settings);
  // With this seed one candidate arrives where all others of its generation fall, and is lost
  // again.
  tuned.problem.search.seed = 3;
  const TaskResult result = WorkOn(std::move(tuned), Quietly());
  ASSERT_TRUE(result.file) << result.cause;
  EXPECT_LT(result.outcome.history.back().cost, RobotLoss::kCarried);
  ASSERT_TRUE(result.best.robots);
  EXPECT_GT(2 * result.best.robots->carried, result.best.robots->of);
}

}  // namespace
}  // namespace tumbler
