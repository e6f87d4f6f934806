// What an identification is worth, over hidden robots: errors, coverage of intervals, chi, CPU
// time; and of motions that are found anew for them. In the twin, or, in a build that has it, in
// MuJoCo. docs/identify.md has its figures.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "common/files/command_line.h"
#include "common/files/program.h"
#include "offline/problem/posterior_toml.h"
#include "offline/studies/gate.h"
#include "offline/studies/identified_model.h"
#include "offline/studies/recorded_motion.h"
#include "offline/studies/recorded_robot.h"
#include "offline/studies/robot_fit.h"
#include "tests/support/files.h"
#include "tests/support/hidden_robot.h"
#include "tests/support/tuned_motion.h"
#ifdef TUMBLER_WITH_MUJOCO
#include "tests/support/mujoco_robot.h"
#endif

namespace tumbler {
namespace {

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double Quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

/// "gate closed (+ + - +)": which of its robots stand, the mean first.
std::string Verdict(const GateOutcome& gate) {
  std::string robots;
  for (const TrialOutcome& robot : gate.robots)
    robots += fmt::format("{}{}", robots.empty() ? "" : " ", robot.stands() ? '+' : '-');
  for (const FailedMotion& failed : gate.failed)
    robots +=
        fmt::format("; {} left out{}", failed.left_out, failed.mean_fails ? "" : ", mean stands");
  return fmt::format("gate {} ({})", gate.open() ? "open" : "closed", robots);
}

/// The coordinate that a hidden robot has.
double TruthOf(const Scene& scene, const testing::HiddenRobot& robot, const RobotQuantity& of) {
  using Kind = RobotQuantity::Kind;
  if (of.kind == Kind::kTorque) return std::log(robot.torque_factor);
  if (of.kind == Kind::kVelocityLag) return robot.velocity_filter_s;
  if (of.kind == Kind::kTorqueLag) return robot.torque_lag_s;
  if (of.kind == Kind::kLag) return std::nan("");
  const Scene varied = Varied(scene, robot.variation);
  if (of.kind == Kind::kLength) {
    const std::size_t first = Index(scene.robot.first_body());
    for (std::size_t i = first; i < scene.robot.body_names.size(); ++i) {
      if (scene.robot.body_names[i] == of.of)
        return std::log(robot.variation.links[i - first].length);
    }
  }
  for (std::size_t j = 0; j < varied.robot.joint_count(); ++j) {
    if (varied.robot.tree.dofs[varied.robot.DofOfJoint(j)].name != of.of) continue;
    const RobotVariation::Joint& joint = robot.variation.joints[j];
    if (of.kind == Kind::kZero) return joint.zero_rad;
    if (of.kind == Kind::kViscous)
      return std::log(kUsualViscousFriction_nm_s_per_rad + joint.viscous_friction_nm_s_per_rad);
  }
  if (of.kind == Kind::kSlope) return robot.variation.slope_rad;
  return CoordinateIn(varied, of);
}

struct StudySettings {
  std::vector<std::string> motions;
  std::string drives;
  int robots = 20, first = 0;
  double torque = 1, filter_s = 0, lag_s = 0, weight = 0;
  testing::HiddenBesides besides;
  std::string task, further, keep, known;
  std::vector<std::string> gated, guesses;
  int falls = 0, stands = 0, draws = -1;
  double scale = 1, deviations = -1;
  bool one_by_one = false;
  bool effective = false, each = false, tried = false, by_encoders = false;
  double mujoco_s = 0;
  TuningSettings tuning;
  std::vector<double> annealing;
  int starts = 0;
  GateSettings gate;
  std::optional<std::uint64_t> seed;
};

StudySettings Parse(int argc, char** argv) {
  StudySettings s;
  CommandLine line("Fits hidden robots.", "identification_study");
  line.Option("MOTION", s.motions, "motions that each robot plays").Required();
  line.Option("--drives", s.drives, "drives file").Required();
  line.Option("--robots", s.robots, "how many").Within(1, 100000);
  line.Option("--first", s.first, "number of the first").Within(0, 1000000);
  line.Option("--torque-factor", s.torque, "of all drives").Within(0.1, 10.0);
  line.Option("--velocity-filter-s", s.filter_s, "of all drives").Within(0.0, 0.1);
  line.Option("--torque-lag-s", s.lag_s, "of all drives").Within(0.0, 0.1);
  line.Option("--inertia", s.besides.inertia, "deviation of each link's, a factor")
      .Within(0.0, 1.0);
  line.Option("--rotor", s.besides.rotor, "deviation of the rotors', a factor").Within(0.0, 1.0);
  line.Option("--creep-speed", s.besides.creep_speed, "deviation of it, a factor").Within(0.0, 1.0);
  line.Option("--length", s.besides.length, "deviation of each link's, a factor").Within(0.0, 1.0);
  line.Option(
      "--gated", s.gated,
      "motions that the gate is asked about, and that are then played, as is what is found");
  line.Flag("--one-by-one", s.one_by_one, "fit the records one after the other, and compare");
#ifdef TUMBLER_WITH_MUJOCO
  line.Option("--mujoco-s", s.mujoco_s,
              "robots are in MuJoCo, with this time constant of contacts; 0: in the twin")
      .Within(0.0, 1.0);
#endif
  line.Option("--draws", s.draws, "of the gate; -1: its own").Within(-1, 1000);
  line.Option("--deviations", s.deviations, "of the gate's draws; -1: its own").Within(-1.0, 10.0);
  line.Option("--margin-torque", s.gate.margins.torque_limit, "of the gate").Within(0.0, 1.0);
  line.Option("--margin-delay-s", s.gate.margins.delay_s, "of the gate").Within(0.0, 1.0);
  line.Option("--weigh", s.weight, "1: the robot is weighed").Within(0.0, 1.0);
  line.Option("--scale", s.scale, "of what robots differ by, but for --inertia and its kin")
      .Within(0.0, 10.0);
  line.Option("--task", s.task,
              "of a motion that is found anew where none of --guess is let through");
  line.Option("--guess", s.guesses,
              "a motion of the task, tried first where the gate is open for it")
      .TakesOneValueEachTime();
  line.Option("--further", s.further,
              "a motion that robots play after a first try that did not stand, for a second one");
  line.Option("--falls", s.falls, "end with so many robots that fail in it, or in all of --guess")
      .Within(0, 100000);
  line.Option("--stands", s.stands, "of robots that stand in one of --guess, take so many")
      .Within(0, 100000);
  line.Option("--generations", s.tuning.generations, "at most, of finding it anew").Within(1, 1000);
  line.Option("--rounds", s.tuning.rounds, "of them").Within(1, 10);
  line.Option("--annealing", s.annealing, "of fits");
  line.Option("--starts", s.starts, "of fits; 0: their own").Within(0, 100);
  line.Flag("--by-encoders", s.by_encoders,
            "robots are set down where their encoders read the start of a motion");
  line.Flag("--each", s.each, "print every quantity of every robot");
  line.Flag("--tried", s.tried,
            "robots have played the first of --guess before, and its record is fitted, too; those "
            "that fail in it are the failing ones");
  line.Flag("--effective", s.effective, "effective models are tried, too, and their errors count");
  line.Option("--keep", s.keep,
              "folder for the posterior of each robot that is fitted, and motions found for it");
  line.Option("--known", s.known,
              "a folder of --keep: robots of which it has the posterior are not fitted again");
  line.Seed(s.seed, "of the robots");
  line.Parse(argc, argv);
  if (s.draws >= 0) s.gate.draws = s.draws;
  if (s.deviations >= 0) s.gate.deviations = s.deviations;
  return s;
}

/// Fits one hidden robot after the other, and counts.
class Study {
 public:
  explicit Study(const StudySettings& settings) : settings_(settings) {
    for (const std::string& motion : settings.motions) runs_.push_back(RunsOf(motion));
    if (settings.tried) runs_.push_back(RunsOf(settings.guesses.at(0)));
  }

