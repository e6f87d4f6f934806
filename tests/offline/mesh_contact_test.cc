// Meshes in contact: the corners of their convex hulls, in the plane and in space.

#include <gmock/gmock-matchers.h>
#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/model/contact_model.h"
#include "offline/model/hull_points.h"
#include "offline/model/mesh_points.h"
#include "offline/model/robot.h"
#include "offline/model/robot_finding.h"
#include "offline/pages/shown_scene.h"
#include "offline/pages/space_poses.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/rest_pose.h"
#include "offline/scene/space_scene.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::Program;
using testing::Replaced;

/// A mesh as OBJ, of corners and faces.
std::string Obj(const std::vector<SpaceVector>& corners,
                const std::vector<std::vector<int>>& faces) {
  std::string text;
  for (const SpaceVector& c : corners) text += fmt::format("v {} {} {}\n", c.x(), c.y(), c.z());
  for (const std::vector<int>& face : faces) {
    text += "f";
    for (const int corner : face) text += fmt::format(" {}", corner + 1);
    text += "\n";
  }
  return text;
}

/// A box of whole sides, around a point.
std::string BoxObj(const SpaceVector& sides, const SpaceVector& centre = {0, 0, 0}) {
  std::vector<SpaceVector> corners;
  for (int i = 0; i < 8; ++i) {
    corners.push_back(centre + SpaceVector((i & 4) != 0 ? sides.x() / 2 : -sides.x() / 2,
                                           (i & 2) != 0 ? sides.y() / 2 : -sides.y() / 2,
                                           (i & 1) != 0 ? sides.z() / 2 : -sides.z() / 2));
  }
  return Obj(corners,
             {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}});
}

/// A prism across the plane, of corners in it.
std::string PrismObj(const std::vector<std::array<double, 2>>& outline, double width) {
  const int n = static_cast<int>(outline.size());
  std::vector<SpaceVector> corners;
  for (const double y : {-width / 2, width / 2}) {
    for (const auto& [x, z] : outline) corners.emplace_back(x, y, z);
  }
  std::vector<std::vector<int>> faces(2);
  for (int i = 0; i < n; ++i) {
    faces[0].push_back(i);
    faces[1].push_back(2 * n - 1 - i);
    faces.push_back({i, (i + 1) % n, n + (i + 1) % n, n + i});
  }
  return Obj(corners, faces);
}

std::string Collision(const std::string& form, const std::string& origin = "0 0 0") {
  return fmt::format("<collision><origin xyz=\"{}\"/><geometry>{}</geometry></collision>\n", origin,
                     form);
}

/// A body with a small arm that touches nothing.
std::string BodyWith(const std::string& collisions) {
  return R"(<robot name="body"><link name="base"><inertial><mass value="1"/>
<inertia ixx="0.004" ixy="0" ixz="0" iyy="0.005" iyz="0" izz="0.006"/></inertial>
)" + collisions +
         R"(</link><link name="arm"><inertial><mass value="0.1"/>
<inertia ixx="0.0004" ixy="0" ixz="0" iyy="0.0004" iyz="0" izz="0.0004"/></inertial></link>
<joint name="hip" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>)";
}

/// A task of that robot.
std::string BodyTask(bool in_space, const std::string& contact) {
  return fmt::format(
      R"(format = "tumbler-task"
version = 1
name = "lies"
robot = "body.urdf"
root = "{}"
duration_s = 0.5
settle_s = 0
[start]
{}
joints_rad = {{ hip = 0.0 }}
[end]
joints_rad = {{ hip = 0.0 }}
[spline]
degree = 5
control_points = 8
[limits]
acceleration_max_rad_s2 = 100.0
rotor_inertia_kg_m2 = 0.0
[[cost]]
term = "effort"
weight = 1.0
[contact]
stiffness_n_per_m = 5.0e3
damping_n_s_per_m = 20.0
{}
[[obstacle]]
name = "ground"
point_m = {}
normal = {}
)",
      in_space ? "floating" : "planar-xz",
      in_space ? "quaternion = [0.98, 0.0, 0.19899748, 0.0]" : "pitch_rad = 0.4", contact,
      in_space ? "[0, 0, 0]" : "[0, 0]", in_space ? "[0, 0, 1]" : "[0, 1]");
}

