// Shipped motions in engines that others wrote, with contacts of their own. The robot is the one
// that tumbler-export writes, and so are the setpoints: what a user of such an engine has.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numbers>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "common/files/sequence_toml.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/problem/simulated_motion.h"
#include "offline/programs/mjcf.h"
#include "offline/programs/setpoints.h"
#include "tests/support/docs_tables.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

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

struct Row {
  double time_s = 0;
  std::string node;
  std::vector<double> ctrl;
};

std::vector<Row> ParseCsv(const std::string& text, std::size_t joints) {
  std::vector<Row> rows;
  std::size_t at = text.find('\n') + 1;
  while (at < text.size()) {
    const std::size_t end = text.find('\n', at);
    std::vector<std::string> cells(1);
    bool quoted = false;
    for (const char c : text.substr(at, end - at)) {
      if (c == '"') {
        quoted = !quoted;
      } else if (c == ',' && !quoted) {
        cells.emplace_back();
      } else {
        cells.back() += c;
      }
    }
    EXPECT_EQ(cells.size(), 2 + 4 * joints);
    Row row{std::stod(cells[0]), cells[1], {}};
    for (std::size_t j = 0; j < joints; ++j) row.ctrl.push_back(std::stod(cells[5 + 4 * j]));
    rows.push_back(row);
    at = end + 1;
  }
  return rows;
}

/// The numbers of an object in one of MuJoCo's arrays, `size` for each.
template <int size>
mjtNum* NumbersOf(mjtNum* all, int object) {
  return all + static_cast<std::ptrdiff_t>(size) * object;
}

struct ModelDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};

class InMujoco {
 public:
  explicit InMujoco(const std::string& mjcf) {
    const testing::TemporaryFolder folder;
    const std::string file = folder.path() / "model.xml";
    testing::WriteFile(file, mjcf);
    std::array<char, 1000> error{};
    model_.reset(mj_loadXML(file.c_str(), nullptr, error.data(), error.size()));
    if (model_ == nullptr) throw std::runtime_error(error.data());
    data_.reset(mj_makeData(model_.get()));
    as_written_.reset(mj_copyModel(nullptr, model_.get()));
  }
  [[nodiscard]] mjModel& model() { return *model_; }
  [[nodiscard]] mjData& data() { return *data_; }

  void Set(const Contacts& contacts) {
    mj_copyModel(model_.get(), as_written_.get());
    model_->opt.cone = contacts.elliptic ? mjCONE_ELLIPTIC : mjCONE_PYRAMIDAL;
    for (int i = 0; i < model_->ngeom; ++i) {
      if (contacts.mu > 0) *NumbersOf<3>(model_->geom_friction, i) = contacts.mu;
      NumbersOf<2>(model_->geom_solref, i)[0] = contacts.time_constant;
      NumbersOf<2>(model_->geom_solref, i)[1] = contacts.damping_ratio;
    }
  }

  /// Makes the robot another one: each link's mass with its inertia by 5 %, friction, stiffness and
  /// damping of the ground by 20 % (standard deviations). MuJoCo's time constant goes with the
  /// inverse root of the stiffness.
  void Vary(const Contacts& contacts, std::mt19937_64& random) {
    Set(contacts);
    std::normal_distribution<double> normal;
    const auto factor = [&](double spread) { return std::max(1 + spread * normal(random), 0.05); };
    const double mu = factor(0.2), stiffness = factor(0.2), damping = factor(0.2);
    for (int body = 1; body < model_->nbody; ++body) {
      const double mass = factor(0.05);
      model_->body_mass[body] *= mass;
      for (int i = 0; i < 3; ++i) NumbersOf<3>(model_->body_inertia, body)[i] *= mass;
    }
    for (int i = 0; i < model_->ngeom; ++i) {
      *NumbersOf<3>(model_->geom_friction, i) *= mu;
      NumbersOf<2>(model_->geom_solref, i)[0] /= std::sqrt(stiffness);
      NumbersOf<2>(model_->geom_solref, i)[1] *= damping / std::sqrt(stiffness);
    }
    mj_setConst(model_.get(), data_.get());
  }

  /// Where a joint is, or the root's coordinate.
  [[nodiscard]] double Position(const char* joint) const {
    const int id = mj_name2id(model_.get(), mjOBJ_JOINT, joint);
    EXPECT_GE(id, 0) << joint;
    return data_->qpos[model_->jnt_qposadr[id]];
  }

  void Begin() { mj_resetDataKeyframe(model_.get(), data_.get(), 0); }
  void PlayTo(double time_s, const std::vector<double>& ctrl) {
    std::copy(ctrl.begin(), ctrl.end(), data_->ctrl);
    while (data_->time < time_s - 0.5 * model_->opt.timestep) mj_step(model_.get(), data_.get());
  }

 private:
  std::unique_ptr<mjModel, ModelDeleter> as_written_;
  std::unique_ptr<mjModel, ModelDeleter> model_;
  std::unique_ptr<mjData, ModelDeleter> data_;
};

