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

/// Makes the page of samples that come one after the other.
class PageOfSamples {
 public:
  /// @param frame_s  between frames.
  PageOfSamples(const Problem& problem, double frame_s, double end_s)
      : problem_(problem), frame_s_(frame_s), end_s_(end_s) {
    const SpaceScene& scene = problem.space->scene;
    page.bodies = BodiesOf(scene.robot);
    page.obstacles = scene.obstacles;
    const double limit = problem.joints.front().limits.torque_max_nm;
    const bool same = std::ranges::all_of(problem.joints, [limit](const ActuatedJoint& joint) {
      return joint.limits.torque_max_nm == limit;
    });
    page.plots = {
        PlotOf(problem, "Joint position", "rad", std::nullopt),
        PlotOf(problem, "Joint torque", "N·m", same ? std::optional(limit) : std::nullopt)};
  }

  void Take(const SpaceSample& sample) {
    const bool last = std::abs(sample.time_s - end_s_) <= 1e-9;
    if (sample.time_s > end_s_ + 1e-9 || (sample.time_s < next_s_ - 1e-9 && !last)) return;
    next_s_ += frame_s_;
    if (!page.frames.empty() && !(sample.time_s > page.frames.back().time_s + 1e-6)) return;
    page.frames.push_back(FrameOf(sample, problem_.space->scene.robot));
    for (std::size_t j = 0; j < problem_.joints.size(); ++j) {
      page.plots[0].series[j].values.push_back(sample.q[Index(problem_.joints[j].dof)]);
      page.plots[1].series[j].values.push_back(sample.torque[j]);
    }
  }

  SpaceMotionPage page;

 private:
  const Problem& problem_;
  double frame_s_, end_s_;
  double next_s_ = 0;
};

constexpr const char* kModelNote =
    "Simulated as the model, with joints that follow their paths exactly; whether it holds "
    "through drives, for robots that differ, or in other physics is not shown here.";

}  // namespace

SpaceMotionPage MakeSpaceMotionPage(const Task& task, const std::vector<double>& x,
                                    const PrimitiveFile& file) {
  const Problem& problem = task.problem;
  PageOfSamples samples(problem, kFrame_s, problem.duration_s + problem.settle_s);
  VisitWithOwnDistance(problem, x, problem.solver.step_s,
                       [&](const auto& sample, const SelfClearance& /*own*/, double /*least_m*/) {
                         if constexpr (std::is_same_v<std::decay_t<decltype(sample)>, SpaceSample>)
                           samples.Take(sample);
                       });
  SpaceMotionPage page = std::move(samples.page);
  page.title = problem.name;
  page.subtitle = fmt::format("{}, seed {}", file.provenance.tool, file.provenance.seed);
  page.motion_s = problem.duration_s;
  for (const PurposeFigure& figure : file.purpose) {
    // What is nothing but rounding is nothing to people.
    const bool nothing = std::abs(figure.result) < 1e-6;
    page.facts.emplace_back(fmt::format("{}; asked {:.4g} within {:.3g}", figure.name(),
                                        figure.target, figure.tolerance),
                            fmt::format("{:.4g} {}", nothing ? 0.0 : figure.result, figure.unit()));
  }
  const Certificate& certificate = file.certificate;
  page.facts.emplace_back("peak torque", fmt::format("{:.2f} N·m", certificate.peak_torque_nm));
  page.facts.emplace_back("peak penetration",
                          fmt::format("{:.2f} mm", 1e3 * certificate.peak_penetration_m));
  page.facts.emplace_back("gradient error", fmt::format("{:.1e}", certificate.gradient_error));
  page.notes = kModelNote;
  return page;
}

SpaceMotionPage MakeSpaceChainPage(const SimulatedMotion& motion, const ChainOptions& options) {
  const SequenceFile& file = motion.file();
  const ChainOutcome outcome = SimulateChainInSpace(motion, options);
  // A long chain does not make a page of tens of megabytes.
  constexpr double kMostFrames = 4000;
  PageOfSamples samples(motion.ProblemOf(0), std::max(kFrame_s, outcome.duration_s / kMostFrames),
                        outcome.duration_s);
  SimulateChainInSpace(motion, options,
                       [&](int, const SpaceSample& sample) { samples.Take(sample); });
  SpaceMotionPage page = std::move(samples.page);
  page.title = file.graph.name.view();
  page.subtitle = fmt::format("{} passages, {} cycles", outcome.passages.size(), outcome.cycles);
  page.motion_s = outcome.duration_s;
  page.facts.emplace_back(
      "chain", outcome.failure ? fmt::format("{} at {:.2f} s: {}", ToString(outcome.failure->cause),
                                             outcome.failure->time_s, outcome.failure->text)
                               : "no fall");
  page.facts.emplace_back("travelled", fmt::format("{:.3f} m", outcome.travelled_m));
  for (const PlayedNode& p : outcome.passages) {
    const std::string which =
        fmt::format("{} at {:.2f} s", file.graph.node(p.node).name.view(), p.start_s);
    page.facts.emplace_back(
        which, fmt::format("tilt off by {:.1e} rad, {:.3f} m and {:.3f} rad on, peak torque {:.2f} "
                           "N·m, penetration {:.2f} mm",
                           p.exit_pitch_error_rad, p.travelled_m, p.turned_rad, p.peak_torque_nm,
                           1e3 * p.peak_penetration_m));
    for (const JudgedTarget& judged : p.purpose)
      page.facts.emplace_back(fmt::format("{}, {}", which, judged.name()), judged.Verdict());
  }
  page.notes = kModelNote;
  return page;
}

}  // namespace tumbler
