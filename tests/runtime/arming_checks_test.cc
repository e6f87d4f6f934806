// What is proved of drives before they are armed.

#include "runtime/bench/arming_checks.h"

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <tuple>
#include <vector>

#include "common/files/program.h"
#include "common/files/toml_reader.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/bench/bench_operator.h"
#include "runtime/bench/bench_session.h"
#include "runtime/bench/bench_tests.h"
#include "tests/support/bench_rig.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::Replaced;

/// Somebody who sees what a test says, and has the way clear.
class ToldOperator final : public BenchOperator {
 public:
  bool Confirm(const std::string& /*what*/, const std::function<void()>& /*meanwhile*/) override {
    return clear;
  }
  std::string WhichTurned(const std::vector<std::string>& /*joints*/,
                          const std::function<void()>& /*meanwhile*/) override {
    return turned.at(asked++);
  }
  bool Grew(const std::string& /*joint*/, const std::function<void()>& /*meanwhile*/) override {
    return grew;
  }
  bool Place(const std::string& /*joint*/, double /*angle_rad*/,
             const std::function<void()>& /*meanwhile*/) override {
    return true;
  }
  bool TurnThrough(const std::string& /*joint*/, double /*lower_rad*/, double /*upper_rad*/,
                   const std::function<void()>& /*meanwhile*/) override {
    return true;
  }

  bool clear = true;
  std::vector<std::string> turned{"leg1", "leg2"};
  bool grew = true;
  std::size_t asked = 0;
};

/// What became of the checks before arming.
struct Checked {
  std::string refusal;  ///< Empty: the drives may be armed.
  std::vector<std::string> said;
  double farthest_rad[2] = {0, 0};  ///< Of each joint from where it was.
  double torque_nm = 0;             ///< The largest.
  bool both = false;                ///< Whether two drives were ever enabled at once.
};

Checked CheckDrives(RigWorld& world, const DrivesConfig& drives, const ArmingChecks& checks,
                    ToldOperator& somebody, const std::function<void()>& disturb = {}) {
  Checked checked;
  world.each_tick = [&] {
    if (disturb) disturb();
    for (std::size_t i = 0; i < 2; ++i) {
      checked.farthest_rad[i] =
          std::max(checked.farthest_rad[i], std::abs(world.rotor(i).position_rad));
      checked.torque_nm = std::max(checked.torque_nm, std::abs(world.simulated[i]->torque_nm()));
    }
    checked.both = checked.both || (world.simulated[0]->enabled() && world.simulated[1]->enabled());
  };
  try {
    CheckBeforeArming(world, drives, {"leg1", "leg2"}, checks, somebody,
                      [&](const std::string& line) { checked.said.push_back(line); });
  } catch (const Refused& refused) {
    checked.refusal = refused.what();
  }
  world.each_tick = {};
  EXPECT_FALSE(world.AnyEnabled());
  EXPECT_FALSE(checked.both);
  return checked;
}

TEST_P(BenchOf, BeforeArmingDrivesThatAreRightAreProvedOneAtATimeWithinTheBounds) {
  ToldOperator somebody;
  const Checked checked = CheckDrives(world_, drives_, {true, true, false, {}}, somebody);
  EXPECT_EQ(checked.refusal, "");
  ASSERT_EQ(checked.said.size(), 4U);
  EXPECT_THAT(checked.said[0], HasSubstr("(leg1) turns leg1, as the drives file says"));
  EXPECT_THAT(checked.said[1], HasSubstr("(leg2) turns leg2, as the drives file says"));
  EXPECT_THAT(checked.said[2], HasSubstr("(leg1): limp "));
  EXPECT_THAT(checked.said[3], HasSubstr("(leg2): limp "));
  for (const double way_rad : checked.farthest_rad) {
    EXPECT_GT(way_rad, 0.05);
    EXPECT_LT(way_rad, 0.15);
  }
  for (const auto& drive : world_.simulated) EXPECT_GT(drive->watchdog_expiries(), 0);
  if (GetParam().protocol == "mit") {
    EXPECT_LE(checked.torque_nm, 1.0);
  }
}

TEST_P(BenchOf, BeforeArmingExchangedDrivesAreRefusedByNameAndNothingElseMoves) {
  ToldOperator somebody;
  somebody.turned = {"leg2", "leg1"};
  const Checked checked = CheckDrives(world_, drives_, {true, true, false, {}}, somebody);
  EXPECT_THAT(checked.refusal, HasSubstr("(leg1) turns leg2, and the drives file says leg1"));
  EXPECT_EQ(checked.farthest_rad[1], 0);
  EXPECT_EQ(world_.simulated[0]->watchdog_expiries(), 0) << "no further check";
}

