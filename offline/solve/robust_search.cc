#include "offline/solve/robust_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "offline/solve/capture_search.h"
#include "offline/solve/cma_es.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/robust_ranking.h"

namespace tumbler {
namespace {

/// Random motions, of which so many go on from the model to robots.
struct Drawing {
  static constexpr std::size_t kKept = 1000;
  static constexpr int kRobots = 16;
  static constexpr double kScale = 1;
};

/// Robots that motions are led to, and by which those that were led are compared.
struct Capturing {
  static constexpr int kRobots = 512, kJudges = 128;
};

/// A stage in which several motions are improved.
struct Stage {
  int robots;
  double scale;           ///< Of the task's spreads.
  double sigma;           ///< Of the variables in the first generation.
  int generations_share;  ///< The stage has this part of the task's generations.
};
constexpr Stage kFirst{16, 1, 0.12, 3};
constexpr Stage kSecond{32, 1.25, 0.05, 2};

/// The last improvement, of one motion, with the task's robots.
struct Polishing {
  static constexpr double kReach_rad = 0.15;
  /// Of all variables, where divergences tell nothing.
  static constexpr double kSigma = 0.03;
};

/// Motions made for one robot each, of those that other motions do not carry.
struct Complementing {
  static constexpr double kSigma = 0.05;
  static constexpr int kGenerationsShare = 3;
  /// A motion of which most robots still fall is kept where its loss is at most this part of the
  /// worst.
  static constexpr double kBetter = 0.95;
};

/// The tuning of a motion to one robot, of which a posterior is known. Its robots differ little,
/// and the search ends as soon as they stand.
struct Tuning {
  /// The largest loss of a robot that stands with a margin (RobotLoss): it is off by at most 0.6 of
  /// what is allowed in angle, and about as much in speed.
  static constexpr double kMargin = 0.04;
  /// A search has come to its end when the mean loss has sunk by less than this part in so many
  /// generations; while robots fall, not before it had a chance.
  static constexpr double kProgress = 0.05;
  static constexpr std::size_t kPatience = 10, kChance = 20;
  /// Robots by which a motion is led before, and in how many generations at most.
  static constexpr int kLeading = 64, kLeadingGenerations = 50;
  /// See ArrivalCovariance: of leading, and of the last improvement.
  static constexpr double kLeadingReach_rad = 0.1, kReach_rad = 0.06;
  /// A mean loss of few robots from which more robots do not lead on: many of them fall.
  static constexpr double kNoUse = 0.5;
};

/// Says when the tuning of a motion is at its end.
class TuningEnd {
 public:
  /// @param loss   the least so far, after each generation.
  /// @param worst  RobustRanking::WorstLoss of the motion that has it: 1 and more where a robot
  ///               falls, or its plan exceeds a limit. Then the search goes on.
  bool Reached(double loss, const std::function<double()>& worst) {
    const bool better = losses_.empty() || loss < losses_.back();
    if (better && loss < 2 * Tuning::kMargin) worst_ = worst();
    losses_.push_back(loss);
    if (has_margin()) return true;
    if (losses_.size() <= Tuning::kPatience) return false;
    const double before = losses_[losses_.size() - 1 - Tuning::kPatience];
    if (loss > RobotLoss::kCarried && losses_.size() < Tuning::kChance) return false;
    return loss > (1 - Tuning::kProgress) * before && (loss > Tuning::kNoUse || worst() < 1);
  }
  /// Whether every robot stands with a margin.
  [[nodiscard]] bool has_margin() const { return worst_ <= Tuning::kMargin; }

