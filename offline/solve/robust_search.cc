#include "offline/solve/robust_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "offline/model/least_squares.h"
#include "offline/problem/feed_forward_knots.h"
#include "offline/problem/link_chains.h"
#include "offline/scene/lane_kernel.h"
#include "offline/scene/self_clearance.h"
#include "offline/solve/cma_es.h"
#include "offline/solve/free_paths.h"
#include "offline/solve/hold_feedback.h"
#include "offline/solve/lane_feedback.h"
#include "offline/solve/random_starts.h"

namespace tumbler {
namespace {

constexpr std::size_t kLanes = Packet::kLanes;
constexpr double kTick_s = 1e-3;  // of the runtime that will play the motion
constexpr std::size_t kPitch = 2;

/// What a robot is watched for.
struct Watching {
  /// How long a robot stands before the motion, so that it rests on its own ground.
  static constexpr double kBefore_s = 0.5;
  /// How long after the settle phase the robot has to be at rest, and how long that is watched.
  static constexpr double kLater_s = 0.9;
  static constexpr double kWatched_s = 0.4;
};

/// Steps that do where motions are ranked, and those of the last improvement, which are the twin's
/// to some 0.5 % of robots.
constexpr LaneSteps kRough{.per_tick = 2}, kFine{.per_tick = 4};

/// The random motions.
struct Drawing {
  /// Motions that go on from the model to 16 robots.
  static constexpr std::size_t kKept = 1000;
};

/// The improvement of motions.
struct Improving {
  static constexpr int kPopulation = 16;
  /// A loss from which on robots mostly fall, and one that cannot be told from 0.
  static constexpr double kHopeless = 0.9;
  static constexpr double kPerfect = 1e-3;
  static constexpr int kHopelessAfter = 20;  // generations
  /// Change of the logarithm of a free duration with the variable that stands for it, so that this
  /// is of the size of the others.
  static constexpr double kStretch = 0.5;
};

/// Successive halving [JT16]: motions of a generation are compared on a part of the robots, the
/// better half of them on twice as many, and so on, at last on all. Where a generation begins
/// rotates, so that motions suit all robots and not the first ones.
///
/// [JT16] K. Jamieson, A. Talwalkar, Non-stochastic Best Arm Identification and Hyperparameter
/// Optimization, AISTATS 2016.
struct Racing {
  /// Ensembles of at least so many packets are divided so; of fewer, a part says nothing.
  static constexpr std::size_t kLeastPackets = 16;
  /// Parts of the ensemble, one after the other: 1/8, 1/4, 1/2, 1.
  static constexpr int kRungs = 4;
  /// What a motion's loss is above that of one that went a rung further.
  static constexpr double kDropped = 100;
  /// How many motions of the last improvement are compared on robots that none was found for.
  static constexpr std::size_t kElite = 8;
};

/// The plan of a motion, and the limits of its path.
struct Planning {
  /// Thinning of the feed-forward: half the width of a triangle [ticks], as wide as the knots of a
  /// primitive's torque.
  static constexpr int kSmoothing_ticks = 12;
  /// Parts of the contact's layer and of the torque limit that the plan may use. The certificate
  /// and the second look take finer steps than lanes do, and refuse a motion above the whole.
  static constexpr double kLargestDepth = 0.85, kLargestTorque = 0.95;
  /// A candidate worth this keeps no limit of its path, and is not simulated.
  static constexpr double kUnplayable = 4;
  /// What a path that is at its limits exceeds them by once a primitive's file has rounded it.
  static constexpr double kRounding = 1e-9;
};

/// The loss of robots whose setpoints are corrected.
struct Faulting {
  /// The loss of a robot that the runtime stops, or whose own shapes overlap.
  static constexpr double kFaultLoss = 1.3;
  /// How often the shapes are looked at [ticks].
  static constexpr int kLookAtShapes = 2;
};

/// Motions for the robots that other motions do not carry.
struct Complementing {
  /// A loss below which a motion carries a robot (`LossOf`).
  static constexpr double kCarried = 0.2;
  /// A loss with which the model does what is asked, and not only nearly.
  static constexpr double kCalm = 0.08;
  /// A motion of which most robots still fall is kept where its loss is at most this part of the
  /// worst.
  static constexpr double kBetter = 0.95;
  /// How many robots are looked at, for each that is wanted, to find those that no motion carries.
  static constexpr int kLooked = 200;
};

/// The tuning of a motion to one robot, of which a posterior is known. Its robots differ little,
/// and the search ends as soon as they stand.
struct Tuning {
  /// The largest loss of a robot that stands with a margin (`LossOf`): it is off by at most 0.6 of
  /// what is allowed in angle, and about as much in speed.
  static constexpr double kMargin = 0.04;
  /// A search has come to its end when the mean loss has sunk by less than this part in so many
  /// generations; while robots fall, not before it had a chance.
  static constexpr double kProgress = 0.05;
  static constexpr std::size_t kPatience = 10, kChance = 20;
  /// A mean loss of few robots from which more robots do not lead on: many of them fall.
  static constexpr double kNoUse = 0.5;
  /// Slopes of the ground on which the model has to stay, too [rad]: one for each lane. The second
  /// look asks for 2 mrad.
  static constexpr std::array<double, kLanes> kSlopes_rad = {0,     1e-3, -1e-3, 2e-3,
                                                             -2e-3, 3e-3, -3e-3, 0};
};

/// The feedback in the motion and that of the hold.
struct FeedingBack {
  /// Gains of a feedback in the motion, for one of the variables that stand for them, whose
  /// standard deviation is 1 at first. With a tenth of it nothing is found that is better than no
  /// feedback.
  static constexpr double kAngleGain = 2, kRateGain = 0.2;
  /// The largest gains that are tried.
  static constexpr double kLargestAngleGain = 20, kLargestRateGain = 5;
  /// When after a motion a feedback of the hold sets in, once the robot has landed, and how long it
  /// takes; and for how many random motions one law is tried.
  static constexpr double kHoldBegins_s = 0.2, kHoldRise_s = 0.1;
  static constexpr int kMotionsForHold = 75;
  /// The dead zone of a feedback that acts in the motion alone, and where it has ended: several
  /// times a sensor's noise. With one of the hold it is that.
  static constexpr double kErrorMin_rad = 0.02, kErrorFull_rad = 0.06;
  /// Where the fed-back angle is off by more, nothing is corrected, and how fast feedback fades.
  static constexpr double kErrorMax_rad = 0.6, kStartErrorMax_rad = 0.2, kFade_s = 0.05;
};

int Ticks(double time_s) { return static_cast<int>(std::lround(time_s / kTick_s)); }

/// Robots in packets, as they stand before the motion.
struct Ensemble {
  HeldSetpoints<Packet> held{};
  std::vector<LaneRobot<Packet>> robots;
  std::vector<LaneState<Packet>> states;
  std::vector<LaneNoise> noise;  ///< Of the sensors, where there are any.
  LaneSteps steps;
};

/// What the plan of a motion, the model with joints that follow exactly, takes.
struct Plan {
  std::vector<double> feed_forward;  ///< For each tick of the motion and joint.
  double excess = 0;                 ///< Of torque and of penetration.
  Feedback<double> feedback;         ///< Absent where the task asks for none.
};

/// A motion with its loss.
struct Candidate {
  std::vector<double> x;  ///< See RobustSearch::variables.
  double loss = 0;
};

class RobustSearch {
 public:
  RobustSearch(const Problem& problem, const SolveOptions& options,
               std::span<const Primitive<double>> complement)
      : problem_(problem),
        robust_(*problem.robust),
        options_(options),
        complement_(complement),
        kernel_(*PacketKernels().front()),
        paths_(problem),
        rows_(paths_.Reduce(DerivativeLimitRows(problem))),
        parameters_(static_cast<int>(paths_.count())),
        joints_(problem.joints.size()) {
    lanes_ = LanesOf(RobotVariation{});
    target_rad_ = *problem.target_pitch_rad;
    for (const CostTerm& term : problem.cost) {
      if (term.targets_pitch() && term.when == CostTerm::When::kSettled)
        tolerance_rad_ = term.tolerance;
    }
    for (const CostTerm& term : problem.cost) {
      const bool place = term.kind == CostTerm::Kind::kSquare && !term.of_velocity &&
                         term.dof < static_cast<int>(kPitch);
      if (!place || term.when != CostTerm::When::kSettled || term.weight <= 0) continue;
      places_.push_back({Index(term.dof), term.target, tolerance_rad_ / term.tolerance});
    }
    model_ = EnsembleOf(std::vector<std::uint64_t>(kLanes), 0, 0, kRough);
    if (tunes()) {
      fine_model_ = ModelOnSlopes();
    } else if (beside_model()) {
      fine_model_ = EnsembleOf(std::vector<std::uint64_t>(kLanes), 0, 0, kFine);
    }
  }

