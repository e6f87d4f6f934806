#include "offline/twin/damping_notes.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "common/core/index.h"
#include "offline/problem/contact_steps.h"
#include "offline/problem/damped_motion.h"

namespace tumbler {
namespace {

/// The warning about a loop that is slower than advised; empty for one that is not.
std::string WarningOf(const std::string& loop, double period_s, const DampedMotion& motion,
                      std::string_view remedy) {
  if (period_s <= motion.AdvisedPeriod()) return "";
  const bool stable = period_s < motion.LongestPeriod();
  return fmt::format("warning: {} takes {:.4g} ms, {}; {}", loop, 1e3 * period_s,
                     stable ? "more than is advised: a velocity that is a sample old is enough to "
                              "make the damping unstable"
                            : "with which the damping is unstable",
                     remedy);
}

/// The warning about steps of a twin that contact does not bear; empty where it does.
std::string ContactWarning(const SimulatedMotion& motion, const TwinConfig& twin, double step_s) {
  // The midpoint rule is stable up to twice what is advised, which leaves room for impacts.
  ContactSteps least;
  std::string of;
  for (std::size_t i = 0; i < motion.file().primitives.size(); ++i) {
    const Problem& problem = motion.ProblemOf(i);
    const Primitive<double>& primitive = motion.file().primitives[i].primitive;
    const ContactSteps steps = ContactStepsOf(
        problem, primitive, twin.contact.value_or(problem.contact()), JointMoves::kByTorque);
    if (steps.step_s >= least.step_s) continue;
    least = steps;
    of = primitive.name.view();
  }
  if (step_s <= least.step_s) return "";
  return fmt::format(
      "warning: step_s of the twin takes {:.4g} ms, and contact allows {:.4g} ms with the pose of "
      "'{}' at {:.3g} s: feet may buzz where they should stick; give the twin a shorter step_s",
      1e3 * step_s, 1e3 * least.step_s, of, least.time_s);
}

}  // namespace

std::vector<std::string> DampingNotes(const SimulatedMotion& motion, const DrivesConfig& drives,
                                      const TwinConfig* twin) {
  const auto& graph = motion.file().graph;
  DampedMotion worst;
  std::string of;
  std::vector<double> kd(drives.drives.size());
  for (int node = 0; node < graph.node_count; ++node) {
    // A joint that plays the role of another has its own drive's gains there.
    for (std::size_t j = 0; j < kd.size(); ++j) {
      kd[Index(graph.RoleOf(node, static_cast<int>(j)))] =
          static_cast<double>(drives.drives[j].kd_nm_s_per_rad);
    }
    const PrimitiveFile& file = motion.file().PrimitiveOf(node);
    const DampedMotion damped = DampingOf(motion.ProblemAt(node), file.primitive, kd);
    if (damped.rate_per_s <= worst.rate_per_s) continue;
    worst = damped;
    of = file.primitive.name.view();
  }
  const double step_s = twin == nullptr ? 0 : 1e-9 * static_cast<double>(twin->step_ns);
  const std::string of_contact =
      twin == nullptr ? std::string() : ContactWarning(motion, *twin, step_s);
  if (worst.rate_per_s == 0)
    return of_contact.empty() ? std::vector<std::string>() : std::vector{of_contact};

  std::string unknown;
  std::vector<std::string> warnings;
  constexpr const char* kLess = "give it less kd, or use a drive with a faster loop";
  for (const DriveEntry& drive : drives.drives) {
    if (drive.loop_hz == 0) {
      unknown += (unknown.empty() ? "" : ", ") + drive.joint;
    } else if (drive.kd_nm_s_per_rad > 0) {
      warnings.push_back(WarningOf(fmt::format("joint {}: the drive's own loop", drive.joint),
                                   1 / drive.loop_hz, worst, kLess));
    }
  }
  if (twin != nullptr) {
    warnings.push_back(WarningOf("step_s of the twin, which computes the drives' law,", step_s,
                                 worst, "give the twin a shorter step_s"));
    warnings.push_back(of_contact);
  }
  std::erase(warnings, "");
  std::vector<std::string> notes = {fmt::format(
      "damping of '{}': {}{}", of, worst.Describe(kd),
      unknown.empty() ? "" : "; the rate of the own loop (loop_hz) is not known of " + unknown)};
  notes.insert(notes.end(), warnings.begin(), warnings.end());
  return notes;
}

}  // namespace tumbler