class MeshContact : public ::testing::Test {
 protected:
  /// The task of the body with these collision shapes, which may be meshes of the folder.
  [[nodiscard]] Task TaskWith(const std::string& collisions, bool in_space,
                              const std::string& contact = "meshes = \"points\"") const {
    return ParseTask(BodyTask(in_space, contact), folder_ / "task.toml", BodyWith(collisions),
                     folder_ / "body.urdf", TaskSpaces::kPlaneAndSpace);
  }
  /// What a task with this mesh is told.
  std::string ErrorOf(const std::string& form, bool in_space = false) {
    try {
      static_cast<void>(TaskWith(Collision(form), in_space));
    } catch (const FileError& error) {
      return testing::ReplacedAll(error.what(), folder_.path().string() + "/", "");
    }
    return "nothing";
  }
  std::string ErrorOfObj(const std::string& text) {
    testing::WriteFile(folder_ / "wrong.obj", text);
    return ErrorOf("<mesh filename=\"wrong.obj\"/>");
  }

  testing::TemporaryFolder folder_;
};

/// The forces of the ground on the robot in states at random near it.
template <class Space, class Scene>
std::vector<double> ForcesOf(const Scene& scene) {
  std::vector<double> forces;
  ContactModel<Space> contact(scene.contact, scene.robot.shapes, scene.obstacles);
  HybridDynamics<Space> dynamics(scene.robot.tree);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  const std::size_t n = scene.robot.tree.dofs.size();
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<double> q(n), qd(n), qdd(n), tau(n);
    for (std::size_t j = 0; j < n; ++j) {
      q[j] = any(random);
      qd[j] = any(random);
    }
    q[n - 1] = 0;
    q[Space::kMotions == 3 ? 1 : 2] = 0.1 * any(random);
    dynamics.SetState(q, qd);
    contact.Apply(dynamics);
    dynamics.Solve(qdd, tau);
    forces.insert(forces.end(), qdd.begin(), qdd.end());
    forces.insert(forces.end(), tau.begin(), tau.end());
    forces.push_back(static_cast<double>(contact.active().size()));
  }
  return forces;
}

std::vector<double> ForcesOf(const Task& task) {
  return task.problem.space ? ForcesOf<Spatial>(task.problem.space->scene)
                            : ForcesOf<Plane>(task.problem.scene);
}

void ExpectTheSame(const std::vector<double>& a, const std::vector<double>& b) {
  ASSERT_EQ(a.size(), b.size());
  double largest = 0;
  for (const double value : a) largest = std::max(largest, std::abs(value));
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-12 * largest) << i;
  EXPECT_GT(largest, 100) << "something touches";
}

TEST(HullPoints, OfABoxWithPointsOnItsFacesAreItsCorners) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-1, 1);
  std::vector<SpaceVector> points;
  for (int i = 0; i < 8; ++i)
    points.emplace_back((i & 4) != 0 ? 0.5 : -0.5, (i & 2) != 0 ? 1 : -1, (i & 1) != 0 ? 2 : -2);
  for (int i = 0; i < 2000; ++i) {
    SpaceVector p(0.5 * any(random), any(random), 2 * any(random));
    const int face = i % 4;  // 3: inside
    if (face < 3) p[face] = (p[face] < 0 ? -1 : 1) * (face == 0 ? 0.5 : face);
    points.push_back(p);
  }
  // The middles of edges are as far from some hulls as corners.
  for (const double s : {-1.0, 0.0, 1.0}) points.emplace_back(0.5, s, 2);
  std::shuffle(points.begin(), points.end(), random);
  const HullPoints hull = ChooseHullPoints<SpaceVector>(points, 8);
  EXPECT_EQ(hull.chosen.size(), 8U);
  EXPECT_LT(hull.beyond_m, 1e-12);
  for (const std::size_t i : hull.chosen) {
    EXPECT_EQ(std::abs(points[i].x()), 0.5);
    EXPECT_EQ(std::abs(points[i].y()), 1);
    EXPECT_EQ(std::abs(points[i].z()), 2);
  }
  const HullPoints fewer = ChooseHullPoints<SpaceVector>(points, 7);
  EXPECT_EQ(fewer.chosen.size(), 7U);
  EXPECT_GT(fewer.beyond_m, 0.4) << "a corner is lost";
}