  /// @param guess  a motion to begin with, in place of the first two stages; empty: none. Where a
  ///               feedback is asked for, it stays as it is.
  /// @param gains  the guess's feedback, where its gains are taken; null: they are found.
  std::vector<Candidate> Run(std::span<const double> guess, const Feedback<double>* gains) {
    taken_ = gains;
    std::vector<Candidate> best;
    if (!guess.empty()) {
      best = {{paths_.Reduce(guess), 0}};
      best.front().x.resize(variables());
      if (!complement_.empty()) {
        // The model, none of these robots, may not do well with the best: then another is taken.
        best = ForOneEach(best.front());
        const std::vector<Candidate> polished = Polish(best);
        best.insert(best.begin(), polished.begin(), polished.end());
      } else if (!robust_.feedback) {
        best = Polish(best);
      }
    } else {
      best = Improve(RandomMotions(), robust_.starts, 0.12, MakeEnsemble(16, 1),
                     robust_.generations / 3);
      best = Improve(best, robust_.improved, 0.05, MakeEnsemble(32, 1.25), robust_.generations / 2);
      const std::vector<Candidate> polished = Polish(best);
      best.insert(best.begin(), polished.begin(), polished.end());
    }
    // No gains mend a path that the model itself cannot play.
    as_it_is_ =
        taken_ != nullptr || (!guess.empty() && robust_.feedback && !IsPlayable(best.front().x));
    if (!as_it_is_ && feeds_back() && !best.empty()) FindGains(best.front());
    return best;
  }

  /// A candidate's motion: the problem's parameters, and how long it takes.
  [[nodiscard]] std::vector<double> ParametersOf(const Candidate& candidate) const {
    return paths_.Expand({candidate.x.data(), Index(parameters_)});
  }
  [[nodiscard]] double DurationOf(const std::vector<double>& x) const {
    if (!free_duration()) return problem_.duration_s;
    const double stretched_s =
        problem_.duration_s * portable::Exp(Improving::kStretch * x[Index(parameters_)]);
    return kTick_s * std::round(stretched_s / kTick_s);
  }

  /// A candidate's feedback; absent where the task asks for none.
  [[nodiscard]] Feedback<double> FeedbackOf(const Candidate& candidate) {
    if (as_it_is_) return taken_ != nullptr ? TakenFeedback(candidate.x) : Feedback<double>{};
    return feeds_back() ? Plans({candidate.x}).front().feedback
                        : FindHold(candidate.x, robust_.polish_robots);
  }

  /// Whether nothing was searched: the guess is as it was given.
  [[nodiscard]] bool as_it_is() const { return as_it_is_; }
  [[nodiscard]] std::int64_t evaluations() const { return evaluations_; }
  [[nodiscard]] std::vector<Evaluation>& history() { return history_; }
  [[nodiscard]] bool interrupted() const {
    return options_.interrupt != nullptr && *options_.interrupt;
  }

 private:
  /// The robots of the last improvement, or a part of them.
  /// @param series  of robots: 0, or 1 for others than those.
  [[nodiscard]] Ensemble Polishing(int part, int series = 0) const {
    const bool rough = tunes() && part > 1;  // the last round corrects what that takes wrong
    return MakeEnsemble(std::max(robust_.polish_robots / part, static_cast<int>(kLanes)),
                        robust_.polish_scale, rough ? kRough : kFine, series);
  }
  std::vector<Candidate> Polish(std::vector<Candidate> from) {
    for (int round = robust_.polish_rounds - 1; round >= 0; --round) {
      from = Improve(from, 1, 0.03, Polishing(1 << round), robust_.generations);
      if (tunes() && !from.empty() && from.front().loss > Tuning::kNoUse) break;
    }
    const bool raced = Index(robust_.polish_robots) >= Racing::kLeastPackets * kLanes;
    if (from.empty() || !raced || !complement_.empty() || interrupted()) return from;
    // The least of many losses is also that of the motion that suits these robots by chance.
    const std::vector<double> losses = Evaluate(elite_, Polishing(1, 1));
    const auto least = std::ranges::min_element(losses);
    from.front() = {elite_[static_cast<std::size_t>(least - losses.begin())], *least};
    Tell(false, 0, *least);
    return from;
  }

  /// Motions made for one robot each, of those that the complement's motions do not carry, judged
  /// by many of them. These fall for several reasons, between which no small change of a motion
  /// leads; what carries one of them carries those that fall for the same.
  /// @returns  the best first.
  std::vector<Candidate> ForOneEach(const Candidate& from) {
    constexpr double kSigma = 0.05;
    const std::uint64_t seed = problem_.search.seed * 1000;
    const double scale = robust_.polish_scale;
    const std::size_t starts = (Index(robust_.starts) + kLanes - 1) / kLanes * kLanes;
    std::vector<Candidate> found = {from};
    ++stage_;
    for (const std::uint64_t robot : NotCarried(starts, scale, seed, kRough)) {
      if (interrupted()) break;
      const Ensemble one =
          EnsembleOf(std::vector<std::uint64_t>(kLanes, robot), scale, seed, kRough);
      found.push_back(ImproveOne(from, static_cast<int>(found.size()) - 1, kSigma, one,
                                 robust_.generations / 3, Improving::kHopeless));
    }
    std::vector<std::vector<double>> motions;
    for (const Candidate& candidate : found) motions.push_back(candidate.x);
    const std::vector<double> losses = Evaluate(motions, Polishing(1));
    for (std::size_t i = 0; i < found.size(); ++i) found[i].loss = losses[i];
    const double worst = std::ranges::max(losses);
    std::erase_if(found, [&](const Candidate& candidate) {
      return candidate.loss > Improving::kHopeless &&
             candidate.loss > Complementing::kBetter * worst;
    });
    Sort(found);
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
    constexpr int kPartForHold = 4;
    if (robust_.feedback->acts == FeedbackSettings::Acts::kAlways) {
      hold_ = FindHold(motion.x, robust_.polish_robots / kPartForHold);
    } else {
      hold_.emplace();
      AddHoldKnots(DurationOf(motion.x), 1, *hold_);
      hold_->error_min_rad = FeedingBack::kErrorMin_rad;
      hold_->error_full_rad = FeedingBack::kErrorFull_rad;
    }
    motion.x.resize(variables());
    for (int round = robust_.polish_rounds; round >= 0; --round) {
      ++stage_;
      const double sigma = round == robust_.polish_rounds ? 1.0 : 0.5;
      motion = ImproveOne(motion, 0, sigma, Polishing(1 << round), robust_.generations,
                          Improving::kHopeless, first_gain());
    }
  }

  using Setpoints = std::vector<LaneSetpoint<Packet>>;

  /// Of a candidate: what is free of the paths, the duration where it is free, and, once the
  /// feedback of the hold is known, for each joint the gains in the motion, those of the angle
  /// before those of the rate.
  [[nodiscard]] std::size_t variables() const {
    const std::size_t gains = hold_ ? 2 * joints_ * Index(robust_.feedback->knots) : 0;
    return first_gain() + gains;
  }
  [[nodiscard]] std::size_t first_gain() const {
    return Index(parameters_) + (free_duration() ? 1 : 0);
  }
  /// Whether the task asks for a feedback that acts in the motion, too.
  [[nodiscard]] bool feeds_back() const {
    return robust_.feedback && robust_.feedback->acts != FeedbackSettings::Acts::kHold;
  }
  /// Whether the model is none of the robots: others carry it, or it is known that the robot has
  /// friction, zeros and a slope that the model has not.
  [[nodiscard]] bool beside_model() const {
    return !complement_.empty() || robust_.spreads.posterior != nullptr;
  }
  /// Whether the motion is for one robot, of which a posterior is known.
  [[nodiscard]] bool tunes() const {
    return robust_.spreads.posterior != nullptr && complement_.empty() && !robust_.feedback;
  }
  [[nodiscard]] bool free_duration() const { return robust_.duration_max_s.has_value(); }
  [[nodiscard]] int TicksOf(const std::vector<double>& x) const { return Ticks(DurationOf(x)); }
  /// By how much a motion is faster than one of the problem's duration.
  [[nodiscard]] double HasteOf(const std::vector<double>& x) const {
    return problem_.duration_s / DurationOf(x);
  }

