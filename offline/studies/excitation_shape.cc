#include "offline/studies/excitation_shape.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <string_view>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/toml_writer.h"
#include "offline/scene/normal.h"
#include "offline/studies/toml_edit.h"

namespace tumbler {
namespace {

/// Control points of a path: enough for waves of 5 Hz in 1.2 s.
constexpr int kPointsPerSecond = 25;
/// Of the waves of a joint [1/s]. Slower ones move everything together, faster ones do not get far.
constexpr double kSlowest_hz = 0.8, kFastest_hz = 4.5;

}  // namespace

std::string TextOfExcitation(const Task& given, double duration_s) {
  constexpr std::array<std::string_view, 11> kKept = {
      "format",  "version",  "robot", "root",   "start",       "limits",
      "contact", "obstacle", "motor", "locked", "self_contact"};
  const Problem& problem = given.problem;
  TomlWriter writer("a task");
  writer.Line("# Made by tumbler identify excite of " +
              std::filesystem::path(given.task_file).filename().string() +
              ": to be told from, and to end where it began.");
  writer.Text("name", "identify_" + problem.name);
  writer.Number("duration_s", duration_s);
  writer.Number("settle_s", 0.5);
  writer.Line(WithOnly(given.task_text, given.task_file, kKept));
  writer.Line("[end.joints_rad]");
  for (const ActuatedJoint& joint : problem.joints) {
    const std::string& name = problem.scene.robot.tree.dofs[Index(joint.dof)].name;
    writer.Number("\"" + name + "\"", joint.start_rad);
  }
  writer.Line("[spline]\ndegree = 5");
  writer.Line(fmt::format("control_points = {}", std::lround(kPointsPerSecond * duration_s)));
  writer.Line("[[cost]]\nterm = \"terminal\"\nof = \"pitch\"\nwhen = \"settled\"\nweight = 10.0");
  writer.Number("target", problem.start_q[2]);
  writer.Line(
      "[[cost]]\nterm = \"terminal\"\nof = \"pitch_rate\"\nwhen = \"settled\"\nweight = 1.0");
  writer.Line("[[cost]]\nterm = \"effort\"\nweight = 1e-4");
  writer.Line("[drives]");
  writer.Number("kp_nm_per_rad", problem.drive_gains().kp_nm_per_rad);
  writer.Number("kd_nm_s_per_rad", problem.drive_gains().kd_nm_s_per_rad);
  writer.Line("[solver]");
  writer.Number("step_s", problem.solver.step_s);
  return writer.Take();
}

MotionGenes DrawGenes(std::size_t joints, std::uint64_t seed, std::uint64_t index) {
  Normal random(seed, index);
  MotionGenes genes;
  const double together = random.DrawUniform();
  const std::array<double, 2> both = {random.DrawUniform(), random.DrawUniform()};
  for (std::size_t j = 0; j < joints; ++j) {
    for (std::size_t w = 0; w < 2; ++w) {
      // In a third of the motions all joints move at the same rates: legs sway.
      const double own = random.DrawUniform();
      genes.push_back(together < 1.0 / 3 ? both[w] : own);
      genes.push_back(random.DrawUniform());
      genes.push_back((w == 0 ? 1.0 : 0.6) * (0.3 + 0.7 * random.DrawUniform()));
    }
  }
  return genes;
}

WaveShape ShapeOf(const MotionGenes& genes, std::size_t joints) {
  WaveShape shape;
  shape.joints.resize(joints);
  auto gene = genes.begin();
  for (auto& waves : shape.joints) {
    for (WaveShape::Wave& wave : waves) {
      wave.hz =
          kSlowest_hz * portable::Power(kFastest_hz / kSlowest_hz, std::clamp(*gene++, 0., 1.));
      wave.phase = 2 * std::numbers::pi * *gene++;
      wave.part = std::clamp(*gene++, 0., 1.);
    }
  }
  return shape;
}

}  // namespace tumbler