 private:
  std::vector<double> losses_;
  double worst_ = std::numeric_limits<double>::infinity();
};

/// The gains of a feedback. Those of the motion begin far from what is known, and go on from there.
struct FindingGains {
  static constexpr double kSigma = 1, kLaterSigma = 0.5;
  /// Those of the hold are found for a part of the robots, by a law for so many random motions.
  static constexpr int kRobotsShare = 4;
  static constexpr int kMotionsForLaw = 75, kLeastLaws = 8;
  static constexpr int kGenerationsShare = 2;
};

/// The improvement of a motion by CMA-ES.
struct Improving {
  static constexpr int kPopulation = 16;
  /// Generations after which a motion is given up whose robots mostly fall, or whose loss is more
  /// than this of the best of the stage so far.
  static constexpr int kPatience = 20;
  static constexpr double kTimesRival = 3, kAboveRival = 0.1;
  static constexpr double kLeastSigma = 1e-5;
  /// How many motions of an improvement are compared on robots that none was found for.
  static constexpr std::size_t kElite = 8;
};

/// A motion with its loss.
struct Candidate {
  std::vector<double> x;  ///< See RobustMotion and MotionFeedback::gains.
  double loss = 0;
  bool all_rest = false;  ///< Whether its improvement ended because nothing was left to gain.
};

void SortByLoss(std::vector<Candidate>& candidates) {
  std::ranges::stable_sort(candidates, {}, &Candidate::loss);
}

class RobustSearch {
 public:
  RobustSearch(const Problem& problem, const SolveOptions& options,
               std::span<const Primitive<double>> complement)
      : task_(problem, options, complement) {}

  /// @param guess  a motion to begin with, in place of all before the last improvement; empty:
  ///               none. Where a feedback is asked for, it stays as it is.
  /// @param gains  the guess's feedback, where its gains are taken; null: they are found.
  std::vector<Candidate> Run(std::span<const double> guess, const Feedback<double>* gains) {
    taken_ = gains;
    std::vector<Candidate> best;
    if (!guess.empty()) {
      best = {{motion_.Reduce(guess), 0}};
      if (!task_.complement.empty()) {
        // The model, none of these robots, may not do well with the best: then another is taken.
        best = WithPolished(ForOneEach(best.front()));
      } else if (!task_.settings.feedback) {
        best = task_.tunes() ? Tuned(best.front()) : Polish(best);
      }
    } else {
      best = Captured(FoundForTheModel());
      if (best.empty()) {
        best = Improve(RandomMotions(), task_.settings.starts, kFirst);
        best = Improve(best, task_.settings.improved, kSecond);
      }
      best = WithPolished(best);
    }
    // No gains mend a path that the model itself cannot play.
    as_it_is_ = taken_ != nullptr ||
                (!guess.empty() && task_.settings.feedback && !ranking_.IsPlayable(best.front().x));
    if (!as_it_is_ && FeedsBackInMotion() && !best.empty()) FindGains(best.front());
    return best;
  }

  /// A candidate's motion: the problem's parameters, and how long it takes.
  [[nodiscard]] std::vector<double> ParametersOf(const Candidate& candidate) const {
    return motion_.Parameters(candidate.x);
  }
  [[nodiscard]] double DurationOf(const Candidate& candidate) const {
    return motion_.Duration_s(candidate.x);
  }
  /// A candidate's feedback, where the task asks for one.
  [[nodiscard]] Feedback<double> FeedbackOf(const Candidate& candidate) {
    const std::vector<double>& x = candidate.x;
    if (as_it_is_ && taken_ == nullptr) return {};
    if (as_it_is_) return feedback_.Along(*taken_, x, ranking_.Plans({x}).front());
    return FeedsBackInMotion() ? ranking_.Plans({x}).front().feedback
                               : FindHold(x, task_.settings.polish_robots);
  }

  /// How many robots a motion carries that the search has not met; none where they do not differ, a
  /// feedback is asked for, which has a say in that, or the motion cannot be played.
  [[nodiscard]] std::optional<RobotsCarried> CarriedBy(const Candidate& candidate) {
    if (task_.settings.feedback || interrupted()) return std::nullopt;
    // One robot, however often it is played, has no share.
    Spreads none;
    none.mass = 0;
    none.LeaveGround();
    if (task_.settings.polish_scale == 0 || task_.settings.spreads == none) return std::nullopt;
    constexpr int kSeries = 2;  // of none of the search
    if (!not_met_) not_met_ = PolishingRobots(1, kSeries);
    const std::vector<double> losses = ranking_.LossesOfRobots(candidate.x, *not_met_);
    if (losses.empty()) return std::nullopt;
    const auto carried =
        std::ranges::count_if(losses, [](double loss) { return loss < RobotLoss::kCarried; });
    return RobotsCarried{static_cast<int>(carried), static_cast<int>(losses.size()),
                         task_.settings.polish_scale};
  }

