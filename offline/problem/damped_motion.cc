#include "offline/problem/damped_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/core/damping_bound.h"
#include "common/core/index.h"
#include "offline/scene/drive_damping.h"

namespace tumbler {
namespace {

constexpr double kSample_s = 1e-3;

}  // namespace

double DampedMotion::LongestPeriod() const { return LongestDampedPeriod(rate_per_s); }

double DampedMotion::AdvisedPeriod() const { return kDampedPart * LongestPeriod(); }

std::string DampedMotion::Describe(const std::vector<double>& kd) const {
  const auto [least, most] = std::ranges::minmax(kd);
  if (rate_per_s == 0) return "the drives have no damping that could be unstable";
  const std::string gains =
      least == most ? fmt::format("{:.4g}", most) : fmt::format("{:.4g} to {:.4g}", least, most);
  return fmt::format(
      "kd of {} N m s/rad is stable in drives whose loop takes less than {:.3g} ms (above {:.3g} "
      "kHz; the pose at {:.3g} s decides); advised is half of that, {:.3g} ms",
      gains, 1e3 * LongestPeriod(), 1e-3 / LongestPeriod(), time_s, 1e3 * AdvisedPeriod());
}

namespace {

template <class Space>
DampedMotion DampingIn(const SceneOf<Space>& scene, const Problem& problem,
                       const Primitive<double>& primitive, const std::vector<double>& kd) {
  std::vector<int> dofs;
  for (const ActuatedJoint& joint : problem.joints) dofs.push_back(joint.dof);
  DriveDampingIn<Space> damping(scene, dofs, kd);
  DampedMotion motion;
  std::vector<double> q = problem.start_q;
  const int samples = static_cast<int>(std::ceil(primitive.duration_s / kSample_s));
  for (int i = 0; i <= samples; ++i) {
    const double time_s = primitive.duration_s * i / samples;
    for (std::size_t j = 0; j < dofs.size(); ++j)
      q[Index(dofs[j])] = primitive.joints[j].position.Evaluate(time_s).value;
    const double rate = damping.RateAt(q);
    if (rate > motion.rate_per_s) motion = {rate, time_s};
  }
  return motion;
}

}  // namespace

DampedMotion DampingOf(const Problem& problem, const Primitive<double>& primitive,
                       const std::vector<double>& kd) {
  return problem.space ? DampingIn<Spatial>(problem.space->scene, problem, primitive, kd)
                       : DampingIn<Plane>(problem.scene, problem, primitive, kd);
}

}  // namespace tumbler