  void FitOne(int number);
  /// Whether as many robots failed in the gated motion as were asked for.
  [[nodiscard]] bool HasEnoughFalls() const {
    return settings_.falls > 0 && (settings_.task.empty() ? open_falls_ + closed_falls_
                                                          : of_failing_.robots) >= settings_.falls;
  }
  void Print() const;

 private:
  struct Figures {
    std::vector<double> errors, sigmas, shares;
  };

  /// What hidden robots do with a motion.
  [[nodiscard]] testing::HiddenRuns RunsOf(const std::string& motion) const;
  [[nodiscard]] testing::HiddenRobot Draw(int number) const;
  void FitOneByOne(std::span<const RecordedMotion> records, const FitSettings& fit_settings,
                   const FitOutcome& fit);
  /// @returns  whether a link's mass is wrong by 8 %.
  bool NoteErrors(const testing::HiddenRobot& robot, const FitOutcome& fit);
  /// Asks the gate about a motion, and notes what the robot does with it, whatever the gate says.
  /// @returns  whether it is open.
  bool AskGate(const testing::HiddenRobot& robot, const PosteriorFile& known,
               const std::string& motion);
  [[nodiscard]] std::string MotionFor(const testing::HiddenRobot& robot, const PosteriorFile& known,
                                      const std::string& folder, bool& found_anew);
  /// What the records of a robot say.
  struct Known {
    std::vector<RecordedMotion> records;
    FitSettings settings;
    FitOutcome fit;
    bool rests = true;     ///< Whether it was as asked in all of them.
    double reading_s = 0;  ///< CPU time of reading them.
  };
  /// Records a robot.
  [[nodiscard]] Known Recorded(const testing::HiddenRobot& robot, const std::string& folder);
  /// Fits the robot of these records.
  void Fit(const testing::HiddenRobot& robot, Known& known);
  void Try(const testing::HiddenRobot& robot, const Known& known, const std::string& folder);
  /// What was known before, with the records of a further motion and of the one that was tried.
  /// @returns  empty: the robot was as asked in the further one, which is one of --guess.
  [[nodiscard]] std::optional<FitOutcome> FitAgain(const testing::HiddenRobot& robot,
                                                   const Known& known, const std::string& folder,
                                                   const std::string& tried);
  /// Whether a robot fails in all that the present one has failed in.
  [[nodiscard]] std::function<bool(const std::vector<double>&)> FailsInWhatWasTried(
      const RobotPosterior& like) const;
  void PrintQuantities() const;

