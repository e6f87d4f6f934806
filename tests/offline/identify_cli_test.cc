// tumbler identify as a user meets it.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_hash.h"
#include "common/files/primitive_toml.h"
#include "common/files/result_file.h"
#include "firmware_interface/devices/drives_toml.h"
#include "offline/problem/posterior_toml.h"
#include "offline/problem/simulated_motion.h"
#include "offline/studies/excitation.h"
#include "offline/studies/identified_model.h"
#include "offline/studies/recorded_motion.h"
#include "runtime/record/flight_record.h"
#include "tests/support/files.h"
#include "tests/support/hidden_robot.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Outcome;
using testing::ReadFile;
using testing::Replaced;
using testing::ReplacedAll;
using testing::SourcePath;
using testing::WriteFile;
namespace fs = std::filesystem;

const std::string kDrivesFile = SourcePath("primitives/robots/tumbler_drives.toml");
const std::string kStand = SourcePath("primitives/stand.toml");

/// A robot's records, and a model that was fitted to the first, made once.
class Records {
 public:
  Records() {
    ExcitationSettings settings;
    settings.candidates = 6;
    settings.generations = 0;
    for (const std::string task : {"rise", "stand"}) {
      const Excitation found =
          MakeExcitation(SourcePath("primitives/tasks/" + task + ".toml"), settings);
      EXPECT_TRUE(found.file) << found.cause;
      PendingFile(folder_ / (task + ".toml"), ToToml(*found.file)).Commit();
      Record(task, kDrivesFile, folder_ / (task + ".rec"));
    }
    EXPECT_EQ(Identify({"fit", back(), "--out", model()}).exit_code, 0);
  }

  void Record(const std::string& motion, const std::string& drives, const std::string& to) const {
    const testing::HiddenRuns run(folder_ / (motion + ".toml"), drives);
    EXPECT_TRUE(run.Record(testing::DrawHiddenRobot(run.scene(), 11, 2), to));
  }
  static Outcome Identify(const std::vector<std::string>& arguments) {
    std::vector<std::string> all = {"tumbler identify"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    if (arguments.front() == "fit") all.emplace_back("--quiet");
    return testing::RunProgram(all);
  }

  [[nodiscard]] std::string back() const { return folder_ / "rise.rec"; }
  [[nodiscard]] std::string sway() const { return folder_ / "stand.rec"; }
  [[nodiscard]] std::string motion() const { return folder_ / "rise.toml"; }
  [[nodiscard]] std::string model() const { return folder_ / "model"; }
  [[nodiscard]] std::string posterior() const { return model() + "/posterior.toml"; }

 private:
  testing::TemporaryFolder folder_;
};

const Records& Shared() {
  static const Records records;
  return records;
}

Outcome Identify(const std::vector<std::string>& arguments) { return Records::Identify(arguments); }

TEST(IdentifyProgram, ARecordThatIsGivenTwiceIsRefusedByName) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const std::string copy = folder / "copy.rec", cut = folder / "cut.rec", out = folder / "model";
  const std::string bytes = ReadFile(of.back());
  WriteFile(copy, bytes);
  WriteFile(cut, bytes.substr(0, bytes.size() * 3 / 5));
  for (const std::string& other : {of.back(), copy, cut}) {
    const Outcome outcome = Identify({"fit", of.back(), other, "--out", out});
    EXPECT_EQ(outcome.exit_code, 1) << other;
    EXPECT_THAT(outcome.text, AllOf(HasSubstr(other), HasSubstr("as " + of.back()),
                                    HasSubstr("give each record once")));
  }
  EXPECT_EQ(Identify({"fit", of.back(), "--held-out", copy, "--out", out}).exit_code, 1);
  const Outcome again = Identify({"fit", copy, "--prior", of.posterior(), "--out", out});
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.text, AllOf(HasSubstr(copy), HasSubstr(of.posterior()), HasSubstr("rise.rec")));
  EXPECT_FALSE(fs::exists(out));
  // Another record of the robot is another one.
  const Outcome both = Identify({"fit", of.sway(), "--prior", of.posterior(), "--out", out});
  EXPECT_EQ(both.exit_code, 0) << both.text;
  const PosteriorFile file = LoadPosterior(out + "/posterior.toml");
  ASSERT_EQ(file.records.size(), 2U);
  EXPECT_TRUE(fs::equivalent(fs::path(out) / file.records[0], of.back())) << file.records[0];
  EXPECT_TRUE(fs::equivalent(fs::path(out) / file.records[1], of.sway())) << file.records[1];
}