TEST(HullPoints, OfACircleAreThoseOfARegularPolygon) {
  std::vector<PlaneVector> circle;
  for (int i = 0; i < 720; ++i) {
    const double angle = 2 * std::numbers::pi * i / 720;
    circle.emplace_back(std::cos(angle), std::sin(angle));
  }
  const HullPoints hull = ChooseHullPoints<PlaneVector>(circle, 8);
  EXPECT_EQ(hull.chosen.size(), 8U);
  EXPECT_NEAR(hull.beyond_m, 1 - std::cos(std::numbers::pi / 8), 1e-9);
}

TEST(HullPoints, DistanceIsThatFromABoxWithTheseCorners) {
  const SpaceVector half(0.3, 0.5, 0.7);
  std::vector<SpaceVector> corners;
  for (int i = 0; i < 8; ++i) {
    corners.emplace_back((i & 4) != 0 ? half.x() : -half.x(), (i & 2) != 0 ? half.y() : -half.y(),
                         (i & 1) != 0 ? half.z() : -half.z());
  }
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1, 1);
  for (int trial = 0; trial < 2000; ++trial) {
    const SpaceVector p(any(random), any(random), any(random));
    SpaceVector beyond = SpaceVector::Zero();
    for (int i = 0; i < 3; ++i) beyond[i] = p[i] - std::clamp(p[i], -half[i], half[i]);
    EXPECT_NEAR(DistanceFromHull<SpaceVector>(p, corners), beyond.norm(), 1e-10);
  }
}

TEST_F(MeshContact, OfABoxPushesAndRestsAsTheBoxDoes) {
  testing::WriteFile(folder_ / "box.obj", BoxObj({0.25, 0.125, 0.5}));
  for (const bool in_space : {false, true}) {
    const Task mesh = TaskWith(Collision("<mesh filename=\"box.obj\"/>"), in_space);
    const Task box = TaskWith(Collision("<box size=\"0.25 0.125 0.5\"/>"), in_space);
    ASSERT_EQ(mesh.meshes.size(), 1U);
    EXPECT_EQ(mesh.meshes[0].points, in_space ? 8U : 4U);
    EXPECT_EQ(mesh.meshes[0].beyond_m, 0);
    ExpectTheSame(ForcesOf(mesh), ForcesOf(box));
    // It begins on an edge, and falls on a face.
    for (std::size_t j = 0; j < box.problem.start_q.size(); ++j)
      EXPECT_NEAR(mesh.problem.start_q[j], box.problem.start_q[j], 1e-9) << j;
    const double down = in_space ? box.problem.start_q[2] : box.problem.start_q[1];
    EXPECT_NEAR(down, 0.25, 0.01);
  }
}

TEST_F(MeshContact, OfAPrismInThePlaneTouchesWithItsThreeCorners) {
  testing::WriteFile(folder_ / "prism.obj",
                     PrismObj({{-0.25, -0.125}, {0.25, -0.125}, {0, 0.25}}, 0.25));
  const Task mesh = TaskWith(Collision("<mesh filename=\"prism.obj\"/>"), false);
  EXPECT_EQ(mesh.problem.scene.robot.shapes.size(), 3U);
  const Task spheres = TaskWith(Collision("<sphere radius=\"0\"/>", "-0.25 0 -0.125") +
                                    Collision("<sphere radius=\"0\"/>", "0.25 0 -0.125") +
                                    Collision("<sphere radius=\"0\"/>", "0 0 0.25"),
                                false, "");
  ExpectTheSame(ForcesOf(mesh), ForcesOf(spheres));
  EXPECT_NEAR(mesh.problem.start_q[1], 0.125, 0.01);
  EXPECT_NEAR(mesh.problem.start_q[2], 0, 1e-3) << "it lies flat";
}

