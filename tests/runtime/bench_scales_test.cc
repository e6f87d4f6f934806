// What a drive's own words tell of the scales in its drives file: every wrong one is named, and
// none that is right, whatever turns at its shaft.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/files/program.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/rotor_plant.h"
#include "runtime/bench/arming_checks.h"
#include "runtime/bench/bench_operator.h"
#include "runtime/bench/bench_session.h"
#include "runtime/bench/bench_tests.h"
#include "runtime/bench/drive_reading.h"
#include "runtime/bench/drive_scales.h"
#include "tests/support/example_drives.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::Replaced;
using testing::ReplacedAll;

/// What turns at a drive's shaft.
struct Mechanics {
  double inertia_kg_m2 = 0.02;
  double damping_nm_s_per_rad = 0.1;
  double friction_nm = 0;
  double position_rad = 0;
};

/// Simulated drives whose joints have mechanics of their own.
class ScaleWorld final : public BenchWorld {
 public:
  ScaleWorld(const DrivesConfig& drives, const Mechanics& mechanics,
             const SimulatedMotorConfig& motor, const BusFaultPlan& faults)
      : bus_(drives.bit_rate), clock_([this](std::int64_t ns) {
          plant_->AdvanceTo(ns);
          if (stuck) {
            rotor().position_rad = 0;
            rotor().velocity_rad_s = 0;
          }
          farthest_rad = std::max(farthest_rad, std::abs(rotor().position_rad - start_rad_));
          hardest_nm = std::max(hardest_nm, std::abs(drives_.front()->torque_nm()));
        }) {
    std::vector<RotorPlant::Rotor> rotors;
    for (const DriveEntry& entry : drives.drives) {
      drives_.push_back(MakeSimulatedDrive(entry, motor));
      drives_.back()->AttachTo(bus_);
      rotors.push_back({drives_.back().get(), mechanics.position_rad, 0, mechanics.inertia_kg_m2,
                        mechanics.damping_nm_s_per_rad, mechanics.friction_nm});
    }
    start_rad_ = mechanics.position_rad;
    SimulatedPortConfig host;
    host.transmit_capacity = 64;
    host_ = &bus_.Attach(host);
    plant_ = std::make_unique<RotorPlant>(bus_, rotors);
    bus_.SetFaults(faults);
  }
  CanBus& bus() override { return *host_; }
  Clock& clock() override { return clock_; }
  [[nodiscard]] BusTrouble trouble() const override { return {}; }
  RotorPlant::Rotor& rotor() { return plant_->rotors()[0]; }
  [[nodiscard]] bool enabled() const { return drives_.front()->enabled(); }

  bool stuck = false;       ///< Whether the joint is blocked.
  double farthest_rad = 0;  ///< Of the joint from where it was,
  double hardest_nm = 0;    ///< and the largest torque.

 private:
  SimulatedBus bus_;
  std::vector<std::unique_ptr<SimulatedDrive>> drives_;
  std::unique_ptr<RotorPlant> plant_;
  SimulatedPort* host_ = nullptr;
  VirtualClock clock_;
  double start_rad_ = 0;
};

/// A value of a drives file that is another one in the drive.
struct Wrong {
  std::string key;  ///< As findings name it.
  std::function<void(DriveEntry&)> in_drive;
};

template <auto kRange>
void Scale(ImpedanceRanges& ranges, float factor) {
  (ranges.*kRange).min *= factor;
  (ranges.*kRange).max *= factor;
}
/// A range of commands and replies of an MIT drive.
template <auto kRange>
Wrong OfMit(const char* key, float factor) {
  return {key, [factor](DriveEntry& entry) {
            auto& mit = std::get<MitConfig>(entry.config);
            Scale<kRange>(mit.command, factor);
            Scale<kRange>(mit.reply, factor);
          }};
}
template <auto kRange>
Wrong OfAk(const char* key, float factor) {
  return {key, [factor](DriveEntry& entry) {
            Scale<kRange>(std::get<AkV3Config>(entry.config).range, factor);
          }};
}
template <auto kMember>
Wrong Constant(const char* key, float factor) {
  return {key, [factor](DriveEntry& entry) {
            std::visit(
                [factor](auto& config) {
                  if constexpr (requires { config.*kMember; }) config.*kMember *= factor;
                },
                entry.config);
          }};
}
Wrong Kp(float factor) {
  return {"kp_nm_per_rad", [factor](DriveEntry& entry) { entry.kp_nm_per_rad *= factor; }};
}
/// The damping of a drive's own loops; its stiffness stays.
Wrong Kd(float factor) {
  return {"kd_nm_s_per_rad", [factor](DriveEntry& entry) { entry.kd_nm_s_per_rad *= factor; }};
}