TEST(IdentifyProgram, APriorWhoseRecordsAreThereLeadsToTheRobotOfOneFitOfAll) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const std::string again = folder / "again", once = folder / "once", deep = folder / "deep";
  const Outcome fit = Identify({"fit", of.sway(), "--prior", of.posterior(), "--out", again});
  ASSERT_EQ(fit.exit_code, 0) << fit.text;
  EXPECT_THAT(fit.text, HasSubstr("its 1 records are fitted again"));
  ASSERT_EQ(Identify({"fit", of.back(), of.sway(), "--out", once}).exit_code, 0);
  const PosteriorFile a = LoadPosterior(again + "/posterior.toml");
  const PosteriorFile b = LoadPosterior(once + "/posterior.toml");
  ASSERT_EQ(a.posterior.quantities, b.posterior.quantities);
  for (std::size_t i = 0; i < a.posterior.size(); ++i) {
    // Both are minima of one function, begun from two robots.
    const double deviation = b.posterior.DeviationOf(i);
    EXPECT_NEAR(a.posterior.mean[i], b.posterior.mean[i], 0.2 * deviation) << i;
    EXPECT_NEAR(a.posterior.DeviationOf(i), deviation, 0.05 * deviation) << i;
  }
  EXPECT_EQ(a.fingerprints, b.fingerprints);
  // The posterior went elsewhere alone: its records are not there.
  fs::create_directories(fs::path(deep) / "er");
  fs::copy_file(of.posterior(), fs::path(deep) / "er" / "posterior.toml");
  const std::string alone = (fs::path(deep) / "er" / "posterior.toml").string();
  const Outcome on = Identify({"fit", of.sway(), "--prior", alone});
  EXPECT_NE(on.exit_code, 1) << on.text;
  EXPECT_THAT(on.text, AllOf(HasSubstr("goes on from what it says of its records"),
                             HasSubstr("rise.rec is not there"), HasSubstr("moved by ")));
  // Another file under a record's name is not that record.
  WriteFile((fs::path(deep) / "rise.rec").string(), ReadFile(of.sway()));
  const Outcome other = Identify({"fit", of.sway(), "--prior", alone});
  EXPECT_THAT(other.text, HasSubstr("rise.rec is another record now"));
}

TEST(IdentifyProgram, RecordsOfAPriorMayHaveOtherZerosThanTheNewOnes) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  // Drives as the model corrected them. The robot is as it was: by as much its encoders read more.
  const std::string drives = of.model() + "/drives.toml", shifted = folder / "shifted.rec";
  const DrivesConfig corrected = LoadDrives(drives);
  const auto zero_of = [&corrected](std::size_t joint) {
    return static_cast<double>(JointOf(corrected.drives[joint].config).zero_offset_rad);
  };
  const testing::HiddenRuns run(fs::path(of.motion()).parent_path() / "stand.toml", drives);
  testing::HiddenRobot robot = testing::DrawHiddenRobot(run.scene(), 11, 2);
  for (std::size_t j = 0; j < 2; ++j) robot.variation.joints[j].zero_rad += zero_of(j);
  EXPECT_TRUE(run.Record(robot, shifted));
  const std::string with = folder / "with", without = folder / "without";
  const Outcome fit = Identify({"fit", shifted, "--prior", of.posterior(), "--out", with});
  EXPECT_EQ(fit.exit_code, 0) << fit.text;
  EXPECT_THAT(fit.text, HasSubstr("its 1 records are fitted again"));
  ASSERT_EQ(Identify({"fit", of.back(), of.sway(), "--out", without}).exit_code, 0);
  const PosteriorFile a = LoadPosterior(with + "/posterior.toml");
  const PosteriorFile b = LoadPosterior(without + "/posterior.toml");
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_GT(std::abs(zero_of(j)), 1e-4);
    const RobotQuantity zero{RobotQuantity::Kind::kZero, corrected.drives[j].joint};
    const auto mean = [&zero](const PosteriorFile& file) {
      const auto& all = file.posterior.quantities;
      const auto at = std::find(all.begin(), all.end(), zero);
      return file.posterior.mean[static_cast<std::size_t>(at - all.begin())];
    };
    EXPECT_NEAR(mean(a) - zero_of(j), mean(b), 5e-4);
  }
}

/// A posterior's robot as a motion of optimize --posterior has it: the motion with another URDF.
void MakeForIdentified(const std::string& motion, const std::string& posterior,
                       const std::string& to) {
  PrimitiveFile file = LoadPrimitive(motion);
  const SimulatedMotion model(LoadMotion(motion));
  file.provenance.robot_urdf =
      IdentifiedUrdf(file.provenance.robot_urdf, file.provenance.robot_file, model.scene(),
                     LoadPosterior(posterior).posterior);
  file.provenance.robot_hash = HashOfText(file.provenance.robot_urdf);
  file.provenance.task_toml = ReplacedAll(file.provenance.task_toml, "mu = 0.3", "mu = 0.25");
  file.provenance.task_hash = HashOfText(file.provenance.task_toml);
  PendingFile(to, ToToml(file)).Commit();
}

