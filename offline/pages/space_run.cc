#include "offline/pages/space_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "common/core/index.h"

namespace tumbler {
namespace {

constexpr double kFrame_s = 1.0 / 60;
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

/// The last tick that is not after a time.
std::size_t TickAt(const RunData& run, double time_s) {
  const auto after = std::ranges::upper_bound(run.ticks, time_s + 1e-9, {}, &RunTick::time_s);
  return after == run.ticks.begin() ? 0 : static_cast<std::size_t>(after - run.ticks.begin()) - 1;
}

/// The facts of the run, and in place of those of each joint the largest of all joints.
void AddFacts(const RunData& run, SpaceMotionPage& page) {
  const auto of_joint = [&run](const auto& fact) {
    return std::ranges::any_of(run.scene.joint_names, [&fact](const std::string& joint) {
      return fact.first.starts_with(joint + ": ");
    });
  };
  std::ranges::remove_copy_if(run.facts, std::back_inserter(page.facts), of_joint);
  struct Largest {
    double value = 0, time_s = 0;
    std::string joint;
    void Take(double other, double at_s, const std::string& of) {
      if (std::abs(other) > value) *this = {std::abs(other), at_s, of};
    }
    [[nodiscard]] std::string Text(const char* unit) const {
      return joint.empty() ? "not measured"
                           : fmt::format("{:.4f} {} of {} at {:.3f} s", value, unit, joint, time_s);
    }
  };
  Largest error, torque;
  std::int32_t oldest = 0;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    for (std::size_t j = 0; j < run.joint_count(); ++j) {
      const std::string& name = run.scene.joint_names[j];
      const JointRecord& joint = run.joint(i, j);
      error.Take(run.FollowingError(i, j).value_or(0), run.ticks[i].time_s, name);
      if (joint.reply_age_ticks >= 0)
        torque.Take(static_cast<double>(joint.measured.torque_nm), run.ticks[i].time_s, name);
      oldest = std::max(oldest, joint.reply_age_ticks);
    }
  }
  page.facts.emplace_back("following error at most", error.Text("rad"));
  page.facts.emplace_back("measured torque at most", torque.Text("N·m"));
  page.facts.emplace_back("oldest reply", fmt::format("{} ticks", oldest));
}

}  // namespace

SpaceMotionPage MakeSpaceRunPage(const RunData& run, const FlightReportOptions& options) {
  const SpaceRun& space = *run.space;
  SpaceMotionPage page;
  for (const RunBand& band : run.bands) {
    const bool again = std::ranges::any_of(
        run.bands, [&](const RunBand& other) { return &other < &band && other.name == band.name; });
    if (!again) page.title += (page.title.empty() ? "" : ", ") + band.name;
  }
  if (page.title.empty()) page.title = run.name;
  page.subtitle = "run " + run.name;
  page.bodies = space.bodies;
  page.obstacles = space.obstacles;
  page.motion_s = run.bands.empty() ? run.ticks.back().time_s : run.bands.back().to_s;
  page.plots = {{"Measured position", "rad", {}, {}},
                {"Following error", "rad", {}, {}},
                {"Measured torque", "N·m", {}, {}}};
  for (SpacePlot& plot : page.plots) {
    for (std::size_t j = 0; j < run.joint_count(); ++j)
      plot.series.push_back({run.scene.joint_names[j], {}, space.joint_hues[j]});
  }
  double next_s = -std::numeric_limits<double>::infinity();
  for (const SpaceFrame& frame : space.frames) {
    if (!options.Shows(frame.time_s) || frame.time_s < next_s - 1e-9) continue;
    next_s =
        std::isfinite(next_s) ? std::max(next_s + kFrame_s, frame.time_s) : frame.time_s + kFrame_s;
    page.frames.push_back(frame);
    const std::size_t tick = TickAt(run, frame.time_s);
    for (std::size_t j = 0; j < run.joint_count(); ++j) {
      // Before the first reply nothing was measured.
      const JointRecord& joint = run.joint(tick, j);
      const bool replied = joint.reply_age_ticks >= 0;
      const auto torque = static_cast<double>(joint.measured.torque_nm);
      page.plots[0].series[j].values.push_back(
          replied ? static_cast<double>(joint.measured.position_rad) : kNothing);
      page.plots[1].series[j].values.push_back(run.FollowingError(tick, j).value_or(kNothing));
      page.plots[2].series[j].values.push_back(replied ? torque : kNothing);
    }
  }
  if (page.frames.size() < 2) {
    throw std::runtime_error(
        fmt::format("{}: has nothing in the interval that is shown; give another --from-s and "
                    "--to-s",
                    run.name));
  }
  page.motion_s = std::clamp(page.motion_s, page.frames.front().time_s, page.frames.back().time_s);
  AddFacts(run, page);
  page.notes =
      space.true_root
          ? "The robot is drawn as the simulation says that it truly was. Obstacles that a "
            "twin file adds are not drawn."
          : "Nothing tells where the root was: it is drawn where the motion begins, and "
            "only the joints are as they were measured.";
  for (const RunEvent& event : run.events)
    page.notes += fmt::format("\n{:.3f} s: {}", event.time_s, event.text);
  return page;
}

}  // namespace tumbler
