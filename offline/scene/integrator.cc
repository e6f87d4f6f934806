#include "offline/scene/integrator.h"

namespace tumbler {

Integrator::Integrator(const StepSettings& settings, std::size_t equations, std::size_t deciding)
    : settings_(settings),
      tableau_(settings.scheme == StepSettings::Scheme::kFixed ? kClassical : kDormandPrince),
      state_(equations),
      stage_state_(equations),
      next_(equations),
      between_(deciding) {
  for (std::size_t s = 0; s < tableau_.stages; ++s) slopes_[s].resize(equations);
}

void Integrator::Combine(double h, const Tableau::Row& w, std::size_t count,
                         std::vector<double>& out) const {
  std::copy(state_.begin(), state_.end(), out.begin());
  double* const sum = out.data();
  for (std::size_t k = 0; k < count; ++k) {
    if (w[k] == 0) continue;
    const double scale = h * w[k];
    const double* const slope = slopes_[k].data();
    for (std::size_t i = 0; i < out.size(); ++i) sum[i] += scale * slope[i];
  }
}

void Integrator::Between(double h, double part) {
  const std::size_t last = tableau_.stages - 1;
  for (std::size_t i = 0; i < between_.size(); ++i) {
    double highest = 0;
    for (std::size_t s = 0; s < tableau_.stages; ++s)
      highest += tableau_.between[s] * slopes_[s][i];
    // The cubic through both ends with their slopes, and a term that vanishes there with its slope.
    const double across = next_[i] - state_[i];
    const double at_start = h * slopes_[0][i] - across;
    const double at_end = across - h * slopes_[last][i] - at_start;
    const double rest = 1 - part;
    between_[i] =
        state_[i] + part * (across + rest * (at_start + part * (at_end + rest * h * highest)));
  }
}

double Integrator::StepError(double h) const {
  double worst = 0;
  for (std::size_t i = 0; i < state_.size(); ++i) {
    double error = 0;
    for (std::size_t s = 0; s < tableau_.stages; ++s) error += tableau_.error[s] * slopes_[s][i];
    const double size = 1 + std::max(std::abs(state_[i]), std::abs(next_[i]));
    const double scaled = std::abs(h * error) / (settings_.tolerance * size);
    // std::max would pass over one that is not a number.
    worst = std::isfinite(scaled) ? std::max(worst, scaled) : 1e10;
  }
  return worst;
}

}  // namespace tumbler