TEST(IdentifyProgram, ARecordOfAMotionForAnIdentifiedRobotIsFittedWithTheOthers) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const std::string motion = folder / "sway.toml", record = folder / "sway.rec";
  const std::string stand = (fs::path(of.motion()).parent_path() / "stand.toml").string();
  MakeForIdentified(stand, of.posterior(), motion);
  // The robot is the one of the other records, whatever the motion was made for.
  testing::HiddenRuns run(motion, kDrivesFile);
  const testing::HiddenRuns first(stand, kDrivesFile);
  ASSERT_NE(run.scene().robot.tree.dofs.back().mass_kg,
            first.scene().robot.tree.dofs.back().mass_kg);
  run.OfModel(first.scene());
  EXPECT_TRUE(run.Record(testing::DrawHiddenRobot(first.scene(), 11, 2), record));
  const Outcome together = Identify({"fit", of.back(), record, "--out", folder / "both"});
  EXPECT_EQ(together.exit_code, 0) << together.text;
  ASSERT_EQ(Identify({"fit", of.back(), of.sway(), "--out", folder / "usual"}).exit_code, 0);
  const PosteriorFile a = LoadPosterior(folder / "both/posterior.toml");
  const PosteriorFile b = LoadPosterior(folder / "usual/posterior.toml");
  for (std::size_t i = 0; i < a.posterior.size(); ++i) {
    EXPECT_NEAR(a.posterior.mean[i], b.posterior.mean[i],
                1.5 * std::max(1e-9, b.posterior.DeviationOf(i)))
        << NameOf(a.posterior.quantities[i]);
  }
  // What no fit estimates may not differ, and the message says what does.
  PrimitiveFile other = LoadPrimitive(motion);
  other.provenance.robot_urdf =
      ReplacedAll(other.provenance.robot_urdf, "effort=\"8.0\"", "effort=\"7.0\"");
  ASSERT_NE(other.provenance.robot_urdf, LoadPrimitive(motion).provenance.robot_urdf);
  other.provenance.robot_hash = HashOfText(other.provenance.robot_urdf);
  PendingFile(folder / "other.toml", ToToml(other)).Commit();
  testing::HiddenRuns strange(folder / "other.toml", kDrivesFile);
  strange.OfModel(first.scene());
  strange.Record(testing::DrawHiddenRobot(first.scene(), 11, 2), folder / "other.rec");
  const Outcome refused = Identify({"fit", of.back(), folder / "other.rec"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.text, AllOf(HasSubstr("other.rec"), HasSubstr(of.back()),
                                  HasSubstr("the limits of the joint 'leg1' differ")));
}

TEST(IdentifyProgram, ARecordBehindTheOneThatIsHeldOutIsNotFitted) {
  const Outcome outcome = Identify({"fit", "a.rec", "--held-out", "b.rec", "c.rec"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, AllOf(HasSubstr("--held-out"), HasSubstr("c.rec is behind it"),
                                  HasSubstr("give the option again")));
}

TEST(IdentifyProgram, RecordsOfOtherDrivesAreRefusedNamingBoth) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const std::string drives = folder / "drives.toml", other = folder / "other.rec";
  WriteFile(drives,
            ReplacedAll(ReadFile(kDrivesFile), "kd_nm_s_per_rad = 5.0", "kd_nm_s_per_rad = 4.0"));
  of.Record("stand", drives, other);
  const Outcome outcome = Identify({"fit", of.back(), other});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, AllOf(HasSubstr(other), HasSubstr(of.back()),
                                  HasSubstr("kd_nm_s_per_rad of leg1 is 4 and 5")));
  const Outcome prior = Identify({"fit", other, "--prior", of.posterior()});
  EXPECT_EQ(prior.exit_code, 1);
  EXPECT_THAT(prior.text, AllOf(HasSubstr(other), HasSubstr(of.posterior()),
                                HasSubstr("kd_nm_s_per_rad of leg1 is 4 and 5")));
  const Outcome gate = Identify({"gate", kStand, of.posterior(), "--drives", drives});
  EXPECT_EQ(gate.exit_code, 1);
  EXPECT_THAT(gate.text, AllOf(HasSubstr(drives), HasSubstr("kd_nm_s_per_rad of leg1 is 4 and 5")));
}