/// Everything that can be wrong of a protocol, by different factors.
/// @param which  of several lists.
std::vector<Wrong> AllWrong(const std::string& protocol, int which) {
  const auto factor = [which](float first, float second) { return which == 0 ? first : second; };
  if (protocol == "mit") {
    return {
        OfMit<&ImpedanceRanges::position_rad>("range.position_rad", factor(0.5F, 7.64F)),
        OfMit<&ImpedanceRanges::velocity_rad_s>("range.velocity_rad_s", factor(0.45F, 1.52F)),
        OfMit<&ImpedanceRanges::kp_nm_per_rad>("range.kp_nm_per_rad", factor(2, 0.5F)),
        OfMit<&ImpedanceRanges::kd_nm_s_per_rad>("range.kd_nm_s_per_rad", factor(0.4F, 5)),
        OfMit<&ImpedanceRanges::torque_nm>("range.torque_nm", factor(0.667F, 3.61F)),
    };
  }
  if (protocol == "akv3") {
    return {
        OfAk<&ImpedanceRanges::position_rad>("range.position_rad", factor(0.5F, 2)),
        OfAk<&ImpedanceRanges::velocity_rad_s>("range.velocity_rad_s", factor(0.43F, 1.6F)),
        OfAk<&ImpedanceRanges::kp_nm_per_rad>("range.kp_nm_per_rad", factor(2, 0.5F)),
        OfAk<&ImpedanceRanges::kd_nm_s_per_rad>("range.kd_nm_s_per_rad", factor(0.4F, 5)),
        OfAk<&ImpedanceRanges::torque_nm>("range.torque_nm", factor(0.667F, 3)),
        Constant<&AkV3Config::gear_inside>("pole_pairs x gear_inside", factor(0.444F, 2.33F)),
        Constant<&AkV3Config::torque_constant_nm_per_a>("torque_constant_nm_per_a",
                                                        factor(1.4F, 0.3F)),
    };
  }
  if (protocol == "cansimple") return {Kp(factor(2, 0.5F)), Kd(factor(0.6F, 1.5F))};
  return {
      Constant<&Cia402Config::position_units_per_turn>("position_units_per_turn",
                                                       factor(0.5F, 1.5F)),
      Constant<&Cia402Config::velocity_units_per_turn_s>("velocity_units_per_turn_s",
                                                         factor(2, 0.6F)),
      Constant<&Cia402Config::rated_torque_nm>("rated_torque_nm", factor(1.8F, 0.7F)),
      Kp(factor(2.2F, 0.5F)),
      Kd(factor(0.6F, 1.5F)),
  };
}