TEST_F(MeshContact, StandsInItsPlaceWithScaleAndOrigin) {
  testing::WriteFile(folder_ / "mm.obj", BoxObj({250, 125, 500}, {0, 0, 125}));
  const std::string turned =
      "<collision><origin xyz=\"0.125 0 0.0625\" rpy=\"0 1.5707963267948966 0\"/><geometry><mesh "
      "filename=\"package://robots/mm.obj\" scale=\"0.001 0.001 -0.001\"/></geometry></collision>";
  for (const bool in_space : {false, true}) {
    const Task mesh = TaskWith(turned, in_space);
    const Task box = TaskWith(Collision("<box size=\"0.5 0.125 0.25\"/>", "0 0 0.0625"), in_space);
    ExpectTheSame(ForcesOf(mesh), ForcesOf(box));
  }
}

TEST_F(MeshContact, LeavesAllOtherShapesTheirNamesAndTheTextItsLines) {
  testing::WriteFile(folder_ / "box.obj", BoxObj({0.25, 0.125, 0.5}));
  const std::string urdf = BodyWith(
      Collision("<sphere radius=\"0.1\"/>") +
      "<!-- </collision> <mesh> --><collision name='>'>\n<geometry>\n<mesh "
      "filename=\"box.obj\"/></geometry>\n</collision>\n" +
      Collision("<sphere radius=\"0.2\"/>", "1 0 0") + Collision("<mesh filename=\"box.obj\"/>"));
  const Robot before = ParseRobot(urdf, folder_ / "body.urdf", RootKind::kPlanarXz);
  const RobotOfPoints with = WithMeshPoints(urdf, before, 8);
  const Robot after = ParseRobot(with.urdf, folder_ / "body.urdf", RootKind::kPlanarXz);
  ASSERT_EQ(after.collision_shapes.size(), 10U);
  EXPECT_EQ(after.collision_shapes[0].radius_m, 0.1);
  EXPECT_TRUE(after.collision_shapes[1].mesh_point);
  EXPECT_EQ(after.collision_shapes[2].radius_m, 0.2);
  EXPECT_EQ(after.collision_shapes[2].name, "base/2");
  for (std::size_t i = 3; i < 10; ++i) EXPECT_TRUE(after.collision_shapes[i].mesh_point);
  for (const char* part : {"<link name=\"arm\">", "<joint name=\"hip\"", "radius=\"0.2\""})
    EXPECT_EQ(testing::LineOf(with.urdf, part), testing::LineOf(urdf, part)) << part;
  EXPECT_EQ(WithMeshPoints(with.urdf, after, 8).urdf, with.urdf) << "nothing is left to do";
}

TEST_F(MeshContact, IsOnlyOnRequest) {
  testing::WriteFile(folder_ / "box.obj", BoxObj({0.25, 0.125, 0.5}));
  const std::string shapes =
      Collision("<mesh filename=\"box.obj\"/>") + Collision("<sphere radius=\"0.3\"/>");
  const Task ignored = TaskWith(shapes, false, "");
  EXPECT_EQ(ignored.problem.scene.robot.shapes.size(), 1U);
  EXPECT_EQ(ignored.robot_text, BodyWith(shapes));
  EXPECT_THAT(ignored.meshes, IsEmpty());
  EXPECT_EQ(TaskWith(shapes, false, "meshes = \"ignored\"").robot_text, BodyWith(shapes));
  EXPECT_THAT(ErrorOf("<sphere radius=\"0.1\"/>"), "nothing") << "without a mesh";
}