TEST(IdentifyProgram, TheGateSaysWithWhichDrivesAndTwinItPlays) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const Outcome given = Identify(
      {"gate", kStand, of.posterior(), "--drives", kDrivesFile, "--json", folder / "gate.json"});
  EXPECT_THAT(given.text, AllOf(HasSubstr("drives: " + kDrivesFile), HasSubstr("leg2: mit, kp 40"),
                                HasSubstr("twin: "), HasSubstr("without a twin file")));
  const std::optional<Json> json = Json::Parse(ReadFile(folder / "gate.json"));
  ASSERT_TRUE(json);
  EXPECT_EQ((*json)["drives"]["file"].text(), kDrivesFile);
  EXPECT_FALSE((*json)["drives"]["default"].boolean());
  EXPECT_EQ((*json)["drives"]["of_joint"][0]["kp_nm_per_rad"].number(), 40);
  EXPECT_TRUE((*json)["twin"]["default"].boolean());
  EXPECT_EQ((*json)["open"].boolean(), given.exit_code == 0);
  const Outcome none = Identify({"gate", of.motion(), of.posterior(), "--json", "-"});
  EXPECT_THAT(none.text, AllOf(HasSubstr("no --drives was given"), HasSubstr("\"default\": true")));
  // The default drives have another motion's gains.
  const Outcome others = Identify({"gate", kStand, of.posterior()});
  EXPECT_EQ(others.exit_code, 1);
  EXPECT_THAT(others.text,
              AllOf(HasSubstr(kStand), HasSubstr("kp_nm_per_rad of leg1 is 200 and 40"),
                    HasSubstr("--drives")));
}

TEST(IdentifyProgram, TheGateRefusesAMotionOfARobotWithOtherFeetThanTheIdentifiedOne) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  fs::copy(of.model(), folder / "model");
  const std::string urdf = folder / "model/robot.urdf";
  const std::vector<std::string> gate = {"gate", kStand, folder / "model/posterior.toml",
                                         "--drives", kDrivesFile};
  EXPECT_THAT(Identify(gate).text, Not(HasSubstr("another robot")));
  WriteFile(urdf, Replaced(ReadFile(urdf), "radius=\"0.03\"", "radius=\"0.05\""));
  for (const bool as_failed : {false, true}) {
    std::vector<std::string> asked = gate;
    if (as_failed) asked.insert(asked.end(), {"--failed", kStand});
    const Outcome refused = Identify(asked);
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_THAT(refused.text,
                AllOf(HasSubstr(kStand), HasSubstr(urdf), HasSubstr("contact shape")));
  }
}

TEST(IdentifyProgram, FitAndGateSayThatTheModelDoesNotFailWhereTheRobotDid) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const Outcome fit = Identify({"fit", of.back(), "--failed", kStand});
  EXPECT_EQ(fit.exit_code, 4) << fit.text;
  EXPECT_THAT(fit.text, HasSubstr("warning: the model does not fail in " + kStand));
  const Outcome gate =
      Identify({"gate", kStand, of.posterior(), "--drives", kDrivesFile, "--failed", kStand,
                "--draws", "2", "--json", folder / "gate.json"});
  EXPECT_EQ(gate.exit_code, 4);
  EXPECT_THAT(gate.text, AllOf(HasSubstr("does not fail; draws left out because they do not: 4"),
                               HasSubstr("0 robots at 2 standard deviations of 4 that were drawn"),
                               HasSubstr("fit the record of that run, too, with --failed")));
  const std::optional<Json> json = Json::Parse(ReadFile(folder / "gate.json"));
  ASSERT_TRUE(json);
  EXPECT_EQ((*json)["robots"].size(), 1U) << "the mean alone";
  EXPECT_EQ((*json)["failed"][0]["left_out"].number(), 4);
  const std::vector<std::tuple<const char*, const char*, int>> refused = {
      {"hopper/hop_up.toml", "is a motion of another robot than that of", 1},
      {"acrobot/swing_up.toml", "is a motion of another robot than that of", 1},
      {"gait.toml", "goes on for ever", 2},
      {"absent.toml", "cannot be opened", 1}};
  for (const auto& [motion, why, status] : refused) {
    const Outcome none =
        Identify({"fit", of.back(), "--failed", SourcePath(std::string("primitives/") + motion),
                  "--out", folder / "model"});
    EXPECT_EQ(none.exit_code, status) << motion;
    EXPECT_THAT(none.text, HasSubstr(why)) << motion;
    EXPECT_FALSE(fs::exists(folder / "model")) << motion;
  }
}

TEST(IdentifyProgram, NothingThatIsReadIsReplacedByWhatIsWritten) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  fs::copy(of.model(), folder / "model");
  fs::copy(SourcePath("primitives/tasks"), folder / "tasks");
  fs::copy(SourcePath("primitives/robots"), folder / "robots");
  const std::string record = folder / "model/index.html",
                    posterior = folder / "model/posterior.toml";
  fs::copy(of.back(), record, fs::copy_options::overwrite_existing);
  const std::string motion = folder / "model/ground.toml";
  fs::copy(kStand, motion, fs::copy_options::overwrite_existing);
  const std::string out = folder / "model";
  const std::vector<std::pair<std::vector<std::string>, std::string>> refused = {
      {{"fit", record, "--out", out}, record},
      {{"fit", of.sway(), "--held-out", record, "--out", out}, record},
      {{"fit", of.back(), "--failed", motion, "--out", out}, motion},
      {{"fit", of.sway(), "--prior", posterior, "--out", out}, posterior},
      {{"excite", folder / "tasks/stand.toml", "--out", folder / "robots/tumbler.urdf"},
       folder / "robots/tumbler.urdf"},
      {{"gate", kStand, posterior, "--drives", kDrivesFile, "--json", out + "/robot.urdf"},
       out + "/robot.urdf"}};
  for (const auto& [arguments, file] : refused) {
    const std::string before = ReadFile(file);
    const Outcome outcome = Identify(arguments);
    EXPECT_EQ(outcome.exit_code, 1) << file;
    EXPECT_THAT(outcome.text, HasSubstr(file + ": is an input")) << outcome.text;
    EXPECT_EQ(ReadFile(file), before) << file;
  }
}