  /// Whether nothing was searched: the guess is as it was given.
  [[nodiscard]] bool as_it_is() const { return as_it_is_; }
  [[nodiscard]] std::int64_t evaluations() const { return evaluations_; }
  [[nodiscard]] std::vector<Evaluation>& history() { return history_; }
  [[nodiscard]] bool interrupted() const { return task_.interrupted(); }

 private:
  /// Whether the task asks for a feedback that acts in the motion, too.
  [[nodiscard]] bool FeedsBackInMotion() const {
    const auto& feedback = task_.settings.feedback;
    return feedback && feedback->acts != FeedbackSettings::Acts::kHold;
  }

  /// Robots of an ensemble of its own for each size, scale and series.
  [[nodiscard]] Ensemble MakeEnsemble(int robots, double scale, LaneSteps steps,
                                      int series = 0) const {
    constexpr std::uint64_t kSeries = 0x6672'6573'6800'0000;  // far from all seeds
    const std::uint64_t seed = task_.problem.search.seed * 1000 +
                               static_cast<std::uint64_t>(robots) +
                               kSeries * static_cast<std::uint64_t>(series);
    const RobotDraw draw{scale, seed, steps, ranking_.has_gains()};
    const std::size_t count =
        (Index(robots) + Packet::kLanes - 1) / Packet::kLanes * Packet::kLanes;
    if (!task_.complement.empty())
      return DrawEnsemble(task_, draw, RobotsNotCarried(task_, draw, count));
    std::vector<std::uint64_t> which(count);
    std::iota(which.begin(), which.end(), 0);
    return DrawEnsemble(task_, draw, which);
  }
  /// The robots of the last improvement, or a part of them.
  /// @param series  of robots: 0, or another number for others than those.
  [[nodiscard]] Ensemble PolishingRobots(int part, int series = 0,
                                         LaneSteps steps = RobustTask::kFine) const {
    return MakeEnsemble(
        std::max(task_.settings.polish_robots / part, static_cast<int>(Packet::kLanes)),
        task_.settings.polish_scale, steps, series);
  }

  std::vector<Candidate> WithPolished(std::vector<Candidate> best) {
    const std::vector<Candidate> polished = Polish(best);
    best.insert(best.begin(), polished.begin(), polished.end());
    return best;
  }
  std::vector<Candidate> Polish(std::vector<Candidate> from) {
    const RobustSettings& settings = task_.settings;
    std::vector<Candidate> polished;
    const bool raced = RobustRanking::CanRace(Index(settings.polish_robots));
    for (int round = settings.polish_rounds - 1; round >= 0; --round) {
      if (from.empty() || interrupted()) break;
      ++stage_;
      // What rough steps take wrong is corrected by the last round, or by who is chosen at last.
      const bool rough = task_.tunes() ? round > 0 : raced && task_.complement.empty();
      const Ensemble ensemble =
          PolishingRobots(1 << round, 0, rough ? RobustTask::kRough : RobustTask::kFine);
      from = {ImproveOne(from.front(), PolishingSearch(from.front().x, ensemble), 0, ensemble,
                         settings.generations)};
      polished = from;
      if (task_.tunes() && from.front().loss > Tuning::kNoUse) break;
    }
    if (polished.empty() || !raced || !task_.complement.empty() || interrupted()) return polished;
    // The least of many losses is also that of the motion that suits these robots by chance.
    const std::vector<double> losses = Evaluate(elite_, PolishingRobots(1, 1));
    const auto least = std::ranges::min_element(losses);
    const bool all_rest = polished.front().all_rest && *least < RobotLoss::kPerfect;
    polished.front() = {elite_[static_cast<std::size_t>(least - losses.begin())], *least, all_rest};
    Tell(false, 0, *least);
    return polished;
  }