  StudySettings settings_;
  std::vector<testing::HiddenRuns> runs_;
  std::map<std::string, Figures> figures_;
  std::vector<std::string> order_;
  std::vector<double> chis_, cpu_, apart_, ratios_, tuning_, again_;
  int effective_ = 0, wrong_ = 0, missed_ = 0;
  int open_stands_ = 0, open_falls_ = 0, closed_stands_ = 0, closed_falls_ = 0;
  /// What became of robots that fail in all guesses, or stand in one of them.
  struct Tries {
    int robots = 0, kept = 0, stands = 0, fell = 0, refused = 0;  ///< At the first.
    int then_stands = 0, then_fell = 0;                           ///< At a second.
  };
  Tries of_failing_, of_standing_;
  std::set<std::string> tried_;  ///< Motions that the present robot has failed in.
  int number_ = 0;               ///< Of the present robot.
  bool stood_ = false;           ///< Whether the present robot stands in one of the guesses.
};

testing::HiddenRuns Study::RunsOf(const std::string& motion) const {
  testing::HiddenRuns runs(motion, settings_.drives);
  // The true robot is what differs from the first model, whatever a motion was made for.
  if (!runs_.empty()) runs.OfModel(runs_.front().scene());
#ifdef TUMBLER_WITH_MUJOCO
  if (settings_.mujoco_s > 0) {
    runs.Behind(testing::MujocoEngine(
        runs.motion(), {.time_constant_s = settings_.mujoco_s, .model = runs.scene().contact}));
  }
#endif
  return runs;
}

testing::HiddenRobot Study::Draw(int number) const {
  const std::uint64_t seed = settings_.seed.value_or(1);
  const auto index = static_cast<std::uint64_t>(number);
  testing::HiddenRobot robot =
      testing::DrawHiddenRobot(runs_.front().scene(), seed, index, settings_.scale);
  AddBesides(settings_.besides, seed, index, robot);
  robot.torque_factor = settings_.torque;
  robot.velocity_filter_s = settings_.filter_s;
  robot.torque_lag_s = settings_.lag_s;
  robot.by_encoders = settings_.by_encoders;
  return robot;
}

void Study::FitOne(int number) {
  const testing::HiddenRobot robot = Draw(number);
  const testing::TemporaryFolder folder;
  number_ = number;
  if (!settings_.task.empty()) {
    const std::span guesses(settings_.guesses);
    stood_ =
        std::ranges::any_of(settings_.tried ? guesses.first(1) : guesses,
                            [&](const std::string& guess) { return RunsOf(guess).Play(robot); });
    if (stood_ && of_standing_.robots >= settings_.stands) return;
  }
  tried_.clear();
  if (settings_.tried && !stood_) tried_.insert(settings_.guesses.front());
  const std::string kept = fmt::format("{}/{}.toml", settings_.known, number);
  Known of = Recorded(robot, folder.path().string());
  if (!settings_.known.empty() && std::filesystem::exists(kept)) {
    const PosteriorFile file = LoadPosterior(kept);
    of.fit.posterior = file.posterior;
    of.fit.first_deviations = file.prior_deviations;
    of.fit.chi = file.chi;
    of.fit.effective = file.effective;
  } else {
    Fit(robot, of);
  }
  const FitOutcome& fit = of.fit;
  chis_.push_back(fit.chi);
  effective_ += fit.effective ? 1 : 0;
  if (settings_.one_by_one && !fit.effective) FitOneByOne(of.records, of.settings, fit);
  const bool off = NoteErrors(robot, fit);
  PosteriorFile known;
  known.posterior = fit.posterior;
  known.prior_deviations = fit.first_deviations;
  known.chi = fit.chi;
  known.effective = fit.effective;
  if (!settings_.keep.empty())
    PendingFile(fmt::format("{}/{}.toml", settings_.keep, number), ToToml(known)).Commit();
  for (const std::string& motion : settings_.gated) AskGate(robot, known, motion);
  if (!settings_.task.empty()) Try(robot, of, folder.path().string());
  wrong_ += off ? 1 : 0;
  missed_ += off && !fit.effective ? 1 : 0;
  for (std::size_t q = 0; settings_.each && q < fit.posterior.size(); ++q) {
    const RobotQuantity& quantity = fit.posterior.quantities[q];
    fmt::print("  {:32} {:10.4g} +- {:.2g}, truth {:.4g}, {:.0f} %\n", NameOf(quantity),
               fit.posterior.mean[q], fit.posterior.DeviationOf(q),
               TruthOf(runs_.front().scene(), robot, quantity), 100 * fit.ShareLeft(q));
  }
  fmt::print("{}: chi {:.3f} starts {}{}{}\n", number, fit.chi, fit.starts,
             fit.effective ? " effective" : "", of.rests ? "" : " (not as asked)");
  std::fflush(stdout);
}

Study::Known Study::Recorded(const testing::HiddenRobot& robot, const std::string& folder) {
  Known known;
  for (std::size_t m = 0; m < runs_.size(); ++m) {
    const std::string file = folder + fmt::format("/{}.rec", m);
    known.rests = runs_[m].Record(robot, file) && known.rests;
    const double start = CpuSeconds();
    known.records.push_back(ReadRecordedMotion(file));
    known.reading_s += CpuSeconds() - start;
  }
  if (!settings_.annealing.empty()) known.settings.annealing = settings_.annealing;
  if (settings_.starts > 0) known.settings.starts = settings_.starts;
  return known;
}

void Study::Fit(const testing::HiddenRobot& robot, Known& known) {
  const double start = CpuSeconds();
  const bool weighed = settings_.weight > 0;
  if (weighed) {
    const Scene varied = Varied(runs_.front().scene(), robot.variation);
    for (const auto& dof : varied.robot.tree.dofs) known.settings.weight_kg += dof.mass_kg;
  }
  const FitPrior prior = PriorOfRecords(known.records, weighed);
  known.settings.fails = FailsInWhatWasTried(prior.known);
  known.fit = FitRobot(known.records, prior, known.settings);
  cpu_.push_back(known.reading_s + CpuSeconds() - start);
  fmt::print("  fitted in {:.2f} s\n", cpu_.back());
}

void Study::FitOneByOne(std::span<const RecordedMotion> records, const FitSettings& fit_settings,
                        const FitOutcome& fit) {
  FitPrior known = PriorOfRecords(records, settings_.weight > 0);
  FitOutcome last;
  for (std::size_t m = 0; m < records.size(); ++m) {
    last = FitRobot(records.subspan(m, 1), known, fit_settings);
    known = {last.posterior, last.information, last.first_deviations, last.weighed};
  }
  for (std::size_t q = 0; q < fit.posterior.size(); ++q) {
    const double deviation = fit.posterior.DeviationOf(q);
    apart_.push_back(std::abs(last.posterior.mean[q] - fit.posterior.mean[q]) / deviation);
    ratios_.push_back(last.posterior.DeviationOf(q) / deviation);
  }
}

bool Study::NoteErrors(const testing::HiddenRobot& robot, const FitOutcome& fit) {
  bool off = false;
  for (std::size_t q = 0; q < fit.posterior.size(); ++q) {
    const RobotQuantity& quantity = fit.posterior.quantities[q];
    const double truth = TruthOf(runs_.front().scene(), robot, quantity);
    const std::string name = NameOf(quantity);
    if (!figures_.contains(name)) order_.push_back(name);
    Figures& figures = figures_[name];
    const double error = fit.posterior.mean[q] - truth;
    if (quantity.kind == RobotQuantity::Kind::kMass && std::abs(error) > 0.08) off = true;
    if (std::isnan(truth)) continue;
    // Statistics of wrong fits that chi flags are not those of intervals.
    if (fit.effective && !settings_.effective) continue;
    figures.errors.push_back(std::abs(error));
    figures.sigmas.push_back(error / fit.posterior.DeviationOf(q));
    figures.shares.push_back(fit.ShareLeft(q));
  }
  return off;
}

bool Study::AskGate(const testing::HiddenRobot& robot, const PosteriorFile& known,
                    const std::string& motion) {
  GateSettings asked = settings_.gate;
  asked.failed.assign(tried_.begin(), tried_.end());
  const GateOutcome gate = PassGate(motion, settings_.drives, known, asked);
  const bool works = RunsOf(motion).Play(robot);
  if (gate.open()) {
    (works ? open_stands_ : open_falls_) += 1;
  } else {
    (works ? closed_stands_ : closed_falls_) += 1;
  }
  fmt::print("  {}: {}, {}\n", motion, Verdict(gate), works ? "stands" : "falls");
  return gate.open();
}

/// The motion that is tried on a robot: a guess for which the gate is open, or else one that is
/// found anew, and for which it is. Empty: none is.
std::string Study::MotionFor(const testing::HiddenRobot& robot, const PosteriorFile& known,
                             const std::string& folder, bool& found_anew) {
  const auto passes = [&](const std::string& motion) { return AskGate(robot, known, motion); };
  found_anew = false;
  for (const std::string& guess : settings_.guesses) {
    // Of what is not near the motion that the robot has failed in its record tells little.
    if (settings_.tried && !stood_) break;
    if (!tried_.contains(guess) && passes(guess)) return guess;
  }
  found_anew = true;
  const double start = CpuSeconds();
  std::string motion =
      settings_.keep.empty()
          ? folder + fmt::format("/tuned{}.toml", tuning_.size())
          : fmt::format("{}/{}_motion{}.toml", settings_.keep, number_, tuning_.size());
  const std::string cause =
      testing::FindAnew(settings_.task, settings_.guesses, known, settings_.tuning, motion);
  tuning_.push_back(CpuSeconds() - start);
  fmt::print("  tuned in {:.1f} s{}{}\n", tuning_.back(), cause.empty() ? "" : ": ", cause);
  if (!cause.empty()) return "";
  return passes(motion) ? motion : "";
}

std::function<bool(const std::vector<double>&)> Study::FailsInWhatWasTried(
    const RobotPosterior& like) const {
  PosteriorFile of;
  of.posterior = like;
  std::vector<std::function<bool(const std::vector<double>&)>> all;
  for (const std::string& motion : tried_) all.push_back(FailsIn(motion, settings_.drives, of));
  if (all.empty()) return {};
  return [all](const std::vector<double>& robot) {
    return std::ranges::all_of(all, [&](const auto& fails) { return fails(robot); });
  };
}

std::optional<FitOutcome> Study::FitAgain(const testing::HiddenRobot& robot, const Known& known,
                                          const std::string& folder, const std::string& tried) {
  std::vector<RecordedMotion> records = known.records;
  for (const std::string& motion : {settings_.further, tried}) {
    if (motion.empty() || tried_.contains(motion)) continue;
    const std::string file = folder + fmt::format("/again{}.rec", records.size());
    const bool as_asked = RunsOf(motion).Record(robot, file);
    const bool is_guess = std::ranges::find(settings_.guesses, motion) != settings_.guesses.end();
    if (as_asked && is_guess) return std::nullopt;
    if (is_guess || motion == tried) tried_.insert(motion);
    records.push_back(ReadRecordedMotion(file));
    TakeModelOf(records.front(), records.back());
  }
  FitSettings settings = known.settings;
  settings.begin = known.fit.posterior.mean;
  const FitPrior prior = PriorOfRecords(records, known.fit.weighed);
  if (settings_.tried) settings.fails = FailsInWhatWasTried(prior.known);
  return FitRobot(records, prior, settings);
}

/// The whole procedure, as the guide has it. An effective model is tried on no
/// robot, unless that is asked for.
void Study::Try(const testing::HiddenRobot& robot, const Known& known, const std::string& folder) {
  Tries& tries = stood_ ? of_standing_ : of_failing_;
  ++tries.robots;
  PosteriorFile file;
  file.posterior = known.fit.posterior;
  file.effective = known.fit.effective;
  file.chi = known.fit.chi;
  bool found_anew = false;
  const auto may_try = [this](const FitOutcome& fit) {
    return settings_.effective || !fit.effective;
  };
  const std::string motion =
      may_try(known.fit) ? MotionFor(robot, file, folder, found_anew) : std::string();
  const char* const which = stood_ ? "standing" : "failing";
  if (!motion.empty() && RunsOf(motion).Play(robot)) {
    ++(found_anew ? tries.stands : tries.kept);
    fmt::print("  {}: {}\n", which, found_anew ? "stands with another" : "keeps its motion");
    return;
  }
  ++(motion.empty() ? tries.refused : tries.fell);
  fmt::print("  {}: {}\n", which, motion.empty() ? "refused" : "FELL");
  if (settings_.further.empty()) return;
  const double start = CpuSeconds();
  const std::optional<FitOutcome> again = FitAgain(robot, known, folder, motion);
  if (!again) {
    ++tries.then_stands;
    fmt::print("    then stands in {}\n", settings_.further);
    return;
  }
  file.posterior = again->posterior;
  file.effective = again->effective;
  file.chi = again->chi;
  fmt::print("    then chi {:.3f}{}\n", again->chi, again->effective ? " effective" : "");
  const std::string second =
      may_try(*again) ? MotionFor(robot, file, folder, found_anew) : std::string();
  again_.push_back(CpuSeconds() - start);
  if (second.empty()) {
    fmt::print("    then refused\n");
    return;
  }
  const bool stands = RunsOf(second).Play(robot);
  ++(stands ? tries.then_stands : tries.then_fell);
  fmt::print("    then {}\n", stands ? "stands" : "FELL");
}

void Study::Print() const {
  fmt::print(
      "chi {:.3f} {:.3f} {:.3f} (5, 50, 95 %), effective {}, masses off by 8 % {} (not flagged "
      "{}), CPU median {:.2f} s\n",
      Quantile(chis_, 0.05), Quantile(chis_, 0.5), Quantile(chis_, 0.95), effective_, wrong_,
      missed_, Quantile(cpu_, 0.5));
  if (settings_.one_by_one) {
    fmt::print(
        "one by one: means are apart by {:.3g} {:.3g} {:.3g} deviations (50, 95, 100 %), "
        "deviations "
        "{:.3g} {:.3g} {:.3g} {:.3g} {:.3g} times those of one fit (0, 5, 50, 95, 100 %)\n",
        Quantile(apart_, 0.5), Quantile(apart_, 0.95), Quantile(apart_, 1), Quantile(ratios_, 0),
        Quantile(ratios_, 0.05), Quantile(ratios_, 0.5), Quantile(ratios_, 0.95),
        Quantile(ratios_, 1));
  }
  if (!settings_.task.empty()) {
    for (const auto& [name, of] : {std::pair("fail in all guesses", of_failing_),
                                   std::pair("stand in a guess", of_standing_)}) {
      fmt::print(
          "of {} robots that {}: at the first try {} stand in a guess, {} in a motion found anew, "
          "{} fell, {} refused; at the second {} more stand, {} fell\n",
          of.robots, name, of.kept, of.stands, of.fell, of.refused, of.then_stands, of.then_fell);
    }
    fmt::print(
        "tuning {:.1f} {:.1f} {:.1f} s of CPU (5, 50, 95 %), a second try {:.1f} s in the "
        "median\n",
        Quantile(tuning_, 0.05), Quantile(tuning_, 0.5), Quantile(tuning_, 0.95),
        Quantile(again_, 0.5));
  }
  if (!settings_.gated.empty() || !settings_.task.empty()) {
    fmt::print("gate: of {} that fail it refuses {}; of {} that stand it refuses {}\n",
               open_falls_ + closed_falls_, closed_falls_, open_stands_ + closed_stands_,
               closed_stands_);
  }
  PrintQuantities();
}

void Study::PrintQuantities() const {
  fmt::print("{:32} {:>10} {:>10} {:>8} {:>8} {:>8}\n", "quantity", "median", "largest", "cover95",
             "rms/sd", "share");
  for (const std::string& name : order_) {
    const Figures& of = figures_.at(name);
    if (of.errors.empty()) continue;
    double covered = 0, squares = 0;
    for (const double s : of.sigmas) {
      covered += std::abs(s) < 1.96 ? 1 : 0;
      squares += s * s;
    }
    const auto n = static_cast<double>(of.sigmas.size());
    fmt::print("{:32} {:10.3g} {:10.3g} {:8.1f} {:8.2f} {:8.3f}\n", name, Quantile(of.errors, 0.5),
               Quantile(of.errors, 1), 100 * covered / n, std::sqrt(squares / n),
               Quantile(of.shares, 0.5));
  }
}

ExitStatus Main(int argc, char** argv) {
  const StudySettings settings = Parse(argc, argv);
  Study study(settings);
  for (int i = 0; i < settings.robots && !study.HasEnoughFalls(); ++i)
    study.FitOne(settings.first + i);
  study.Print();
  return ExitStatus::kDone;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return tumbler::RunProgram("error", argc, argv, tumbler::Main); }
