// tumbler optimize as a user meets it: its outputs, the cases in which it writes nothing,
// interrupts, and that results depend on task and seed alone.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "offline/certify/progress.h"
#include "offline/problem/task_toml.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using testing::EndlessSearch;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Program;
using testing::QuickTask;
using testing::ReadFile;
using testing::Replaced;
using testing::TaskFolder;

/// Runs the program on the folder's task.
Program Optimize(const TaskFolder& folder, std::vector<std::string> more) {
  more.insert(more.begin(), {testing::ProgramPath("tumbler optimize"), folder.task_file()});
  return Program(more);
}

/// The quick task with so many starts, all of them hard to finish, that it runs until it is
/// stopped.
std::string EndlessLocalSolves() {
  std::string text = Replaced(QuickTask(), "batch = 8\nmax_samples = 8\nrefine = 2",
                              "batch = 30\nmax_samples = 30\nrefine = 30");
  return Replaced(text, "screen_evaluations = 10\nfinalists = 2\nmax_evaluations = 25",
                  "screen_evaluations = 100000\nmax_evaluations = 100000\nrelative_tolerance = "
                  "1e-300");
}

TEST(OptimizeCli, TellsBeforeTheSearchAllThatTheDrivesOfASimulationDoNotCarry) {
  const TaskFolder folder(
      EndlessSearch() + "\n[drives]\nkp_nm_per_rad = 600\nkd_nm_s_per_rad = 6\n",
      testing::ReplacedAll(
          testing::ReplacedAll(testing::ShippedRobot(), "upper=\"2.9\"", "upper=\"13\""),
          "effort=\"8.0\"", "effort=\"20\""));
  Program program = Optimize(folder, {});
  EXPECT_TRUE(
      program.WaitFor("leg2: torque_max_nm 20 (of 18 N m), kp_nm_per_rad 600 (of 500 N "
                      "m/rad), kd_nm_s_per_rad 6 (of 5 N m s/rad)"));
  program.Signal(SIGINT);
  program.Wait();
  EXPECT_THAT(program.text(), HasSubstr("leg1: position_max_rad 13 (of 12.5 rad)"));
  EXPECT_THAT(program.text(), HasSubstr("play the motion with a drives file (--drives)"));
}

TEST(OptimizeCli, SaysNothingOfDrivesThatCarryTheTaskButHowSlowTheirLoopsMayBe) {
  const TaskFolder folder(QuickTask());
  Program program = Optimize(folder, {});
  EXPECT_EQ(program.Wait(), 0);
  EXPECT_THAT(program.text(), Not(HasSubstr("drives of a simulation")));
  EXPECT_THAT(program.text(),
              HasSubstr("damping: kd of 4 N m s/rad is stable in drives whose loop takes less "));
  EXPECT_THAT(program.text(), Not(HasSubstr("advised are loops of the drives")));
}

TEST(OptimizeCli, WarnsOfDampingThatASimulationIsTooSlowFor) {
  // Legs without rotors of so much damping need loops far above 20 kHz.
  const TaskFolder folder(QuickTask() + "\n[drives]\nkp_nm_per_rad = 200\nkd_nm_s_per_rad = 100\n");
  Program program = Optimize(folder, {});
  program.Wait();
  EXPECT_THAT(program.text(), HasSubstr("warning: advised are loops of the drives of 0.0"));
}

TEST(OptimizeCli, AdvisesStifferDrivesWhereOnlyDrivesThatGiveWayLetTheRobotFall) {
  // The shipped handstand stands with exact joints, and not with drives of a twentieth of its kp.
  const TaskFolder folder(
      Replaced(ReadFile(testing::SourcePath("primitives/tasks/nominal/handstand.toml")),
               "../../robots", "../robots") +
      "\n[drives]\nkp_nm_per_rad = 10\nkd_nm_s_per_rad = 1\n");
  Program program =
      Optimize(folder, {"--guess", testing::SourcePath("primitives/nominal/handstand.toml")});
  EXPECT_EQ(program.Wait(), 2) << program.text();
  EXPECT_THAT(program.text(),
              HasSubstr("use stiffer drives: a larger drives.kp_nm_per_rad than 10, and "
                        "drives.kd_nm_s_per_rad than 1"));
  EXPECT_THAT(program.text(), Not(HasSubstr("another --seed")));
}

TEST(OptimizeCli, FindsTheMotionOfAJointWithManyControlPoints) {
  // Such a motion is looked for with fewer, and judged with all of them.
  const testing::TemporaryFolder folder;
  Program program({testing::ProgramPath("tumbler optimize"),
                   testing::SourcePath("primitives/acrobot/tasks/swing_up.toml"), "--out",
                   folder.path() / "swing_up.toml"});
  EXPECT_EQ(program.Wait(), 0) << program.text();
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "swing_up.toml"));
}

/// Runs a program as on a processor without wide vectors and fused multiplications: the C library
/// chooses among its functions as if they were not there.
Program OnAPlainProcessor(std::vector<std::string> command) {
  command.insert(command.begin(),
                 {"/usr/bin/env", "GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX"});
  return Program(command);
}

