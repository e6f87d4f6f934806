// PostureWatch tells from a robot's motion whether it rests, in which pose, and whether it fell.

#include "offline/twin/posture.h"

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "offline/twin/simulated_robot.h"
#include "tests/support/nominal_gait.h"

namespace tumbler {
namespace {

using testing::Gait;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kMs;

constexpr DrivesPosture kOn{true, false};
constexpr DrivesPosture kTaken{false, false};  // a watchdog took the torque away
constexpr DrivesPosture kLetGo{false, true};

/// A watch on the gait's robot, to which tests show poses.
class Watcher {
 public:
  explicit Watcher(const PostureConfig& config = {})
      : watch_(Gait().file(), config, StartOf(Gait().file())) {}

  /// Shows this pose, at rest, for a while.
  void Rest(double pitch_rad, double z_m, double leg1_rad, double leg2_rad,
            const DrivesPosture& drives = kOn, int ms = 400) {
    state_.root_pitch_rad = pitch_rad;
    state_.root_z_m = z_m;
    state_.joint_positions_rad = {leg1_rad, leg2_rad};
    state_.joint_velocities_rad_s = {0, 0};
    state_.root_pitch_rate_rad_s = 0;
    Look(drives, ms);
  }
  void Move(const DrivesPosture& drives = kOn, int ms = 100) {
    state_.root_pitch_rate_rad_s = 1;
    Look(drives, ms);
  }
  void Touch(const std::string& link) {
    state_.time_ns += kMs;
    watch_.Observe(state_, {{link, "ground", 5}}, kOn);
  }
  /// Lets own shapes overlap by this much; 0: they are apart.
  void Overlap(double depth_m) {
    state_.time_ns += kMs;
    state_.self_overlap_m = depth_m;
    state_.overlapping = depth_m > 0 ? "leg1_link/0 and leg2_link/1" : "";
    watch_.Observe(state_, {}, kOn);
  }
  void Hold() {
    state_.held = true;
    Look(kLetGo, 10);
    state_.held = false;
  }
  [[nodiscard]] const PostureWatch& watch() const { return watch_; }