TEST(IdentifyProgram, TheGateRefusesAPosteriorThatLeavesOutWhatAFitEstimates) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  PosteriorFile part = LoadPosterior(of.posterior());
  const std::size_t n = part.posterior.size();
  part.posterior.quantities.erase(part.posterior.quantities.begin());
  part.posterior.mean.erase(part.posterior.mean.begin());
  part.prior_deviations.erase(part.prior_deviations.begin());
  part.information = {};
  std::vector<double> covariance;
  for (std::size_t i = 1; i < n; ++i)
    for (std::size_t k = 1; k < n; ++k) covariance.push_back(part.posterior.covariance[i * n + k]);
  part.posterior.covariance = covariance;
  PendingFile(folder / "part.toml", ToToml(part)).Commit();
  const Outcome outcome =
      Identify({"gate", kStand, folder / "part.toml", "--drives", kDrivesFile, "--draws", "0"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("has none of 'mass of middle'"));
}

TEST(IdentifyProgram, AFolderIsAsItWasWhereItsPageCannotBeWritten) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const std::string out = folder / "model";
  fs::create_directories(out + "/index.html");
  WriteFile(out + "/posterior.toml", "the old one");
  const Outcome outcome = Identify({"fit", of.back(), "--out", out});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("index.html"));
  EXPECT_EQ(ReadFile(out + "/posterior.toml"), "the old one");
  EXPECT_EQ(folder.Listing(),
            (std::set<std::string>{"model", "model/index.html", "model/posterior.toml"}));
}

TEST(IdentifyProgram, RecordsWithBareNamesAreNamedFromTheFolderOfAModelThatIsNew) {
  const testing::TemporaryFolder folder;
  fs::copy_file(Shared().back(), folder / "back.rec");
  const Outcome fit = testing::RunInShell("cd " + folder.path().string() +
                                          " && tumbler identify fit back.rec --out model --quiet");
  ASSERT_EQ(fit.exit_code, 0) << fit.text;
  EXPECT_THAT(LoadPosterior(folder / "model/posterior.toml").records,
              ::testing::ElementsAre("../back.rec"));
}

TEST(IdentifyProgram, AModelHasTheDrivesFileWithItsEncodersZeros) {
  const Records& of = Shared();
  const PosteriorFile file = LoadPosterior(of.posterior());
  const DrivesConfig drives = LoadDrives(of.model() + "/drives.toml");
  for (std::size_t i = 0; i < file.posterior.size(); ++i) {
    const RobotQuantity& quantity = file.posterior.quantities[i];
    if (quantity.kind != RobotQuantity::Kind::kZero) continue;
    const DriveEntry& drive = drives.drives[quantity.of == "leg1" ? 0 : 1];
    EXPECT_GT(std::abs(file.posterior.mean[i]), 1e-4);
    EXPECT_NEAR(static_cast<double>(JointOf(drive.config).zero_offset_rad), -file.posterior.mean[i],
                1e-6);
  }
  EXPECT_THAT(ReadFile(of.model() + "/drives.toml"), HasSubstr("CAN_MASTER")) << "all else stays";
  // The twin takes them, and the gate knows that zeros are right with them.
  EXPECT_THAT(ReadFile(of.model() + "/twin.toml"), HasSubstr("drives = \"drives.toml\""));
  const Outcome gate =
      Identify({"gate", kStand, of.posterior(), "--drives", of.model() + "/drives.toml"});
  EXPECT_NE(gate.exit_code, 1) << gate.text;
}

TEST(IdentifyProgram, APosteriorOfAnotherRobotIsRefusedByFileLineAndName) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const std::string other = folder / "posterior.toml";
  const std::string text =
      ReplacedAll(ReadFile(of.posterior()), "of = \"leg2_link\"", "of = \"arm\"");
  WriteFile(other, text);
  const Outcome gate = Identify({"gate", kStand, other, "--drives", kDrivesFile});
  EXPECT_EQ(gate.exit_code, 1);
  EXPECT_THAT(gate.text,
              AllOf(HasSubstr(other + ":" + std::to_string(testing::LineOf(text, "of = \"arm\""))),
                    HasSubstr("'arm'"), HasSubstr("allowed: middle, leg1_link, leg2_link")));
}