TEST(OptimizeCli, TheSameSeedIsTheSameFileAndRunOnAProcessorWithoutAvx2AndFma) {
  const testing::TemporaryFolder folder;
  const auto optimize = [&folder](const std::string& out) {
    return std::vector<std::string>{testing::ProgramPath("tumbler optimize"),
                                    testing::SourcePath("primitives/tasks/nominal/handstand.toml"),
                                    "--quiet", "--out", folder / out};
  };
  Program here(optimize("here.toml"));
  ASSERT_EQ(here.Wait(), 0) << here.text();
  Program plain = OnAPlainProcessor(optimize("plain.toml"));
  ASSERT_EQ(plain.Wait(), 0) << plain.text();
  EXPECT_EQ(ReadFile(folder / "here.toml"), ReadFile(folder / "plain.toml"));

  const auto play = [&folder](const std::string& out) {
    return std::vector<std::string>{testing::ProgramPath("tumbler run"),
                                    "sim",
                                    folder / "here.toml",
                                    "--csv",
                                    folder / (out + ".csv"),
                                    "--truth",
                                    folder / (out + ".log")};
  };
  Program run_here(play("here"));
  ASSERT_EQ(run_here.Wait(), 0) << run_here.text();
  Program run_plain = OnAPlainProcessor(play("plain"));
  ASSERT_EQ(run_plain.Wait(), 0) << run_plain.text();
  for (const std::string end : {".csv", ".log"}) {
    const std::string of_here = ReadFile(folder / ("here" + end));
    EXPECT_GT(of_here.size(), 10'000U);
    EXPECT_TRUE(of_here == ReadFile(folder / ("plain" + end))) << end;
  }
}

TEST(OptimizeCli, WritesAPrimitiveAReportAndFiguresThatAgree) {
  const TaskFolder folder(QuickTask());
  Program program = Optimize(folder, {"--out", folder / "motion.toml", "--report", folder / "a/b",
                                      "--json", folder / "figures.json"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  const PrimitiveFile file = LoadPrimitive(folder / "motion.toml");
  EXPECT_EQ(file.provenance.task_toml, QuickTask());
  EXPECT_TRUE(std::filesystem::exists(folder / "a/b/index.html"));
  const auto figures = Json::Parse(ReadFile(folder / "figures.json")).value();
  EXPECT_EQ(figures["content_hash"], ContentHash(file));
  EXPECT_EQ(figures["seed"], 1);
  EXPECT_EQ(figures["objective"], file.provenance.objective);
  EXPECT_EQ(figures["peak_torque_nm"], file.certificate.peak_torque_nm);
  EXPECT_EQ(figures["gradient_errors"], file.certificate.gradient_errors);
  EXPECT_EQ(figures["gradient_step_halving_change"], file.certificate.gradient_step_halving_change);
  EXPECT_THAT(file.certificate.gradient_errors,
              ::testing::Contains(figures["gradient_error"].number()));
  // The page has the same.
  const std::string page = ReadFile(folder / "a/b/index.html");
  const std::string begin = "<script type=\"application/json\" id=\"data\">";
  const std::size_t at = page.find(begin) + begin.size();
  const auto shown = Json::Parse(page.substr(at, page.find("</script>", at) - at)).value();
  EXPECT_EQ(shown["evaluation_count"], figures["evaluations"]);
  EXPECT_EQ(shown["peak_torque"]["torque_nm"], figures["peak_torque_nm"]);
  EXPECT_EQ(shown["settle_s"], 0.1);
  EXPECT_EQ(folder.Listing(),
            (std::set<std::string>{"a", "a/b", "a/b/index.html", "figures.json", "motion.toml",
                                   "robots", "robots/tumbler.urdf", "tasks", "tasks/task.toml"}));
}

TEST(OptimizeCli, ADurationThatIsFoundIsInThePrimitiveItsFiguresAndThePage) {
  const TaskFolder folder(Replaced(QuickTask(), "duration_s = 0.5",
                                   "duration_s = 0.5\nduration_min_s = 0.4\nduration_max_s = 0.8"));
  Program program = Optimize(folder, {"--out", folder / "motion.toml", "--report", folder / "page",
                                      "--json", folder / "figures.json", "--quiet"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  const PrimitiveFile file = LoadPrimitive(folder / "motion.toml");
  const double duration_s = file.primitive.duration_s;
  EXPECT_GE(duration_s, 0.4);
  EXPECT_LE(duration_s, 0.8);
  EXPECT_NE(duration_s, 0.5) << "it was not looked for";
  EXPECT_EQ(TaskOf(file).problem.duration_s, duration_s);
  EXPECT_EQ(file.primitive.joints[0].position.end_s(), duration_s);
  const std::string said = fmt::format("{:.6g} s, found between 0.4 and 0.8", duration_s);
  EXPECT_THAT(program.text(), HasSubstr("duration " + said));
  EXPECT_THAT(ReadFile(folder / "page/index.html"), HasSubstr(said));
  EXPECT_EQ(Json::Parse(ReadFile(folder / "figures.json")).value()["duration_s"], duration_s);
  // The same task may begin with it.
  Program again =
      Optimize(folder, {"--guess", folder / "motion.toml", "--out", folder / "again.toml"});
  ASSERT_EQ(again.Wait(), 0) << again.text();
  EXPECT_NEAR(LoadPrimitive(folder / "again.toml").primitive.duration_s, duration_s,
              0.1 * duration_s);
}

TEST(OptimizeProgress, CountsNoStartBeyondThoseThatArePlannedAndPromisesNoTimeForIt) {
  Problem problem;
  problem.search.refine = 4;
  ::testing::internal::CaptureStderr();
  Progress progress(problem);
  progress({true, 0, 1, 0.5, 0});
  progress({false, 0, 1, 0.5, 1});
  progress({true, 0, 2, 0.5, 0});  // back to the search, for further candidates
  progress({false, 5, 1, 0.25, 0});
  EXPECT_EQ(::testing::internal::GetCapturedStderr(),
            fmt::format("search       1/{} evaluations  best rank 0.5\n"
                        "solve   start 1 of 4  evaluation    1  cost 0.5  violation 1.0e+00\n"
                        "solve   start 6, in place of another  evaluation    1  cost 0.25  "
                        "violation 0.0e+00\n",
                        problem.search.max_samples));
}

TEST(OptimizeCli, AContactTooStiffForAFixedStepHasARightGradient) {
  // Friction with this little creep is too stiff for a step of 1 ms. The solver's steps are
  // shorter.
  const TaskFolder folder(Replaced(QuickTask(), "v_max_m_per_s = 0.05", "v_max_m_per_s = 1.0e-4"));
  Program program = Optimize(folder, {"--out", folder / "motion.toml"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  EXPECT_THAT(program.text(), Not(HasSubstr("warning: gradient")));
  const Certificate certificate = LoadPrimitive(folder / "motion.toml").certificate;
  EXPECT_LT(certificate.gradient_error, 1e-3);
  EXPECT_LT(certificate.gradient_step_halving_change, 0.01);
}

TEST(OptimizeCli, AMotionThatMissesWhatItsCostAsksForIsNotWritten) {
  // The legs end almost where they start, so that the robot cannot stay upright.
  const TaskFolder folder(Replaced(QuickTask(), "target = 0.0", "target = 1.5"));
  Program program =
      Optimize(folder, {"--out", folder / "motion.toml", "--json", folder / "figures.json"});
  ASSERT_EQ(program.Wait(), 2) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("shows that it is not what the task asks for: "));
  EXPECT_THAT(program.text(), HasSubstr("pitch, settled: asked 1.5, got "));
  EXPECT_THAT(program.text(), HasSubstr("pitch, 2 s later: asked 1.5, got "));
  EXPECT_FALSE(std::filesystem::exists(folder / "motion.toml"));
  EXPECT_FALSE(std::filesystem::exists(folder / "figures.json"));
}

TEST(OptimizeCli, TargetsAndResultsStandBesideEachOtherOnTerminalAndPageAndInJson) {
  const TaskFolder folder(Replaced(QuickTask(), "target = 0.0", "target = 0.0\ntolerance = 0.04"));
  Program program = Optimize(folder, {"--json", folder / "figures.json", "--report",
                                      folder / "page", "--out", folder / "motion.toml"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("pitch, settled: asked 0, got "));
  const std::vector<PurposeFigure> purpose = LoadPrimitive(folder / "motion.toml").purpose;
  ASSERT_EQ(purpose.size(), 4U);
  EXPECT_THAT(
      ReadFile(folder / "page/index.html"),
      HasSubstr("[\"pitch, settled\",\"" + purpose[0].AskedAndGot(purpose[0].result) + "\"]"));
  EXPECT_THAT(program.text(), HasSubstr("(within 0.04)"));
  const auto figures = Json::Parse(ReadFile(folder / "figures.json")).value();
  EXPECT_EQ(figures["second_look"]["purpose"][0]["of"], "pitch, settled");
  EXPECT_EQ(figures["second_look"]["purpose"][0]["tolerance"], 0.04);
  EXPECT_EQ(figures["second_look"]["purpose"][0]["met"], true);
}

TEST(OptimizeCli, WithoutOutputOptionsItWritesNothing) {
  const TaskFolder folder(QuickTask());
  const auto before = folder.Listing();
  Program program = Optimize(folder, {"--json", "-"});
  EXPECT_EQ(program.Wait(), 0) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("\"content_hash\""));
  EXPECT_EQ(folder.Listing(), before);
}

TEST(OptimizeCli, OfATaskWithoutATargetOfThePitchNothingSpeaksOfThatTarget) {
  const TaskFolder folder(Replaced(QuickTask(), "of = \"pitch\"", "of = \"x\"\ntolerance = 10.0"));
  Program program =
      Optimize(folder, {"--json", folder / "figures.json", "--report", folder / "page"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("x, settled: asked 0, got "));
  EXPECT_THAT(program.text(), Not(HasSubstr("pitch at the end")));
  EXPECT_THAT(ReadFile(folder / "figures.json"), Not(HasSubstr("settled_error_rad")));
  EXPECT_THAT(ReadFile(folder / "page/index.html"), Not(HasSubstr("pitch 2 s after the end")));
}

/// The control points of all paths.
std::vector<double> PathsOf(const PrimitiveFile& file) {
  std::vector<double> points;
  for (const auto& motion : file.primitive.motions()) {
    for (const auto* spline : {&motion.position, &motion.torque}) {
      const auto of_spline = spline->control_points();
      points.insert(points.end(), of_spline.begin(), of_spline.end());
    }
  }
  return points;
}

TEST(OptimizeCli, TheResultDependsOnTaskAndSeedAlone) {
  const TaskFolder folder(QuickTask());
  const auto run = [&folder](const std::string& name, const std::string& seed,
                             const std::string& threads) {
    Program program = Optimize(folder, {"--out", folder / (name + ".toml"), "--report",
                                        folder / name, "--seed", seed, "--threads", threads});
    EXPECT_EQ(program.Wait(), 0) << program.text();
    return std::pair(ReadFile(folder / (name + ".toml")),
                     ReadFile(folder / (name + "/index.html")));
  };
  const auto first = run("first", "1", "1");
  for (const auto& [name, threads] : {std::pair("again", "1"), std::pair("threads", "2"),
                                      std::pair("threads_again", "2"), std::pair("many", "7")}) {
    const auto other = run(name, "1", threads);
    EXPECT_EQ(other.first, first.first) << name;
    EXPECT_EQ(other.second, first.second) << name;
  }
  const auto seeded = run("seed2", "2", "1");
  EXPECT_NE(seeded.first, first.first);
  EXPECT_NE(PathsOf(ParsePrimitive(seeded.first, "")), PathsOf(ParsePrimitive(first.first, "")));
}

TEST(OptimizeCli, ARightAngleOfFewDigitsIsNotedAndGivesTheSameMotion) {
  const TaskFolder exact(QuickTask());
  const TaskFolder rounded(
      QuickTask(), Replaced(testing::ShippedRobot(), "0 1.5707963267948966 0", "0 1.5708 0"));
  Program of_exact = Optimize(exact, {"--out", exact / "motion.toml"});
  ASSERT_EQ(of_exact.Wait(), 0) << of_exact.text();
  EXPECT_THAT(of_exact.text(), Not(HasSubstr("is taken as")));
  Program of_rounded = Optimize(rounded, {"--out", rounded / "motion.toml"});
  ASSERT_EQ(of_rounded.Wait(), 0) << of_rounded.text();
  EXPECT_THAT(of_rounded.text(),
              HasSubstr("tumbler.urdf:18: link 'middle': note: origin rpy 1.5708 "
                        "is taken as pi/2"));
  EXPECT_EQ(PathsOf(LoadPrimitive(exact / "motion.toml")),
            PathsOf(LoadPrimitive(rounded / "motion.toml")));
}

TEST(OptimizeCli, AMotionThatConvergedOnlyWithItsOwnStepsIsNotSaidToHaveConverged) {
  const std::string shipped =
      ReadFile(testing::SourcePath("primitives/tasks/nominal/handstand.toml"));
  // With steps as coarse as these, the residual is below 1e-4, and with finer ones ten times that.
  const TaskFolder folder(Replaced(Replaced(shipped, "../../robots", "../robots"),
                                   "tolerance = 1.0e-8", "tolerance = 1.0e-4"));
  // (A proof would go on until these confirm it.)
  Program program =
      Optimize(folder, {"--out", folder / "motion.toml", "--json", folder / "figures.json"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("; converged, but not by finer steps\n"));
  const auto figures = Json::Parse(ReadFile(folder / "figures.json")).value();
  EXPECT_EQ(figures["end"], "converged, but not by finer steps");
  EXPECT_LE(figures["kkt"]["relative"].number(), 1e-4);
  EXPECT_GT(figures["kkt_residual"].number(), 1e-4);
}

TEST(OptimizeCli, SeedOnTheCommandLineReplacesTheTasks) {
  const TaskFolder of_task(Replaced(QuickTask(), "seed = 1", "seed = 5"));
  Program by_task = Optimize(of_task, {"--out", of_task / "motion.toml"});
  ASSERT_EQ(by_task.Wait(), 0);
  const TaskFolder of_option(QuickTask());
  Program by_option = Optimize(of_option, {"--out", of_option / "motion.toml", "--seed", "5"});
  ASSERT_EQ(by_option.Wait(), 0);
  const PrimitiveFile a = LoadPrimitive(of_task / "motion.toml");
  const PrimitiveFile b = LoadPrimitive(of_option / "motion.toml");
  EXPECT_EQ(PathsOf(a), PathsOf(b));
  EXPECT_EQ(b.provenance.seed, 5U);
}

TEST(OptimizeCli, TheWindowThatIsAskedForIsInThePrimitiveAndOnThePage) {
  const testing::TemporaryFolder folder;
  Program program({testing::ProgramPath("tumbler optimize"),
                   testing::SourcePath("primitives/tasks/nominal/handstand.toml"), "--quiet",
                   "--window", "--threads", "2", "--out", folder / "motion.toml", "--report",
                   folder / "page"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("handstand: the model is as asked on ground with\n"));
  const PrimitiveFile file = LoadPrimitive(folder / "motion.toml");
  ASSERT_TRUE(file.window);
  const double mu = TaskOf(file).problem.contact().mu;
  EXPECT_LT(file.window->mu[0], mu);
  EXPECT_GT(file.window->mu[1], mu);
  const std::string page = ReadFile(folder / "page/index.html");
  EXPECT_THAT(page,
              HasSubstr(fmt::format(R"("friction","{}","{}",)", GroundValueText(file.window->mu[0]),
                                    GroundValueText(file.window->mu[1]))));
  EXPECT_THAT(page, Not(HasSubstr("was not looked for")));
}

TEST(OptimizeCli, AMotionOfWhichNoWindowIsFoundIsWrittenAllTheSameAndItsPageSaysWhy) {
  // From which no factors lead anywhere.
  const TaskFolder folder(Replaced(QuickTask(), "mu = 0.3", "mu = 0.0"));
  const auto optimize = [&folder](std::vector<std::string> more) {
    more.insert(more.end(), {"--out", folder / "motion.toml", "--report", folder / "page"});
    Program program = Optimize(folder, more);
    const int status = program.Wait();
    EXPECT_FALSE(LoadPrimitive(folder / "motion.toml").window) << program.text();
    return status;
  };
  EXPECT_EQ(optimize({"--window"}), 4);
  EXPECT_THAT(ReadFile(folder / "page/index.html"),
              HasSubstr("no window was found: the friction of its task's ground is 0"));
  EXPECT_EQ(optimize({}), 0);
  EXPECT_THAT(ReadFile(folder / "page/index.html"),
              HasSubstr("The window was not looked for: tumbler robustness --window FILE."));
}

TEST(OptimizeCli, AWindowIsOfTheGroundOfARobotInThePlane) {
  const std::pair<const char*, const char*> kTasks[] = {
      {"primitives/acrobot/tasks/swing_up.toml", "no ground"},
      {"primitives/solo12/tasks/turn.toml", "one in space"}};
  for (const auto& [task, why] : kTasks) {
    Program program(
        {testing::ProgramPath("tumbler optimize"), testing::SourcePath(task), "--window"});
    EXPECT_EQ(program.Wait(), 1) << task;
    EXPECT_THAT(program.text(), HasSubstr("--window: is of the ground"));
    EXPECT_THAT(program.text(), HasSubstr(why));
  }
}

TEST(OptimizeCli, WrongCommandLinesAreRefused) {
  const TaskFolder folder(QuickTask());
  const auto before = folder.Listing();
  const std::string out = folder / "motion.toml";
  const struct {
    std::vector<std::string> arguments;
    std::string says;
  } kCases[] = {
      {{"--threads", "0"}, "--threads: Value 0 not in range"},
      {{"--threads", "-1"}, "--threads: Value -1 not in range"},
      {{"--seed", "-1"}, "--seed: is '-1'; allowed: from 0 ..."},
      {{"--seed", "1.5"}, "--seed: is '1.5'; allowed"},
      {{"--seed", "9223372036854775808"}, "--seed: is '9223372036854775808'; allowed"},
      {{"--out", ""}, "--out: is empty"},
      {{"--minima", "0"}, "--minima: Value 0 not in range"},
      {{folder.task_file()}, "tasks that are ranked need different names"},
      {{"--nonsense"}, "--nonsense"},
      {{"--out", out, "--json", out}, "is named for two results"},
      {{"--out", folder / "x/index.html", "--report", folder / "x"}, "is named for two results"},
      {{"--out", folder.task_file()}, "task.toml: is an input"},
      {{"--json", folder.robot_file()}, "tumbler.urdf: is an input"},
  };
  for (const auto& c : kCases) {
    Program program = Optimize(folder, c.arguments);
    EXPECT_EQ(program.Wait(), 1) << c.says;
    EXPECT_THAT(program.text(), HasSubstr(c.says));
  }
  Program nothing({testing::ProgramPath("tumbler optimize")});
  EXPECT_EQ(nothing.Wait(), 1);
  EXPECT_EQ(folder.Listing(), before);
}

// Permission bits do not bind the super-user, so these are places where nobody can write.
TEST(OptimizeCli, ATaskThatTakesSomethingOfAGuessNeedsOne) {
  const std::string task =
      ReadFile(testing::SourcePath("primitives/tasks/handstand_sensor_mirrored.toml"));
  for (const std::string key : {"robust.feedback.from_guess", "mirror"}) {
    const TaskFolder folder(key == "mirror" ? Replaced(task, "from_guess = true", "") : task);
    Program program = Optimize(folder, {"--out", folder / "m.toml"});
    EXPECT_EQ(program.Wait(), 1);
    EXPECT_THAT(program.text(),
                HasSubstr(key + ": is for a task with a guess; name a primitive with --guess"));
    EXPECT_FALSE(std::filesystem::exists(folder / "m.toml"));
  }
}

TEST(OptimizeCli, AMotionWithoutTheFeedbackThatTheTaskAsksForIsNotWritten) {
  // Beyond a limit by less than counts as a violation, but by more than a file's digits.
  const std::string task =
      Replaced(ReadFile(testing::SourcePath("primitives/tasks/handstand_sensor.toml")), "[limits]",
               "[limits.leg2]\nposition_max_rad = 2.69896590\n[limits]");
  const TaskFolder folder(task);
  Program program = Optimize(folder, {"--guess", testing::SourcePath("primitives/handstand.toml"),
                                      "--out", folder / "m.toml"});
  EXPECT_EQ(program.Wait(), 2);
  EXPECT_THAT(program.text(),
              HasSubstr("the guess, whose path is taken as it is, exceeds a limit"));
  EXPECT_FALSE(std::filesystem::exists(folder / "m.toml"));
}

TEST(OptimizeCli, StandardOutputIsNoFolderForPages) {
  const TaskFolder folder(EndlessSearch());
  const auto before = folder.Listing();
  Program program = Optimize(folder, {"--report", "-"});
  EXPECT_EQ(program.Wait(), 1);
  EXPECT_THAT(program.text(), HasSubstr("tumbler optimize: -: a page cannot be written to standard "
                                        "output; './-' is a folder"));
  EXPECT_FALSE(std::filesystem::exists("-"));
  EXPECT_EQ(folder.Listing(), before);
}

TEST(OptimizeCli, OutputThatCannotBeWrittenIsFoundBeforeTheWork) {
  const TaskFolder folder(EndlessSearch());
  testing::WriteFile(folder / "file", "keep me");
  const auto before = folder.Listing();
  const std::string below_a_file = folder / "file/motion.toml";
  const std::string in_no_folder = "/proc/absent/motion.toml";
  const std::string in_proc = "/proc/tumbler_motion.toml";
  for (const char* option : {"--out", "--json"}) {
    for (const std::string& path : {below_a_file, in_no_folder, in_proc,
                                    std::string(folder / "tasks"), std::string("/dev/full")}) {
      Program program = Optimize(folder, {option, path});
      EXPECT_EQ(program.Wait(), 1) << path;
      EXPECT_THAT(program.text(), HasSubstr("tumbler optimize: " + path + ": "));
      EXPECT_THAT(program.text(), Not(HasSubstr("search "))) << "the work had begun";
    }
  }
  for (const std::string& path : {std::string(folder / "file"), std::string(folder / "file/report"),
                                  std::string("/proc/report")}) {
    Program program = Optimize(folder, {"--report", path});
    EXPECT_EQ(program.Wait(), 1) << path;
    EXPECT_THAT(program.text(), HasSubstr("tumbler optimize: " + path + ": "));
    EXPECT_THAT(program.text(), Not(HasSubstr("search ")));
  }
  EXPECT_EQ(folder.Listing(), before);
  EXPECT_EQ(ReadFile(folder / "file"), "keep me");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(OptimizeCli, SaysNothingWhileItWorksWhenItIsToBeQuiet) {
  const TaskFolder folder(QuickTask());
  Program told = Optimize(folder, {"--out", folder / "a.toml"});
  EXPECT_EQ(told.Wait(), 0);
  EXPECT_THAT(told.text(), HasSubstr("search "));
  EXPECT_THAT(told.text(), Not(HasSubstr("at most -")));
  Program quiet = Optimize(folder, {"--out", folder / "b.toml", "--quiet"});
  EXPECT_EQ(quiet.Wait(), 0);
  EXPECT_THAT(quiet.text(), Not(HasSubstr("search ")));
  EXPECT_THAT(quiet.text(), Not(HasSubstr("solve ")));
  EXPECT_THAT(quiet.text(), HasSubstr("  primitive "));
  EXPECT_EQ(ReadFile(folder / "a.toml"), ReadFile(folder / "b.toml"));
}

TEST(OptimizeCli, ReplacesTheFileBehindASymbolicLinkAndKeepsTheLink) {
  const TaskFolder folder(QuickTask());
  testing::WriteFile(folder / "real.toml", "old");
  std::filesystem::create_symlink(folder / "real.toml", folder / "link.toml");
  Program program = Optimize(folder, {"--out", folder / "link.toml"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.toml"));
  EXPECT_EQ(LoadPrimitive(folder / "real.toml").primitive.name.view(), "handstand");
}

TEST(OptimizeCli, FailureOfOneOutputLeavesNoOther) {
  const TaskFolder folder(QuickTask());
  // A folder has the name of the page, which shows only when the page is renamed.
  std::filesystem::create_directories(folder / "report/index.html/x");
  const auto before = folder.Listing();
  Program program = Optimize(folder, {"--out", folder / "motion.toml", "--json",
                                      folder / "figures.json", "--report", folder / "report"});
  EXPECT_EQ(program.Wait(), 1) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("index.html"));
  EXPECT_EQ(folder.Listing(), before);
}

TEST(OptimizeCli, AnEndThatNoSpeedLimitAllowsIsRefusedByTheLimitsName) {
  // From home to the handstand are 1.57 rad. In 0.06 s at 20 rad/s only 1.2 rad are possible.
  const TaskFolder folder(
      Replaced(testing::LongHandstandTask(), "duration_s = 1.2", "duration_s = 0.06"));
  const auto before = folder.Listing();
  Program program = Optimize(folder, {"--out", folder / "motion.toml"});
  EXPECT_EQ(program.Wait(), 2) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("no motion was found: the best motion exceeds a limit: "));
  EXPECT_THAT(program.text(), ::testing::ContainsRegex("(velocity|acceleration) of leg[12] by"));
  EXPECT_THAT(program.text(), HasSubstr("duration_s"));
  EXPECT_THAT(program.text(), HasSubstr("no file was written"));
  EXPECT_EQ(folder.Listing(), before);
}

/// The quick task under another name.
std::string Named(const std::string& name, const std::string& task = QuickTask()) {
  return Replaced(task, "name = \"handstand\"", "name = \"" + name + "\"");
}

TEST(OptimizeCliSeveral, TasksAreRankedFeasibleFirstAndThenByCost) {
  const TaskFolder folder(
      Named("far", Replaced(QuickTask(), "target = 0.0", "target = 0.4\ntolerance = 1.0")));
  testing::WriteFile(folder / "tasks/hopeless.toml",
                     Named("hopeless", Replaced(testing::LongHandstandTask(), "duration_s = 1.2",
                                                "duration_s = 0.06")));
  testing::WriteFile(folder / "tasks/near.toml", Named("near"));
  Program program = Optimize(folder, {folder / "tasks/hopeless.toml", folder / "tasks/near.toml",
                                      "--out", folder / "found", "--json", folder / "all.json"});
  EXPECT_EQ(program.Wait(), 2) << "not every task has a motion\n" << program.text();
  const auto ranking = Json::Parse(ReadFile(folder / "all.json")).value()["ranking"];
  ASSERT_EQ(ranking.size(), 3U);
  EXPECT_EQ(ranking[0]["name"], "near");
  EXPECT_EQ(ranking[1]["name"], "far");
  EXPECT_EQ(ranking[2]["name"], "hopeless");
  EXPECT_LT(ranking[0]["objective"].number(), ranking[1]["objective"].number());
  EXPECT_EQ(ranking[2]["found"], false);
  EXPECT_THAT(ranking[2]["cause"].text(), HasSubstr("of leg"));
  for (const char* name : {"near", "far"}) {
    const PrimitiveFile file = LoadPrimitive(folder / ("found/" + std::string(name) + ".toml"));
    EXPECT_EQ(file.primitive.name.view(), name);
    const auto& entry = ranking[name == std::string("near") ? 0 : 1];
    EXPECT_EQ(entry["content_hash"], ContentHash(file));
    EXPECT_EQ(entry["peak_torque_nm"], file.certificate.peak_torque_nm);
    EXPECT_EQ(entry["settled_error_rad"], std::abs(file.certificate.settled_pitch_error_rad));
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "found/hopeless.toml"));
  const std::string& text = program.text();
  const std::size_t table = text.rfind("rank  task");
  ASSERT_NE(table, std::string::npos) << text;
  EXPECT_LT(text.find("1  near", table), text.find("2  far", table));
  EXPECT_LT(text.find("2  far", table), text.find("3  hopeless", table));
}

TEST(OptimizeCliSeveral, WhatIsWrongWithOneIsFoundBeforeTheWorkOnAny) {
  const TaskFolder folder(Named("good", EndlessSearch()));
  testing::WriteFile(folder / "tasks/bad.toml",
                     Named("bad", Replaced(QuickTask(), "mu = 0.3", "mu = -0.3")));
  testing::WriteFile(folder / "tasks/twin.toml", Named("good"));
  testing::WriteFile(folder / "tasks/up.toml", Named("../up"));
  testing::WriteFile(folder / "tasks/other.toml", Named("other"));
  testing::WriteFile(folder / "file", "keep me");
  const auto before = folder.Listing();
  const std::string other = folder / "tasks/other.toml", out = folder / "found";
  const struct {
    std::vector<std::string> arguments;
    std::string says;
  } kCases[] = {
      {{folder / "tasks/bad.toml", "--out", out}, "bad.toml:"},
      {{folder / "tasks/twin.toml", "--out", out}, "is 'good', like that of "},
      {{folder / "tasks/up.toml", "--out", out}, "is '../up', which cannot name a file"},
      {{other, "--out", folder / "file"}, "is not a folder"},
      {{other, "--out", folder / "tasks"}, "other.toml: is an input"},
      {{other, "--start-from", other}, "--start-from: is for one task"},
  };
  for (const auto& c : kCases) {
    Program program = Optimize(folder, c.arguments);
    EXPECT_EQ(program.Wait(), 1) << c.says;
    EXPECT_THAT(program.text(), HasSubstr(c.says));
    EXPECT_THAT(program.text(), Not(HasSubstr("search "))) << "the work had begun";
    EXPECT_EQ(folder.Listing(), before);
  }
}

TEST(OptimizeCliSeveral, ResultsRankingAndMinimaAreTheSameForAnyNumberOfThreads) {
  // A coarse tolerance, so that local solves converge soon.
  const std::string quick =
      Replaced(QuickTask(), "[solver]", "[solver]\nrelative_tolerance = 1e-3");
  const TaskFolder folder(
      Named("far", Replaced(quick, "target = 0.0", "target = 0.4\ntolerance = 1.0")));
  testing::WriteFile(folder / "tasks/near.toml", Named("near", quick));
  const auto run = [&folder](const std::string& threads) {
    const std::string out = folder / ("of" + threads);
    Program program = Optimize(folder, {folder / "tasks/near.toml", "--minima", "3", "--out", out,
                                        "--json", out + ".json", "--threads", threads});
    EXPECT_EQ(program.Wait(), 0) << program.text();
    auto figures = Json::Parse(ReadFile(out + ".json")).value();
    Json& ranking = figures["ranking"];
    for (std::size_t i = 0; i < ranking.size(); ++i) {
      Json& entry = ranking[i];
      EXPECT_GE(entry["minima"].size(), 1U);
      std::size_t starts = 0;
      for (const Json& minimum : entry["minima"].elements()) starts += minimum["starts"].size();
      EXPECT_GE(starts, 3U) << "so many starts are solved to the end";
      EXPECT_EQ(entry["minima"][0]["objective"], entry["objective"]);
      entry["wall_s"] = entry["cpu_s"] = entry["look_cpu_s"] = nullptr;
    }
    const std::size_t table = program.text().find(" starts solved to the end led to ");
    EXPECT_NE(table, std::string::npos) << program.text();
    const std::size_t end = program.text().find("objective", table);
    return std::vector<std::string>{ReadFile(out + "/far.toml"), ReadFile(out + "/near.toml"),
                                    figures.Dump(2), program.text().substr(table, end - table)};
  };
  const std::vector<std::string> one = run("1");
  EXPECT_EQ(run("2"), one);
  EXPECT_EQ(run("4"), one);
}

TEST(OptimizeCli, ARobotThatTouchesNothingIsReported) {
  std::string task =
      Replaced(QuickTask(), "pitch_rad = 0.0", "pitch_rad = 0.0\nz_m = 0.0", "[start]");
  task = Replaced(task, "point_m = [0.0, 0.0]", "point_m = [0.0, -500.0]");
  const TaskFolder folder(task);
  const auto before = folder.Listing();
  Program program = Optimize(folder, {"--out", folder / "motion.toml", "--keep-best"});
  EXPECT_EQ(program.Wait(), 2) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("no contact was ever active"));
  EXPECT_THAT(program.text(), HasSubstr("start.z_m"));
  EXPECT_EQ(folder.Listing(), before);
}

TEST(OptimizeCli, ARobotOnABarMayPassBesideAnObstacle) {
  const std::string robot =
      Replaced(testing::ReadFile(testing::SourcePath("primitives/acrobot/acrobot.urdf")), "</link>",
               "<collision><geometry><sphere radius=\"0.02\"/></geometry></collision></link>");
  const TaskFolder folder(
      "format = \"tumbler-task\"\nversion = 1\nname = \"swing\"\n"
      "robot = \"../robots/tumbler.urdf\"\nroot = \"hinge-y\"\nduration_s = 1.0\n"
      "settle_s = 0.1\n[start]\nz_m = 1.2\njoints_rad = { waist = 0.0 }\n"
      "[end]\njoints_rad = { waist = 0.5 }\n[limits]\nacceleration_max_rad_s2 = 300.0\n"
      "[[cost]]\nterm = \"terminal\"\nof = \"pitch\"\nwhen = \"settled\"\ntarget = 0.5\n"
      "tolerance = 0.3\nweight = 10.0\n[[cost]]\nterm = \"effort\"\nweight = 1.0e-3\n"
      "[[obstacle]]\nname = \"floor\"\nkind = \"half-space\"\npoint_m = [0.0, 0.0]\n"
      "normal = [0.0, 1.0]\n",
      robot);
  Program program = Optimize(folder, {"--out", folder / "motion.toml"});
  EXPECT_EQ(program.Wait(), 0) << program.text();
  EXPECT_THAT(program.text(), Not(HasSubstr("no contact was ever active")));
}

TEST(OptimizeCli, AFlightWithoutObstaclesIsAMotionLikeAnyOther) {
  std::string task =
      Replaced(QuickTask(), "pitch_rad = 0.0", "pitch_rad = 0.0\nz_m = 5.0", "[start]");
  const std::size_t from = task.find("[[obstacle]]");
  task.erase(from, task.find("[search]") - from);
  const TaskFolder folder("obstacle = []\n" + task);
  Program program = Optimize(folder, {"--out", folder / "motion.toml"});
  ASSERT_EQ(program.Wait(), 0) << program.text();
  EXPECT_TRUE(LoadPrimitive(folder / "motion.toml").contacts.empty());
}

TEST(OptimizeCliInterrupt, DuringTheSearchNothingIsKept) {
  const TaskFolder folder(EndlessSearch());
  const auto before = folder.Listing();
  for (const char* threads : {"1", "2"}) {
    Program program = Optimize(folder, {"--out", folder / "motion.toml", "--threads", threads});
    ASSERT_TRUE(program.WaitFor("search ")) << program.text();
    program.Signal(SIGINT);
    EXPECT_EQ(program.Wait(), 130) << program.text();
    EXPECT_THAT(program.text(), HasSubstr("interrupted: "));
    EXPECT_THAT(program.text(), HasSubstr("no file was written"));
    EXPECT_EQ(folder.Listing(), before);
  }
}

TEST(OptimizeCliInterrupt, DuringTheLocalSolvesNothingIsKeptUnlessAskedFor) {
  const TaskFolder folder(EndlessLocalSolves());
  const auto before = folder.Listing();
  Program program =
      Optimize(folder, {"--report", folder / "report", "--json", folder / "figures.json"});
  ASSERT_TRUE(program.WaitFor("solve ")) << program.text();
  program.Signal(SIGINT);
  EXPECT_EQ(program.Wait(), 130) << program.text();
  EXPECT_THAT(program.text(),
              HasSubstr("interrupted: what was found so far is dropped (--keep-best keeps a "
                        "motion that is as asked); no file was written"));
  EXPECT_EQ(folder.Listing(), before);
}

TEST(OptimizeCliInterrupt, AMotionThatIsAsAskedIsThereWhileAProofIsLookedForAndStaysThere) {
  const TaskFolder folder(EndlessLocalSolves());
  const std::string out = folder / "motion.toml";
  Program program = Optimize(folder, {"--out", out, "--json", folder / "figures.json", "--prove"});
  ASSERT_TRUE(program.WaitFor("interim: objective ")) << program.text();
  const PrimitiveFile meanwhile = LoadPrimitive(out);
  EXPECT_EQ(meanwhile.certificate.constraint_violation, 0);
  EXPECT_TRUE(meanwhile.certificate.kkt_residual.has_value());
  for (const PurposeFigure& figure : meanwhile.purpose) EXPECT_TRUE(figure.met()) << figure.name();
  program.Signal(SIGINT);
  EXPECT_EQ(program.Wait(), 130) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("the interim motion in " + out + " stands"));
  EXPECT_LE(LoadPrimitive(out).provenance.objective, meanwhile.provenance.objective);
  EXPECT_FALSE(std::filesystem::exists(folder / "figures.json"));
}

TEST(OptimizeCliInterrupt, KeepBestWritesAWholePrimitiveWhicheverSignalEndsIt) {
  const TaskFolder folder(EndlessLocalSolves());
  for (const auto& [threads, signal] : {std::pair{"1", SIGINT}, {"2", SIGTERM}, {"3", SIGHUP}}) {
    const std::string out = folder / ("motion" + std::string(threads) + ".toml");
    Program program = Optimize(folder, {"--out", out, "--keep-best", "--threads", threads});
    ASSERT_TRUE(program.WaitFor("violation 0.0e+00")) << program.text();
    program.Signal(signal);
    EXPECT_EQ(program.Wait(), 130) << program.text();
    EXPECT_THAT(program.text(), HasSubstr("interrupted: the best motion so far is kept"));
    EXPECT_THAT(program.text(), HasSubstr("primitive " + out));
    const PrimitiveFile file = LoadPrimitive(out);
    EXPECT_EQ(file.certificate.constraint_violation, 0);
    EXPECT_GT(file.certificate.torque_margin_nm, 0);
  }
}

TEST(OptimizeCliInterrupt, KeepBestWritesAWholePrimitiveWhenItsTerminalGoes) {
  const TaskFolder folder(EndlessLocalSolves());
  const std::string out = folder / "motion.toml", task = folder.task_file();
  const std::string program = testing::ProgramPath("tumbler");
  int terminal = -1;
  const pid_t child = forkpty(&terminal, nullptr, nullptr, nullptr);
  ASSERT_GE(child, 0);
  if (child == 0) {
    execl(program.c_str(), program.c_str(), "optimize", task.c_str(), "--out", out.c_str(),
          "--keep-best", nullptr);
    _exit(127);
  }
  std::string text;
  std::array<char, 4096> buffer{};
  while (text.find("violation 0.0e+00") == std::string::npos) {
    const ssize_t count = read(terminal, buffer.data(), buffer.size());
    ASSERT_GT(count, 0) << text;
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
  close(terminal);  // The kernel tells the program.
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 130) << status << text;
  EXPECT_EQ(LoadPrimitive(out).certificate.constraint_violation, 0);
}

TEST(OptimizeCliInterrupt, KeepBestDuringTheSearchEndsWithoutACrash) {
  const TaskFolder folder(Replaced(testing::LongHandstandTask(), "seed = 1",
                                   "seed = 1\nbatch = 1000000\nmax_samples = 1000000"));
  for (const char* threads : {"1", "2"}) {
    const std::string out = folder / ("motion" + std::string(threads) + ".toml");
    Program program = Optimize(folder, {"--out", out, "--keep-best", "--threads", threads});
    ASSERT_TRUE(program.WaitFor("search ")) << program.text();
    program.Signal(SIGINT);
    EXPECT_EQ(program.Wait(), 130) << program.text();
    if (std::filesystem::exists(out)) {
      EXPECT_EQ(LoadPrimitive(out).certificate.constraint_violation, 0);
      EXPECT_THAT(program.text(), HasSubstr("is kept"));
    } else {
      EXPECT_THAT(program.text(), HasSubstr("interrupted: no motion was found so far: "));
      EXPECT_THAT(program.text(), HasSubstr("; no file was written"));
    }
  }
}

}  // namespace
}  // namespace tumbler