TEST_F(MeshContact, IsThereWithoutItsFileInTheTextThatAPrimitiveHolds) {
  testing::WriteFile(folder_ / "box.obj", BoxObj({0.25, 0.125, 0.5}));
  const Task task = TaskWith(Collision("<mesh filename=\"box.obj\"/>"), true);
  std::filesystem::remove(folder_ / "box.obj");
  const Task again = ParseTask(task.task_text, task.task_file, task.robot_text, task.robot_file,
                               TaskSpaces::kPlaneAndSpace);
  EXPECT_EQ(again.robot_text, task.robot_text);
  EXPECT_EQ(again.problem.space->scene.robot.shapes.size(), 8U);
  EXPECT_EQ(again.problem.start_q, task.problem.start_q);
}

TEST_F(MeshContact, HasAsManyPointsAsAreAskedForAndSaysWhatIsLost) {
  std::vector<std::array<double, 2>> circle;
  for (int i = 0; i < 120; ++i) {
    const double angle = 2 * std::numbers::pi * i / 120;
    circle.push_back({0.25 * std::cos(angle), 0.25 * std::sin(angle)});
  }
  testing::WriteFile(folder_ / "disc.obj", PrismObj(circle, 0.1));
  const std::string disc = Collision("<mesh filename=\"disc.obj\"/>");
  const Task coarse = TaskWith(disc, false, "meshes = \"points\"\nmesh_points = 8");
  EXPECT_EQ(coarse.meshes[0].points, 8U);
  EXPECT_NEAR(coarse.meshes[0].beyond_m, 0.25 * (1 - std::cos(std::numbers::pi / 8)), 1e-4);
  EXPECT_EQ(Describe(coarse.meshes[0]),
            "collision mesh base/0 (disc.obj) touches with 8 points, out of whose hull it sticks "
            "by up to 19 mm");
  const Task fine = TaskWith(disc, false, "meshes = \"points\"\nmesh_points = 40");
  EXPECT_EQ(fine.meshes[0].points, 40U);
  EXPECT_LT(fine.meshes[0].beyond_m, 0.002);
  EXPECT_EQ(TaskWith(disc, false).meshes[0].points, 16U);
}

TEST_F(MeshContact, PointsAreNoOwnShapes) {
  testing::WriteFile(folder_ / "box.obj", BoxObj({0.25, 0.125, 0.5}));
  const std::string shapes =
      Collision("<mesh filename=\"box.obj\"/>") + Collision("<sphere radius=\"0.01\"/>");
  EXPECT_EQ(TaskWith(shapes, false).problem.scene.robot.own_shapes.size(), 1U);
  EXPECT_EQ(TaskWith(shapes, true).problem.space->scene.robot.own_shapes.size(), 1U);
}

TEST_F(MeshContact, PointsAreShownAsSmallBalls) {
  testing::WriteFile(folder_ / "box.obj", BoxObj({0.25, 0.125, 0.5}));
  const std::string shape = Collision("<mesh filename=\"box.obj\"/>");
  const ReportData plane = ReportScene(TaskWith(shape, false).problem);
  std::size_t balls = 0;
  for (const ReportShape& shown : plane.links[0].shapes) {
    if (shown.collides) ++balls;
    EXPECT_GT(shown.radius_m, 0);
  }
  EXPECT_EQ(balls, 4U);
  const std::vector<SpaceBody> bodies = BodiesOf(TaskWith(shape, true).problem.space->scene.robot);
  ASSERT_EQ(bodies[0].shapes.size(), 8U);
  for (const Shape<Spatial>& shown : bodies[0].shapes) EXPECT_EQ(shown.radius_m, kShownPoint_m);
}