TEST(IdentifyProgram, APriorOfAnEarlierVersionIsRefused) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  PosteriorFile file = LoadPosterior(of.posterior());
  file.information = {};
  PendingFile(folder / "old.toml", ToToml(file)).Commit();
  const Outcome outcome = Identify({"fit", of.sway(), "--prior", folder / "old.toml"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, AllOf(HasSubstr("old.toml"), HasSubstr("earlier version")));
}

/// Drives whose file says of their motors what they are, or does not.
std::string DrivesThatSay(const std::string& keys) {
  return ReplacedAll(ReadFile(kDrivesFile), "kd_nm_s_per_rad = 5.0",
                     "kd_nm_s_per_rad = 5.0\n" + keys);
}

double MeanOf(const PosteriorFile& file, RobotQuantity::Kind kind, const std::string& of = "") {
  for (std::size_t i = 0; i < file.posterior.size(); ++i) {
    if (file.posterior.quantities[i] == RobotQuantity{kind, of}) return file.posterior.mean[i];
  }
  ADD_FAILURE() << "there is no such quantity";
  return 0;
}

TEST(IdentifyProgram, WhatADrivesFileSaysOfItsMotorsIsWhereAFitBeginsAndWhatAModelSays) {
  using Kind = RobotQuantity::Kind;
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const std::string says = folder / "says.toml", silent = folder / "silent.toml";
  WriteFile(says, DrivesThatSay("torque_factor = 1.03\nvelocity_filter_s = 0.003"));
  WriteFile(silent, DrivesThatSay(""));
  std::map<std::string, PosteriorFile> model_of;
  for (const std::string& drives : {says, silent}) {
    std::vector<std::string> fit = {"fit"};
    for (const std::string task : {"rise", "stand"}) {
      const testing::HiddenRuns run(fs::path(of.motion()).parent_path() / (task + ".toml"), drives);
      testing::HiddenRobot robot = testing::DrawHiddenRobot(run.scene(), 11, 2);
      robot.torque_factor = 1.03;
      robot.velocity_filter_s = 0.003;
      EXPECT_TRUE(run.Record(robot, drives + task + ".rec"));
      fit.push_back(drives + task + ".rec");
    }
    fit.insert(fit.end(), {"--out", drives + ".model"});
    const Outcome outcome = Identify(fit);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
    model_of[drives] = LoadPosterior(drives + ".model/posterior.toml");
    EXPECT_NEAR(MeanOf(model_of[drives], Kind::kVelocityLag), 0.003, 3e-4);
  }
  // Nothing but what is said tells the torque constant, and with it the masses.
  EXPECT_NEAR(MeanOf(model_of[says], Kind::kMass, "middle") -
                  MeanOf(model_of[silent], Kind::kMass, "middle"),
              std::log(1.03), 0.02);
  const PosteriorFile& model = model_of[says];
  EXPECT_EQ(model.drives.of_joint[1].torque_factor, 1.03);
  EXPECT_EQ(model.drives.of_joint[1].velocity_filter_s, 0.003) << "before the fit";
  const DrivesConfig found = LoadDrives(says + ".model/drives.toml");
  for (const DriveEntry& drive : found.drives) {
    EXPECT_EQ(drive.motor.torque_factor, 1.03);
    EXPECT_EQ(drive.motor.velocity_filter_s, MeanOf(model, Kind::kVelocityLag));
  }
  EXPECT_THAT(ReadFile(says + ".model/twin.toml"),
              AllOf(HasSubstr("torque_factor = 1.03\n"), HasSubstr("\nvelocity_filter_s = 0.00")));
  // The gate plays the robot of the posterior, whatever is said of its drives.
  std::vector<std::string> robots;
  for (const std::string& drives : {says, silent}) {
    static_cast<void>(Identify({"gate", kStand, says + ".model/posterior.toml", "--drives", drives,
                                "--draws", "1", "--json", folder / "gate.json"}));
    const std::string json = ReadFile(folder / "gate.json");
    robots.push_back(json.substr(json.find("\"robots\"")));
  }
  EXPECT_EQ(robots[0], robots[1]);
  EXPECT_THAT(robots[0], HasSubstr("\"stands\""));
}