  /// Motions made for one robot each, of those that the complement's motions do not carry, judged
  /// by many of them. These fall for several reasons, between which no small change of a motion
  /// leads; what carries one of them carries those that fall for the same.
  /// @returns  the best first.
  std::vector<Candidate> ForOneEach(const Candidate& from) {
    const RobustSettings& settings = task_.settings;
    const RobotDraw draw{settings.polish_scale, task_.problem.search.seed * 1000,
                         RobustTask::kRough};
    const std::size_t starts =
        (Index(settings.starts) + Packet::kLanes - 1) / Packet::kLanes * Packet::kLanes;
    std::vector<Candidate> found = {from};
    ++stage_;
    for (const std::uint64_t robot : RobotsNotCarried(task_, draw, starts)) {
      if (interrupted()) break;
      const Ensemble one =
          DrawEnsemble(task_, draw, std::vector<std::uint64_t>(Packet::kLanes, robot));
      const int start = static_cast<int>(found.size()) - 1;
      found.push_back(ImproveOne(
          from, CmaEs(from.x, Complementing::kSigma, Improving::kPopulation, SeedOf(start)), start,
          one, settings.generations / Complementing::kGenerationsShare));
    }
    EvaluateAgain(found, PolishingRobots(1));
    const double worst = std::ranges::max(found, {}, &Candidate::loss).loss;
    std::erase_if(found, [&](const Candidate& candidate) {
      return candidate.loss > RobotLoss::kHopeless &&
             candidate.loss > Complementing::kBetter * worst;
    });
    ++stage_;
    if (found.empty() && !interrupted()) {
      throw std::runtime_error(
          "no motion that was tried carries more than a few of the robots that the motions to "
          "complement do not carry; give robust.generations or robust.starts more, or another "
          "guess");
    }
    if (!found.empty()) Tell(false, 0, found.front().loss);
    return found;
  }

  /// Finds gains that act in a motion, which stays as it is, and before them those of the hold,
  /// where it acts there.
  void FindGains(Candidate& motion) {
    const RobustSettings& settings = task_.settings;
    const bool holds = settings.feedback->acts == FeedbackSettings::Acts::kAlways;
    ranking_.SetHold(holds ? FindHold(motion.x, settings.polish_robots / FindingGains::kRobotsShare)
                           : MotionFeedback::NoHold(motion_.Duration_s(motion.x)));
    motion.x.resize(motion_.count() + feedback_.gains());
    for (int round = settings.polish_rounds; round >= 0; --round) {
      ++stage_;
      const double sigma =
          round == settings.polish_rounds ? FindingGains::kSigma : FindingGains::kLaterSigma;
      const std::vector<double> gains(
          motion.x.begin() + static_cast<std::ptrdiff_t>(motion_.count()), motion.x.end());
      motion = ImproveOne(motion, CmaEs(gains, sigma, Improving::kPopulation, SeedOf(0)), 0,
                          PolishingRobots(1 << round), settings.generations);
    }
  }

  /// A feedback of the hold after a motion. Until it sets in, the robot lands as without it.
  [[nodiscard]] Feedback<double> FindHold(const std::vector<double>& x, int robots) {
    const RobustSettings& settings = task_.settings;
    const HoldStudy study =
        feedback_.StudyHold(x, ranking_.Plans({x}).front(),
                            MakeEnsemble(std::max(robots, static_cast<int>(Packet::kLanes)),
                                         settings.polish_scale, RobustTask::kFine));
    ++stage_;
    return FindHoldFeedback(
        study,
        {std::max(settings.samples / FindingGains::kMotionsForLaw, FindingGains::kLeastLaws),
         settings.improved, settings.generations / FindingGains::kGenerationsShare},
        task_.problem.search.seed, task_.options.threads,
        [this](int start, std::int64_t tried, double loss) {
          evaluations_ += tried;
          Tell(false, start, loss);
        },
        [this] { return interrupted(); });
  }

