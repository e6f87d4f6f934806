// Tasks that differ in some numbers.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/toml_reader.h"
#include "offline/model/urdf_mass.h"
#include "offline/problem/task_toml.h"
#include "offline/studies/task_grid.h"
#include "tests/support/files.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string HandstandTask() {
  return testing::SourcePath("primitives/tasks/nominal/handstand.toml");
}

template <class Work>
std::string MessageOf(Work&& work) {
  try {
    work();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

double TotalMass(const Task& task) {
  double mass = 0;
  for (const Dof<Plane>& dof : task.problem.scene.robot.tree.dofs) mass += dof.mass_kg;
  return mass;
}

TEST(GridAxis, IsAListOrEvenlySpacedWithBothEnds) {
  const GridAxis list = ReadAxis("contact.mu=0.3,-1,2e-1");
  EXPECT_EQ(list.of, "contact.mu");
  EXPECT_THAT(list.values, ElementsAre(0.3, -1, 0.2));
  const GridAxis even = ReadAxis("slope_rad=-0.1:0.1:5");
  EXPECT_THAT(even.values, ElementsAre(-0.1, -0.05, 0, 0.05, 0.1));
}

TEST(GridAxis, SaysWhatItCannotRead) {
  for (const char* text :
       {"", "mu", "=1", "mu=", "mu=1,,2", "mu=nan", "mu=inf", "mu=1:2", "mu=1:2:1", "mu=1:2:2.5",
        "mu=1:2:1e9", "mu=1:2:3:4", "mu=1:x:3", "mu=1,1", "mu=2:2:2", "mu=1 ,2", "mu=0x1"}) {
    EXPECT_THAT(MessageOf([&] { ReadAxis(text); }), HasSubstr("allowed: KEY=VALUE")) << text;
  }
}

TEST(TaskGrid, HasEveryCombinationWithTheLastAxisFastest) {
  const TaskGrid grid(HandstandTask(),
                      {ReadAxis("contact.mu=0.2,0.4"), ReadAxis("mass=0.9,1,1.1")});
  ASSERT_EQ(grid.size(), 6);
  EXPECT_THAT(grid.At(0), ElementsAre(0.2, 0.9));
  EXPECT_THAT(grid.At(1), ElementsAre(0.2, 1));
  EXPECT_THAT(grid.At(5), ElementsAre(0.4, 1.1));
  const double mass = TotalMass(LoadTask(HandstandTask()));
  for (int point = 0; point < grid.size(); ++point) {
    const Task task = grid.TaskAt(point);
    EXPECT_EQ(task.problem.scene.contact.mu, grid.At(point)[0]);
    EXPECT_NEAR(TotalMass(task), mass * grid.At(point)[1], 1e-12);
  }
}

TEST(TaskGrid, APointWithTheTasksOwnNumbersIsTheTask) {
  const Task base = LoadTask(HandstandTask());
  const TaskGrid grid(HandstandTask(),
                      {ReadAxis("contact.mu=0.3"), ReadAxis("mass=1"), ReadAxis("slope_rad=0")});
  const Task task = grid.TaskAt(0);
  EXPECT_EQ(task.problem.start_q, base.problem.start_q);
  EXPECT_EQ(task.problem.scene.obstacles, base.problem.scene.obstacles);
  EXPECT_EQ(TotalMass(task), TotalMass(base));
}

TEST(TaskGrid, OneLinkAloneGetsAnotherMassWithItsInertia) {
  const TaskGrid grid(HandstandTask(), {ReadAxis("mass.leg1_link=2")});
  const auto dofs = grid.TaskAt(0).problem.scene.robot.tree.dofs;
  const auto before = grid.base().problem.scene.robot.tree.dofs;
  ASSERT_EQ(dofs.size(), before.size());
  for (std::size_t i = 0; i < dofs.size(); ++i) {
    const double factor = dofs[i].name == "leg1" ? 2 : 1;
    EXPECT_DOUBLE_EQ(dofs[i].mass_kg, factor * before[i].mass_kg) << dofs[i].name;
  }
  const std::string urdf = testing::ShippedRobot();
  const std::string heavier = WithMassTimes(2, "leg1_link", urdf, "a.urdf");
  EXPECT_THAT(heavier, HasSubstr("iyy=\"0.0026666666666666666\""));
  EXPECT_THAT(heavier, HasSubstr("iyy=\"7.5e-3\""));  // the middle link's is as it was
  EXPECT_THAT(heavier, HasSubstr("SI units."));
}

TEST(TaskGrid, ASlopeTurnsGravityAndTheRobotStandsOnTheGround) {
  const double slope = 0.05;
  const TaskGrid grid(HandstandTask(), {ReadAxis("slope_rad=0,0.05")});
  const Task flat = grid.TaskAt(0), steep = grid.TaskAt(1);
  EXPECT_EQ(flat.problem.start_q, grid.base().problem.start_q);
  const Plane::Vector gravity = steep.problem.scene.robot.tree.gravity;
  EXPECT_NEAR(gravity.x(), -9.81 * std::sin(slope), 1e-12);  // down is to the left
  EXPECT_NEAR(gravity.y(), -9.81 * std::cos(slope), 1e-12);
  EXPECT_EQ(steep.problem.scene.obstacles, flat.problem.scene.obstacles);
  EXPECT_NEAR(steep.problem.start_q[2], 0, 2e-3);
  // Errors name the lines of the file that the user has.
  EXPECT_EQ(testing::LineOf(steep.task_text, "[solver]"),
            testing::LineOf(flat.task_text, "[solver]"));
  EXPECT_EQ(testing::LineOf(grid.base().task_text, "[solver]"),
            testing::LineOf(flat.task_text, "[solver]"));
}

TEST(TaskGrid, ARobotThatSlidesDownASlopeDoesNotRest) {
  EXPECT_THAT(
      MessageOf([] {
        TaskGrid(HandstandTask(), {ReadAxis("contact.mu=0.03"), ReadAxis("slope_rad=0.05")});
      }),
      HasSubstr("does not come to rest"));
}

TEST(TaskGrid, RefusesAValueThatTheTaskDoesNotAllowBeforeAnyWork) {
  const auto message = [](const std::string& axis) {
    return MessageOf([&] {
      TaskGrid(HandstandTask(), {ReadAxis("contact.mu=0.3"), ReadAxis(axis)});
    });
  };
  EXPECT_THAT(message("duration_s=1,-1"),
              ::testing::AllOf(HasSubstr("handstand.toml:"), HasSubstr("duration_s: is -1")));
  EXPECT_THAT(message("spline.degree=4.5"), HasSubstr("spline.degree"));
  EXPECT_THAT(message("contact.nu=1"), HasSubstr("is not there"));
  EXPECT_THAT(message("contact.mu=0.5"), HasSubstr("varied twice"));
  EXPECT_THAT(message("mass=0"), HasSubstr("allowed: from 0.01"));
  EXPECT_THAT(message("mass.leg3=1"), HasSubstr("middle, leg1_link, leg2_link"));
  EXPECT_THAT(message("slope_rad=2"), HasSubstr("slope_rad: is 2; allowed: from -0.7 ... 0.7"));
  EXPECT_THAT(message("contact.d_on_m=0.001:0.01:10000"), HasSubstr("contact."));
}

TEST(TaskGrid, RefusesMorePointsThanAnyoneWaitsFor) {
  EXPECT_THAT(MessageOf([] {
                TaskGrid(HandstandTask(),
                         {ReadAxis("mass=0.9:1.1:101"), ReadAxis("contact.mu=0.2:0.3:100")});
              }),
              HasSubstr("more than 10000 points"));
}

}  // namespace
}  // namespace tumbler