/// The bytes of a record up to so many ticks after its motion began; below 0: before that.
std::string CutAt(const std::string& path, std::int64_t ticks) {
  const std::string bytes = ReadFile(path);
  FlightRecord record({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, path);
  const auto entry = std::make_unique<TickEntry>();
  std::vector<std::size_t> offsets;
  std::int64_t begins = -1;
  while (record.Next(*entry)) {
    if (begins < 0 && entry->record.state == ExecutorState::kRunning)
      begins = static_cast<std::int64_t>(offsets.size());
    offsets.push_back(record.tick_offset());
  }
  return bytes.substr(0, offsets[static_cast<std::size_t>(begins + ticks)]);
}

TEST(IdentifyProgram, WhyAModelIsEffectiveIsSaidWhereItIsKnown) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const std::string drives = SourcePath("primitives/robots/tumbler_drives_cansimple.toml");
  of.Record("stand", drives, folder / "other.rec");
  const Outcome other = Identify({"fit", folder / "other.rec", "--out", folder / "model"});
  EXPECT_EQ(other.exit_code, 4);
  EXPECT_THAT(other.text, AllOf(HasSubstr("the drive of leg1 is none of MIT"),
                                HasSubstr("an EFFECTIVE model")));
  EXPECT_THAT(ReadFile(folder / "model/index.html"), HasSubstr("the drive of leg1 is none of MIT"));
  EXPECT_TRUE(LoadPosterior(folder / "model/posterior.toml").effective);
  EXPECT_THAT(Identify({"fit", of.back()}).text, Not(HasSubstr("none of MIT")));
}

TEST(IdentifyProgram, ARecordThatTellsNothingIsRefusedBySayingWhy) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const std::string bad = folder / "bad.rec";
  const auto refused = [&](const std::string& what) {
    const Outcome outcome = Identify({"fit", bad, "--out", folder / "model"});
    EXPECT_EQ(outcome.exit_code, 1) << what;
    EXPECT_THAT(outcome.text, AllOf(HasSubstr(bad), HasSubstr(what)));
    EXPECT_FALSE(fs::exists(folder / "model"));
  };
  WriteFile(bad, "");
  refused("cut off within its first 16 bytes");
  WriteFile(bad, ReadFile(of.motion()));
  refused("is not a flight record");
  WriteFile(bad, CutAt(of.back(), -1));
  refused("no motion was played");
  // The motion has begun, and ends before it has told anything.
  WriteFile(bad, CutAt(of.back(), 450));  // 0.4 s of it are a hold.
  refused("of its motion can be used (the record ends)");
}

TEST(IdentifyProgram, OfARecordThatIsCutOrHasAFaultWhatIsThereIsUsedAndSaid) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  WriteFile(folder / "cut.rec", CutAt(of.back(), 1200));
  const Outcome cut = Identify({"fit", folder / "cut.rec"});
  EXPECT_NE(cut.exit_code, 1) << cut.text;
  EXPECT_THAT(cut.text, HasSubstr("is cut in the motion; used are the 0."));
  std::string damaged = ReadFile(of.back());
  damaged[CutAt(of.back(), 900).size() + 100] ^= 1;
  WriteFile(folder / "damaged.rec", damaged);
  const Outcome lost = Identify({"fit", folder / "damaged.rec"});
  EXPECT_NE(lost.exit_code, 1) << lost.text;
  EXPECT_THAT(lost.text, HasSubstr("used up to ticks that the record has lost, 0."));
  // A drive falls silent in the motion.
  WriteFile(folder / "faults.toml",
            "format = \"tumbler-bus-faults\"\nversion = 1\n[[fault]]\nkind = \"disconnect\"\n"
            "node = \"leg1\"\nstart_s = 1.2\nduration_s = 5.0\n");
  const Outcome run = testing::RunProgram({"tumbler run", "sim", of.motion(), "--drives",
                                           kDrivesFile, "--bus-faults", folder / "faults.toml",
                                           "--record", folder / "fault.rec"});
  EXPECT_EQ(run.exit_code, 3) << run.text;
  const Outcome fault = Identify({"fit", folder / "fault.rec"});
  EXPECT_NE(fault.exit_code, 1) << fault.text;
  EXPECT_THAT(fault.text, HasSubstr("used up to a fault, 0."));
}

TEST(IdentifyProgram, ARunThatFellIsFittedAsTheRobotMayHaveMovedSo) {
  const testing::TemporaryFolder folder;
  const Outcome run = testing::RunProgram(
      {"tumbler run", "sim", SourcePath("primitives/handstand.toml"), "--twin",
       SourcePath("primitives/robots/tumbler_built_twin.toml"), "--record", folder / "fell.rec"});
  EXPECT_EQ(run.exit_code, 4) << run.text;
  const Outcome fit = Identify({"fit", folder / "fell.rec"});
  EXPECT_NE(fit.exit_code, 1) << fit.text;
  EXPECT_THAT(fit.text,
              AllOf(HasSubstr("fell.rec: handstand"), HasSubstr(" s used"), HasSubstr("chi ")));
}

