// tumbler identify as a user meets it.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/result_file.h"
#include "firmware_interface/devices/drives_toml.h"
#include "offline/problem/posterior_toml.h"
#include "offline/studies/excitation.h"
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
  EXPECT_EQ(LoadPosterior(out + "/posterior.toml").records,
            (std::vector<std::string>{"rise.rec", "stand.rec"}));
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

}  // namespace
}  // namespace tumbler
