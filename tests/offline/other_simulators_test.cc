// Shipped motions in engines that others wrote, with contacts of their own. The robot is the one
// that tumbler export writes, and so are the setpoints: what a user of such an engine has.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/problem/simulated_motion.h"
#include "offline/programs/mjcf.h"
#include "tests/offline/played_motion.h"
#include "tests/support/files.h"
#include "tests/support/mujoco_model.h"

namespace tumbler {
namespace {

using testing::PlayedMotion;

/// How the contacts of an engine are set.
struct Contacts {
  const char* name;
  double mu;             ///< 0: the motion's own.
  double time_constant;  ///< MuJoCo's solref [s]: of how soft the ground is.
  double damping_ratio;  ///< Likewise.
  bool elliptic;         ///< The cone of friction.
};

constexpr std::array kContacts = {Contacts{"as it comes", 0, 0.02, 1, false},
                                  Contacts{"5 ms", 0, 0.005, 1, false},
                                  Contacts{"2 ms", 0, 0.002, 1, false},
                                  Contacts{"5 ms, elliptic cone", 0, 0.005, 1, true},
                                  Contacts{"5 ms, bouncing", 0, 0.005, 0.3, false},
                                  Contacts{"5 ms, mu 0.15", 0.15, 0.005, 1, false},
                                  Contacts{"5 ms, mu 0.6", 0.6, 0.005, 1, false},
                                  Contacts{"5 ms, mu 0.9", 0.9, 0.005, 1, false}};

class InMujoco : public testing::Engine {
 public:
  explicit InMujoco(const std::string& mjcf)
      : as_written_(testing::LoadMjcf(mjcf)),
        model_(mj_copyModel(nullptr, as_written_.get())),
        data_(mj_makeData(model_.get())) {}
  [[nodiscard]] mjModel& model() { return *model_; }
  [[nodiscard]] mjData& data() { return *data_; }

  void Set(const Contacts& contacts) {
    mj_copyModel(model_.get(), as_written_.get());
    model_->opt.cone = contacts.elliptic ? mjCONE_ELLIPTIC : mjCONE_PYRAMIDAL;
    for (int i = 0; i < model_->ngeom; ++i) {
      if (contacts.mu > 0) *testing::NumbersOf<3>(model_->geom_friction, i) = contacts.mu;
      testing::NumbersOf<2>(model_->geom_solref, i)[0] = contacts.time_constant;
      testing::NumbersOf<2>(model_->geom_solref, i)[1] = contacts.damping_ratio;
    }
  }

  /// Makes the robot another one. MuJoCo's time constant goes with the inverse root of the ground's
  /// stiffness.
  void Set(const Contacts& contacts, const testing::RobotFactors& factors) {
    Set(contacts);
    for (int body = 1; body < model_->nbody; ++body) {
      const double mass = factors.masses.at(Index(body) - 1);
      model_->body_mass[body] *= mass;
      for (int i = 0; i < 3; ++i) testing::NumbersOf<3>(model_->body_inertia, body)[i] *= mass;
    }
    const double slower = 1 / std::sqrt(factors.stiffness);
    for (int i = 0; i < model_->ngeom; ++i) {
      *testing::NumbersOf<3>(model_->geom_friction, i) *= factors.mu;
      testing::NumbersOf<2>(model_->geom_solref, i)[0] *= slower;
      testing::NumbersOf<2>(model_->geom_solref, i)[1] *= factors.damping * slower;
    }
    mj_setConst(model_.get(), data_.get());
  }

  [[nodiscard]] double Position(const std::string& joint) const override {
    const int id = mj_name2id(model_.get(), mjOBJ_JOINT, joint.c_str());
    EXPECT_GE(id, 0) << joint;
    return data_->qpos[model_->jnt_qposadr[id]];
  }

  void Begin() override { mj_resetDataKeyframe(model_.get(), data_.get(), 0); }
  void PlayTo(double time_s, const std::vector<double>& ctrl) override {
    std::copy(ctrl.begin(), ctrl.end(), data_->ctrl);
    while (data_->time < time_s - 0.5 * model_->opt.timestep) mj_step(model_.get(), data_.get());
  }