TEST_P(BenchOf, BeforeArmingAWrongDirectionIsRefusedByNameAndNothingElseMoves) {
  ToldOperator somebody;
  somebody.grew = false;
  const Checked checked = CheckDrives(world_, drives_, {true, true, false, {}}, somebody);
  EXPECT_THAT(checked.refusal, HasSubstr("(leg1) turns leg1 against its axis"));
  EXPECT_EQ(checked.farthest_rad[1], 0);
  EXPECT_EQ(world_.simulated[0]->watchdog_expiries(), 0);
}

TEST_P(BenchOf, BeforeArmingOnlyTheRightEncoderMayMove) {
  ToldOperator somebody;
  const Checked stuck = CheckDrives(world_, drives_, {true, false, false, {}}, somebody,
                                    [this] { world_.rotor(0).position_rad = 0; });
  EXPECT_THAT(stuck.refusal, HasSubstr("(leg1) moved by "));
  const Checked coupled = CheckDrives(world_, drives_, {true, false, false, {}}, somebody, [this] {
    world_.rotor(1).position_rad = world_.rotor(0).position_rad;
  });
  EXPECT_THAT(coupled.refusal, HasSubstr("(leg2) moved by "));
  EXPECT_THAT(coupled.refusal, HasSubstr("too, when "));
  somebody.clear = false;
  const Checked unclear = CheckDrives(world_, drives_, {true, false, false, {}}, somebody);
  EXPECT_THAT(unclear.refusal, HasSubstr("was not to move"));
  EXPECT_EQ(somebody.asked, 0U);
}

TEST_P(BenchOf, BeforeArmingADriveThatIsSilentOrReportsAnErrorIsRefused) {
  ToldOperator somebody;
  world_.simulated[1]->set_silent(true);
  EXPECT_THAT(CheckDrives(world_, drives_, {true, true, false, {}}, somebody).refusal,
              HasSubstr("(leg2) does not reply"));
  world_.simulated[1]->set_silent(false);
  const std::uint32_t code = GetParam().protocol == "cia402" ? 0x8611 : 4;
  world_.simulated[1]->RaiseError(code);
  EXPECT_THAT(CheckDrives(world_, drives_, {true, true, false, {}}, somebody).refusal,
              HasSubstr("(leg2) reports 0x"));
  EXPECT_EQ(somebody.asked, 0U);
  if (!side().nature().clears_errors) return;
  EXPECT_EQ(CheckDrives(world_, drives_, {true, true, true, {}}, somebody).refusal, "");
}

TEST_P(BenchOf, BeforeArmingADriveWithoutWatchdogIsRefusedWithTheReason) {
  std::string text = Example(GetParam());
  if (GetParam().protocol == "cia402")
    text = Replaced(text, "watchdog_reaction = \"fault\"", "watchdog_reaction = \"none\"");
  const DrivesConfig believed = ParseDrives(text, "believed");
  const std::string second = "joint = \"leg2\"";
  std::string really = Replaced(text, "watchdog_s = 0.025", "watchdog_s = 0.0", second);
  if (GetParam().protocol == "cia402")
    really = Replaced(really, "watchdog_s = 0.025", "watchdog_s = 0.0");
  RigWorld world(ParseDrives(really, "really"));
  ToldOperator somebody;
  const Checked checked = CheckDrives(world, believed, {false, true, false, {}}, somebody);
  EXPECT_THAT(checked.refusal, HasSubstr(GetParam().protocol == "cia402" ? "(leg1)" : "(leg2)"));
  EXPECT_THAT(checked.refusal, HasSubstr("still drives"));
  EXPECT_EQ(somebody.asked, 0U);
}

TEST(WatchdogProof, OfAnAkV3DriveWhoseTorqueIsUnknownIsRefusedWithWhatIsMissing) {
  DrivesConfig drives = ParseDrives(
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives_akv3.toml")), "ak");
  std::get<AkV3Config>(drives.drives[0].config).torque_constant_nm_per_a = 0;
  RigWorld world(drives);
  BenchSession session(world, drives, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  try {
    static_cast<void>(ProveWatchdog(session, 0));
    FAIL() << "not refused";
  } catch (const Refused& refused) {
    EXPECT_THAT(refused.what(), HasSubstr("torque_constant_nm_per_a is 0"));
  }
  EXPECT_FALSE(world.AnyEnabled());
}

}  // namespace
}  // namespace tumbler