  std::vector<double> Evaluate(const std::vector<std::vector<double>>& motions,
                               const Ensemble& ensemble) {
    evaluations_ += static_cast<std::int64_t>(motions.size());
    return ranking_.Evaluate(motions, ensemble);
  }
  /// Gives motions the losses of an ensemble, and sorts them by these.
  void EvaluateAgain(std::vector<Candidate>& candidates, const Ensemble& ensemble) {
    std::vector<std::vector<double>> motions;
    motions.reserve(candidates.size());
    for (const Candidate& candidate : candidates) motions.push_back(candidate.x);
    const std::vector<double> losses = Evaluate(motions, ensemble);
    for (std::size_t i = 0; i < candidates.size(); ++i) candidates[i].loss = losses[i];
    SortByLoss(candidates);
  }

  void Tell(bool global, int start, double loss) {
    const Evaluation evaluation{global, start, evaluations_, loss, 0};
    history_.push_back(evaluation);
    if (task_.options.progress) task_.options.progress(evaluation);
  }

  /// Motions that were screened for the model, in searches each with a seed of its own, the one
  /// that costs least first. Where the duration is free, they take from the least to the most.
  /// Empty where the best of the first search says that how robots arrive does not tell what comes
  /// of them, or of another, where those before it carry too few robots to say.
  std::vector<Candidate> FoundForTheModel() {
    const RobustSettings& settings = task_.settings;
    SolveOptions silent;
    silent.threads = task_.options.threads;
    silent.interrupt = task_.options.interrupt;
    silent.to = SolveTo::kScreened;
    const Ensemble robots =
        MakeEnsemble(Capturing::kJudges, settings.polish_scale, RobustTask::kRough);
    Telling telling = Telling::kUnknown;
    std::vector<Candidate> found;
    for (int i = 0; i < settings.starts && !interrupted(); ++i) {
      Problem problem = task_.problem;
      problem.robust.reset();
      problem.search.seed = SeedOf(i);
      if (task_.free_duration()) {
        const double part = (i + 0.5) / settings.starts;
        problem.duration_s =
            *settings.duration_min_s + part * (*settings.duration_max_s - *settings.duration_min_s);
      }
      const SolveOutcome outcome = Solve(problem, silent);
      evaluations_ += outcome.evaluations;
      Candidate best{{}, std::numeric_limits<double>::infinity()};
      for (const Solution& solution : outcome.solutions) {
        if (solution.evaluations == 0 || !solution.rollout.finite) continue;
        found.push_back({motion_.Reduce(solution.x, problem.duration_s), solution.rollout.cost});
        if (found.back().loss < best.loss) best = found.back();
      }
      if (best.x.empty()) continue;
      Show(SearchStage::kModel, i, best.loss);
      if (telling == Telling::kUnknown) telling = DivergenceTells(ranking_, best.x, robots);
      if (telling == Telling::kNo) return {};
    }
    SortByLoss(found);
    return found;
  }

  /// Motions led to where robots come to rest; those that leave the fewest falling come first.
  std::vector<Candidate> Captured(const std::vector<Candidate>& found) {
    if (found.empty()) return {};
    std::vector<std::vector<double>> from;
    for (const Candidate& candidate : found) from.push_back(candidate.x);
    ++stage_;
    const std::vector<CapturedMotion> led = Capture(
        ranking_, from,
        MakeEnsemble(Capturing::kRobots, task_.settings.polish_scale, RobustTask::kRough),
        {.started = Index(task_.settings.starts),
         .wanted = Index(task_.settings.improved),
         .generations = task_.settings.generations},
        SeedOf(0),
        [this](int start, int motions, double loss) {
          evaluations_ += motions;
          Show(SearchStage::kArrivals, start, loss);
        },
        [this] { return interrupted(); });
    if (led.empty()) return {found.front()};  // interrupted
    std::vector<Candidate> captured;
    for (const CapturedMotion& motion : led) captured.push_back({motion.x, motion.loss});
    EvaluateAgain(captured, MakeEnsemble(Capturing::kJudges, task_.settings.polish_scale,
                                         RobustTask::kRough));
    Tell(false, 0, captured.front().loss);
    return captured;
  }

