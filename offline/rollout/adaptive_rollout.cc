#include "offline/rollout/adaptive_rollout.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace tumbler {

struct AdaptiveRollout::Implementation {
  Implementation(const Problem& problem, std::unique_ptr<ContactForces<Plane>> contact) {
    if (contact == nullptr) {
      chooser.emplace(problem, AdaptiveSteps(problem));
      last_gradient.resize(chooser->output_count(), chooser->parameter_count());
    }
    // With the paper's own gradient, every run is one of the forward sensitivities.
    if (!chooser || problem.solver.gradient == SolverSettings::Gradient::kAdjoint)
      rollout.emplace(problem, problem.solver.step_s, std::move(contact));
  }

  [[nodiscard]] bool near(std::span<const double> x) const {
    return chosen_for.size() == x.size() &&
           std::equal(x.begin(), x.end(), chosen_for.begin(),
                      [](double a, double b) { return std::abs(a - b) <= kSameSteps_rad; });
  }

  /// Chooses steps for x. Result and gradient stay in `last` and `last_gradient`.
  /// @param gauss_newton  is filled, if it is not null.
  void Choose(std::span<const double> x, GaussNewton* gauss_newton = nullptr) {
    last = chooser->Run(x, last_gradient, gauss_newton);
    chosen_for.clear();
    if (!last.finite) return;
    chosen_for.assign(x.begin(), x.end());
    if (rollout) rollout->Use(chooser->grid());
  }

  std::optional<ForwardSensitivity> chooser;  // none with a contact model of the caller's
  std::optional<Rollout> rollout;
  std::vector<double> chosen_for;  // the parameters that the present steps are for
  RolloutResult last;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> last_gradient;
};

AdaptiveRollout::AdaptiveRollout(const Problem& problem,
                                 std::unique_ptr<ContactForces<Plane>> contact)
    : implementation_(std::make_unique<Implementation>(problem, std::move(contact))) {}
AdaptiveRollout::~AdaptiveRollout() = default;
AdaptiveRollout::AdaptiveRollout(AdaptiveRollout&&) noexcept = default;

int AdaptiveRollout::parameter_count() const {
  const Implementation& m = *implementation_;
  return m.chooser ? m.chooser->parameter_count() : m.rollout->parameter_count();
}
int AdaptiveRollout::output_count() const {
  const Implementation& m = *implementation_;
  return m.chooser ? m.chooser->output_count() : m.rollout->output_count();
}

RolloutResult AdaptiveRollout::Run(std::span<const double> x) {
  Implementation& m = *implementation_;
  if (!m.chooser || (m.rollout && m.near(x))) return m.rollout->Run(x);
  m.Choose(x);
  return m.last;
}

// What is written through is passed by value, as Eigen has it.
// NOLINTNEXTLINE(performance-unnecessary-value-param)
RolloutResult AdaptiveRollout::Run(std::span<const double> x, Gradient gradient) {
  Implementation& m = *implementation_;
  const bool known = std::ranges::equal(x, m.chosen_for);
  return m.rollout && m.near(x) && !known ? m.rollout->Run(x, gradient) : RunAnew(x, gradient);
}

RolloutResult AdaptiveRollout::RunAnew(std::span<const double> x, Gradient gradient) {
  Implementation& m = *implementation_;
  if (!m.chooser) return m.rollout->Run(x, gradient);
  if (!std::ranges::equal(x, m.chosen_for)) m.Choose(x);
  gradient = m.last_gradient;
  return m.last;
}

RolloutResult AdaptiveRollout::RunAnew(std::span<const double> x, Gradient gradient,
                                       GaussNewton& gauss_newton) {
  Implementation& m = *implementation_;
  if (!m.chooser) throw std::logic_error("this contact model has no sensitivities");
  m.Choose(x, &gauss_newton);
  gradient = m.last_gradient;
  return m.last;
}

}  // namespace tumbler