 private:
  testing::MujocoModel as_written_, model_;
  testing::MujocoData data_;
};

constexpr const char* kSource = "tests/offline/other_simulators_test.cc";

std::vector<std::string> NamesOf(std::span<const Contacts> all) {
  std::vector<std::string> names;
  for (const Contacts& contacts : all) names.emplace_back(contacts.name);
  return names;
}

/// What comes of a motion with all contacts.
std::vector<std::string> WithAllContacts(const PlayedMotion& played) {
  InMujoco engine(ToMjcf(played.motion(), played.gains()));
  std::vector<std::string> cells;
  for (const Contacts& contacts : kContacts) {
    engine.Set(contacts);
    const std::string amiss = played.Play(engine);
    cells.push_back(amiss.empty() ? "yes" : "no: " + amiss);
  }
  return cells;
}

/// How many of a hundred robots that are not the model stand with these contacts.
int Standing(const PlayedMotion& played, const Contacts& contacts,
             std::uint64_t seed = testing::kDocumentedRobots) {
  InMujoco engine(ToMjcf(played.motion(), played.gains()));
  int stand = 0;
  for (const testing::RobotFactors& factors :
       testing::AHundredRobots(engine.model().nbody - 1, seed)) {
    engine.Set(contacts, factors);
    if (played.Play(engine).empty()) ++stand;
  }
  return stand;
}

TEST(OtherSimulators, CarryAHundredRobotsAsTheDocumentSays) {
  static constexpr std::array kOfRobots = {kContacts[0], kContacts[1], kContacts[5], kContacts[6],
                                           kContacts[7]};
  constexpr std::array kHandstands = {testing::Shipped{"handstand.toml", 1},
                                      testing::Shipped{"handstand_wide.toml", 1}};
  testing::ExpectDocumented(kHandstands, kSource, "robots in MuJoCo", NamesOf(kOfRobots),
                            [](const PlayedMotion& played) {
                              std::vector<std::string> cells;
                              for (const Contacts& contacts : kOfRobots)
                                cells.push_back(fmt::format("{}", Standing(played, contacts)));
                              return cells;
                            });
}

TEST(OtherSimulators, CarryAHundredRobotsByWhichNoMotionWasChosen) {
  const PlayedMotion wide("handstand_wide.toml");
  EXPECT_GE(Standing(wide, kContacts[0], 201), 90);
  EXPECT_GE(Standing(wide, kContacts[1], 201), 97);
}

TEST(OtherSimulators, AccelerateTheRobotInTheAirAsOurDynamicsDo) {
  const SimulatedMotion motion(LoadMotion(testing::SourcePath("primitives/handstand.toml")));
  PlanarRobot robot = motion.scene().robot;
  for (Dof<Plane>& dof : robot.tree.dofs) dof.prescribed = false;
  HybridDynamics<Plane> dynamics(robot.tree);
  InMujoco engine(ToMjcf(motion, {0, 0}));
  ASSERT_EQ(engine.model().nq, 5);  // in our order, as the robot's tree is written
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> any(-1, 1);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<double> q(5), qd(5), qdd(5), tau(5);
    for (double& x : q) x = 2 * any(random);
    for (double& x : qd) x = 5 * any(random);
    q[1] = 10;  // far above the ground
    tau[3] = 5 * any(random);
    tau[4] = 5 * any(random);
    std::ranges::copy(q, engine.data().qpos);
    std::ranges::copy(qd, engine.data().qvel);
    engine.data().ctrl[0] = tau[3];
    engine.data().ctrl[1] = tau[4];
    mj_forward(&engine.model(), &engine.data());
    dynamics.SetState(q, qd);
    dynamics.Solve(qdd, tau);
    for (std::size_t i = 0; i < 5; ++i)
      EXPECT_NEAR(engine.data().qacc[i], qdd[i], 1e-6 * (1 + std::abs(qdd[i]))) << i;
  }
}

TEST(OtherSimulators, ReadNamesWithTwoHyphensAsTheyAre) {
  SequenceFile file = LoadMotion(testing::SourcePath("primitives/nominal/handstand.toml"));
  file.graph.name = FixedString<48>("hand--stand-");
  PrimitiveFile& primitive = file.primitives.front();
  for (std::string* text : {&primitive.provenance.robot_urdf, &primitive.provenance.task_toml}) {
    for (std::size_t at = text->find("leg1"); at != std::string::npos; at = text->find("leg1", at))
      text->replace(at, 4, "leg--1");
  }
  for (JointMotion<double>& motion : std::span(primitive.primitive.joints).first(2)) {
    if (motion.name.view() == "leg1") motion.name = FixedString<32>("leg--1");
  }
  const SimulatedMotion motion(file);
  const std::string text = ToMjcf(motion, motion.problem().drive_gains());
  const std::size_t comment = text.find("<!--") + 4;
  EXPECT_EQ(text.find("--", comment), text.find("-->", comment)) << "XML has no -- in a comment";
  const testing::MujocoModel model = testing::LoadMjcf(text);
  EXPECT_EQ(std::string(model->names), "hand--stand-");
  EXPECT_GE(mj_name2id(model.get(), mjOBJ_JOINT, "leg--1"), 0) << "as setpoints name it";
}

TEST(OtherSimulators, BeginWithTheFeetOnTheGround) {
  const SimulatedMotion motion(LoadMotion(testing::SourcePath("primitives/handstand.toml")));
  const PrimitivePose& entry = motion.file().PrimitiveOf(0).entry;
  const std::vector<double> q = PositionsIn(entry, motion.scene().robot);
  // By hand: legs of 0.2 m straight down, feet of 10 mm.
  EXPECT_NEAR(ClearanceAt(motion.scene(), q), entry.root_z_m - 0.21, 1e-6);
  InMujoco engine(ToMjcf(motion, {40, 5}));
  engine.Begin();
  EXPECT_NEAR(engine.Position("z"), 0.21, 1e-6);
  EXPECT_NEAR(engine.Position("leg1"), -std::numbers::pi / 2, 1e-12);
}

TEST(OtherSimulators, PlayShippedMotionsAsTheDocumentSays) {
  testing::ExpectDocumented(testing::ShippedMotions(), kSource, "motions in MuJoCo",
                            NamesOf(kContacts), WithAllContacts);
}

TEST(OtherSimulators, PlayTenCyclesOfTheWideGaitWithAnyFrictionAsTheDocumentSays) {
  constexpr std::array kWide = {testing::Shipped{"handstand_wide.toml", 1},
                                testing::Shipped{"gait_wide.toml", 10}};
  static constexpr std::array kFrictions = {0.15, 0.3, 0.45, 0.6, 0.75, 0.9};
  std::vector<std::string> heads;
  for (const double mu : kFrictions) heads.push_back(fmt::format("mu {}", mu));
  testing::ExpectDocumented(
      kWide, kSource, "friction in MuJoCo", heads, [](const PlayedMotion& played) {
        InMujoco engine(ToMjcf(played.motion(), played.gains()));
        std::vector<std::string> cells;
        for (const double mu : kFrictions) {
          std::vector<std::pair<std::string, std::string>> amiss;
          for (Contacts contacts : {kContacts[0], kContacts[1], kContacts[2]}) {
            contacts.mu = mu;
            engine.Set(contacts);
            amiss.emplace_back(contacts.name, played.Play(engine));
          }
          cells.push_back(testing::CellOf(amiss));
        }
        return cells;
      });
}

TEST(OtherSimulators, PlayTenCyclesOfTheGaitsAsTheDocumentSays) {
  testing::ExpectDocumented(testing::ShippedGaits(), kSource, "gaits in MuJoCo", NamesOf(kContacts),
                            WithAllContacts);
}

}  // namespace
}  // namespace tumbler