TEST(IdentifyProgram, RecordsThatDoNotGoTogetherAreRefusedOrNotExplained) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  // Another robot's: its motion was made for another URDF.
  const std::string other = folder / "other.toml";
  const PrimitiveFile file = LoadPrimitive(of.motion());
  PrimitiveFile heavier = file;
  heavier.provenance.robot_urdf =
      ReplacedAll(file.provenance.robot_urdf, "<robot name=\"", "<robot name=\"another_");
  heavier.provenance.robot_hash = HashOfText(heavier.provenance.robot_urdf);
  PendingFile(other, ToToml(heavier)).Commit();
  const testing::HiddenRuns run(other, kDrivesFile);
  EXPECT_TRUE(run.Record(testing::DrawHiddenRobot(run.scene(), 11, 2), folder / "other.rec"));
  const Outcome of_other = Identify({"fit", of.sway(), folder / "other.rec"});
  EXPECT_EQ(of_other.exit_code, 1);
  EXPECT_THAT(of_other.text, AllOf(HasSubstr("other.rec: is of another robot than " + of.sway()),
                                   HasSubstr("the robot's name is 'another_"),
                                   HasSubstr("give records of motions whose URDFs differ in ")));
  // At another rate.
  WriteFile(folder / "slow.toml",
            ReplacedAll(ReadFile(kDrivesFile), "rate_hz = 1000.0", "rate_hz = 500.0"));
  of.Record("stand", folder / "slow.toml", folder / "slow.rec");
  const Outcome at_other = Identify({"fit", of.back(), folder / "slow.rec"});
  EXPECT_EQ(at_other.exit_code, 1);
  EXPECT_THAT(at_other.text, AllOf(HasSubstr("slow.rec: was made with other drives"),
                                   HasSubstr("rate_hz is 500 and 1000")));
  const Outcome alone = Identify({"fit", folder / "slow.rec"});
  EXPECT_NE(alone.exit_code, 1) << "a rate of its own is none the worse" << alone.text;
  // Two robots of one URDF on one kind of drives: nothing says so but that no robot is both.
  const testing::HiddenRuns sway(fs::path(of.motion()).parent_path() / "stand.toml", kDrivesFile);
  EXPECT_TRUE(sway.Record(testing::DrawHiddenRobot(sway.scene(), 11, 3), folder / "mixed.rec"));
  const Outcome mixed = Identify({"fit", of.back(), folder / "mixed.rec"});
  EXPECT_EQ(mixed.exit_code, 4) << mixed.text;
  EXPECT_THAT(mixed.text, HasSubstr("an EFFECTIVE model"));
}

TEST(IdentifyProgram, AWeightThatIsNoneIsRefusedAndAWrongOneIsWarnedOf) {
  const Records& of = Shared();
  for (const std::string weight : {"0", "-1.2", "1e9", "nan", "heavy"}) {
    const Outcome outcome = Identify({"fit", of.back(), "--weight-kg", weight});
    EXPECT_EQ(outcome.exit_code, 1) << weight;
    EXPECT_THAT(outcome.text, HasSubstr("--weight-kg")) << weight;
  }
  const Outcome twice = Identify({"fit", of.back(), of.sway(), "--weight-kg", "2.4"});
  EXPECT_NE(twice.exit_code, 1) << twice.text;
  EXPECT_THAT(twice.text, HasSubstr("warning: torque factor is "));
  EXPECT_THAT(twice.text, HasSubstr("a wrong weight"));
}

TEST(IdentifyProgram, APriorThatIsNoneIsRefusedByFileLineAndWhatIsWrong) {
  const Records& of = Shared();
  const testing::TemporaryFolder folder;
  const std::string prior = folder / "prior.toml", good = ReadFile(of.posterior());
  const auto refused = [&](const std::string& text, const std::string& what) {
    WriteFile(prior, text);
    const Outcome outcome = Identify({"fit", of.sway(), "--prior", prior, "--out", folder / "m"});
    EXPECT_EQ(outcome.exit_code, 1) << what;
    EXPECT_THAT(outcome.text, AllOf(HasSubstr(prior), HasSubstr(what)));
    EXPECT_FALSE(fs::exists(folder / "m"));
  };
  refused("", "format");
  refused(ReadFile(kDrivesFile), "is 'tumbler-drives'");
  refused(ReadFile(of.back()), "is a flight record");
  refused(good.substr(0, good.size() / 2), "prior.toml");
  refused(Replaced(good, "effective = false", "effective = true"),
          "what does not explain its records says nothing");
  const std::size_t chi = good.find("\nchi = ") + 1;
  refused(good.substr(0, chi) + "chi = 4.0" + good.substr(good.find('\n', chi)),
          "is false, but chi is 4, and its limit 1");
  refused(ReplacedAll(good, "kind = \"slope\"", "kind = \"colour\""), "'colour'");
  const Outcome none = Identify({"fit", of.sway(), "--prior", folder / "none.toml"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.text, HasSubstr("none.toml"));
}

}  // namespace
}  // namespace tumbler