  /// The scene in lanes, for the model or a robot.
  LaneScene LanesOf(const RobotVariation& variation) const {
    const bool model = variation.links.empty();
    LaneScene lanes =
        MakeLaneScene(model ? problem_.scene : Varied(problem_.scene, variation), robust_.drive);
    for (std::size_t j = 0; j < problem_.joints.size(); ++j) {
      auto& joint = lanes.robot.joints[j];
      joint.torque_max = problem_.joints[j].limits.torque_max_nm;
      if (model) continue;
      const double torque = variation.joints[j].torque;
      joint.torque_max *= variation.joints[j].torque_limit * torque;
      joint.kp *= variation.joints[j].gain * torque;
      joint.kd *= variation.joints[j].gain * torque;
      joint.feed_forward = torque;
      joint.velocity_filter = variation.joints[j].velocity_filter_s;
      joint.torque_lag = variation.joints[j].torque_lag_s;
      joint.delay = std::min(joint.delay + variation.delay_s, kTick_s);
      joint.zero_error = variation.joints[j].zero_rad;
    }
    return lanes;
  }

  /// What is added to a robot's state when the motion begins.
  [[nodiscard]] LaneState<double> DisplacementOf(const RobotVariation& variation) const {
    LaneState<double> by{};
    const PlanarRobot& robot = problem_.scene.robot;
    const auto q = variation.StartPositions(robot), v = variation.StartRates(robot);
    std::copy(q.begin(), q.end(), by.q.begin());
    std::copy(v.begin(), v.end(), by.v.begin());
    return by;
  }

  [[nodiscard]] LaneState<double> Start() const {
    LaneState<double> state{};
    std::copy(problem_.start_q.begin(), problem_.start_q.end(), state.q.begin());
    return state;
  }

  /// Robots of an ensemble of its own for each size, scale and series.
  Ensemble MakeEnsemble(int robots, double scale, LaneSteps steps = kRough, int series = 0) const {
    constexpr std::uint64_t kSeries = 0x6672'6573'6800'0000;  // far from all seeds
    const std::uint64_t seed = problem_.search.seed * 1000 + static_cast<std::uint64_t>(robots) +
                               kSeries * static_cast<std::uint64_t>(series);
    std::vector<std::uint64_t> which;
    const std::size_t whole = (Index(robots) + kLanes - 1) / kLanes * kLanes;
    if (complement_.empty()) {
      for (std::size_t i = 0; i < whole; ++i) which.push_back(i);
    } else {
      which = NotCarried(whole, scale, seed, steps);
    }
    return EnsembleOf(which, scale, seed, steps);
  }

  /// The first robots of a seed that no motion of the complement carries.
  /// @param count  of robots, whole packets. Fewer are returned where so many are hard to find.
  std::vector<std::uint64_t> NotCarried(std::size_t count, double scale, std::uint64_t seed,
                                        LaneSteps steps) const {
    constexpr std::size_t kPackets = 32;  // at a time
    std::vector<Setpoints> motions;
    for (const Primitive<double>& motion : complement_) motions.push_back(SetpointsOf(motion));
    std::vector<std::uint64_t> found;
    std::uint64_t looked = 0;
    while (found.size() < count && looked < count * Complementing::kLooked && !interrupted()) {
      std::array<std::array<bool, kLanes>, kPackets> carried{};
      ParallelFor(static_cast<int>(kPackets), options_.threads, [&](int packet, int /*thread*/) {
        std::vector<std::uint64_t> which;
        for (std::size_t lane = 0; lane < kLanes; ++lane)
          which.push_back(looked + Index(packet) * kLanes + lane);
        const Ensemble ensemble = EnsembleOf(which, scale, seed, steps);
        Distances distances;  // without a feedback nothing is looked at
        for (std::size_t m = 0; m < motions.size(); ++m) {
          const std::array<double, kLanes> losses = LossesOf(
              MakePlay(ensemble, 0, motions[m], distances), Ticks(complement_[m].duration_s));
          for (std::size_t lane = 0; lane < kLanes; ++lane)
            carried[Index(packet)][lane] |= losses[lane] < Complementing::kCarried;
        }
      });
      for (std::size_t i = 0; i < kPackets * kLanes && found.size() < count; ++i)
        if (!carried[i / kLanes][i % kLanes]) found.push_back(looked + i);
      looked += kPackets * kLanes;
    }
    if (found.size() < kLanes && !interrupted()) {
      throw std::runtime_error(
          fmt::format("the motions to complement carry all but {} of {} robots: too few to find "
                      "another for; leave --complement out, or let robots differ more "
                      "(robust.polish_scale)",
                      found.size(), looked));
    }
    found.resize(std::max(found.size() / kLanes, std::size_t{1}) * kLanes);  // 1: interrupted
    return found;
  }

  /// Those of a primitive, as its hold goes on.
  Setpoints SetpointsOf(const Primitive<double>& motion) const {
    const int end = Ticks(motion.duration_s) + Ticks(problem_.settle_s) + Ticks(Watching::kLater_s);
    Setpoints setpoints;
    for (int k = 0; k < end; ++k) {
      const double t = std::min(k * kTick_s, motion.duration_s);
      for (const JointMotion<double>& joint : motion.motions()) {
        const auto at = joint.position.Evaluate(t);
        const double velocity = k * kTick_s < motion.duration_s ? at.first : 0;
        setpoints.push_back({Packet::Of(at.value), Packet::Of(velocity),
                             Packet::Of(joint.torque.Evaluate(t).value)});
      }
    }
    return setpoints;
  }

  /// The robots with these numbers, as they stand before the motion.
  /// @param which  whole packets.
  Ensemble EnsembleOf(const std::vector<std::uint64_t>& which, double scale, std::uint64_t seed,
                      LaneSteps steps) const {
    steps.per_tick *= FinerStepsFor(problem_.scene.contact, robust_.spreads, scale);
    std::vector<RobotVariation> robots;
    for (const std::uint64_t robot : which)
      robots.push_back(DrawRobot(problem_.scene, robust_.spreads, scale, seed, robot));
    return EnsembleOf(robots, seed, steps);
  }

  /// The model on grounds that slope. (A posterior's robots of no deviation are its mean.)
  [[nodiscard]] Ensemble ModelOnSlopes() const {
    Spreads none;
    none.mass = 0;
    none.LeaveGround();
    std::vector<RobotVariation> robots(kLanes, DrawRobot(problem_.scene, none, 0, 0, 0));
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      robots[lane].slope_rad = Tuning::kSlopes_rad[lane];
    return EnsembleOf(robots, 0, kFine);
  }

  /// @param robots  whole packets.
  /// @param seed    of their sensors' noise.
  Ensemble EnsembleOf(const std::vector<RobotVariation>& variations, std::uint64_t seed,
                      LaneSteps steps) const {
    Ensemble ensemble;
    ensemble.steps = steps;
    for (std::size_t j = 0; j < joints_; ++j)
      ensemble.held[j] = {Packet::Of(problem_.joints[j].start_rad), Packet::Of(0), Packet::Of(0)};
    Setpoints hold;
    for (int k = 0; k < Ticks(Watching::kBefore_s); ++k)
      hold.insert(hold.end(), ensemble.held.begin(), ensemble.held.begin() + joints_);
    for (std::size_t first = 0; first < variations.size(); first += kLanes) {
      std::array<LaneRobot<double>, kLanes> each;
      std::array<LaneState<double>, kLanes> states, displaced;
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const RobotVariation& variation = variations[first + lane];
        each[lane] = LanesOf(variation).robot;
        states[lane] = Start();
        displaced[lane] = DisplacementOf(variation);
      }
      LaneState<Packet> state = PackLanes<LaneState>(states);
      HeldSetpoints<Packet> held = ensemble.held;
      LaneWatch<Packet> watch;
      ensemble.robots.push_back(PackLanes<LaneRobot>(each));
      kernel_.drive(lanes_.model, ensemble.robots.back(), ensemble.steps, hold, held, state, watch);
      const LaneState<Packet> by = PackLanes<LaneState>(displaced);
      for (std::size_t dof = 0; dof < joints_ + 3; ++dof) {
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
          state.q[dof].set_lane(lane, state.q[dof].lane(lane) + by.q[dof].lane(lane));
          state.v[dof].set_lane(lane, state.v[dof].lane(lane) + by.v[dof].lane(lane));
        }
      }
      ensemble.states.push_back(state);
      if (!hold_) continue;
      const double most_s = robust_.duration_max_s.value_or(problem_.duration_s);
      const double time_s = most_s + problem_.settle_s + Watching::kLater_s;
      ensemble.noise.emplace_back(*robust_.feedback, Index(Ticks(time_s)) + 1, seed,
                                  ensemble.noise.size());
    }
    return ensemble;
  }