  /// Motions that are tuned to one robot, the best first: one that is changed a little, and, where
  /// that does not do, one that is led to where the robots of its posterior come to rest before, or
  /// changed further where nothing is led.
  std::vector<Candidate> Tuned(const Candidate& from) {
    std::vector<Candidate> tuned = Polish({from});
    if (interrupted() || (!tuned.empty() && tuned.front().loss < Tuning::kMargin)) return tuned;
    const std::optional<Candidate> led = LedToOneRobot(from);
    const std::vector<Candidate> further = Polish({led             ? *led
                                                   : tuned.empty() ? from
                                                                   : tuned.front()});
    tuned.insert(tuned.end(), further.begin(), further.end());
    SortByLoss(tuned);
    if (!tuned.empty()) Tell(false, 0, tuned.front().loss);
    return tuned;
  }

  /// A motion that is led to where the robots of a posterior come to rest; none where most do
  /// already, their divergences tell nothing, or it leaves more of them falling.
  std::optional<Candidate> LedToOneRobot(const Candidate& from) {
    const Ensemble robots =
        MakeEnsemble(Tuning::kLeading, task_.settings.polish_scale, RobustTask::kRough);
    const double loss = Evaluate({from.x}, robots).front();
    if (loss < RobotLoss::kCarried) return std::nullopt;
    if (DivergenceTells(ranking_, from.x, robots) == Telling::kNo) return std::nullopt;
    ++stage_;
    const std::vector<CapturedMotion> led = Capture(
        ranking_, {from.x}, robots,
        {.generations = Tuning::kLeadingGenerations, .reach_rad = Tuning::kLeadingReach_rad},
        SeedOf(0),
        [this](int start, int motions, double least) {
          evaluations_ += motions;
          Show(SearchStage::kArrivals, start, least);
        },
        [this] { return interrupted(); });
    if (led.empty() || interrupted()) return std::nullopt;
    Candidate found{led.front().x, Evaluate({led.front().x}, robots).front()};
    if (found.loss >= loss) return std::nullopt;
    return found;
  }

  /// Of a start of the present stage.
  [[nodiscard]] std::uint64_t SeedOf(int start) const {
    return task_.problem.search.seed * 1'000'000 + Index(stage_ * 1000 + start);
  }
  /// From a motion that is to be polished.
  [[nodiscard]] CmaEs PolishingSearch(const std::vector<double>& x,
                                      const Ensemble& ensemble) const {
    if ((!task_.beside_model() || task_.tunes()) &&
        DivergenceTells(ranking_, x, ensemble) != Telling::kNo) {
      const double reach_rad = task_.tunes() ? Tuning::kReach_rad : Polishing::kReach_rad;
      const auto covariance = ArrivalCovariance(ranking_, x, ensemble, reach_rad);
      if (covariance) return {x, *covariance, Improving::kPopulation, SeedOf(0)};
    }
    return {x, Polishing::kSigma, Improving::kPopulation, SeedOf(0)};
  }

  /// Says how far it is, where losses are no robots'.
  void Show(SearchStage stage, int start, double cost) const {
    Evaluation evaluation{stage == SearchStage::kModel, start, evaluations_, cost, 0};
    evaluation.stage = stage;
    if (task_.options.progress) task_.options.progress(evaluation);
  }

  /// Random motions, each in a lane of its own on the model; the best of them on 16 robots.
  std::vector<Candidate> RandomMotions() {
    const RandomStarts starts(task_.problem);
    const int packets = (task_.settings.samples + static_cast<int>(Packet::kLanes) - 1) /
                        static_cast<int>(Packet::kLanes);
    std::vector<Candidate> all(Index(packets) * Packet::kLanes);
    ParallelFor(packets, task_.options.threads, [&](int p, int /*thread*/) {
      if (interrupted()) return;
      PlayRandom(starts, p, {all.data() + Index(p) * Packet::kLanes, Packet::kLanes});
    });
    evaluations_ += static_cast<std::int64_t>(all.size());
    if (interrupted()) return {};
    SortByLoss(all);
    Tell(true, 0, all.front().loss);
    if (all.size() > Drawing::kKept) all.resize(Drawing::kKept);
    EvaluateAgain(all, MakeEnsemble(Drawing::kRobots, Drawing::kScale, RobustTask::kRough));
    return all;
  }