class ScalesOf : public ::testing::TestWithParam<testing::ExampleDrives> {
 protected:
  [[nodiscard]] DrivesConfig Believed() const {
    DrivesConfig drives =
        ParseDrives(testing::ReadFile(testing::SourcePath(GetParam().file)), "example");
    drives.drives.resize(1);
    return drives;
  }
  /// Turns the joint by hand and measures, as `check` does.
  Judgement Judge(const DrivesConfig& believed, const DrivesConfig& actual,
                  const Mechanics& mechanics = {}, const SimulatedMotorConfig& motor = {},
                  const BusFaultPlan& faults = {}) {
    ScaleWorld world(actual, mechanics, motor, faults);
    BenchSession session(world, believed, {});
    EXPECT_THAT(session.AwaitReplies(), IsEmpty());
    const double before_rad = session.position_rad(0);
    world.rotor().position_rad += 1;
    session.Wait(0.1);
    KnownScales known;
    known.position = 1 / (session.position_rad(0) - before_rad);
    if (std::abs(std::log(*known.position)) < 0.03) known.position = 1;
    world.rotor().position_rad -= 1;
    session.Wait(0.1);
    world.farthest_rad = 0;
    scales_ = MeasureScales(session, 0);
    EXPECT_FALSE(world.enabled());
    farthest_rad_ = world.farthest_rad;
    if (faults.faults.empty()) return JudgeScales("drive", believed.drives[0], scales_, known);
    // The small motion that is made before arming.
    const JogResult jog = Jog(session, 0, {0.1, false}, nullptr);
    jog_ =
        JudgeScales("drive", believed.drives[0], FitMotion(believed.drives[0], jog.recording), {});
    return JudgeScales("drive", believed.drives[0], scales_, known);
  }

  DriveScales scales_;
  Judgement jog_;
  double farthest_rad_ = 0;
};

std::string TextOf(const Judgement& judgement) {
  std::string text;
  for (const BenchFinding& finding : judgement.findings)
    text += finding.kind + ": " + finding.text + "\n";
  return text;
}

/// Whether exactly this key is named, and not the end of a longer one.
bool Names(const std::string& text, const std::string& key) {
  return (" " + text).find(" " + key + " is ") != std::string::npos;
}

TEST_P(ScalesOf, EveryWrongValueIsNamedAloneAndTogetherWithOthers) {
  for (const int which : {0, 1}) {
    const std::vector<Wrong> all = AllWrong(GetParam().protocol, which);
    for (unsigned set = 0; set < 1U << all.size(); ++set) {
      // Of more, that all are wrong stands for the rest.
      const bool all_wrong = set + 1 == 1U << all.size();
      if (std::popcount(set) > (which == 0 ? 3 : 2) && !all_wrong) continue;
      const DrivesConfig believed = Believed();
      DrivesConfig actual = believed;
      std::string names;
      for (std::size_t i = 0; i < all.size(); ++i) {
        if ((set >> i & 1U) == 0) continue;
        all[i].in_drive(actual.drives[0]);
        names += all[i].key + " ";
      }
      const Judgement judgement = Judge(believed, actual);
      SCOPED_TRACE(names + "; " + Describe(scales_));
      const std::string text = TextOf(judgement);
      EXPECT_EQ(judgement.findings.empty(), set == 0) << text;
      const bool unsure = text.find("either ") != std::string::npos;
      for (std::size_t i = 0; i < all.size(); ++i) {
        const bool wrong = (set >> i & 1U) != 0;
        // Where several explanations are as good, some that are right are named beside.
        if (!wrong && unsure) continue;
        EXPECT_EQ(Names(text, all[i].key), wrong) << all[i].key << "\n" << text;
      }
    }
  }
}

TEST_P(ScalesOf, OfDrivesThatAreRightNothingIsNamedWhateverTurnsAtTheirShafts) {
  const int seeds = 25;
  int told = 0;
  for (int seed = 0; seed < seeds; ++seed) {
    std::mt19937 random(static_cast<unsigned>(seed));
    const auto between = [&random](double low, double high) {
      return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
    };
    Mechanics mechanics;
    mechanics.inertia_kg_m2 = 0.003 * std::pow(100.0, between(0, 1));
    mechanics.damping_nm_s_per_rad = 0.005 * std::pow(100.0, between(0, 1));
    mechanics.friction_nm = std::max(0.0, between(-0.1, 0.15));
    mechanics.position_rad = between(-1.5, 1.5);
    SimulatedMotorConfig motor;
    motor.torque_time_constant_s = between(0, 0.001);
    motor.encoder_step_rad = 2 * 3.14159265358979 / std::pow(2.0, std::floor(between(13, 18)));
    BusFaultPlan faults;
    faults.seed = static_cast<unsigned>(seed) + 1;
    faults.faults.push_back({});
    faults.faults.back().node = 1;  // the host
    faults.faults.back().probability = between(0, 0.01);
    SCOPED_TRACE(seed);
    const DrivesConfig drives = Believed();
    const Judgement judgement = Judge(drives, drives, mechanics, motor, faults);
    EXPECT_THAT(judgement.findings, IsEmpty())
        << TextOf(judgement) << Describe(scales_) << "\nJ " << mechanics.inertia_kg_m2
        << " viscous " << mechanics.damping_nm_s_per_rad << " dry " << mechanics.friction_nm
        << " explained " << scales_.explained;
    EXPECT_LT(farthest_rad_, 0.2);
    EXPECT_THAT(jog_.findings, IsEmpty()) << TextOf(jog_);
    if (scales_.velocity.told() && scales_.stiffness.told() && scales_.damping.told()) ++told;
  }
  std::printf("%s: all told of %d of %d drives\n", GetParam().protocol.c_str(), told, seeds);
  EXPECT_GE(told, seeds * 3 / 4);
}