  /// Whether the plan keeps the limits of its path, of torque and of penetration, or nearly so.
  [[nodiscard]] bool IsPlayable(const std::vector<double>& x) const {
    constexpr double kNearly = 0.3;
    SelfDistances distances(problem_.scene.robot, problem_.scene.self_contact.pairs);
    return PathExcess(x, distances) < Planning::kUnplayable && Plans({x}).front().excess < kNearly;
  }

  /// How far the path leaves its limits and the clearance; 0 where it keeps them.
  [[nodiscard]] double PathExcess(const std::vector<double>& x, SelfDistances& distances) const {
    double excess = 0;
    const double duration_s = DurationOf(x), haste = HasteOf(x);
    if (free_duration()) {
      excess += std::max(
          {0.0, *robust_.duration_min_s - duration_s, duration_s - *robust_.duration_max_s});
    }
    for (std::size_t i = 0; i < Index(parameters_); ++i) {
      const auto [least, most] = paths_.bounds(i);
      excess += std::max({0.0, x[i] - most, least - x[i]});
    }
    for (const LinearRow& row : rows_) {
      double sum = row.b;
      for (std::size_t i = 0; i < row.a.size(); ++i) sum += row.a[i] * x[i];
      const double faster = row.derivative == 1 ? haste : haste * haste;
      excess += std::max(0.0, sum * faster + (faster - 1));
    }
    if (excess > Planning::kRounding) return Planning::kUnplayable + excess;
    const SelfContact& own = problem_.scene.self_contact;
    if (own.pairs.empty()) return 0;
    const auto splines = SplinesOf(x);
    std::vector<double> q = problem_.start_q;
    double nearest = std::numeric_limits<double>::infinity();
    for (int k = 0; k <= TicksOf(x); k += 5) {
      for (std::size_t j = 0; j < joints_; ++j)
        q[Index(problem_.joints[j].dof)] = splines[j].Evaluate(k * kTick_s * haste).value;
      nearest = std::min(nearest, distances.Nearest(q).distance_m);
    }
    const double lacks = own.clearance_m + 5e-4 - nearest;
    return lacks > 0 ? 0.2 + lacks * 20 : 0;
  }

  /// Of the problem's duration.
  [[nodiscard]] std::vector<JointMotion<double>::Spline> SplinesOf(
      const std::vector<double>& x) const {
    std::vector<JointMotion<double>::Spline> splines;
    const std::vector<double> parameters = paths_.Expand({x.data(), Index(parameters_)});
    for (std::size_t j = 0; j < joints_; ++j)
      splines.push_back(PositionSpline(problem_, parameters, j));
    return splines;
  }

  /// Puts a motion into one lane, or all, of setpoints that are `step_s` apart.
  template <class Put>
  void Sample(const std::vector<double>& x, std::size_t count, double step_s,
              const Put& put) const {
    const auto splines = SplinesOf(x);
    const double duration_s = DurationOf(x), haste = HasteOf(x);
    for (std::size_t k = 0; k < count; ++k) {
      const double t = static_cast<double>(k) * step_s;
      for (std::size_t j = 0; j < joints_; ++j) {
        auto at = splines[j].Evaluate(t * haste);
        at.first *= haste;
        at.second *= haste * haste;
        if (t >= duration_s) at.first = at.second = 0;
        put(k * joints_ + j, at);
      }
    }
  }

