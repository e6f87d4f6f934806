// The outlines of meshes that a robot file names, for pages.

#include "offline/pages/mesh_outline.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>

#include "offline/model/mesh_file.h"
#include "offline/pages/shown_scene.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;

// A tetrahedron with corners at the origin and at 1 along each axis, and a point inside.
constexpr const char* kObj =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0.2 0.1 0.2\n"
    "f 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\nf 1 2 5\n";
constexpr const char* kStl =
    "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 2 0 0\nvertex 0 0 1\nendloop\n"
    "endfacet\nendsolid s\n";

std::vector<std::array<double, 2>> CornersOf(const Outline& outline) {
  std::vector<std::array<double, 2>> corners;
  for (const Plane::Vector& c : outline.corners)
    corners.push_back({std::round(1e6 * c.x()) * 1e-6 + 0, std::round(1e6 * c.y()) * 1e-6 + 0});
  return corners;
}

class Meshes : public ::testing::Test {
 protected:
  Meshes() {
    std::filesystem::create_directories(folder_.path() / "arm_description" / "urdf");
    std::filesystem::create_directories(folder_.path() / "arm_description" / "meshes");
    testing::WriteFile(folder_ / "arm_description/meshes/a.obj", kObj);
    testing::WriteFile(folder_ / "arm_description/meshes/b.STL", kStl);
  }

  testing::TemporaryFolder folder_;
  std::string robot_ = folder_ / "arm_description/urdf/arm.urdf";
};

TEST_F(Meshes, AreFoundFromTheRobotsFileOrInThePackageAboveIt) {
  const std::string mesh =
      (folder_.path() / "arm_description" / "meshes" / "a.obj").lexically_normal().string();
  for (const std::string& named : {std::string("package://arm_description/meshes/a.obj"),
                                   std::string("package://another_name/meshes/a.obj"),
                                   std::string("model://arm_description/meshes/a.obj"),
                                   std::string("../meshes/a.obj"), "file://" + mesh, mesh}) {
    EXPECT_EQ(std::filesystem::path(FindMesh(named, robot_)).lexically_normal(), mesh) << named;
  }
  for (const char* named : {"package://arm_description/meshes/none.obj", "package://", "none.stl",
                            "../meshes", "", "http://example.org/a.obj"}) {
    EXPECT_EQ(FindMesh(named, robot_), "") << named;
  }
}

TEST_F(Meshes, OfBothFormatsAreConvexHullsInTheBodysPlane) {
  DrawnMesh mesh;
  mesh.file = "../meshes/a.obj";
  EXPECT_THAT(CornersOf(MeshOutline(mesh, robot_)),
              ElementsAre(ElementsAre(0, 0), ElementsAre(1, 0), ElementsAre(0, 1)));
  mesh.scale = {0.5, 1, 2};
  mesh.pose.translation = {3, 0, -1};
  EXPECT_THAT(CornersOf(MeshOutline(mesh, robot_)),
              ElementsAre(ElementsAre(3, -1), ElementsAre(3.5, -1), ElementsAre(3, 1)));
  mesh = {};
  mesh.file = "../meshes/b.STL";
  EXPECT_THAT(CornersOf(MeshOutline(mesh, robot_)),
              ElementsAre(ElementsAre(0, 0), ElementsAre(2, 0), ElementsAre(0, 1)));
}

TEST_F(Meshes, ThatAreNoneOrFlatOrCannotBeReadHaveNoOutline) {
  testing::WriteFile(folder_ / "broken.stl", "solid s\nfacet");
  testing::WriteFile(folder_ / "empty.obj", "");
  testing::WriteFile(folder_ / "flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  testing::WriteFile(folder_ / "a.toml", kObj);
  for (const char* name : {"broken.stl", "empty.obj", "flat.obj", "a.toml", "none.obj"}) {
    DrawnMesh mesh;
    mesh.file = folder_ / name;
    EXPECT_TRUE(MeshOutline(mesh, robot_).corners.empty()) << name;
  }
}

TEST_F(Meshes, AreReadAsAWholeOrNotAtAll) {
  // What reads them leaves out corners without a digit before the point, takes a file that is cut
  // off between faces for a whole one, and waits for a file of colours that may be a pipe.
  const std::string obj = folder_ / "bare.obj", stl = folder_ / "cut.stl";
  ASSERT_EQ(mkfifo((folder_ / "colours.mtl").c_str(), 0600), 0);
  testing::WriteFile(obj, testing::Replaced(kObj, "v 0 0 1\n", "v 0 -.0 1\nv 0 .5 -.5\n") +
                              std::string("mtllib colours.mtl\nf -1 -2 -3\n"));
  double lowest = 0;
  for (const SpaceVector& corner : ReadMesh(obj)) lowest = std::min(lowest, corner.z());
  EXPECT_EQ(lowest, -0.5);
  testing::WriteFile(stl, testing::Replaced(kStl, "endsolid s\n", ""));
  EXPECT_THAT([&] { ReadMesh(stl); },
              ::testing::ThrowsMessage<MeshError>(::testing::HasSubstr("has no 'endsolid'")));
}

TEST_F(Meshes, OfManyCornersKeepThoseThatCount) {
  std::string obj;
  for (int i = 0; i < 1000; ++i) {
    const double a = 2 * std::numbers::pi * i / 1000;
    obj += "v " + std::to_string(std::cos(a)) + " 0 " + std::to_string(std::sin(a)) + "\n";
  }
  for (int i = 2; i < 1000; ++i)
    obj += "f 1 " + std::to_string(i) + " " + std::to_string(i + 1) + "\n";
  testing::WriteFile(folder_ / "disc.obj", obj);
  DrawnMesh mesh;
  mesh.file = folder_ / "disc.obj";
  const Outline outline = MeshOutline(mesh, robot_);
  ASSERT_EQ(outline.corners.size(), 32U);
  double area = 0;
  for (std::size_t i = 0; i < 32; ++i) {
    const Plane::Vector& a = outline.corners[i];
    const Plane::Vector& b = outline.corners[(i + 1) % 32];
    area += (a.x() * b.y() - a.y() * b.x()) / 2;
  }
  EXPECT_GT(area, 0.98 * std::numbers::pi) << "counter-clockwise, and hardly smaller";
}

TEST_F(Meshes, AreWhatTheSceneShowsOfALink) {
  const std::string urdf = R"(<robot name="r"><link name="base"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><origin xyz="0 0 0.5"/><geometry><mesh filename="package://arm_description/meshes/a.obj"
    scale="0.1 0.1 0.1"/></geometry></visual></link><link name="leg"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
    <joint name="hip" type="revolute"><parent link="base"/><child link="leg"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>)";
  Problem problem;
  problem.scene.robot = ParsePlanarRobot(urdf, robot_, RootKind::kPlanarXz);
  const ReportData data = ReportScene(problem);
  ASSERT_EQ(data.links[0].shapes.size(), 1U);
  const auto& corners = data.links[0].shapes[0].corners_m;
  ASSERT_EQ(corners.size(), 3U);
  EXPECT_NEAR(corners[1][0], 0.1, 1e-9);
  EXPECT_NEAR(corners[2][1], 0.6, 1e-9);
  EXPECT_FALSE(data.links[0].shapes[0].collides);
}

}  // namespace
}  // namespace tumbler