  /// They take as long as the task says, whether that is free or not.
  void PlayRandom(const RandomStarts& starts, int packet, std::span<Candidate> out) const {
    const Problem& problem = task_.problem;
    SelfDistances distances(problem.scene.robot, problem.scene.self_contact.pairs);
    const auto ticks =
        Index(RobustTask::Ticks(problem.duration_s) + RobustTask::Ticks(problem.settle_s));
    PacketSetpoints setpoints(ticks * task_.joints);
    for (std::size_t lane = 0; lane < Packet::kLanes; ++lane) {
      out[lane].x =
          motion_.Reduce(starts.Draw(static_cast<std::uint64_t>(packet) * Packet::kLanes + lane));
      out[lane].loss = motion_.Excess(out[lane].x, distances);
      motion_.Sample(out[lane].x, ticks, RobustTask::kTick_s, [&](std::size_t i, const auto& at) {
        setpoints[i].position.set_lane(lane, at.value);
        setpoints[i].velocity.set_lane(lane, at.first);
      });
    }
    LaneState<Packet> state = model_.states.front();
    HeldSetpoints<Packet> held = model_.held;
    LaneWatch<Packet> watch;
    task_.kernel.drive(task_.lanes.model, model_.robots.front(), model_.steps, setpoints, held,
                       state, watch);
    const std::array<double, Packet::kLanes> off = task_.loss.Off(state);
    for (std::size_t lane = 0; lane < Packet::kLanes; ++lane) {
      const double rate = std::abs(state.v[RobotLoss::kPitch].lane(lane));
      const double loss = off[lane] + 0.1 * std::min(5.0, rate);
      out[lane].loss += std::isfinite(loss) ? loss : 1e3;
    }
  }

  std::vector<Candidate> Improve(const std::vector<Candidate>& from, int count,
                                 const Stage& stage) {
    return Improve(from, count, stage.sigma,
                   MakeEnsemble(stage.robots, stage.scale, RobustTask::kRough),
                   task_.settings.generations / stage.generations_share);
  }
  /// The best of `from`, improved.
  std::vector<Candidate> Improve(const std::vector<Candidate>& from, int count, double sigma,
                                 const Ensemble& ensemble, int generations) {
    std::vector<Candidate> improved;
    ++stage_;
    double rival = RobotLoss::kHopeless;  // the best of the stage so far
    for (int start = 0; start < count && start < static_cast<int>(from.size()); ++start) {
      if (interrupted()) break;
      improved.push_back(
          ImproveOne(from[Index(start)],
                     CmaEs(from[Index(start)].x, sigma, Improving::kPopulation, SeedOf(start)),
                     start, ensemble, generations, rival));
      rival = std::min(rival, improved.back().loss);
    }
    SortByLoss(improved);
    return improved;
  }