  /// The plans of up to a packet of motions.
  std::vector<Plan> Plans(const std::vector<std::vector<double>>& motions) const {
    constexpr int kSteps = 4;  // in a tick
    const double step_s = kTick_s / kSteps;
    int ticks = 0;
    for (const std::vector<double>& x : motions) ticks = std::max(ticks, TicksOf(x));
    const auto count = Index((ticks + Ticks(problem_.settle_s)) * kSteps);
    Setpoints setpoints(count * joints_);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      Sample(motions[std::min(lane, motions.size() - 1)], count, step_s,
             [&](std::size_t i, const auto& at) {
               setpoints[i].position.set_lane(lane, at.value);
               setpoints[i].velocity.set_lane(lane, at.first);
               setpoints[i].third.set_lane(lane, at.second);
             });
    }
    std::array<LaneRobot<double>, kLanes> robots;
    std::array<LaneState<double>, kLanes> states;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      robots[lane] = lanes_.robot;
      // The plan knows the URDF's damping alone.
      for (std::size_t j = 0; j < joints_; ++j) {
        robots[lane].joints[j].viscous_friction -= robust_.drive.viscous_friction_nm_s_per_rad;
        robots[lane].joints[j].dry_friction = 0;
      }
      states[lane] = Start();
    }
    LaneState<Packet> state = PackLanes<LaneState>(states);
    LaneWatch<Packet> watch;
    std::vector<Packet> torques(setpoints.size());
    const auto model = PackLanes<LaneRobot>(robots);
    kernel_.prescribe(lanes_.model, model, step_s, setpoints, state, watch, torques);
    std::vector<Plan> plans(motions.size());
    if (beside_model()) NoteUnrest(model, step_s, setpoints, state, plans);
    for (std::size_t m = 0; m < motions.size(); ++m) {
      plans[m].excess += std::max(0.0, watch.depth.lane(m) - Planning::kLargestDepth);
      for (std::size_t j = 0; j < joints_; ++j) {
        const double limit = Planning::kLargestTorque * problem_.joints[j].limits.torque_max_nm;
        plans[m].excess += std::max(0.0, watch.torque[j].lane(m) / limit - 1);
      }
      plans[m].feed_forward = Smoothed(torques, m, TicksOf(motions[m]), kSteps);
    }
    if (hold_) AddFeedback(motions, plans);
    return plans;
  }

  /// Adds to the excess of plans how far they are from resting where the task asks, at the end of
  /// the settle phase. What is found for robots that others carry does so by itself.
  void NoteUnrest(const LaneRobot<Packet>& model, double step_s, const Setpoints& setpoints,
                  LaneState<Packet>& state, std::vector<Plan>& plans) const {
    // Of the tolerances. On the ground of a posterior, which may damp little, a robot rocks long.
    const double part = complement_.empty() ? 0.4 : 0.7;
    const std::array<double, kLanes> off = OffOf(state);
    Setpoints last;
    const auto steps = static_cast<int>(std::lround(Watching::kWatched_s / step_s));
    for (int k = 0; k < steps; ++k) {
      last.insert(last.end(), setpoints.end() - static_cast<std::ptrdiff_t>(joints_),
                  setpoints.end());
    }
    LaneWatch<Packet> watch;
    std::vector<Packet> torques(last.size());
    kernel_.prescribe(lanes_.model, model, step_s, last, state, watch, torques);
    for (std::size_t m = 0; m < plans.size(); ++m) {
      const double speed = watch.root_speed.lane(m);
      plans[m].excess += std::max(0.0, off[m] / (part * tolerance_rad_) - 1);
      plans[m].excess += std::max(0.0, speed / (part * CostTerm::kRateTolerance) - 1);
      if (!std::isfinite(plans[m].excess)) plans[m].excess = Planning::kUnplayable;
    }
  }

  /// The torques of a lane, one for each tick and joint, averaged over their neighbours.
  [[nodiscard]] std::vector<double> Smoothed(const std::vector<Packet>& torques, std::size_t lane,
                                             int ticks, int steps) const {
    const int count = static_cast<int>(torques.size() / joints_);
    std::vector<double> smoothed;
    for (int k = 0; k <= ticks; ++k) {
      for (std::size_t j = 0; j < joints_; ++j) {
        double sum = 0, weights = 0;
        for (int m = -Planning::kSmoothing_ticks; m <= Planning::kSmoothing_ticks; ++m) {
          const int step = (k + m) * steps;
          if (step < 0 || step >= count) continue;
          const double weight = Planning::kSmoothing_ticks + 1 - std::abs(m);
          sum += weight * torques[Index(step) * joints_ + j].lane(lane);
          weights += weight;
        }
        smoothed.push_back(sum / weights);
      }
    }
    return smoothed;
  }

  /// The feedbacks of plans: in the motion with gains of their own, then with those of the hold.
  /// The angle that they keep is that of the model behind its drives.
  void AddFeedback(const std::vector<std::vector<double>>& motions,
                   std::vector<Plan>& plans) const {
    const FeedbackSettings& settings = *robust_.feedback;
    const int knots = settings.knots;
    const std::vector<double> chain = ChainOf(settings.link);
    const std::vector<std::vector<double>> angles = AnglesOf(motions, plans, chain);
    for (std::size_t m = 0; m < motions.size(); ++m) {
      Feedback<double>& feedback = plans[m].feedback;
      const double duration_s = DurationOf(motions[m]);
      feedback = WithoutGains(duration_s, angles[m], chain);
      feedback.error_min_rad = hold_->error_min_rad;
      feedback.error_full_rad = hold_->error_full_rad;
      for (int k = 0; k < knots; ++k)
        feedback.knots_s[Index(k)] = k + 1 < knots ? duration_s * k / (knots - 1) : duration_s;
      AddHoldKnots(duration_s, knots, feedback);
      const double* x = motions[m].data() + first_gain();
      for (std::size_t j = 0; j < joints_; ++j) {
        JointFeedback<double>& joint = feedback.joints[j];
        for (int k = 0; k < knots; ++k) {
          joint.angle_gain[Index(k)] =
              std::clamp(FeedingBack::kAngleGain * *x++, -FeedingBack::kLargestAngleGain,
                         FeedingBack::kLargestAngleGain);
        }
        for (int k = 0; k < knots; ++k) {
          joint.rate_gain[Index(k)] =
              std::clamp(FeedingBack::kRateGain * *x++, -FeedingBack::kLargestRateGain,
                         FeedingBack::kLargestRateGain);
        }
        const auto last = Index(hold_->knot_count - 1);
        joint.angle_gain[Index(knots + 1)] = hold_->joints[j].angle_gain[last];
        joint.rate_gain[Index(knots + 1)] = hold_->joints[j].rate_gain[last];
      }
    }
  }

  /// Two knots more: when the gains of the hold begin, and when they are whole.
  static void AddHoldKnots(double duration_s, int knots, Feedback<double>& law) {
    law.knots_s[Index(knots)] = duration_s + FeedingBack::kHoldBegins_s;
    law.knots_s[Index(knots + 1)] =
        duration_s + FeedingBack::kHoldBegins_s + FeedingBack::kHoldRise_s;
    law.knot_count = knots + 2;
  }

  [[nodiscard]] std::vector<double> ChainOf(const std::string& link) const {
    const std::vector<LinkChain> chains = LinkChainsOf(problem_.scene.robot);
    return std::ranges::find(chains, link, &LinkChain::link)->joints;
  }

  /// The law of the task's feedback but for its gains, along angles of every tick.
  [[nodiscard]] Feedback<double> WithoutGains(double duration_s, const std::vector<double>& angles,
                                              const std::vector<double>& chain) const {
    const FeedbackSettings& settings = *robust_.feedback;
    Feedback<double> law;
    law.link = FixedString<32>(settings.link);
    law.angle = FitAngle(duration_s, angles);
    law.error_max_rad = FeedingBack::kErrorMax_rad;
    law.start_error_max_rad = FeedingBack::kStartErrorMax_rad;
    law.fade_in_s = law.fade_out_s = FeedingBack::kFade_s;
    for (std::size_t j = 0; j < joints_; ++j) {
      law.joints[j].chain = chain[j];
      law.joints[j].correction_max_rad = settings.correction_max_rad;
      law.joints[j].correction_rate_max_rad_s = settings.correction_rate_max_rad_s;
    }
    return law;
  }

  /// The gains that were given, along the angle of a motion.
  [[nodiscard]] Feedback<double> TakenFeedback(const std::vector<double>& x) const {
    const std::string& link = robust_.feedback->link;
    Feedback<double> law = *taken_;
    law.link = FixedString<32>(link);
    law.angle = FitAngle(DurationOf(x), AnglesOf({x}, Plans({x}), ChainOf(link)).front());
    return law;
  }

  /// A feedback of the hold after a motion. Until it sets in, the robot lands as without it.
  [[nodiscard]] Feedback<double> FindHold(const std::vector<double>& x, int robots) {
    const FeedbackSettings& settings = *robust_.feedback;
    const Plan plan = Plans({x}).front();
    const std::vector<double> chain = ChainOf(settings.link);
    const double duration_s = DurationOf(x);
    const int first = TicksOf(x);
    LaneSteps rough = kRough;
    rough.per_tick *= FinerStepsFor(problem_.scene.contact, robust_.spreads, robust_.polish_scale);
    HoldStudy study{
        kernel_,     lanes_.model,
        rough,       joints_,
        {},          {},
        first,       problem_.settle_s,
        target_rad_, problem_.following_tolerance_rad,
        settings,    WithoutGains(duration_s, AnglesOf({x}, {plan}, chain).front(), chain)};
    AddHoldKnots(duration_s, 1, study.law);
    Setpoints setpoints(Index(TicksOf(x) + 1) * joints_);
    Sample(x, setpoints.size() / joints_, kTick_s, [&](std::size_t i, const auto& at) {
      setpoints[i] = {Packet::Of(at.value), Packet::Of(at.first), Packet::Of(plan.feed_forward[i])};
    });
    const auto split = setpoints.begin() + first * static_cast<std::ptrdiff_t>(joints_);
    study.setpoints.assign(split, setpoints.end());
    setpoints.erase(split, setpoints.end());
    const Ensemble ensemble =
        MakeEnsemble(std::max(robots, static_cast<int>(kLanes)), robust_.polish_scale, kFine);
    for (std::size_t p = 0; p < ensemble.robots.size(); ++p) {
      HeldRobots packet{ensemble.robots[p], ensemble.states[p], ensemble.held};
      LaneWatch<Packet> watch;
      kernel_.drive(lanes_.model, packet.robots, ensemble.steps, setpoints, packet.held,
                    packet.state, watch);
      study.packets.push_back(packet);
    }
    ++stage_;
    return FindHoldFeedback(
        study,
        {std::max(robust_.samples / FeedingBack::kMotionsForHold, 8), robust_.improved,
         robust_.generations / 2},
        problem_.search.seed, options_.threads,
        [this](int start, std::int64_t tried, double loss) {
          evaluations_ += tried;
          Tell(false, start, loss);
        },
        [this] { return interrupted(); });
  }

  /// The absolute angle of a link in every tick of motions, each on the model in a lane of its own;
  /// and the angle at the end of the settle phase behind them.
  [[nodiscard]] std::vector<std::vector<double>> AnglesOf(
      const std::vector<std::vector<double>>& motions, const std::vector<Plan>& plans,
      const std::vector<double>& chain) const {
    int longest = 0;
    for (const std::vector<double>& x : motions) longest = std::max(longest, TicksOf(x));
    const auto count = Index(longest + Ticks(problem_.settle_s));
    Setpoints setpoints(count * joints_);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::size_t m = std::min(lane, motions.size() - 1);
      const std::vector<double>& forward = plans[m].feed_forward;
      Sample(motions[m], count, kTick_s, [&](std::size_t i, const auto& at) {
        setpoints[i].position.set_lane(lane, at.value);
        setpoints[i].velocity.set_lane(lane, at.first);
        setpoints[i].third.set_lane(lane,
                                    forward[std::min(i, forward.size() - joints_ + i % joints_)]);
      });
    }
    LaneState<Packet> state = model_.states.front();
    HeldSetpoints<Packet> held = model_.held;
    LaneWatch<Packet> watch;
    std::vector<std::vector<double>> angles(motions.size());
    const auto note = [&](std::size_t m) {
      double angle = state.q[kPitch].lane(m);
      for (std::size_t j = 0; j < joints_; ++j) angle += chain[j] * state.q[j + 3].lane(m);
      angles[m].push_back(std::isfinite(angle) ? std::clamp(angle, -50.0, 50.0) : 0);
    };
    for (std::size_t k = 0; k < count; ++k) {
      for (std::size_t m = 0; m < motions.size(); ++m) {
        if (static_cast<int>(k) <= TicksOf(motions[m])) note(m);
      }
      kernel_.drive(lanes_.model, model_.robots.front(), kFine,
                    std::span(setpoints).subspan(k * joints_, joints_), held, state, watch);
    }
    for (std::size_t m = 0; m < motions.size(); ++m) note(m);
    return angles;
  }

  /// The spline through angles of every tick, with the knots of the feed-forward, which ends at the
  /// last of them.
  static Feedback<double>::Spline FitAngle(double duration_s, const std::vector<double>& angles) {
    const std::vector<double> knots = FeedForwardKnots(duration_s);
    std::vector<double> points(knots.size() - kFeedForwardDegree - 1);
    Feedback<double>::Spline spline;
    if (spline.Assign(kFeedForwardDegree, knots, points) != Status::kOk)
      throw std::logic_error("the spline of a link's angle could not be set up");
    const auto rows = static_cast<Eigen::Index>(angles.size() - 1);
    const auto columns = static_cast<Eigen::Index>(points.size());
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows, columns);
    for (Eigen::Index i = 0; i < rows; ++i) {
      const auto weights = spline.EvaluateWeights(static_cast<double>(i) * kTick_s);
      for (int k = 0; k <= kFeedForwardDegree; ++k)
        A(i, weights.first + k) = weights.w[0][Index(k)];
    }
    const Eigen::VectorXd fit =
        SolveLeastSquares(A, Eigen::Map<const Eigen::VectorXd>(angles.data(), rows));
    std::copy(fit.begin(), fit.end(), points.begin());
    points.back() = angles.back();
    if (spline.Assign(kFeedForwardDegree, knots, points) != Status::kOk)
      throw std::logic_error("the angles of a link are not finite");
    return spline;
  }

  /// How far robots are from what the task asks for: from the target of the pitch [rad], or from a
  /// place, in as many radians as the tolerance of the pitch is of the place's.
  [[nodiscard]] std::array<double, kLanes> OffOf(const LaneState<Packet>& state) const {
    std::array<double, kLanes> off;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      off[lane] = std::abs(state.q[kPitch].lane(lane) - target_rad_);
      for (const Place& place : places_) {
        const double error_m = state.q[place.dof].lane(lane) - place.target_m;
        off[lane] = std::max(off[lane], std::abs(error_m) * place.rad_per_m);
      }
      if (!std::isfinite(off[lane])) off[lane] = 1e3;
    }
    return off;
  }

  /// What a robot's end is worth: see SolveRobust.
  /// @param settled, off  OffOf when the settle phase ends, and later.
  /// @param speed         the root's largest, in the time that is watched.
  [[nodiscard]] double LossOf(double settled, double off, double speed) const {
    const double t = 0.96 * tolerance_rad_, w = 1.2 * CostTerm::kRateTolerance;
    if (off < t && settled < t && speed < w) {
      const double still = settled / tolerance_rad_, slow = speed / w;
      return 0.1 * (still * still) + 0.1 * (slow * slow);
    }
    if (off < 1.7 * tolerance_rad_ && speed < 1)
      return 0.35 + 0.15 * std::min(1.0, settled / (2 * tolerance_rad_)) + 0.15 * speed;
    // A robot that is still near when the settle phase ends falls later, and is better than one
    // that never came near.
    return 1 + 0.2 * std::min(1.0, settled / 2) + 0.1 * std::min(1.0, off / 3);
  }

  /// The distances between own shapes, for each lane of a packet, which knows where its robot was.
  using Distances = std::vector<SelfDistances>;
  [[nodiscard]] Distances MakeDistances() const {
    const SelfDistances one(problem_.scene.robot, problem_.scene.self_contact.pairs);
    return Distances(kLanes, one);
  }

  /// What robots are told in a motion and the hold after it.
  [[nodiscard]] Setpoints SetpointsOf(const std::vector<double>& x, const Plan& plan) const {
    const int end = TicksOf(x) + Ticks(problem_.settle_s) + Ticks(Watching::kLater_s);
    Setpoints setpoints(Index(end) * joints_);
    Sample(x, setpoints.size() / joints_, kTick_s, [&](std::size_t i, const auto& at) {
      const std::size_t last = plan.feed_forward.size() - joints_ + i % joints_;
      setpoints[i] = {Packet::Of(at.value), Packet::Of(at.first),
                      Packet::Of(plan.feed_forward[std::min(i, last)])};
    });
    return setpoints;
  }

  /// Of a packet of an ensemble.
  [[nodiscard]] double SumOfLosses(const std::vector<double>& x, const Plan& plan,
                                   const Setpoints& setpoints, const Ensemble& ensemble,
                                   std::size_t packet, Distances& distances) const {
    Play play = MakePlay(ensemble, packet, setpoints, distances);
    if (hold_) {
      play.feedback.emplace(plan.feedback, ensemble.noise[packet], robust_.feedback->delay_s,
                            kTick_s, joints_);
    }
    const std::array<double, kLanes> losses = LossesOf(std::move(play), TicksOf(x));
    return std::accumulate(losses.begin(), losses.end(), 0.0);
  }

  /// The mean loss of an ensemble. When all robots of the first packet fall, it is theirs.
  [[nodiscard]] double Judge(const std::vector<double>& x, const Plan& plan,
                             const Ensemble& ensemble, Distances& distances) const {
    const Setpoints setpoints = SetpointsOf(x, plan);
    double sum = 0;
    for (std::size_t p = 0; p < ensemble.robots.size(); ++p) {
      const double packet = SumOfLosses(x, plan, setpoints, ensemble, p, distances);
      // Of robots that other motions do not carry, eight may well fall with a good one.
      if (p == 0 && packet >= kLanes && complement_.empty()) return packet / kLanes;
      sum += packet;
    }
    return sum / static_cast<double>(ensemble.robots.size() * kLanes);
  }

  /// A packet of robots on their way through a motion.
  struct Play {
    const Ensemble& ensemble;
    std::size_t packet;
    const Setpoints& setpoints;
    Distances& distances;
    LaneState<Packet> state;
    HeldSetpoints<Packet> held;
    LaneWatch<Packet> watch;
    std::optional<LaneFeedback> feedback;
    int tick;
    /// Whether a joint was too far from its setpoint, or own shapes overlapped.
    std::array<bool, kLanes> faulty{};
  };

  [[nodiscard]] static Play MakePlay(const Ensemble& ensemble, std::size_t packet,
                                     const Setpoints& setpoints, Distances& distances) {
    return {ensemble,      packet, setpoints, distances, ensemble.states[packet],
            ensemble.held, {},     {},        0,         {}};
  }

  /// Plays on up to a tick.
  void Advance(Play& play, const LaneRobot<Packet>& robots, int end) const {
    const std::span<const LaneSetpoint<Packet>> all(play.setpoints);
    if (!play.feedback) {
      const auto first = Index(play.tick) * joints_, last = Index(end) * joints_;
      kernel_.drive(lanes_.model, robots, play.ensemble.steps, all.subspan(first, last - first),
                    play.held, play.state, play.watch);
    } else {
      std::array<LaneSetpoint<Packet>, LaneModel::kMaxJoints> tick;
      for (int k = play.tick; k < end; ++k) {
        std::ranges::copy(all.subspan(Index(k) * joints_, joints_), tick.begin());
        const std::span<LaneSetpoint<Packet>> corrected(tick.data(), joints_);
        play.feedback->Correct(play.state, corrected);
        kernel_.drive(lanes_.model, robots, play.ensemble.steps, corrected, play.held, play.state,
                      play.watch);
        NoteFaults(corrected, play);
        if (k % Faulting::kLookAtShapes == 0) NoteOverlaps(play);
      }
    }
    play.tick = end;
  }

  /// Notes which robots the runtime stops now: corrections may lead a joint too far.
  void NoteFaults(std::span<const LaneSetpoint<Packet>> setpoints, Play& play) const {
    for (std::size_t j = 0; j < joints_; ++j) {
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const double error_rad = play.state.q[j + 3].lane(lane) - setpoints[j].position.lane(lane);
        play.faulty[lane] =
            play.faulty[lane] || !(std::abs(error_rad) <= problem_.following_tolerance_rad);
      }
    }
  }

  /// Notes which robots' own shapes overlap: corrections may lead a leg into the other. The shapes
  /// are the model's.
  void NoteOverlaps(Play& play) const {
    if (problem_.scene.self_contact.pairs.empty()) return;
    std::array<double, LaneModel::kMaxJoints + 3> q{};
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (play.faulty[lane]) continue;
      for (std::size_t j = 0; j < joints_; ++j) q[j + 3] = play.state.q[j + 3].lane(lane);
      const std::span<const double> at(q.data(), joints_ + 3);
      play.faulty[lane] = play.distances[lane].Nearest(at, 1e-3).distance_m < 0;
    }
  }

  /// Plays a motion and its hold to the end, and watches the last of that time.
  /// @param ticks  of the motion.
  /// @returns the loss of each robot.
  [[nodiscard]] std::array<double, kLanes> LossesOf(Play play, int ticks) const {
    const LaneRobot<Packet>& robots = play.ensemble.robots[play.packet];
    const int settled_tick = ticks + Ticks(problem_.settle_s);
    const int end = settled_tick + Ticks(Watching::kLater_s);
    Advance(play, robots, settled_tick);
    const std::array<double, kLanes> settled = OffOf(play.state);
    Advance(play, robots, end - Ticks(Watching::kWatched_s));
    play.watch = {};
    Advance(play, robots, end);
    const std::array<double, kLanes> off = OffOf(play.state);
    std::array<double, kLanes> losses;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      losses[lane] = play.faulty[lane]
                         ? Faulting::kFaultLoss
                         : LossOf(settled[lane], off[lane], play.watch.root_speed.lane(lane));
    }
    return losses;
  }

  /// Losses of motions by which they can be ordered, where a motion is tuned: each is played on a
  /// packet of the robots, another one in each generation, and the better half on all. The others'
  /// losses are as much higher as a motion that is dropped in a race.
  std::vector<double> EvaluateHalf(const std::vector<std::vector<double>>& motions,
                                   const Ensemble& ensemble, int generation) {
    const std::size_t packet = Index(generation) % ensemble.robots.size();
    Ensemble some;
    some.held = ensemble.held;
    some.steps = ensemble.steps;
    some.robots = {ensemble.robots[packet]};
    some.states = {ensemble.states[packet]};
    std::vector<double> losses = Evaluate(motions, some, false);
    std::vector<std::size_t> order(motions.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return losses[i]; });
    const std::size_t half = (motions.size() + 1) / 2;
    std::vector<std::vector<double>> better;
    for (std::size_t i = 0; i < half; ++i) better.push_back(motions[order[i]]);
    for (double& loss : losses) loss += Racing::kDropped;
    const std::vector<double> of_better = Evaluate(better, ensemble);
    for (std::size_t i = 0; i < half; ++i) losses[order[i]] = of_better[i];
    return losses;
  }

  /// Losses of motions, penalties included.
  std::vector<double> Evaluate(const std::vector<std::vector<double>>& motions,
                               const Ensemble& ensemble, bool with_model = true) {
    std::vector<double> losses(motions.size());
    const int packets = static_cast<int>((motions.size() + kLanes - 1) / kLanes);
    ParallelFor(packets, options_.threads, [&](int p, int /*thread*/) {
      Distances distances = MakeDistances();
      std::vector<std::vector<double>> playable;
      std::vector<std::size_t> which;
      const std::size_t end = std::min(motions.size(), Index(p + 1) * kLanes);
      for (std::size_t i = Index(p) * kLanes; i < end; ++i) {
        losses[i] = PathExcess(motions[i], distances.front());
        if (losses[i] >= Planning::kUnplayable) continue;
        playable.push_back(motions[i]);
        which.push_back(i);
      }
      if (playable.empty()) return;
      const std::vector<Plan> plans = Plans(playable);
      for (std::size_t m = 0; m < playable.size(); ++m) {
        losses[which[m]] += Judge(playable[m], plans[m], ensemble, distances) + 2 * plans[m].excess;
        // The model is none of these, and it has to do what the task asks.
        if (!with_model) continue;
        if (tunes() && losses[which[m]] > Improving::kHopeless) {
          losses[which[m]] +=
              1;  // as if it fell: a motion that far off is not looked at more closely
        } else if (beside_model()) {
          const double model = Judge(playable[m], plans[m], fine_model_, distances);
          losses[which[m]] += std::max(0.0, model - Complementing::kCalm);
        }
      }
    });
    evaluations_ += static_cast<std::int64_t>(motions.size());
    return losses;
  }

  /// The largest loss of a robot in a motion, the model's on slopes among them; 1 and more where
  /// the plan itself exceeds a limit.
  [[nodiscard]] double WorstLoss(const std::vector<double>& x, const Ensemble& ensemble) const {
    const Plan plan = Plans({x}).front();
    if (plan.excess > 0) return 1 + plan.excess;
    const Setpoints setpoints = SetpointsOf(x, plan);
    Distances distances;  // without a feedback nothing is looked at
    double worst = 0;
    const auto look = [&](const Ensemble& robots) {
      for (std::size_t p = 0; p < robots.robots.size(); ++p) {
        const std::array<double, kLanes> losses =
            LossesOf(MakePlay(robots, p, setpoints, distances), TicksOf(x));
        worst = std::max(worst, std::ranges::max(losses));
      }
    };
    look(fine_model_);
    if (worst < Complementing::kCarried) look(ensemble);
    return worst;
  }

  /// Says when the tuning of a motion is at its end.
  class TuningEnd {
   public:
    /// @param loss  the least so far, after each generation.
    /// @param worst  WorstLoss of the motion that has it.
    bool Reached(double loss, const std::function<double()>& worst) {
      const bool better = losses_.empty() || loss < losses_.back();
      if (better && loss < 2 * Tuning::kMargin) worst_ = worst();
      losses_.push_back(loss);
      if (worst_ <= Tuning::kMargin) return true;
      if (losses_.size() <= Tuning::kPatience) return false;
      const double before = losses_[losses_.size() - 1 - Tuning::kPatience];
      if (loss > Complementing::kCarried && losses_.size() < Tuning::kChance) return false;
      return loss > (1 - Tuning::kProgress) * before;
    }

   private:
    std::vector<double> losses_;
    double worst_ = std::numeric_limits<double>::infinity();
  };

  /// A motion on its way through the packets of an ensemble.
  struct Runner {
    std::size_t motion = 0;
    Plan plan;
    Setpoints setpoints;
    double sum = 0;
    std::size_t packets = 0;
    [[nodiscard]] double loss() const {
      return sum / static_cast<double>(packets * kLanes) + 2 * plan.excess;
    }
  };

  /// The motions that are played: their paths keep their limits.
  /// @param losses  gets the penalties of all.
  std::vector<Runner> RunnersOf(const std::vector<std::vector<double>>& motions,
                                std::vector<double>& losses) const {
    const int packets = static_cast<int>((motions.size() + kLanes - 1) / kLanes);
    std::vector<std::vector<Runner>> runners(Index(packets));
    ParallelFor(packets, options_.threads, [&](int p, int /*thread*/) {
      SelfDistances distances(problem_.scene.robot, problem_.scene.self_contact.pairs);
      std::vector<std::vector<double>> playable;
      const std::size_t end = std::min(motions.size(), Index(p + 1) * kLanes);
      for (std::size_t i = Index(p) * kLanes; i < end; ++i) {
        losses[i] = PathExcess(motions[i], distances);
        if (losses[i] >= Planning::kUnplayable) continue;
        playable.push_back(motions[i]);
        runners[Index(p)].emplace_back().motion = i;
      }
      if (playable.empty()) return;
      std::vector<Plan> plans = Plans(playable);
      for (std::size_t m = 0; m < playable.size(); ++m) {
        Runner& runner = runners[Index(p)][m];
        runner.plan = std::move(plans[m]);
        runner.setpoints = SetpointsOf(playable[m], runner.plan);
      }
    });
    std::vector<Runner> all;
    for (std::vector<Runner>& some : runners)
      std::move(some.begin(), some.end(), std::back_inserter(all));
    return all;
  }

  /// Losses of motions by which they can be ordered (Racing): those of the best are of the whole
  /// ensemble, those of others of a part, and higher.
  std::vector<double> Race(const std::vector<std::vector<double>>& motions,
                           const Ensemble& ensemble, int generation) {
    const std::size_t packets = ensemble.robots.size();
    const std::size_t first = Index(generation) * (packets >> (Racing::kRungs - 1));
    std::vector<double> losses(motions.size());
    std::vector<Runner> runners = RunnersOf(motions, losses);
    const std::vector<double> penalties = losses;
    for (double& loss : losses)
      if (loss >= Planning::kUnplayable) loss += Racing::kDropped * Racing::kRungs;
    const auto loss_of = [&](const Runner& runner) {
      return penalties[runner.motion] + runner.loss();
    };
    for (int rung = 0; rung < Racing::kRungs; ++rung) {
      const std::size_t goal = packets >> (Racing::kRungs - 1 - rung);
      ParallelFor(static_cast<int>(runners.size()), options_.threads, [&](int i, int /*thread*/) {
        Runner& runner = runners[Index(i)];
        Distances distances = hold_ ? MakeDistances() : Distances{};
        for (; runner.packets < goal; ++runner.packets) {
          runner.sum += SumOfLosses(motions[runner.motion], runner.plan, runner.setpoints, ensemble,
                                    (first + runner.packets) % packets, distances);
        }
      });
      std::ranges::stable_sort(runners, {}, loss_of);
      const int dropped = Racing::kRungs - 1 - rung;
      for (const Runner& runner : runners)
        losses[runner.motion] = loss_of(runner) + Racing::kDropped * dropped;
      if (dropped > 0) runners.resize((runners.size() + 1) / 2);
    }
    evaluations_ += static_cast<std::int64_t>(motions.size());
    return losses;
  }

  void Tell(bool global, int start, double loss) {
    const Evaluation evaluation{global, start, evaluations_, loss, 0};
    history_.push_back(evaluation);
    if (options_.progress) options_.progress(evaluation);
  }

  /// Random motions, each in a lane of its own on the model; the best of them on 16 robots.
  std::vector<Candidate> RandomMotions() {
    const RandomStarts starts(problem_);
    const int packets = (robust_.samples + static_cast<int>(kLanes) - 1) / static_cast<int>(kLanes);
    std::vector<Candidate> all(Index(packets) * kLanes);
    ParallelFor(packets, options_.threads, [&](int p, int /*thread*/) {
      if (interrupted()) return;
      PlayRandom(starts, p, {all.data() + Index(p) * kLanes, kLanes});
    });
    evaluations_ += static_cast<std::int64_t>(all.size());
    if (interrupted()) return {};
    Sort(all);
    Tell(true, 0, all.front().loss);
    if (all.size() > Drawing::kKept) all.resize(Drawing::kKept);
    std::vector<std::vector<double>> motions;
    motions.reserve(all.size());
    for (const Candidate& candidate : all) motions.push_back(candidate.x);
    const std::vector<double> losses = Evaluate(motions, MakeEnsemble(16, 1));
    for (std::size_t i = 0; i < all.size(); ++i) all[i].loss = losses[i];
    Sort(all);
    return all;
  }

  /// They take as long as the task says, whether that is free or not.
  void PlayRandom(const RandomStarts& starts, int packet, std::span<Candidate> out) const {
    SelfDistances distances(problem_.scene.robot, problem_.scene.self_contact.pairs);
    Setpoints setpoints(Index(Ticks(problem_.duration_s) + Ticks(problem_.settle_s)) * joints_);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      out[lane].x = paths_.Reduce(starts.Draw(static_cast<std::uint64_t>(packet) * kLanes + lane));
      out[lane].x.resize(variables());
      out[lane].loss = PathExcess(out[lane].x, distances);
      Sample(out[lane].x, setpoints.size() / joints_, kTick_s, [&](std::size_t i, const auto& at) {
        setpoints[i].position.set_lane(lane, at.value);
        setpoints[i].velocity.set_lane(lane, at.first);
      });
    }
    LaneState<Packet> state = model_.states.front();
    HeldSetpoints<Packet> held = model_.held;
    LaneWatch<Packet> watch;
    kernel_.drive(lanes_.model, model_.robots.front(), model_.steps, setpoints, held, state, watch);
    const std::array<double, kLanes> off = OffOf(state);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const double loss = off[lane] + 0.1 * std::min(5.0, std::abs(state.v[kPitch].lane(lane)));
      out[lane].loss += std::isfinite(loss) ? loss : 1e3;
    }
  }

  static void Sort(std::vector<Candidate>& candidates) {
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.loss < b.loss; });
  }

  /// The best of `from`, improved.
  std::vector<Candidate> Improve(const std::vector<Candidate>& from, int count, double sigma,
                                 const Ensemble& ensemble, int generations) {
    std::vector<Candidate> improved;
    ++stage_;
    double rival = Improving::kHopeless;  // the best of the stage so far
    for (int start = 0; start < count && start < static_cast<int>(from.size()); ++start) {
      if (interrupted()) break;
      improved.push_back(
          ImproveOne(from[Index(start)], start, sigma, ensemble, generations, rival));
      rival = std::min(rival, improved.back().loss);
    }
    Sort(improved);
    return improved;
  }

  /// @param first  of the variables that are changed; those before it stay.
  Candidate ImproveOne(const Candidate& from, int start, double sigma, const Ensemble& ensemble,
                       int generations, double rival, std::size_t first = 0) {
    const bool races = complement_.empty() && ensemble.robots.size() >= Racing::kLeastPackets;
    const std::uint64_t seed = problem_.search.seed * 1'000'000 + Index(stage_ * 1000 + start);
    const auto begin = from.x.begin() + static_cast<std::ptrdiff_t>(first);
    CmaEs search({begin, from.x.end()}, sigma, Improving::kPopulation, seed);
    Candidate best{from.x, Evaluate({from.x}, ensemble).front()};
    elite_ = {from.x};
    TuningEnd tuned;
    for (int g = 0; g < generations && !interrupted(); ++g) {
      if (tunes() && tuned.Reached(best.loss, [&] { return WorstLoss(best.x, ensemble); })) break;
      if (best.loss < Improving::kPerfect) break;
      if (!beside_model() && g >= Improving::kHopelessAfter &&
          best.loss > std::min(Improving::kHopeless, 3 * rival + 0.1))
        break;
      std::vector<std::vector<double>> motions = search.Ask();
      for (std::vector<double>& x : motions) x.insert(x.begin(), from.x.begin(), begin);
      const std::vector<double> losses = races     ? Race(motions, ensemble, g)
                                         : tunes() ? EvaluateHalf(motions, ensemble, g)
                                                   : Evaluate(motions, ensemble);
      const auto least = std::min_element(losses.begin(), losses.end());
      if (*least < best.loss) {
        best = {motions[static_cast<std::size_t>(least - losses.begin())], *least};
        elite_.push_back(best.x);
      }
      search.Tell(losses);
      Tell(false, start, best.loss);
      if (search.sigma() < 1e-5) break;
    }
    if (elite_.size() >= Racing::kElite)
      elite_.erase(elite_.begin(), elite_.end() - (Racing::kElite - 1));
    // The mean of the candidates is less of a lucky draw than the best of them.
    std::vector<double> mean = search.mean();
    mean.insert(mean.begin(), from.x.begin(), begin);
    elite_.push_back(std::move(mean));
    return best;
  }

  const Problem& problem_;
  const RobustSettings& robust_;
  const SolveOptions& options_;
  std::span<const Primitive<double>> complement_;  ///< Tried before; see SolveRobust.
  const LaneKernel<Packet>& kernel_;
  FreePaths paths_;
  std::vector<LinearRow> rows_;  // by what is free of the paths
  int parameters_;  // what that is of a motion; behind it is its duration, where it is free
  std::size_t joints_;
  LaneScene lanes_;
  Ensemble model_;       ///< Of robots that are all the model.
  Ensemble fine_model_;  ///< The same in finer steps, where a complement is searched.
  /// Of the hold, once it is found: then a motion has gains as well.
  std::optional<Feedback<double>> hold_;
  const Feedback<double>* taken_ = nullptr;  ///< Of the guess, where its gains are taken.
  bool as_it_is_ = false;
  /// Where the root is to be: a target of its x or z.
  struct Place {
    std::size_t dof = 0;
    double target_m = 0;
    double rad_per_m = 0;  ///< Tolerance of the pitch for that of the place.
  };
  std::vector<Place> places_;
  double target_rad_ = 0;
  double tolerance_rad_ = CostTerm::kAngleTolerance_rad;
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
    of_motion.duration_s = search.DurationOf(found[i].x);
    Rollout rollout(of_motion, problem.solver.step_s / 4);
    Solution solution =
        SolveFrom(of_motion, search.ParametersOf(found[i]), 1, rollout, silent, nullptr);
    solution.duration_s = of_motion.duration_s;
    // A feedback takes as long to find as a motion: the best one gets it.
    if (problem.robust->feedback && i == 0) solution.feedback = search.FeedbackOf(found[i]);
    solution.end = search.as_it_is() ? SolveEnd::kTaken : SolveEnd::kGenerations;
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