TEST_P(ScalesOf, OfAJointThatIsBlockedWhatCannotBeSeenIsNotCalledRight) {
  const DrivesConfig drives = Believed();
  ScaleWorld world(drives, {}, {}, {});
  BenchSession session(world, drives, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  world.stuck = true;
  const DriveScales scales = MeasureScales(session, 0);
  EXPECT_FALSE(scales.velocity.told());
  const Judgement judgement = JudgeScales("drive", drives.drives[0], scales, {});
  EXPECT_THAT(judgement.findings, IsEmpty()) << TextOf(judgement);
  EXPECT_THAT(judgement.not_told, Contains(HasSubstr("the scale of its velocity")));
  EXPECT_THAT(judgement.judged, Not(Contains(HasSubstr("velocity against"))));
}

TEST_P(ScalesOf, TheMotionStaysNearWhereTheJointWasWithAnyWrongValue) {
  const std::vector<Wrong> all = AllWrong(GetParam().protocol, 1);
  for (const Wrong& wrong : all) {
    if (wrong.key == "range.position_rad" || wrong.key == "position_units_per_turn") continue;
    const DrivesConfig believed = Believed();
    DrivesConfig actual = believed;
    wrong.in_drive(actual.drives[0]);
    static_cast<void>(Judge(believed, actual, {0.005, 0.02, 0, 0}));
    EXPECT_LT(farthest_rad_, 0.25) << wrong.key;
  }
}

TEST_P(ScalesOf, BeforeArmingADriveWhoseVelocitiesDoNotFitItsPositionsIsRefused) {
  if (GetParam().protocol == "cansimple") return;  // Both are turns by the protocol.
  const DrivesConfig believed = Believed();
  DrivesConfig actual = believed;
  const std::string key = GetParam().protocol == "mit"    ? "range.velocity_rad_s"
                          : GetParam().protocol == "akv3" ? "pole_pairs x gear_inside"
                                                          : "velocity_units_per_turn_s";
  for (const Wrong& wrong : AllWrong(GetParam().protocol, 0)) {
    if (wrong.key == key) wrong.in_drive(actual.drives[0]);
  }
  class Told final : public BenchOperator {
   public:
    bool Confirm(const std::string& /*what*/, const std::function<void()>& /*on*/) override {
      return true;
    }
    std::string WhichTurned(const std::vector<std::string>& joints,
                            const std::function<void()>& /*on*/) override {
      return joints.front();
    }
    bool Grew(const std::string& /*joint*/, const std::function<void()>& /*on*/) override {
      return true;
    }
    bool Place(const std::string& /*joint*/, double /*rad*/,
               const std::function<void()>& /*on*/) override {
      return true;
    }
    bool TurnThrough(const std::string& /*joint*/, double /*lower*/, double /*upper*/,
                     const std::function<void()>& /*on*/) override {
      return true;
    }
  };
  const auto check = [&](const DrivesConfig& real) {
    ScaleWorld world(real, {}, {}, {});
    Told somebody;
    std::string said;
    CheckBeforeArming(world, believed, {believed.drives[0].joint}, {true, false, false, {}},
                      somebody, [&](const std::string& line) { said += line; });
    return said;
  };
  EXPECT_THAT(check(believed), HasSubstr("and its velocities fit its positions"));
  try {
    static_cast<void>(check(actual));
    FAIL() << "not refused";
  } catch (const Refused& refused) {
    EXPECT_TRUE(Names(refused.what(), key)) << refused.what();
  }
}

INSTANTIATE_TEST_SUITE_P(EveryProtocol, ScalesOf,
                         ::testing::ValuesIn(testing::ExampleOfEveryProtocol()),
                         [](const auto& example) { return example.param.protocol; });

TEST(ScaleJudgement, ATorqueRangeIsNamedWithTheModelsThatAreDeliveredWithIt) {
  const DrivesConfig drives = DefaultDrives({"leg1"});  // those of an AK80-9
  DriveScales scales;
  scales.gains_carried = scales.torque_reported = true;
  scales.explained = 1;
  const auto ratio = [](double value) { return ScaleRatio{std::log(value), 0.001, false}; };
  scales.velocity = scales.position_asked = scales.velocity_asked = ratio(1);
  scales.torque_asked = ratio(1);
  scales.stiffness = scales.damping = ratio(18.0 / 12.0);
  const std::string text = TextOf(JudgeScales("drive", drives.drives[0], scales, {1, {}}));
  EXPECT_THAT(text, HasSubstr("about +-12 in the drive, as AK80-6 is delivered"));
  // Both gains may be others in its place, unless the torque is known.
  EXPECT_THAT(text, HasSubstr("unless it is right"));
  EXPECT_THAT(text, HasSubstr("not told by these measurements"));
  const std::string known = TextOf(JudgeScales("drive", drives.drives[0], scales, {1, 1}));
  EXPECT_TRUE(Names(known, "range.kp_nm_per_rad")) << known;
  EXPECT_TRUE(Names(known, "range.kd_nm_s_per_rad"));
  EXPECT_FALSE(Names(known, "range.torque_nm"));
}

TEST(ScaleJudgement, WithoutAKnownWayPositionAndVelocityAreBothNamed) {
  const DrivesConfig drives = DefaultDrives({"leg1"});
  DriveScales scales;
  scales.gains_carried = true;
  scales.velocity = {std::log(2.0), 0.001, false};
  const Judgement judgement = JudgeScales("drive", drives.drives[0], scales, {});
  ASSERT_EQ(judgement.findings.size(), 1U);
  const std::string text = TextOf(judgement);
  EXPECT_THAT(text, HasSubstr("either "));
  EXPECT_TRUE(Names(text, "range.position_rad"));
  EXPECT_TRUE(Names(text, "range.velocity_rad_s"));
  EXPECT_THAT(judgement.not_told, Contains(HasSubstr("it reports no torque")));
}

TEST(ScaleJudgement, OfAWayThatIsAnotherTheTorqueTellsRangesFromAGearOrStops) {
  const DrivesConfig drives = DefaultDrives({"leg1"});
  const auto judge = [&](double stiffness, double damping) {
    const auto ratio = [](double value) { return ScaleRatio{std::log(value), 0.001, false}; };
    DriveScales scales;
    scales.gains_carried = scales.torque_reported = true;
    scales.explained = 1;
    scales.velocity = scales.position_asked = scales.velocity_asked = ratio(1);
    scales.torque_asked = ratio(1);
    scales.stiffness = ratio(stiffness);
    scales.damping = ratio(damping);
    return TextOf(JudgeScales("drive", drives.drives[0], scales, {0.5, {}}));
  };
  EXPECT_EQ(judge(1, 1), "");  // The way itself is a finding of its own.
  const std::string ranges = judge(0.5, 0.5);
  EXPECT_TRUE(Names(ranges, "range.position_rad")) << ranges;
  EXPECT_TRUE(Names(ranges, "range.velocity_rad_s"));
  EXPECT_FALSE(Names(ranges, "range.torque_nm"));
  EXPECT_THAT(judge(3, 1), HasSubstr("or gear_ratio is another, or its stops are not its limits"));
}

TEST(ScaleJudgement, AReportAgainstTheMotionIsASignAndNotAScale) {
  const DrivesConfig drives = DefaultDrives({"leg1"});
  DriveScales scales;
  scales.velocity = {0, 0.001, true};
  EXPECT_EQ(JudgeScales("drive", drives.drives[0], scales, {}).findings.at(0).kind, "wrong-sign");
}

class ScalesProgram : public ::testing::Test {
 protected:
  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  const std::string drives_ = testing::SourcePath("primitives/robots/tumbler_drives.toml");
  const std::string motion_ = testing::SourcePath("primitives/nominal/handstand.toml");

 private:
  testing::TemporaryFolder folder_;
};

TEST_F(ScalesProgram, RangesOfAnotherModelAreNamedByCommissionAndCheck) {
  std::string actual = testing::ReadFile(drives_);
  actual = ReplacedAll(actual, "velocity_rad_s = [-50.0, 50.0]", "velocity_rad_s = [-30.0, 30.0]");
  actual = ReplacedAll(actual, "torque_nm = [-18.0, 18.0]", "torque_nm = [-25.0, 25.0]");
  testing::WriteFile(Path("actual.toml"), actual);
  for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{
           {"check"}, {"commission", "--seconds", "1", "--out", Path("written.toml")}}) {
    std::vector<std::string> arguments{"tumbler bench", "sim",      "--drives",
                                       drives_,         "--actual", Path("actual.toml"),
                                       "--motion",      motion_};
    arguments.insert(arguments.end(), command.begin(), command.end());
    const testing::Outcome outcome = testing::RunProgram(arguments);
    EXPECT_EQ(outcome.exit_code, 4) << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr("REMAINS other-range: drive mit 1 (leg1): velocities"));
    EXPECT_THAT(outcome.text, HasSubstr("in the drive, as DM4310 is delivered, 0.60 times"));
    EXPECT_THAT(outcome.text, HasSubstr("in the drive, as AK70-10 is delivered, 1.39 times"));
    EXPECT_THAT(outcome.text, Not(HasSubstr("Nothing is amiss")));
  }
}