TEST_F(MeshContact, ThatCannotBeUsedIsToldWithLinkFileAndWhatToDo) {
  const auto about = [](const char* file, const char* what, const char* todo) {
    return AllOf(HasSubstr(fmt::format("body.urdf:1: link 'base': collision mesh '{}' ", file)),
                 HasSubstr(what), HasSubstr(todo));
  };
  EXPECT_THAT(ErrorOf("<mesh filename=\"package://robots/none.stl\"/>"),
              about("package://robots/none.stl", "is not found", "put it there"));
  testing::WriteFile(folder_ / "a.dae", "<COLLADA/>");
  EXPECT_THAT(ErrorOf("<mesh filename=\"a.dae\"/>"),
              about("a.dae", "is neither STL nor OBJ", "make one of these of it"));
  testing::WriteFile(folder_ / "cut.stl", "solid s\nfacet");
  EXPECT_THAT(ErrorOf("<mesh filename=\"cut.stl\"/>"), about("cut.stl", "", "write it again"));
  EXPECT_THAT(ErrorOfObj(""), about("wrong.obj", "", "write it again"));
  EXPECT_THAT(ErrorOfObj("v 0 0 0\nv 1 0 0\nv 0 0 1\nv nan 1 0\nf 1 2 3\nf 1 2 4\n"),
              about("wrong.obj", "has a corner at (nan, 1, 0)", "write it again"));
  EXPECT_THAT(ErrorOfObj("v 0 0 0\nv 1 0 0\nv 0 0 1\nv 1 0 1\nf 1 2 3\nf 2 3 4\n"),
              about("wrong.obj", "is flat", "spheres, cylinders or boxes"));
  EXPECT_THAT(ErrorOfObj(BoxObj({20, 20, 20})),
              about("wrong.obj", "reaches 17.32 m", "0.001 0.001 0.001"));
  EXPECT_THAT(ErrorOfObj(BoxObj({2e-5, 2e-5, 2e-5})),
              about("wrong.obj", "m large; allowed: from 0.0001 m", "another scale"));
  testing::WriteFile(folder_ / "box.obj", BoxObj({0.25, 0.125, 0.5}));
  for (const bool in_space : {false, true}) {
    EXPECT_THAT(ErrorOf("<mesh filename=\"box.obj\" scale=\"1 0 1\"/>", in_space),
                about("box.obj", "is flat", "spheres"));
  }
}

TEST_F(MeshContact, AllMistakesOfARobotAreToldAtOnce) {
  const std::string urdf =
      BodyWith(Collision("<mesh filename=\"a.obj\"/>") + Collision("<mesh filename=\"b.obj\"/>"));
  const Robot robot = ParseRobot(urdf, folder_ / "body.urdf", RootKind::kFloating);
  try {
    static_cast<void>(WithMeshPoints(urdf, robot, 8));
    ADD_FAILURE();
  } catch (const RobotFileError& error) {
    EXPECT_EQ(error.findings().size(), 2U);
  }
}

/// The shipped robot with meshes alone where it touches.
std::string MeshTumbler() {
  std::string robot = testing::ShippedRobot();
  constexpr std::string_view kEnd = "</collision>";
  for (std::size_t at = robot.find("<collision>"); at != std::string::npos;
       at = robot.find("<collision>"))
    robot.erase(at, robot.find(kEnd, at) + kEnd.size() - at);
  const auto add = [&robot](const std::string& link, const std::string& mesh,
                            const std::string& origin) {
    robot = Replaced(robot, "</link>",
                     Collision(fmt::format("<mesh filename=\"{}\"/>", mesh), origin) + "</link>",
                     "<link name=\"" + link + "\">");
  };
  add("middle", "../meshes/body.obj", "0 0 0");
  add("leg1_link", "package://any/meshes/sole.obj", "0.2 0 0");
  add("leg2_link", "package://any/meshes/sole.obj", "-0.2 0 0");
  return robot;
}

