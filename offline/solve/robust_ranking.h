#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "offline/solve/motion_feedback.h"
#include "offline/solve/motion_plan.h"
#include "offline/solve/robot_player.h"

namespace tumbler {

/// Ranks motions by robots. The loss of a motion is the mean of the robots' (RobotLoss), and
/// penalties for limits that its path or its plan does not keep, and, where the model is none of
/// the robots, for what the model misses.
class RobustRanking {
 public:
  /// All have to outlive this object.
  RobustRanking(const RobustTask& task, const RobustMotion& motion, const MotionPlanner& planner,
                const MotionFeedback& feedback);

  /// From now on motions have gains of a feedback behind their other variables, and robots that are
  /// drawn with sensors are corrected by them.
  /// @param hold  the law of the hold: MotionFeedback::Add.
  void SetHold(const Feedback<double>& hold);
  [[nodiscard]] bool has_gains() const { return hold_.has_value(); }

  /// The plans of up to a packet of motions whose paths keep their limits.
  [[nodiscard]] std::vector<MotionPlan> Plans(
      const std::vector<std::vector<double>>& motions) const;
  /// Whether the path keeps its limits, and the plan those of torque and of penetration, or nearly.
  [[nodiscard]] bool IsPlayable(const std::vector<double>& x) const;

  /// The losses of motions.
  [[nodiscard]] std::vector<double> Evaluate(const std::vector<std::vector<double>>& motions,
                                             const Ensemble& ensemble) const;
  /// The same with robots in single precision, to order motions by.
  /// @pre no gains
  [[nodiscard]] std::vector<double> Rank(const std::vector<std::vector<double>>& motions,
                                         const Ensemble& ensemble) const {
    return Rank(motions, ensemble, Model::kCounts);
  }
  /// How robots arrive in a motion, in single precision.
  struct Arrival {
    double penalty = 0;  ///< For limits that the path, or its plan, does not keep.
    /// RobotDivergences of each robot, one after the other; empty where the motion cannot be
    /// played.
    std::vector<double> divergences;
  };
  /// @pre no gains
  [[nodiscard]] std::vector<Arrival> Arrivals(const std::vector<std::vector<double>>& motions,
                                              const Ensemble& ensemble) const;
  /// The loss of each robot; empty where the motion cannot be played.
  /// @pre no gains
  [[nodiscard]] std::vector<double> LossesOfRobots(const std::vector<double>& x,
                                                   const Ensemble& ensemble) const;
  /// Losses of motions by which they can be ordered, where a motion is tuned to one robot: each is
  /// played on sixteen of the robots, others in each generation, and the better half on all.
  /// The others' losses are as much higher as those of a motion that is dropped in a race.
  /// @pre no gains
  [[nodiscard]] std::vector<double> RankHalf(const std::vector<std::vector<double>>& motions,
                                             const Ensemble& ensemble, int generation) const;
  /// The largest loss of a robot in a motion, the model's on slopes among them; 1 and more where
  /// the plan itself exceeds a limit.
  /// @pre task.tunes()
  [[nodiscard]] double WorstLoss(const std::vector<double>& x, const Ensemble& ensemble) const;

  /// Losses of motions by which they can be ordered, by successive halving [JT16]: they are
  /// compared on a part of the robots, the better half of them on twice as many, and so on, at last
  /// on all. Those of the best are of the whole ensemble, those of others of a part, and higher.
  /// Where a generation begins rotates, so that motions suit all robots and not the first ones. In
  /// single precision where there are no gains.
  ///
  /// [JT16] K. Jamieson, A. Talwalkar, Non-stochastic Best Arm Identification and Hyperparameter
  /// Optimization, AISTATS 2016.
  [[nodiscard]] std::vector<double> Race(const std::vector<std::vector<double>>& motions,
                                         const Ensemble& ensemble, int generation) const;
  /// Whether so many robots can be divided: of fewer, a part says nothing.
  [[nodiscard]] static bool CanRace(std::size_t robots) {
    constexpr std::size_t kLeastPackets = 16;
    return robots >= kLeastPackets * Packet::kLanes;
  }

 private:
  /// Whether the model, where it is none of the robots, has to do what the task asks, too.
  enum class Model : std::uint8_t { kCounts, kIsLeftOut };
  [[nodiscard]] std::vector<double> Rank(const std::vector<std::vector<double>>& motions,
                                         const Ensemble& ensemble, Model model) const;
  /// A motion on its way through the packets of an ensemble.
  /// @tparam N  the numbers of its setpoints: Packet, or float.
  template <class N>
  struct Runner;
  /// The motions of a packet, from the first on, whose paths keep their limits.
  /// @param losses  gets the penalties of all of them.
  template <class N>
  [[nodiscard]] std::vector<Runner<N>> RunnersOf(const std::vector<std::vector<double>>& motions,
                                                 std::size_t first, SelfDistances& distances,
                                                 std::vector<double>& losses) const;
  [[nodiscard]] PacketMotion MotionOf(const Runner<Packet>& runner) const;
  /// The mean loss of an ensemble. When all robots of the first packet fall, it is theirs.
  [[nodiscard]] double Judge(const PacketMotion& motion, const Ensemble& ensemble,
                             LaneDistances& distances) const;
  /// Whether robots that are looked at first have so large a sum of losses that the others are not
  /// looked at.
  [[nodiscard]] bool AllFall(double sum, std::size_t robots) const;
  /// Adds to the loss of a motion what the model misses, which is none of the robots and has to do
  /// what the task asks.
  /// @param of_model  the loss of the model, where it is asked for.
  void AddModel(double& loss, const std::function<double()>& of_model) const;
  /// Race.
  /// @param play  plays a runner on a packet.
  template <class N, class Play>
  [[nodiscard]] std::vector<double> RaceOn(const std::vector<std::vector<double>>& motions,
                                           std::size_t packets, int generation,
                                           const Play& play) const;

  const RobustTask& task_;
  const RobustMotion& motion_;
  const MotionPlanner& planner_;
  const MotionFeedback& feedback_;
  Ensemble fine_model_;  ///< Where the model is none of the robots. On slopes, where it is tuned.
  std::optional<Feedback<double>> hold_;
};

}  // namespace tumbler