 private:
  void Look(const DrivesPosture& drives, int ms) {
    for (int i = 0; i < ms; ++i) {
      state_.time_ns += kMs;
      watch_.Observe(state_, {}, drives);
    }
  }
  PostureWatch watch_;
  TwinState state_;
};

constexpr double kHome_m = 0.219, kUp_m = 0.369, kFlat_m = 0.057;

void StandUp(Watcher& scene) { scene.Rest(M_PI / 2, kUp_m, 0, 0); }
void LieFlat(Watcher& scene, const DrivesPosture& drives = kOn) {
  scene.Rest(0, kFlat_m, 0, 0, drives);
}

TEST(Posture, AJointThatSlidesIsElsewhereAfterCentimetres) {
  for (const bool slides : {false, true}) {
    PostureWatch watch(Gait().file(), {}, StartOf(Gait().file()), {{false, slides}, {}});
    TwinState state;
    state.root_pitch_rad = M_PI / 2;
    state.root_z_m = kUp_m;
    state.joint_velocities_rad_s = {0, 0};
    for (const double q : {0.04, 0.08}) {
      state.joint_positions_rad = {0, q};
      for (int i = 0; i < 400; ++i) {
        state.time_ns += kMs;
        watch.Observe(state, {}, kOn);
      }
      EXPECT_EQ(watch.resting_as(), slides && q > 0.05 ? "" : "as after handstand") << q;
    }
  }
}

TEST(Posture, APassageThroughTheGaitIsARestInEachOfItsPosesAndNoFall) {
  Watcher scene;
  scene.Rest(0, kHome_m, -M_PI / 2, M_PI / 2);
  scene.Move();
  StandUp(scene);
  EXPECT_EQ(scene.watch().resting_as(), "as after handstand");
  scene.Move();
  EXPECT_EQ(scene.watch().resting_as(), "");
  scene.Rest(M_PI, kHome_m, M_PI / 2, -M_PI / 2);
  scene.Move();
  scene.Rest(3 * M_PI / 2, kUp_m, 0, 0);
  scene.Move();
  scene.Rest(2 * M_PI, kHome_m, -M_PI / 2, M_PI / 2);
  scene.Move();
  scene.Rest(2 * M_PI + M_PI / 2, kUp_m, 0, 0);  // Whole turns do not count.
  std::vector<std::string> poses;
  for (const PostureEvent& event : scene.watch().events()) {
    EXPECT_EQ(event.kind, PostureEvent::Kind::kRest);
    poses.push_back(event.pose);
  }
  EXPECT_EQ(poses, (std::vector<std::string>{"as after downstand, swapped", "as after handstand",
                                             "as after downstand", "as after handstand, swapped",
                                             "as after downstand, swapped", "as after handstand"}));
  EXPECT_EQ(scene.watch().falls(), 0);
}

TEST(Posture, ALongRunKeepsItsFallsAndAsManyEventsAsAShortOne) {
  Watcher scene;
  scene.Rest(0, kHome_m, -M_PI / 2, M_PI / 2);
  std::size_t rests = 1;
  for (int i = 0; i < 1000; ++i) {
    scene.Move();
    ++rests;
    if (i == 10 || i == 700) {
      LieFlat(scene);
    } else {
      StandUp(scene);
    }
    ASSERT_LE(scene.watch().events().size(), PostureWatch::kKept);
  }
  const std::vector<PostureEvent>& events = scene.watch().events();
  EXPECT_EQ(events.size() + scene.watch().left_out(), rests + 2);
  EXPECT_EQ(std::ranges::count(events, PostureEvent::Kind::kFall, &PostureEvent::kind), 2);
  EXPECT_TRUE(std::ranges::is_sorted(events, {}, &PostureEvent::time_ns));
  EXPECT_EQ(events.back().pose, "as after handstand");
}

TEST(Posture, RestInAPoseOfNoMotionIsAFallOnceTheDrivesWereEnabled) {
  Watcher scene;
  LieFlat(scene, kLetGo);
  EXPECT_EQ(scene.watch().falls(), 0) << "nobody has driven it yet";
  scene.Move();
  LieFlat(scene);
  EXPECT_EQ(scene.watch().falls(), 1);
  const PostureEvent& fall = scene.watch().events().back();
  EXPECT_EQ(fall.kind, PostureEvent::Kind::kFall);
  EXPECT_NEAR(fall.root_z_m, kFlat_m, 1e-12);
  EXPECT_THAT(Describe(fall), HasSubstr("no motion begins or ends in"));
  EXPECT_TRUE(scene.watch().fallen());
}

TEST(Posture, EachOfPitchHeightAndJointsTellsAPoseFromAnother) {
  for (const bool of_pitch : {true, false}) {
    Watcher scene;
    scene.Rest(M_PI / 2 + (of_pitch ? 0.12 : 0.08), kUp_m, 0, 0);
    EXPECT_EQ(scene.watch().falls(), of_pitch ? 1 : 0);
  }
  for (const bool of_height : {true, false}) {
    Watcher scene;
    scene.Rest(M_PI / 2, kUp_m + (of_height ? 0.1 : 0.07), 0, 0);
    EXPECT_EQ(scene.watch().falls(), of_height ? 1 : 0);
  }
  for (const bool of_joint : {true, false}) {
    Watcher scene;
    scene.Rest(M_PI / 2, kUp_m, 0, of_joint ? -0.35 : -0.25);
    EXPECT_EQ(scene.watch().falls(), of_joint ? 1 : 0);
  }
}

TEST(Posture, PassingThroughRestForAMomentIsNeitherRestNorFall) {
  Watcher scene;
  for (int i = 0; i < 10; ++i) {
    scene.Rest(1.0, 0.3, 0, 0, kOn, 250);
    scene.Move(kOn, 5);
  }
  EXPECT_THAT(scene.watch().events(), IsEmpty());
}

TEST(Posture, AFallCountsOnceUntilTheRobotIsInAKnownPoseAgainOrHeld) {
  Watcher scene;
  LieFlat(scene);
  scene.Move();
  LieFlat(scene);
  EXPECT_EQ(scene.watch().falls(), 1);
  StandUp(scene);
  EXPECT_FALSE(scene.watch().fallen());
  LieFlat(scene);
  EXPECT_EQ(scene.watch().falls(), 2);
  scene.Hold();
  EXPECT_FALSE(scene.watch().fallen());
  scene.Move();
  LieFlat(scene);
  EXPECT_EQ(scene.watch().falls(), 3);
}

TEST(Posture, ARobotLetGoInAKnownPoseMayCollapseAndOneThatLosesItsTorqueMayNot) {
  Watcher let_go;
  StandUp(let_go);
  StandUp(let_go);
  let_go.Rest(M_PI / 2, kUp_m, 0, 0, kLetGo, 10);
  let_go.Move(kLetGo);
  LieFlat(let_go, kLetGo);
  EXPECT_EQ(let_go.watch().falls(), 0);

  Watcher rocking;
  StandUp(rocking);
  rocking.Move();
  rocking.Move(kLetGo);
  LieFlat(rocking, kLetGo);
  EXPECT_EQ(rocking.watch().falls(), 0) << "upright, but not at rest";

  Watcher watchdog;
  StandUp(watchdog);
  watchdog.Rest(M_PI / 2, kUp_m, 0, 0, kTaken, 10);
  watchdog.Move(kTaken);
  LieFlat(watchdog, kTaken);
  EXPECT_EQ(watchdog.watch().falls(), 1);

  Watcher in_mid_motion;
  in_mid_motion.Rest(0.8, 0.3, 0, 0, kOn, 100);
  in_mid_motion.Move();
  in_mid_motion.Move(kLetGo);
  LieFlat(in_mid_motion, kLetGo);
  EXPECT_EQ(in_mid_motion.watch().falls(), 1);
}

TEST(Posture, ALinkThatMustNotTouchFellsTheRobotAtOnce) {
  PostureConfig config;
  config.clear_links = {"middle"};
  Watcher scene(config);
  scene.Move();
  scene.Touch("leg1_link");
  EXPECT_EQ(scene.watch().falls(), 0);
  scene.Touch("middle");
  ASSERT_EQ(scene.watch().falls(), 1);
  EXPECT_EQ(scene.watch().events().back().cause, "middle touches ground");
  Watcher tolerant;
  tolerant.Move();
  tolerant.Touch("middle");
  EXPECT_EQ(tolerant.watch().falls(), 0);
}

TEST(Posture, OwnShapesThatOverlapAreToldOnceUntilTheyAreApartAgain) {
  Watcher scene;
  StandUp(scene);
  const std::size_t before = scene.watch().events().size();
  scene.Overlap(0.002);
  scene.Overlap(0.005);
  ASSERT_EQ(scene.watch().events().size(), before + 1);
  const PostureEvent& event = scene.watch().events().back();
  EXPECT_EQ(event.kind, PostureEvent::Kind::kOverlap);
  EXPECT_THAT(Describe(event),
              HasSubstr("GOES THROUGH ITSELF: leg1_link/0 and leg2_link/1 overlap"));
  scene.Overlap(0);
  scene.Overlap(0.001);
  EXPECT_EQ(scene.watch().overlaps(), 2);
  EXPECT_EQ(scene.watch().falls(), 0);
}

}  // namespace
}  // namespace tumbler