  /// @param search  from the last of the motion's variables on; those before them stay.
  Candidate ImproveOne(const Candidate& from, CmaEs search, int start, const Ensemble& ensemble,
                       int generations, double rival = RobotLoss::kHopeless) {
    const double hopeless =
        std::min(RobotLoss::kHopeless, Improving::kTimesRival * rival + Improving::kAboveRival);
    const bool races =
        task_.complement.empty() && RobustRanking::CanRace(ensemble.robots.size() * Packet::kLanes);
    const std::ptrdiff_t kept =
        static_cast<std::ptrdiff_t>(from.x.size()) - static_cast<std::ptrdiff_t>(search.size());
    const auto begin = from.x.begin() + kept;
    const Candidate at_first{from.x, Evaluate({from.x}, ensemble).front()};
    Candidate best = at_first;
    elite_ = {from.x};
    TuningEnd tuned;
    for (int g = 0; g < generations && !interrupted(); ++g) {
      const auto worst = [&] { return ranking_.WorstLoss(best.x, ensemble); };
      best.all_rest = best.loss < RobotLoss::kPerfect;
      if (task_.tunes() && tuned.Reached(best.loss, worst)) {
        best.all_rest = tuned.has_margin();
        break;
      }
      if (best.all_rest) break;
      if (!task_.beside_model() && g >= Improving::kPatience && best.loss > hopeless) break;
      std::vector<std::vector<double>> motions = search.Ask();
      for (std::vector<double>& x : motions) x.insert(x.begin(), from.x.begin(), begin);
      std::vector<double> losses;
      if (races) {
        losses = ranking_.Race(motions, ensemble, g);
        evaluations_ += static_cast<std::int64_t>(motions.size());
      } else if (task_.tunes()) {
        losses = ranking_.RankHalf(motions, ensemble, g);
        evaluations_ += static_cast<std::int64_t>(motions.size() + (motions.size() + 1) / 2);
      } else if (!ranking_.has_gains()) {
        losses = ranking_.Rank(motions, ensemble);
        evaluations_ += static_cast<std::int64_t>(motions.size());
      } else {
        losses = Evaluate(motions, ensemble);
      }
      const auto least = std::ranges::min_element(losses);
      if (*least < best.loss) {
        best = {motions[static_cast<std::size_t>(least - losses.begin())], *least};
        elite_.push_back(best.x);
      }
      search.Tell(losses);
      Tell(false, start, best.loss);
      if (search.sigma() < Improving::kLeastSigma) break;
    }
    if (!races && !ranking_.has_gains() && elite_.size() > 1) {
      // Single precision has ordered motions, and judges none.
      best.loss = Evaluate({best.x}, ensemble).front();
      if (!task_.tunes()) best.all_rest = best.loss < RobotLoss::kPerfect;
      if (best.loss > at_first.loss) best = at_first;
    }
    if (elite_.size() >= Improving::kElite)
      elite_.erase(elite_.begin(), elite_.end() - (Improving::kElite - 1));
    // The mean of the candidates is less of a lucky draw than the best of them.
    std::vector<double> mean = search.mean();
    mean.insert(mean.begin(), from.x.begin(), begin);
    elite_.push_back(std::move(mean));
    return best;
  }

  RobustTask task_;
  RobustMotion motion_{task_};
  Ensemble model_ = ModelEnsemble(task_, RobustTask::kRough);
  MotionPlanner planner_{task_, motion_};
  MotionFeedback feedback_{task_, motion_, model_};
  RobustRanking ranking_{task_, motion_, planner_, feedback_};
  const Feedback<double>* taken_ = nullptr;  ///< Of the guess, where its gains are taken.
  bool as_it_is_ = false;
  std::optional<Ensemble> not_met_;  ///< By the search.
  /// Of the last improvement: the last motions that were the best, and the candidates' mean.
  std::vector<std::vector<double>> elite_;
  int stage_ = 0;
  std::int64_t evaluations_ = 0;
  std::vector<Evaluation> history_;
};

}  // namespace

SolveOutcome SolveRobust(const Problem& problem, const SolveOptions& options,
                         std::span<const double> guess, const Feedback<double>* gains,
                         std::span<const Primitive<double>> complement) {
  RobustSearch search(problem, options, complement);
  SolveOutcome outcome;
  const std::vector<Candidate> found = search.Run(guess, gains);
  for (std::size_t i = 0; i < found.size(); ++i) {
    // One evaluation: the figures of the motion as it is.
    SolveOptions silent;
    Problem of_motion = problem;
    of_motion.duration_s = search.DurationOf(found[i]);
    Rollout rollout(of_motion, problem.solver.step_s / 4);
    Solution solution =
        SolveFrom(of_motion, search.ParametersOf(found[i]), 1, rollout, silent, nullptr);
    solution.duration_s = of_motion.duration_s;
    // A feedback takes as long to find as a motion: the best one gets it.
    if (problem.robust->feedback && i == 0) solution.feedback = search.FeedbackOf(found[i]);
    solution.robots = search.CarriedBy(found[i]);
    solution.end = search.as_it_is()      ? SolveEnd::kTaken
                   : search.interrupted() ? SolveEnd::kInterrupted
                   : found[i].all_rest    ? SolveEnd::kAllRest
                                          : SolveEnd::kGenerations;
    solution.finished = true;
    solution.start = static_cast<int>(i);
    outcome.solutions.push_back(std::move(solution));
  }
  outcome.interrupted = search.interrupted();
  outcome.evaluations = search.evaluations();
  outcome.history = std::move(search.history());
  return outcome;
}

}  // namespace tumbler
