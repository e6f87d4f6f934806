#pragma once

#include <string>
#include <vector>

#include "common/json.h"
#include "offline/rehearsal/robustness/trial.h"

namespace tumbler {

/// A share with its confidence interval at 95 %, after Wilson [W27]. It holds for small numbers,
/// and for shares near 0 and 1, too.
///
/// [W27] E. B. Wilson, Probable Inference, the Law of Succession, and Statistical Inference,
/// J. Am. Stat. Assoc. 22(158), 1927.
struct Share {
  int count = 0, of = 0;
  double low = 0, high = 1;

  [[nodiscard]] double value() const { return of == 0 ? 0 : static_cast<double>(count) / of; }
};
[[nodiscard]] Share ShareOf(int count, int of);

/// How a quantity in which robots differ is related to what became of them.
struct Influence {
  std::string name;
  /// Mean of the departure among those that do not stand [standard deviations of the spread].
  double mean_sigma = 0;
  /// Mean departure squared among those that do not stand, over that among all, less 1.
  double excess = 0;
  /// How unlikely that is by chance: the larger of both over its own standard deviation. Above 3 it
  /// is hardly chance.
  double significance = 0;
};

/// The result of a study.
struct RobustnessResult {
  std::string name;
  RobustnessStudy study;
  std::vector<TrialOutcome> trials;  ///< In the order of their numbers.

  [[nodiscard]] int Count(TrialOutcome::Verdict verdict) const;
  [[nodiscard]] Share stands() const;
  /// The most telling first. Empty where all stand, or none.
  [[nodiscard]] std::vector<Influence> Influences() const;
};

/// Plays robots 0 ... count - 1 on so many threads. The result does not depend on the threads.
/// @throws as Trials.
RobustnessResult RunStudy(const RobustnessStudy& study, int count, int threads);

/// For people: several lines, ending with a line feed.
std::string ToText(const RobustnessResult& result);
/// The same as one JSON object, with every robot that does not stand.
Json ToJson(const RobustnessResult& result);

}  // namespace tumbler
