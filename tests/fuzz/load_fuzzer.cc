// Feeds arbitrary bytes to the loaders of a task and a robot. Either they refuse the input with a
// FileError that says why, or the result has all the properties that the code behind the loaders
// relies on.
//
// Linked with libFuzzer, the program looks for inputs by itself (scripts/fuzz). Linked with
// replay.cc, it runs the inputs of the corpus, as one of the normal tests.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

#include "common/files/toml_reader.h"
#include "offline/model/contact_shapes.h"
#include "offline/model/planar_robot.h"
#include "offline/model/robot.h"
#include "offline/model/robot_review.h"
#include "offline/problem/task_toml.h"
#include "tests/support/bad_inputs.h"

namespace tumbler {
namespace {

/// Separates the task from the robot in an input with both.
constexpr std::string_view kSeam = "\n#### ROBOT ####\n";

void Require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "the loader lets through what it must not: %s\n", what);
  std::abort();
}
#define TUMBLER_REQUIRE(condition) Require(condition, #condition)

bool AllFinite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
}

void CheckTree(const Tree<Plane>& tree) {
  for (const Dof<Plane>& dof : tree.dofs) {
    TUMBLER_REQUIRE(std::isfinite(dof.mass_kg) && dof.mass_kg >= 0);
    TUMBLER_REQUIRE(std::isfinite(dof.inertia_kg_m2));
    TUMBLER_REQUIRE(std::isfinite(dof.rotor_inertia_kg_m2) && dof.rotor_inertia_kg_m2 >= 0);
    TUMBLER_REQUIRE(std::isfinite(dof.damping_nm_s_per_rad) && dof.damping_nm_s_per_rad >= 0);
    TUMBLER_REQUIRE(dof.offset.allFinite() && dof.mass_centre.allFinite());
  }
}

void CheckProblem(const Problem& problem) {
  CheckTree(problem.scene.robot.tree);
  const std::size_t n = problem.scene.robot.tree.dofs.size();
  TUMBLER_REQUIRE(problem.start_q.size() == n && AllFinite(problem.start_q));
  TUMBLER_REQUIRE(!problem.joints.empty());
  for (const ActuatedJoint& joint : problem.joints) {
    const JointLimits<double>& limits = joint.limits;
    TUMBLER_REQUIRE(limits.position_min_rad <= joint.start_rad);
    TUMBLER_REQUIRE(limits.position_min_rad <= joint.end_rad);
    TUMBLER_REQUIRE(joint.start_rad <= limits.position_max_rad);
    TUMBLER_REQUIRE(joint.end_rad <= limits.position_max_rad);
    TUMBLER_REQUIRE(std::isfinite(limits.position_min_rad + limits.position_max_rad));
    TUMBLER_REQUIRE(limits.velocity_max_rad_s > 0 && limits.velocity_max_rad_s <= 100);
    TUMBLER_REQUIRE(limits.acceleration_max_rad_s2 > 0 && limits.acceleration_max_rad_s2 <= 1e5);
    TUMBLER_REQUIRE(limits.torque_max_nm > 0 && limits.torque_max_nm <= 1000);
    TUMBLER_REQUIRE(joint.free_points() >= 1 && joint.control_points > problem.degree);
  }
  const ContactLaw& law = problem.scene.contact;
  TUMBLER_REQUIRE(std::isfinite(law.stiffness_n_per_m) && law.stiffness_n_per_m > 0);
  TUMBLER_REQUIRE(std::isfinite(law.damping_n_s_per_m) && law.damping_n_s_per_m >= 0);
  TUMBLER_REQUIRE(0 <= law.d_off_m && law.d_off_m < law.d_on_m && law.d_on_m <= 1);
  TUMBLER_REQUIRE(law.v_max_m_per_s > 0);
  TUMBLER_REQUIRE(problem.advisable_step_s > 0);
  for (const double step :
       {problem.solver.step_s, problem.solver.screen_step_s, problem.search.step_s}) {
    TUMBLER_REQUIRE(step >= 1e-5 && step <= 1e-2);
  }
  for (const CostTerm& term : problem.cost) {
    TUMBLER_REQUIRE(std::isfinite(term.weight) && std::isfinite(term.target));
    TUMBLER_REQUIRE(term.dof >= 0 && static_cast<std::size_t>(term.dof) < n);
  }
  TUMBLER_REQUIRE(problem.scene.robot.shapes.size() * problem.scene.obstacles.size() <= 1000);
}

/// Runs `read`. A refusal must be one that a person can use.
template <class Read>
void ReadOrRefuse(const Read& read) {
  try {
    read();
  } catch (const FileError& error) {
    const std::string_view message = error.what();
    TUMBLER_REQUIRE(message.starts_with("task.toml") || message.starts_with("robot.urdf"));
    TUMBLER_REQUIRE(message.size() > std::string_view("robot.urdf: ").size());
  }
}

void LoadBoth(const std::string& task, const std::string& robot) {
  ReadOrRefuse([&] { CheckProblem(ParseTask(task, "task.toml", robot, "robot.urdf").problem); });
}

void LoadInSpace(const std::string& text) {
  ReadOrRefuse([&] {
    const Robot robot = ParseRobot(text, "robot.urdf", RootKind::kFloating);
    SpatialContactShapes(robot);
    // Whatever a robot lacks, what stands in the way of a task can be said.
    const RobotReview review = ReviewRobot(text, "robot.urdf", RootKind::kPlanarXz);
    TUMBLER_REQUIRE(review.robot.has_value());
    for (const Dof<Spatial>& dof : robot.tree.dofs) {
      TUMBLER_REQUIRE(std::isfinite(dof.mass_kg));
      for (int i = 0; i < 3; ++i) TUMBLER_REQUIRE(dof.inertia_kg_m2.col(i).allFinite());
      TUMBLER_REQUIRE(dof.offset.allFinite() && dof.mass_centre.allFinite());
      const double length = (dof.kind == JointKind::kRevolute ? dof.axis : dof.direction).norm();
      TUMBLER_REQUIRE(std::abs(length - 1) < 1e-9);
    }
  });
}

}  // namespace
}  // namespace tumbler

/// An input is a task, the seam and a robot; or one of the two, which is read with a good other
/// one.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::string good_task = tumbler::testing::GoodTask();
  static const std::string good_robot = tumbler::testing::GoodRobot();
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::size_t seam = text.find(tumbler::kSeam);
  const bool both = seam != std::string::npos;
  const bool robot_only = !both && text.starts_with('<');
  const std::string task = both ? text.substr(0, seam) : robot_only ? good_task : text;
  const std::string robot = both         ? text.substr(seam + tumbler::kSeam.size())
                            : robot_only ? text
                                         : good_robot;
  tumbler::LoadBoth(task, robot);
  if (both || robot_only) tumbler::LoadInSpace(robot);
  return 0;
}
