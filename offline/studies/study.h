#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/files/json.h"
#include "common/files/share.h"
#include "offline/studies/processes.h"
#include "offline/studies/trial.h"

namespace tumbler {

/// How a quantity in which robots differ is related to what became of them.
struct Influence {
  std::string name;
  std::size_t deviate = 0;  ///< Which of RobotVariation::deviates.
  /// Mean of the departure among those that do not stand [standard deviations of the spread].
  double mean_sigma = 0;
  /// Mean departure squared among those that do not stand, over that among all, less 1.
  double excess = 0;
  /// How unlikely that is by chance: the larger of both as a standard normal number.
  double significance = 0;
  /// Whether it is hardly chance, also as the largest of some forty such numbers.
  [[nodiscard]] bool telling() const { return significance > 3.7; }
};

/// Robots by two quantities, in cells: how many there are, and how many stand.
struct SuccessMap {
  static constexpr int kCells = 9;  ///< To a side; the outer ones have all that is beyond.
  struct Cell {
    int robots = 0, stand = 0;
  };
  std::string x, y;       ///< Names of the quantities.
  double half_width = 0;  ///< The cells' middle parts go from -this to this [standard deviations].
  std::array<std::array<Cell, kCells>, kCells> cells{};  ///< [y][x]

  /// The cell's number for a departure.
  [[nodiscard]] int CellOf(double sigma) const;
  /// The departure at the lower edge of a cell; of the first: less than all.
  [[nodiscard]] double EdgeOf(int cell) const;
};

/// Where robots that do not stand left the model's way: how many in a node's motion, and when. The
/// way of robots that are dropped is not the model's: all of them are among `others`.
struct Departures {
  std::string in;                                ///< The node.
  int left = 0;                                  ///< Of these the pitch left the model's for good.
  int others = 0;                                ///< These were only not as asked afterwards.
  double first_s = 0, median_s = 0, last_s = 0;  ///< Of `left`, since the motion began.
};

/// Robots that were dropped and lay alike: their pitch, less whole turns, with their joints where
/// the motion begins.
struct Lies {
  double low_rad = 0, high_rad = 0;  ///< Of these pitches.
  int robots = 0, stand = 0;
  std::map<std::string, int> begun;  ///< How many began with which node; "": none.
};

/// The result of a study.
struct RobustnessResult {
  std::string name;
  RobustnessStudy study;
  std::string files;                 ///< HashOfFiles of the study when it began.
  std::vector<TrialOutcome> trials;  ///< In the order of their numbers.

  [[nodiscard]] int Count(TrialOutcome::Verdict verdict) const;
  /// How many of them were judged, of which all shares are.
  [[nodiscard]] int Judged() const;
  [[nodiscard]] Share stands() const;
  /// How many are as asked in the end: after every motion, or after a fall from which they got up.
  [[nodiscard]] Share ends() const;
  /// How many are amiss, but rest at last in a pose in which a motion ends.
  [[nodiscard]] int AmissAtRest() const;
  /// The most telling first. Empty where all stand, or none.
  [[nodiscard]] std::vector<Influence> Influences() const;
  /// Over the two most telling quantities. Empty where there are no two.
  [[nodiscard]] std::optional<SuccessMap> Map() const;
  /// By node, in the order of their names.
  [[nodiscard]] std::vector<Departures> Where() const;
  /// Of robots that were dropped: classes of pitches, those of one at most 0.2 rad from the next.
  [[nodiscard]] std::vector<Lies> HowTheyLay() const;
};

/// Which of a study's robots are played, and where what became of them is kept.
struct WorkPlan {
  int robots = 100;  ///< Numbers 0 ... robots - 1.
  int threads = 1;   ///< Of each process.
  /// Of `shards` parts of the work, numbered from 1, this one: the robots whose number leaves
  /// `shard - 1` when divided by `shards`.
  int shard = 1, shards = 1;
  std::string checkpoint;           ///< File that outcomes are kept in; empty: none.
  std::vector<std::string> merged;  ///< Files of other parts, which are only read.
  /// Set it from any thread to end after the robots that are being played; may be null.
  const std::atomic<bool>* interrupt = nullptr;
  /// Told how many robots are known, now and then; may be empty.
  std::function<void(int known)> progress;
};

/// What RunStudy has.
struct WorkDone {
  int known = 0;  ///< Of the robots in the plan.
  /// Empty when robots are not known that belong to other shards or were interrupted, and in all
  /// processes but the first.
  std::optional<RobustnessResult> result;
};

/// Plays the robots that are not known yet, shared among the processes. The result does not depend
/// on threads, processes, shards and interruptions.
/// @throws as Trials, and FileError about the files of the plan.
WorkDone RunStudy(const RobustnessStudy& study, const WorkPlan& plan, const Processes& processes);
/// The same of robots 0 ... count - 1 in this process.
RobustnessResult RunStudy(const RobustnessStudy& study, int count, int threads);

/// Two studies that differ in how robots are played, robot by robot.
struct Agreement {
  Share standing;       ///< Both stand, both do not, or neither was judged.
  Share same_verdicts;  ///< Of all.
  struct Difference {
    std::size_t index;
    TrialOutcome::Verdict first, second;
  };
  std::vector<Difference> differences;  ///< In their verdicts.
};
/// @pre both have as many robots.
[[nodiscard]] Agreement Compare(const RobustnessResult& first, const RobustnessResult& second);

/// The unit of departures in words: of spreads that `--scale` has not multiplied.
std::string UnitOfDepartures(const RobustnessStudy& study);

/// What happens to a study's robots, in words behind others; empty where nothing does.
std::string DisturbancesOf(const RobustnessStudy& study);

/// Why robots were not judged, and how many: "40 robots were not judged: its task ..."; empty where
/// all were.
std::string NotJudgedText(const RobustnessResult& result);

/// For people: several lines, ending with a line feed.
std::string ToText(const RobustnessResult& result);
std::string ToText(const Agreement& agreement);
/// The same as one JSON object, with every robot that does not stand.
Json ToJson(const RobustnessResult& result);
Json ToJson(const Agreement& agreement);

}  // namespace tumbler