/// Plays a motion, and looks at the root at the end of the hold after each node.
/// @returns  empty when the robot is where each motion's plan ends; or where it is not.
std::string Play(InMujoco& engine, const SequenceFile& file, const std::vector<Row>& rows) {
  constexpr double kPitch_rad = 0.15, kHeight_m = 0.03;
  engine.Begin();
  int cycle = 1;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const bool last = i + 1 == rows.size();
    engine.PlayTo(last ? rows[i].time_s + 1e-3 : rows[i + 1].time_s, rows[i].ctrl);
    if (!last && rows[i + 1].node == rows[i].node) continue;
    const int node = file.graph.FindNode(rows[i].node);
    const PrimitivePose& exit = file.PrimitiveOf(node).exit;
    const double pitch =
        NearestTurn(engine.Position("pitch") - file.RobotPitch(node, exit.root_pitch_rad));
    const double height = engine.Position("z") - exit.root_z_m;
    if (!(std::abs(pitch) < kPitch_rad && std::abs(height) < kHeight_m)) {
      return fmt::format("{}{}", rows[i].node,
                         file.graph.node_count > 1 ? fmt::format(" of cycle {}", cycle) : "");
    }
    if (file.graph.node(node).ends_cycle) ++cycle;
  }
  return "";
}

struct Shipped {
  const char* file;
  int cycles;
};
// Those that are for robots that differ from the model.
constexpr std::array kMotions = {
    Shipped{"handstand.toml", 1},      Shipped{"handstand_wide.toml", 1},
    Shipped{"downstand.toml", 1},      Shipped{"downstand_back.toml", 1},
    Shipped{"roll.toml", 1},           Shipped{"rise.toml", 1},
    Shipped{"rise_from_leg1.toml", 1}, Shipped{"rise_from_leg2.toml", 1},
    Shipped{"stand.toml", 1}};
constexpr std::array kGaits = {Shipped{"gait.toml", 10}, Shipped{"gait_wide.toml", 10},
                               Shipped{"cartwheel.toml", 10}};

/// Plays each with all contacts, and compares the table of what comes of it with the document's.
void ExpectDocumented(std::span<const Shipped> all, const std::string& name) {
  std::vector<std::string> heads = {"motion"};
  for (const Contacts& contacts : kContacts) heads.emplace_back(contacts.name);
  std::string table = testing::MarkdownHead(heads);
  for (const Shipped& shipped : all) {
    const SimulatedMotion motion(
        LoadMotion(testing::SourcePath(std::string("primitives/") + shipped.file)));
    const DriveGains gains = motion.ProblemAt(motion.file().graph.start).drive_gains();
    SetpointOptions options;
    options.cycles = shipped.cycles;
    const std::vector<Row> rows =
        ParseCsv(SetpointsCsv(motion.file(), gains, options),
                 Index(motion.file().primitives.front().primitive.joint_count));
    InMujoco engine(ToMjcf(motion, gains));
    std::vector<std::string> cells = {fmt::format("`{}`", shipped.file)};
    for (const Contacts& contacts : kContacts) {
      engine.Set(contacts);
      const std::string amiss = Play(engine, motion.file(), rows);
      cells.push_back(amiss.empty() ? "yes" : "no: " + amiss);
    }
    table += testing::MarkdownRow(cells);
  }
  testing::ExpectTables(
      "docs/other-simulators.md",
      std::vector<testing::DocsTable>{{"tests/offline/other_simulators_test.cc", name, table}});
}

/// How many of a hundred robots that are not the model stand with these contacts.
int Standing(const SimulatedMotion& motion, const Contacts& contacts) {
  constexpr int kRobots = 100;
  const DriveGains gains = motion.ProblemAt(0).drive_gains();
  const std::vector<Row> rows =
      ParseCsv(SetpointsCsv(motion.file(), gains, {}),
               Index(motion.file().primitives.front().primitive.joint_count));
  InMujoco engine(ToMjcf(motion, gains));
  std::mt19937_64 random(100);
  int stand = 0;
  for (int robot = 0; robot < kRobots; ++robot) {
    engine.Vary(contacts, random);
    if (Play(engine, motion.file(), rows).empty()) ++stand;
  }
  return stand;
}

TEST(OtherSimulators, CarryAHundredRobotsAsTheDocumentSays) {
  const std::array contacts_of = {kContacts[0], kContacts[1], kContacts[5], kContacts[6],
                                  kContacts[7]};
  std::vector<std::string> heads = {"motion"};
  for (const Contacts& contacts : contacts_of) heads.emplace_back(contacts.name);
  std::string table = testing::MarkdownHead(heads);
  for (const char* file : {"handstand.toml", "handstand_wide.toml"}) {
    const SimulatedMotion motion(
        LoadMotion(testing::SourcePath(std::string("primitives/") + file)));
    std::vector<std::string> cells = {fmt::format("`{}`", file)};
    for (const Contacts& contacts : contacts_of)
      cells.push_back(fmt::format("{}", Standing(motion, contacts)));
    table += testing::MarkdownRow(cells);
  }
  testing::ExpectTables("docs/other-simulators.md",
                        std::vector<testing::DocsTable>{
                            {"tests/offline/other_simulators_test.cc", "robots in MuJoCo", table}});
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
  ExpectDocumented(kMotions, "motions in MuJoCo");
}

TEST(OtherSimulators, PlayTenCyclesOfTheGaitsAsTheDocumentSays) {
  ExpectDocumented(kGaits, "gaits in MuJoCo");
}

}  // namespace
}  // namespace tumbler
