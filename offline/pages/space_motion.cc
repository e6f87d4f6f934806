#include "offline/pages/space_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "common/core/index.h"
#include "offline/certify/certificate.h"
#include "offline/pages/space_poses.h"

namespace tumbler {
namespace {

constexpr double kFrame_s = 1.0 / 60;

SpaceFrame FrameOf(const SpaceSample& sample, const SpaceRobot& robot) {
  SpaceFrame frame;
  frame.time_s = sample.time_s;
  const SpaceVector origin = sample.dynamics->origin();
  for (int body = robot.first_body(); body < static_cast<int>(robot.tree.dofs.size()); ++body) {
    frame.poses.push_back(
        {sample.dynamics->rotation(body).m, origin + sample.dynamics->position(body)});
  }
  for (const ActiveContact<Spatial>& contact : sample.contacts)
    frame.contacts.push_back({origin + contact.point, contact.force});
  return frame;
}

/// Curves of the joints, with the limit where all have the same.
SpacePlot PlotOf(const Problem& problem, const char* title, const char* unit,
                 std::optional<double> limit) {
  SpacePlot plot{title, unit, {}, {}};
  const SpaceRobot& robot = problem.space->scene.robot;
  for (const ActuatedJoint& joint : problem.joints)
    plot.series.push_back({problem.name_of(joint), {}, HueOf(robot, joint.dof)});
  if (limit) plot.limits = {-*limit, *limit};
  return plot;
}

}  // namespace

SpaceMotionPage MakeSpaceMotionPage(const Task& task, const std::vector<double>& x,
                                    const PrimitiveFile& file) {
  const Problem& problem = task.problem;
  const SpaceScene& scene = problem.space->scene;
  SpaceMotionPage page;
  page.title = problem.name;
  page.subtitle = fmt::format("{}, seed {}", file.provenance.tool, file.provenance.seed);
  page.bodies = BodiesOf(scene.robot);
  page.obstacles = scene.obstacles;
  page.motion_s = problem.duration_s;
  const double limit = problem.joints.front().limits.torque_max_nm;
  const bool same = std::ranges::all_of(problem.joints, [limit](const ActuatedJoint& joint) {
    return joint.limits.torque_max_nm == limit;
  });
  page.plots = {PlotOf(problem, "Joint position", "rad", std::nullopt),
                PlotOf(problem, "Joint torque", "N·m", same ? std::optional(limit) : std::nullopt)};
  double next_s = 0;
  const double end_s = problem.duration_s + problem.settle_s;
  const auto take = [&](const auto& sample) {
    if constexpr (std::is_same_v<std::decay_t<decltype(sample)>, SpaceSample>) {
      const bool last = std::abs(sample.time_s - end_s) <= 1e-9;
      if (sample.time_s > end_s + 1e-9 || (sample.time_s < next_s - 1e-9 && !last)) return;
      next_s += kFrame_s;
      if (!page.frames.empty() && !(sample.time_s > page.frames.back().time_s + 1e-6)) return;
      page.frames.push_back(FrameOf(sample, scene.robot));
      for (std::size_t j = 0; j < problem.joints.size(); ++j) {
        page.plots[0].series[j].values.push_back(sample.q[Index(problem.joints[j].dof)]);
        page.plots[1].series[j].values.push_back(sample.torque[j]);
      }
    }
  };
  VisitWithOwnDistance(
      problem, x, problem.solver.step_s,
      [&](const auto& sample, const SelfClearance& /*own*/, double /*least_m*/) { take(sample); });
  for (const PurposeFigure& figure : file.purpose) {
    // What is nearly nothing is nothing to people.
    const bool nothing = std::abs(figure.result) < 1e-3 * figure.tolerance;
    page.facts.emplace_back(fmt::format("{}; asked {:.4g} within {:.3g}", figure.name(),
                                        figure.target, figure.tolerance),
                            fmt::format("{:.4g} {}", nothing ? 0.0 : figure.result, figure.unit()));
  }
  const Certificate& certificate = file.certificate;
  page.facts.emplace_back("peak torque", fmt::format("{:.2f} N·m", certificate.peak_torque_nm));
  page.facts.emplace_back("peak penetration",
                          fmt::format("{:.2f} mm", 1e3 * certificate.peak_penetration_m));
  page.facts.emplace_back("gradient error", fmt::format("{:.1e}", certificate.gradient_error));
  page.notes =
      "Simulated as the model, with joints that follow their paths exactly; whether it holds "
      "through drives, for robots that differ, or in other physics is not shown here.";
  return page;
}

}  // namespace tumbler
