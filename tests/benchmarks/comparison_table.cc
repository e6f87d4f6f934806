// Prints three tables in Markdown: the times and instructions of the offline side beside those of
// other software for the same work, what came of every seed of the motions that are found from
// nothing, and the error that the fixed step leaves in the gradient.
// scripts/compare runs it. usage: comparison_table [INSTRUCTIONS [SEEDS]]
//   INSTRUCTIONS  the output of scripts/count-instructions; without it that column is empty
//   SEEDS         number of seeds for each motion that is found from nothing; default 10
// Times are processor times of one thread: the best of several runs for short computations, the
// median over seeds for whole motions.

#include <ctime>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "offline/certify/certificate.h"
#include "offline/certify/second_look.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/solver.h"
#include "tests/benchmarks/dynamics_cases.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"

namespace tumbler {
namespace {

/// Figures of other software. Unless they say otherwise, they are for the same five-joint tumbler
/// without contact: times on one thread of an AMD Zen 4 with g++ 12.2 -O3 -march=native and, in
/// brackets, instructions of a call (callgrind, x86-64-v3).
struct Peer {
  const char* work;
  const char* figures;
};
constexpr Peer kPeers[] = {
    {"g",
     "Pinocchio 3.7 (nle, CRBA, Cholesky) 1200-1400 ns (9.0k); DART 6.12 2060-2170 ns (18.7k); "
     "generated code, the floor, 70-97 ns (726)"},
    {"dg",
     "Pinocchio, the same with all derivatives 3730-3820 ns (26.4k); generated code, the Jacobian "
     "alone, 310-397 ns (3.3k)"},
    {"ground_g", "MuJoCo 2.2.2 mj_step with two contacts 3520 ns (42.3k)"},
    {"ground_dg", "MuJoCo mjd_transitionFD, one-sided, two contacts 31300 ns (389k)"},
    {"cost", "feasibility study (planar, RK4 at 1 kHz) 0.5 ms"},
    {"gradient12",
     "feasibility study (forward) 5 ms, 10 times cost; Drake's inverse dynamics with AutoDiffXd "
     "100 "
     "times without (2019, drake#10322)"},
    {"gradient60", "-"},
    {"forward11", "-"},
    {"handstand",
     "feasibility study 1.7 s; Crocoddyl 3.0.1 FDDP, tumbler in the air, 100 nodes, 0.173-0.212 s "
     "from a guess"},
    {"paper", "[AB04] 6 to 30 min, MATLAB and C-STORM on a Pentium of 700 MHz"},
};

const char* PeerOf(const std::string& work) {
  for (const Peer& peer : kPeers) {
    if (work == peer.work) return peer.figures;
  }
  return "-";
}

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// The time of one call [s]: the best of several batches of about 20 ms.
template <class Work>
double Best(Work work) {
  int batch = 1;
  double best = 1e300;
  for (int taken = 0; taken < 10;) {
    const double begin = CpuSeconds();
    for (int i = 0; i < batch; ++i) work();
    const double each = (CpuSeconds() - begin) / batch;
    if (each * batch < 0.02) {
      batch *= 2;
      continue;
    }
    best = std::min(best, each);
    ++taken;
  }
  return best;
}

/// The instructions of a call, by the names in the output of scripts/count-instructions.
std::map<std::string, long> ReadInstructions(const char* path) {
  std::map<std::string, long> counts;
  std::ifstream file(path);
  if (!file) throw std::runtime_error(std::string("cannot read ") + path);
  std::string line;
  while (std::getline(file, line)) {
    // A line is NAME, blanks, COUNT, blanks, BOUND. Names have single blanks only.
    const std::size_t gap = line.find("  ");
    if (gap == std::string::npos || gap == 0) continue;
    if (const long count = std::strtol(line.c_str() + gap, nullptr, 10); count > 0)
      counts[line.substr(0, gap)] = count;
  }
  return counts;
}

void Print(const std::string& what, const std::string& ours, const std::string& instructions,
           const char* others) {
  std::printf("| %s | %s | %s | %s |\n", what.c_str(), ours.c_str(), instructions.c_str(), others);
  std::fflush(stdout);
}

std::string Format(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

template <class T>
T Median(std::vector<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// A motion that was found for a task.
struct FoundMotion {
  std::string name;
  Problem problem;
  std::vector<double> x;
};

/// Whether a motion is what its task asks for, by the rule that decides whether it is written. A
/// task without a target of its pitch is a roll, which also has to turn by half a turn, and to the
/// left.
bool IsWhatTheTaskAsksFor(const Problem& problem, const std::vector<double>& x) {
  if (!LookAgain(problem, x).acceptable()) return false;
  if (std::ranges::any_of(problem.cost, &CostTerm::targets_pitch)) return true;
  std::vector<double> q;
  Rollout(problem, problem.solver.step_s).Visit(x, 2.0, [&](const MotionSample& sample) {
    q = sample.q;
  });
  return q[2] - problem.start_q[2] > std::numbers::pi - 0.05 && q[0] < problem.start_q[0];
}

/// Finds a task's motion from nothing with several seeds, and prints the figures.
/// @param outcomes  gets a line for the table of outcomes appended.
/// @returns the motion of the first seed.
FoundMotion PrintMotion(const std::filesystem::path& task, int seeds, const std::string& name,
                        const char* others, std::string& outcomes) {
  Problem problem = LoadTask(task.string()).problem;
  std::vector<double> seconds, objectives;
  std::vector<std::int64_t> evaluations;
  int found = 0, converged = 0, confirmed = 0;
  std::int64_t gradients = 0, dynamics = 0;  // of all local solves with adaptive steps
  FoundMotion first{name, problem, {}};
  for (int seed = 1; seed <= seeds; ++seed) {
    problem.search.seed = static_cast<std::uint64_t>(seed);
    const double begin = CpuSeconds();
    SolveOptions options;
    options.accept = [&](const Solution& solution) {
      return IsWhatTheTaskAsksFor(problem, solution.x);
    };
    const SolveOutcome outcome = Solve(problem, options);
    seconds.push_back(CpuSeconds() - begin);
    evaluations.push_back(outcome.evaluations);
    if (seed == 1 && !outcome.solutions.empty()) first.x = outcome.solutions.front().x;
    if (outcome.solutions.empty()) continue;
    const Solution& best = outcome.solutions.front();
    found += best.feasible() && !best.refused && IsWhatTheTaskAsksFor(problem, best.x) ? 1 : 0;
    objectives.push_back(best.rollout.cost);
    converged += best.end == SolveEnd::kConverged ? 1 : 0;
    const std::optional<KktResidual> finer = FinerKktResidual(problem, best.x);
    confirmed += finer && finer->relative.value_or(1) <= problem.solver.kkt_residual ? 1 : 0;
    for (const Evaluation& evaluation : outcome.history) {
      gradients += evaluation.dynamics > 0 ? 1 : 0;
      dynamics += evaluation.dynamics;
    }
  }
  Print(name + ", " + std::to_string(problem.parameter_count()) + " parameters",
        Format("%.2f s", Median(seconds)) + ", " + std::to_string(Median(evaluations)) +
            " evaluations; found by " + std::to_string(found) + " of " + std::to_string(seeds) +
            " seeds",
        "", others);
  if (!objectives.empty()) {
    const auto [least, largest] = std::ranges::minmax(objectives);
    outcomes += "| " + name + " | " + std::to_string(found) + " | " + std::to_string(converged) +
                " | " + std::to_string(confirmed) + " |" + Format(" %.2e", least) +
                Format(", %.2e", Median(objectives)) + Format(", %.2e |", largest) +
                Format(" %.2f s |", Median(seconds)) +
                Format(" %.0f |\n", static_cast<double>(dynamics) /
                                        static_cast<double>(std::max<std::int64_t>(1, gradients)));
  }
  return first;
}

/// The gradient of the cost by the paper's equations, beside the optimum, where it is not zero.
Eigen::RowVectorXd GradientOf(const FoundMotion& motion, const StepSettings& settings,
                              IntegrationStatistics* statistics = nullptr) {
  std::vector<double> x = motion.x;
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += i % 2 == 0 ? 1e-3 : -1e-3;
  ForwardSensitivity forward(motion.problem, settings);
  auto gradient = OutputGradients::Of(forward);
  forward.Run(x, gradient);
  if (statistics != nullptr) *statistics = forward.statistics();
  return gradient.row(0);
}

/// Prints the error that the fixed step leaves in the gradient: its distance from the gradient of
/// the adaptive scheme.
void PrintStepErrors(const std::vector<FoundMotion>& motions) {
  std::printf(
      "\n| gradient beside the optimum, off that of adaptive steps (1e-10) by | 1 ms | 0.5 ms | "
      "0.25 ms | adaptive (1e-8) | adaptive, as finalists are solved: evaluations of g |\n"
      "|---|---|---|---|---|---|\n");
  for (const FoundMotion& motion : motions) {
    if (motion.x.empty()) continue;
    using Scheme = StepSettings::Scheme;
    IntegrationStatistics statistics;
    const Eigen::RowVectorXd reference = GradientOf(motion, {Scheme::kAdaptive, 1e-3, 1e-10});
    std::printf("| %s |", motion.name.c_str());
    for (const StepSettings& settings :
         {StepSettings{Scheme::kFixed, 1e-3}, StepSettings{Scheme::kFixed, 0.5e-3},
          StepSettings{Scheme::kFixed, 0.25e-3}, StepSettings{Scheme::kAdaptive, 1e-3, 1e-8}}) {
      std::printf(" %.1e |", (GradientOf(motion, settings) - reference).cwiseAbs().maxCoeff() /
                                 reference.cwiseAbs().maxCoeff());
    }
    const Eigen::RowVectorXd solved =
        GradientOf(motion, AdaptiveSteps(motion.problem), &statistics);
    // A Rollout with these steps tries none in vain, and evaluates six stages of each.
    std::printf(" %.1e: %ld |\n",
                (solved - reference).cwiseAbs().maxCoeff() / reference.cwiseAbs().maxCoeff(),
                6 * statistics.steps);
  }
}

/// Finds the nominal and the printed motions from nothing, and prints the figures and, as a second
/// table, what came of the seeds. @returns those of the first seed.
std::vector<FoundMotion> PrintMotions(int seeds) {
  std::vector<FoundMotion> motions;
  std::string outcomes;
  const auto tasks = std::filesystem::path(testing::SourcePath("primitives/tasks"));
  for (const char* name : {"handstand", "downstand", "roll"}) {
    const auto task = tasks / "nominal" / (std::string(name) + ".toml");
    if (!std::filesystem::exists(task)) continue;
    motions.push_back(PrintMotion(task, seeds, std::string(name) + " from nothing, nominal",
                                  std::string(name) == "handstand" ? PeerOf("handstand") : "-",
                                  outcomes));
  }
  for (const auto& [name, equation] : {std::pair("handstand", "(33)"), std::pair("roll", "(34)"),
                                       std::pair("downstand", "(35)")}) {
    motions.push_back(PrintMotion(tasks / "paper" / (std::string(name) + ".toml"), seeds,
                                  std::string(name) + " from nothing, as printed " + equation,
                                  PeerOf("paper"), outcomes));
  }
  std::printf(
      "\n| seeds 1 to %d | as asked | converged | confirmed by a finer tolerance | objective: "
      "least, "
      "median, largest | CPU, median | evaluations of g in an evaluation of cost and gradient |\n"
      "|---|---|---|---|---|---|---|\n%s",
      seeds, outcomes.c_str());
  return motions;
}

int Main(int argc, char** argv) {
  std::map<std::string, long> counts;
  if (argc > 1) counts = ReadInstructions(argv[1]);
  const int seeds = argc > 2 ? std::max(1, std::atoi(argv[2])) : 10;
  const auto count_of = [&](const std::string& name) {
    const auto found = counts.find(name);
    return found == counts.end() ? std::string() : std::to_string(found->second);
  };
  std::printf("| what | here | instructions here | others |\n|---|---|---|---|\n");

  for (const auto& [work, name] : {std::pair("g", "g"), std::pair("dg", "g and dg"),
                                   std::pair("ground_g", "g with two contacts"),
                                   std::pair("ground_dg", "g and dg with two contacts")}) {
    const std::string what = work;
    DynamicsCase c(what.starts_with("ground_"));
    const bool differentiate = what.ends_with("dg");
    const double seconds = Best([&] {
      c.Solve();
      if (differentiate) c.Differentiate();
    });
    Print(name, Format("%.0f ns", 1e9 * seconds), count_of(name), PeerOf(what));
  }

  constexpr double kStep = 1e-3;
  double cost = 0;
  for (const auto& [points, name] : {std::pair(12, "the same with gradient, 12 parameters"),
                                     std::pair(36, "the same with gradient, 60 parameters")}) {
    const Problem problem = HandstandProblem(points);
    const double simulated = problem.duration_s + problem.settle_s;
    const std::vector<double> x = RandomMotion(problem, 1);
    Rollout rollout(problem, kStep);
    auto gradient = OutputGradients::Of(rollout);
    const double alone = Best([&] { rollout.Run(x); });
    const double both = Best([&] { rollout.Run(x, gradient); });
    if (points == 12) {
      cost = alone / simulated;
      Print("cost of 1 s of motion, step 1 ms", Format("%.3f ms", 1e3 * cost),
            count_of("rollout of the handstand, a stage") + " a stage", PeerOf("cost"));
    }
    Print(std::string("cost and gradient of 1 s, ") + (points == 12 ? "12" : "60") + " parameters",
          Format("%.3f ms", 1e3 * both / simulated) + Format(", %.2f times cost", both / alone),
          count_of(name) + " a stage", PeerOf(points == 12 ? "gradient12" : "gradient60"));
  }
  {
    Problem problem = HandstandProblem();
    problem.joints[0].control_points = 11;
    const double simulated = problem.duration_s + problem.settle_s;
    const std::vector<double> x = RandomMotion(problem, 1);
    ForwardSensitivity forward(problem, {StepSettings::Scheme::kFixed, kStep});
    auto gradient = OutputGradients::Of(forward);
    const double both = Best([&] { forward.Run(x, gradient); });
    Print("the paper's " + std::to_string(forward.state_equations()) + " state and " +
              std::to_string(forward.gradient_equations()) + " gradient equations, 1 s",
          Format("%.3f ms", 1e3 * both / simulated) +
              Format(", %.2f times cost", both / simulated / cost),
          count_of("the paper's gradient equations, 11 parameters") + " a stage",
          PeerOf("forward11"));
  }

  PrintStepErrors(PrintMotions(seeds));
  return 0;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return tumbler::Main(argc, argv); }