TEST(MeshRobot, IsToldByTheCheckWhatItsMeshesCouldTouchWith) {
  const testing::TemporaryFolder folder;
  testing::WriteFile(folder / "body.urdf", BodyWith(Collision("<mesh filename=\"box.obj\"/>")));
  const auto check = [&folder](std::vector<std::string> more) {
    more.insert(more.begin(),
                {testing::ProgramPath("tumbler model"), "check", folder / "body.urdf"});
    Program program(more);
    const int status = program.Wait();
    return std::pair(status, program.text());
  };
  EXPECT_THAT(check({}).second,
              AllOf(HasSubstr("can be planned: only where it touches nothing (obstacle = []); to "
                              "touch anything it needs collision shapes: spheres, cylinders, "
                              "capsules or boxes, or points of its meshes: contact.meshes = "
                              "\"points\" in the task, --mesh-points here"),
                    HasSubstr("base/0 is a mesh: contact ignores it")));
  const auto [missing, why] = check({"--mesh-points", "16"});
  EXPECT_EQ(missing, 1);
  EXPECT_THAT(why, HasSubstr("link 'base': collision mesh 'box.obj' is not found"));
  testing::WriteFile(folder / "box.obj", BoxObj({0.25, 0.125, 0.5}));
  for (const char* root : {"planar-xz", "floating"}) {
    const auto [status, text] = check({"--mesh-points", "16", "--root", root});
    EXPECT_EQ(status, 0);
    EXPECT_THAT(text, AllOf(HasSubstr("can be planned: yes"),
                            HasSubstr(fmt::format("base/0 (box.obj) touches with {} points, the "
                                                  "corners of its hull",
                                                  root == std::string("floating") ? 8 : 4))));
  }
}

TEST(MeshRobot, GetsAMotionThatIsPlayedWithoutItsMeshes) {
  testing::TaskFolder folder(
      Replaced(testing::QuickTask(), "[contact]", "[contact]\nmeshes = \"points\""), MeshTumbler());
  std::filesystem::create_directories(folder.path() / "meshes");
  testing::WriteFile(folder / "meshes/body.obj", BoxObj({0.36, 0.06, 0.06}));
  testing::WriteFile(folder / "meshes/sole.obj",
                     PrismObj({{-0.01, -0.05}, {0.01, -0.05}, {0.01, 0.05}, {-0.01, 0.05}}, 0.06));
  const std::string motion = folder / "motion.toml";
  Program optimize({testing::ProgramPath("tumbler optimize"), folder.task_file(), "--out", motion,
                    "--report", folder / "motion.html"});
  EXPECT_EQ(optimize.Wait(), 0) << optimize.text();
  EXPECT_THAT(optimize.text(), HasSubstr("link 'leg1_link': note: collision mesh leg1_link/0 "
                                         "(package://any/meshes/sole.obj) touches with 4 points"));
  // Its exit is no shape in which the task begins, but it is that of the same robot.
  const std::vector<std::string> on = {testing::ProgramPath("tumbler optimize"),
                                       folder.task_file(),
                                       "--start-from",
                                       motion,
                                       "--out",
                                       folder / "next.toml"};
  Program same(on);
  EXPECT_EQ(same.Wait(), 1);
  EXPECT_THAT(same.text(), HasSubstr("start.joints_rad"));
  testing::WriteFile(folder / "meshes/body.obj", BoxObj({0.34, 0.06, 0.06}));
  Program other(on);
  EXPECT_EQ(other.Wait(), 1);
  EXPECT_THAT(other.text(), HasSubstr("is not the robot of the task"));
  std::filesystem::remove_all(folder.path() / "meshes");
  std::filesystem::remove(folder.robot_file());
  Program run({testing::ProgramPath("tumbler run"), "sim", motion});
  EXPECT_EQ(run.Wait(), 0) << run.text();
  // A primitive that somebody gave a mesh makes no program look for files.
  PrimitiveFile forged = LoadPrimitive(motion);
  forged.provenance.robot_urdf = MeshTumbler();
  try {
    static_cast<void>(TaskOf(forged));
    ADD_FAILURE();
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("collision mesh '../meshes/body.obj', of which a primitive "
                                        "holds the points; make it again with tumbler optimize"));
  }
}

}  // namespace
}  // namespace tumbler