TEST_F(ScalesProgram, WhatIsNotAmissIsListedWithWhatIsNotTold) {
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler bench", "sim", "--drives", drives_, "--motion", motion_, "check"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("Nothing is amiss of what was judged:"));
  EXPECT_THAT(outcome.text, HasSubstr("(leg2): reported torque against feed-forward, gains"));
  EXPECT_THAT(outcome.text, HasSubstr("Not told by these measurements:"));
  EXPECT_THAT(outcome.text, HasSubstr("only a known load tells"));
}

TEST_F(ScalesProgram, ReadNamesAJointOutsideItsLimitsAndSaysWhenItDoesNotKnowThem) {
  const std::vector<std::string> read{"tumbler bench", "sim",        "--drives", drives_,
                                      "--position",    "leg1=-7.85", "read"};
  std::vector<std::string> with_motion = read;
  with_motion.insert(with_motion.end(), {"--motion", motion_});
  testing::Outcome outcome = testing::RunProgram(with_motion);
  EXPECT_EQ(outcome.exit_code, 4) << outcome.text;
  EXPECT_THAT(outcome.text,
              HasSubstr("REMAINS outside-limits: drive mit 1 (leg1) reports leg1 at -7.85"));
  EXPECT_THAT(outcome.text, Not(HasSubstr("reports leg2 at")));
  outcome = testing::RunProgram(read);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("whether its joint is within its limits, which --motion"));
}

TEST_F(ScalesProgram, TheRatedTorqueThatACia402DriveHoldsIsComparedWithTheFile) {
  const std::string drives = testing::SourcePath("primitives/robots/tumbler_drives_cia402.toml");
  testing::WriteFile(
      Path("actual.toml"),
      ReplacedAll(testing::ReadFile(drives), "rated_torque_nm = 6.0", "rated_torque_nm = 4.0"));
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler bench", "sim", "--drives", drives, "--actual", Path("actual.toml"), "read"});
  EXPECT_EQ(outcome.exit_code, 4) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("rated torque = 4, and rated_torque_nm of the drives file"));
}

}  // namespace
}  // namespace tumbler
