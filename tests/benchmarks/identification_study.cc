// What an identification is worth, over hidden robots: errors, coverage of intervals, chi, CPU
// time. docs/identify.md has its figures.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <map>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "common/files/command_line.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "offline/certify/task_result.h"
#include "offline/problem/posterior_toml.h"
#include "offline/solve/guess.h"
#include "offline/studies/gate.h"
#include "offline/studies/identified_model.h"
#include "offline/studies/recorded_motion.h"
#include "offline/studies/robot_fit.h"
#include "tests/support/files.h"
#include "tests/support/hidden_robot.h"

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
    for (std::size_t i = first; i < scene.robot.body_names.size(); ++i)
      if (scene.robot.body_names[i] == of.of)
        return std::log(robot.variation.links[i - first].length);
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

ExitStatus Main(int argc, char** argv) {
  std::vector<std::string> motions;
  std::string drives;
  int robots = 20, first = 0;
  double torque = 1, filter_s = 0, lag_s = 0, weight = 0;
  testing::HiddenBesides besides;
  std::string task, guess, gated;
  int falls = 0;
  bool one_by_one = false;
  GateSettings gate;
  double scale = 1;
  std::optional<std::uint64_t> seed;
  CommandLine line("Fits hidden robots.", "identification_study");
  line.Option("MOTION", motions, "motions that each robot plays").Required();
  line.Option("--drives", drives, "drives file").Required();
  line.Option("--robots", robots, "how many").Within(1, 100000);
  line.Option("--first", first, "number of the first").Within(0, 1000000);
  line.Option("--torque-factor", torque, "of all drives").Within(0.1, 10.0);
  line.Option("--velocity-filter-s", filter_s, "of all drives").Within(0.0, 0.1);
  line.Option("--torque-lag-s", lag_s, "of all drives").Within(0.0, 0.1);
  line.Option("--inertia", besides.inertia, "deviation of each link's, a factor").Within(0.0, 1.0);
  line.Option("--rotor", besides.rotor, "deviation of the rotors', a factor").Within(0.0, 1.0);
  line.Option("--creep-speed", besides.creep_speed, "deviation of it, a factor").Within(0.0, 1.0);
  line.Option("--length", besides.length, "deviation of each link's, a factor").Within(0.0, 1.0);
  line.Option("--gated", gated, "a motion that the gate is asked about, and that is then played");
  line.Option("--falls", falls, "end with so many robots that fail in it").Within(0, 100000);
  line.Flag("--one-by-one", one_by_one, "fit the records one after the other, and compare");
  line.Option("--draws", gate.draws, "of the gate").Within(0, 1000);
  line.Option("--margin-torque", gate.margins.torque_limit, "of the gate").Within(0.0, 1.0);
  line.Option("--margin-delay-s", gate.margins.delay_s, "of the gate").Within(0.0, 1.0);
  line.Option("--weigh", weight, "1: the robot is weighed").Within(0.0, 1.0);
  line.Option("--scale", scale, "of what robots differ by").Within(0.0, 10.0);
  line.Option("--task", task, "of a motion that is found anew for robots on which it fails");
  line.Option("--guess", guess, "that motion");
  line.Seed(seed, "of the robots");
  line.Parse(argc, argv);
  std::vector<testing::HiddenRuns> runs;
  for (const std::string& motion : motions) runs.emplace_back(motion, drives);
  struct Figures {
    std::vector<double> errors, sigmas, shares;
  };
  std::map<std::string, Figures> figures;
  std::vector<std::string> order;
  std::vector<double> chis, cpu, apart, ratios;
  int effective = 0, wrong = 0, missed = 0;
  int open_stands = 0, open_falls = 0, closed_stands = 0, closed_falls = 0;
  int stood = 0, not_found = 0, refused = 0, stands = 0, fell = 0;
  std::vector<double> tuning;
  for (int i = 0; i < robots; ++i) {
    testing::HiddenRobot robot = testing::DrawHiddenRobot(runs.front().scene(), seed.value_or(1),
                                                          static_cast<std::uint64_t>(first + i));
    AddBesides(besides, seed.value_or(1), static_cast<std::uint64_t>(first + i), robot);
    robot.torque_factor = torque;
    robot.velocity_filter_s = filter_s;
    robot.torque_lag_s = lag_s;
    const testing::TemporaryFolder folder;
    if (!task.empty() && testing::HiddenRuns(guess, drives).Play(robot)) {
      ++stood;
      continue;  // A motion that stands is never replaced.
    }
    std::vector<RecordedMotion> records;
    bool rests = true;
    double cpu_s = 0;
    for (std::size_t m = 0; m < runs.size(); ++m) {
      const std::string file = folder / fmt::format("{}.rec", m);
      rests = runs[m].Record(robot, file) && rests;
      const double start = CpuSeconds();
      records.push_back(ReadRecordedMotion(file));
      cpu_s += CpuSeconds() - start;
    }
    const double start = CpuSeconds();
    FitSettings settings;
    const Scene varied = Varied(runs.front().scene(), robot.variation);
    if (weight > 0)
      for (const auto& dof : varied.robot.tree.dofs) settings.weight_kg += dof.mass_kg;
    const FitOutcome fit = FitRobot(records, PriorOfRecords(records, weight > 0), settings);
    cpu.push_back(cpu_s + CpuSeconds() - start);
    chis.push_back(fit.chi);
    effective += fit.effective ? 1 : 0;
    if (one_by_one && !fit.effective) {
      FitPrior known = PriorOfRecords(records, weight > 0);
      FitOutcome last;
      for (std::size_t m = 0; m < records.size(); ++m) {
        last = FitRobot(std::span(records).subspan(m, 1), known, settings);
        known = {last.posterior, last.information, last.first_deviations, last.weighed};
      }
      for (std::size_t q = 0; q < fit.posterior.size(); ++q) {
        const double deviation = fit.posterior.DeviationOf(q);
        apart.push_back(std::abs(last.posterior.mean[q] - fit.posterior.mean[q]) / deviation);
        ratios.push_back(last.posterior.DeviationOf(q) / deviation);
      }
    }
    bool off = false;
    for (std::size_t q = 0; q < fit.posterior.size(); ++q) {
      const RobotQuantity& quantity = fit.posterior.quantities[q];
      const double truth = TruthOf(runs.front().scene(), robot, quantity);
      const std::string name = NameOf(quantity);
      if (!figures.contains(name)) order.push_back(name);
      const double error = fit.posterior.mean[q] - truth;
      if (quantity.kind == RobotQuantity::Kind::kMass && std::abs(error) > 0.08) off = true;
      if (std::isnan(truth)) continue;
      // Statistics of wrong fits that chi flags are not those of intervals.
      if (fit.effective) continue;
      figures[name].errors.push_back(std::abs(error));
      figures[name].sigmas.push_back(error / fit.posterior.DeviationOf(q));
      figures[name].shares.push_back(fit.ShareLeft(q));
    }
    PosteriorFile known;
    known.posterior = fit.posterior;
    if (!gated.empty()) {
      const bool open = PassGate(gated, drives, known, gate).open();
      const bool works = testing::HiddenRuns(gated, drives).Play(robot);
      (open ? (works ? open_stands : open_falls) : (works ? closed_stands : closed_falls)) += 1;
      fmt::print("  gate {}, {}\n", open ? "open" : "closed", works ? "stands" : "falls");
    }
    if (!task.empty()) {
      const double tuned = CpuSeconds();
      Task own = IdentifiedTask(LoadTask(task), known);
      TuneTo(known, {}, own);
      TakeGuess(own, LoadPrimitive(guess), guess);
      WorkSettings settings_of_work;
      settings_of_work.quiet = true;
      const TaskResult result = WorkOn(std::move(own), settings_of_work);
      tuning.push_back(CpuSeconds() - tuned);
      std::string became = "no motion found";
      if (!result.file) {
        ++not_found;
        became = "no motion found: " + result.cause;
      } else {
        const std::string motion = folder / "tuned.toml";
        PendingFile(motion, ToToml(*result.file)).Commit();
        if (!PassGate(motion, drives, known, gate).open()) {
          ++refused;
          became = "refused by the gate";
        } else {
          // The true robot is what differs from the first model, not from the identified one.
          const bool works =
              testing::HiddenRuns(motion, drives).OfModel(runs.front().scene()).Play(robot);
          (works ? stands : fell) += 1;
          became = works ? "stands" : "FELL";
        }
      }
      fmt::print("  {} ({:.1f} s of tuning)\n", became, tuning.back());
    }
    wrong += off ? 1 : 0;
    missed += off && !fit.effective ? 1 : 0;
    fmt::print("{}: chi {:.3f} starts {} cpu {:.2f} s{}{}\n", first + i, fit.chi, fit.starts,
               cpu.back(), fit.effective ? " effective" : "", rests ? "" : " (not as asked)");
    std::fflush(stdout);
    if (falls > 0 && open_falls + closed_falls >= falls) break;
  }
  fmt::print(
      "chi {:.3f} {:.3f} {:.3f} (5, 50, 95 %), effective {}, masses off by 8 % {} (not flagged "
      "{}), CPU median {:.2f} s\n",
      Quantile(chis, 0.05), Quantile(chis, 0.5), Quantile(chis, 0.95), effective, wrong, missed,
      Quantile(cpu, 0.5));
  if (one_by_one) {
    fmt::print(
        "one by one: means are apart by {:.3g} {:.3g} {:.3g} deviations (50, 95, 100 %), "
        "deviations "
        "{:.3g} {:.3g} {:.3g} {:.3g} {:.3g} times those of one fit (0, 5, 50, 95, 100 %)\n",
        Quantile(apart, 0.5), Quantile(apart, 0.95), Quantile(apart, 1), Quantile(ratios, 0),
        Quantile(ratios, 0.05), Quantile(ratios, 0.5), Quantile(ratios, 0.95), Quantile(ratios, 1));
  }
  if (!task.empty()) {
    fmt::print(
        "{} stood already; of the others {} stand, {} fell, {} refused by the gate, {} without "
        "a motion; tuning {:.1f} s of CPU in the median\n",
        stood, stands, fell, refused, not_found, Quantile(tuning, 0.5));
  }
  if (!gated.empty()) {
    fmt::print("gate: of {} that fail it refuses {}; of {} that stand it refuses {}\n",
               open_falls + closed_falls, closed_falls, open_stands + closed_stands, closed_stands);
  }
  fmt::print("{:32} {:>10} {:>10} {:>8} {:>8} {:>8}\n", "quantity", "median", "largest", "cover95",
             "rms/sd", "share");
  for (const std::string& name : order) {
    const Figures& of = figures[name];
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
  return ExitStatus::kDone;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return tumbler::RunProgram("error", argc, argv, tumbler::Main); }
