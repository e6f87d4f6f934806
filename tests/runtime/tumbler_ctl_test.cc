// tumbler ctl with a tumbler run at the pace of the clock. They talk by UDP multicast inside a
// network namespace of the test's own (CMakeLists.txt).

#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <pty.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <lcm/lcm-cpp.hpp>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <tumbler/command_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>
#include <vector>

#include "common/files/json.h"
#include "runtime/record/channels.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/steady_time.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::Outcome;
using testing::Program;
using testing::ReadFile;
using testing::Replaced;
using testing::ReplacedAll;
using testing::WriteFile;

constexpr const char* kUrl = "udpm://239.255.76.67:7667?ttl=0";
const std::string kGait = testing::SourcePath("primitives/nominal/gait.toml");

Outcome Ctl(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "tumbler ctl");
  arguments.insert(arguments.end(), {"--lcm-url", kUrl});
  return testing::RunProgram(arguments);
}

std::string State() {
  const Outcome status = Ctl({"status", "--json"});
  if (status.text.empty() || status.text[0] != '{') return status.text;
  return Json::Parse(status.text).value()["state"].text();
}

/// Expects a request to be carried out.
void ExpectDone(const std::vector<std::string>& request) {
  const Outcome answer = Ctl(request);
  EXPECT_EQ(answer.exit_code, 0) << answer.text;
}

/// Waits until the run is in one of these states. @returns the last state that was seen.
std::string WaitForState(const std::vector<std::string>& wanted) {
  std::string state;
  for (int i = 0; i < 80; ++i) {  // Each try takes a quarter of a second.
    state = State();
    if (std::find(wanted.begin(), wanted.end(), state) != wanted.end()) break;
  }
  return state;
}

/// The nominal gait in an attended run. Ticks are slow, so that the test does not depend on how
/// well the machine keeps time.
class TumblerCtl : public ::testing::Test {
 protected:
  TumblerCtl() {
    std::string text = ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
    text = Replaced(text, "rate_hz = 1000.0", "rate_hz = 100.0");
    WriteFile(drives_, ReplacedAll(text, "watchdog_s = 0.025", "watchdog_s = 1.0"));
  }
  [[nodiscard]] std::unique_ptr<Program> Play(const std::vector<std::string>& more = {}) const {
    return std::make_unique<Program>(PlayArguments(more));
  }
  [[nodiscard]] std::vector<std::string> PlayArguments(
      const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{testing::ProgramPath("tumbler run"),
                                       "sim",
                                       kGait,
                                       "--realtime",
                                       "--lcm-url",
                                       kUrl,
                                       "--hold-s",
                                       "0.2",
                                       "--attended",
                                       "--drives",
                                       drives_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }

 private:
  testing::TemporaryFolder folder_;
  std::string drives_ = folder_ / "drives.toml";
};

TEST_F(TumblerCtl, SaysThatNobodyAnswers) {
  for (const char* request : {"status", "start", "stop"}) {
    const Outcome answer = Ctl({request});
    EXPECT_EQ(answer.exit_code, 1);
    EXPECT_THAT(answer.text, HasSubstr("is tumbler run there"));
  }
}

TEST_F(TumblerCtl, RejectsWhatItDoesNotKnow) {
  EXPECT_EQ(Ctl({}).exit_code, 1);
  EXPECT_EQ(Ctl({"arm"}).exit_code, 1);
  EXPECT_EQ(Ctl({"branch"}).exit_code, 1);
}

TEST_F(TumblerCtl, StartsBranchesFinishesAndStartsAgain) {
  testing::InSteadyTime([this] {
    const std::unique_ptr<Program> run = Play();
    ASSERT_EQ(WaitForState({"disarmed"}), "disarmed") << run->text();
    EXPECT_THAT(Ctl({"status"}).text, HasSubstr("attended"));
    const Outcome early = Ctl({"branch", "roll"});
    EXPECT_EQ(early.exit_code, 2) << early.text;
    EXPECT_THAT(early.text, HasSubstr("not possible in this state"));
    EXPECT_EQ(State(), "disarmed") << "nothing moves by itself";

    ExpectDone({"start"});
    ASSERT_NE(WaitForState({"running", "settling"}), "disarmed");
    EXPECT_EQ(Ctl({"start"}).exit_code, 2);
    const Outcome wrong = Ctl({"branch", "rol"});
    EXPECT_EQ(wrong.exit_code, 2);
    EXPECT_THAT(wrong.text, HasSubstr("no branch 'rol'"));
    ExpectDone({"branch", "roll"});
    ASSERT_EQ(WaitForState({"disarmed"}), "disarmed") << "the roll ends the sequence";

    ExpectDone({"start"});
    ASSERT_NE(WaitForState({"running", "settling"}), "disarmed");
    ExpectDone({"stop"});
    ASSERT_EQ(WaitForState({"holding", "disarmed"}), "holding") << "it would drop";
    usleep(1'500'000);
    EXPECT_EQ(State(), "holding");
    ExpectDone({"disarm"});
    ASSERT_EQ(WaitForState({"disarmed"}), "disarmed");
    run->Signal(SIGINT);
    EXPECT_EQ(run->Wait(), 130) << run->text();
    EXPECT_THAT(run->text(), HasSubstr("2 runs"));
  });
}

TEST_F(TumblerCtl, AsksTheRobotThatItsOptionNamesWhereThereAreTwo) {
  testing::InSteadyTime([this] {
    const std::unique_ptr<Program> left = Play({"--robot", "left"});
    ASSERT_EQ(WaitForState({"disarmed"}), "disarmed") << left->text();
    const std::unique_ptr<Program> right = Play({"--robot", "right"});
    const auto of = [](const std::string& robot) {
      const Outcome status = Ctl({"status", "--json", "--robot", robot});
      if (status.text.empty() || status.text[0] != '{') return status.text;
      return Json::Parse(status.text).value()["state"].text();
    };
    ASSERT_TRUE(testing::Eventually([&] { return of("right") == "disarmed"; }));
    const Outcome unclear = Ctl({"start"});
    EXPECT_EQ(unclear.exit_code, 1);
    EXPECT_THAT(unclear.text, HasSubstr("2 robots answer"));
    EXPECT_THAT(unclear.text, HasSubstr("'left'"));
    EXPECT_THAT(unclear.text, HasSubstr("'right'"));
    EXPECT_THAT(Ctl({"start", "--robot", "middle"}).text, HasSubstr("no robot 'middle' answers"));
    ExpectDone({"start", "--robot", "right"});
    EXPECT_NE(of("right"), "disarmed");
    EXPECT_EQ(of("left"), "disarmed");
  });
}

TEST_F(TumblerCtl, SaysThatTheRunItStartedWasRefused) {
  testing::InSteadyTime([this] {
    const std::unique_ptr<Program> run = Play({"--start-within", "0"});
    ASSERT_EQ(WaitForState({"disarmed"}), "disarmed") << run->text();
    const Outcome start = Ctl({"start"});
    EXPECT_EQ(start.exit_code, 2);
    EXPECT_THAT(start.text,
                HasSubstr("the run was refused: a joint is far from the motion's start"));
  });
}

/// Sends fragments of messages that say to be where there is no room for them.
void SendFragmentsThatLie() {
  const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
  ASSERT_GE(socket, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(7667);
  inet_pton(AF_INET, "239.255.76.67", &to.sin_addr);
  struct Fragment {
    std::uint32_t size, offset;
    std::uint16_t number, count;
  };
  for (const char* channel : {kStateChannel, kRunChannel, kEventChannel, kCommandChannel}) {
    for (const Fragment& lie :
         {Fragment{1000, 0xffffffff, 0, 1}, Fragment{100, 0, 0, 3}, Fragment{100, 0xffffffff, 1, 3},
          Fragment{5'000'000, 0, 0, 3}, Fragment{5'000'000, 0xffffffd8, 1, 3}}) {
      std::string datagram;
      const auto add = [&datagram](std::uint32_t number, int bytes) {
        for (int i = bytes; i-- > 0;)
          datagram += static_cast<char>(number >> (8 * static_cast<unsigned>(i)) & 0xffU);
      };
      add(0x4c433033, 4);  // LC03
      add(3, 4);
      add(lie.size, 4);
      add(lie.offset, 4);
      add(lie.number, 2);
      add(lie.count, 2);
      if (lie.number == 0) datagram += std::string(channel) + '\0';
      datagram += std::string(50, 'a');
      sendto(socket, datagram.data(), datagram.size(), 0, reinterpret_cast<sockaddr*>(&to),
             sizeof to);
    }
  }
  close(socket);
}

TEST_F(TumblerCtl, FragmentsThatLieEndNeitherTheRunNorThoseWhoLookAtItNorARequest) {
  const auto run = Play();
  Program watch({testing::ProgramPath("tumbler ctl"), "watch", "--lcm-url", kUrl});
  ASSERT_EQ(WaitForState({"disarmed"}), "disarmed");
  ASSERT_TRUE(watch.WaitFor("disarmed"));
  for (int i = 0; i < 20; ++i) SendFragmentsThatLie();
  ExpectDone({"start"});
  for (int i = 0; i < 20; ++i) SendFragmentsThatLie();
  EXPECT_TRUE(watch.WaitFor("running")) << watch.text();
  ExpectDone({"stop"});
  watch.Signal(SIGINT);
  EXPECT_EQ(watch.Wait(), 0) << watch.text();
  run->Signal(SIGKILL);
  run->Wait();
  EXPECT_THAT(run->text(), Not(HasSubstr("egmentation")));
}

TEST_F(TumblerCtl, WatchesALinePerSecondInAPipe) {
  const std::unique_ptr<Program> run = Play();
  ASSERT_EQ(WaitForState({"disarmed"}), "disarmed") << run->text();
  Program watch({testing::ProgramPath("tumbler ctl"), "watch", "--lcm-url", kUrl});
  ASSERT_TRUE(watch.WaitFor("disarmed")) << watch.text();
  run->Signal(SIGKILL);
  run->Wait();
  ASSERT_TRUE(watch.WaitFor("NOTHING RECEIVED")) << watch.text();
  watch.Signal(SIGINT);
  EXPECT_EQ(watch.Wait(), 0);
  EXPECT_THAT(watch.text(), Not(HasSubstr("\x1b"))) << "no terminal, no escapes";
}

/// Telemetry of an earlier run of a robot, as when its log is played: one more run, which answers
/// nothing.
class PlayedLog {
 public:
  PlayedLog(std::int64_t run, const std::string& robot)
      : thread_([this, run, robot] {
          run_t about{};
          about.run = run;
          about.robot = robot;
          state_t state{};
          state.run = run;
          state.state = state_t::STATE_RUNNING;
          for (; !over_; ++state.number) {
            if (state.number % 20 == 0) lcm_.publish(kRunChannel, &about);
            lcm_.publish(kStateChannel, &state);
            usleep(10'000);
          }
        }) {}
  ~PlayedLog() {
    over_ = true;
    thread_.join();
  }
  PlayedLog(const PlayedLog&) = delete;
  PlayedLog& operator=(const PlayedLog&) = delete;

 private:
  lcm::LCM lcm_{kUrl};
  std::atomic<bool> over_{false};
  std::thread thread_;
};

TEST_F(TumblerCtl, AsksEveryRunOfTheRobotToRestWhileALogOfItIsPlayed) {
  testing::InSteadyTime([this] {
    const std::unique_ptr<Program> run = Play({"--robot", "left"});
    ASSERT_EQ(WaitForState({"disarmed"}), "disarmed") << run->text();
    const PlayedLog earlier(1, "left"), later(std::numeric_limits<std::int64_t>::max(), "left");
    const Outcome unclear = Ctl({"clear", "--robot", "left"});
    EXPECT_EQ(unclear.exit_code, 1);
    EXPECT_THAT(unclear.text, HasSubstr("3 runs of 'left' are heard"));
    const Outcome disarm = Ctl({"disarm", "--robot", "left"});
    EXPECT_EQ(disarm.exit_code, 4) << "logs give no answer";
    EXPECT_THAT(disarm.text, HasSubstr("taken at tick"));
    EXPECT_THAT(disarm.text,
                HasSubstr("disarm, run 1: no answer; a log that is played gives none"));
    EXPECT_THAT(Ctl({"stop"}).text, HasSubstr("taken at tick"));
    const PlayedLog other(3, "right");
    const Outcome whose = Ctl({"stop"});
    EXPECT_EQ(whose.exit_code, 1);
    EXPECT_THAT(whose.text, HasSubstr("2 robots answer"));
    EXPECT_THAT(Ctl({"stop", "--robot", "left"}).text, HasSubstr("taken at tick"));
  });
}

/// A pipe that somebody has opened, and nobody reads.
class StalledPipe {
 public:
  explicit StalledPipe(const std::string& path) {
    EXPECT_EQ(mkfifo(path.c_str(), 0600), 0);
    end_ = open(path.c_str(), O_RDWR | O_CLOEXEC);
    constexpr int kFewBytes = 4096;
    fcntl(end_, F_SETPIPE_SZ, kFewBytes);
  }
  ~StalledPipe() { close(end_); }
  StalledPipe(const StalledPipe&) = delete;
  StalledPipe& operator=(const StalledPipe&) = delete;

 private:
  int end_ = -1;
};

TEST_F(TumblerCtl, AFileThatTakesNothingKeepsNeitherTelemetryNorRequestsNorTheEndWaiting) {
  for (const char* const option : {"--log", "--csv"}) {
    SCOPED_TRACE(option);
    testing::InSteadyTime([&] {
      const testing::TemporaryFolder folder;
      const std::string path = folder / "stalled";
      const StalledPipe pipe(path);
      const std::unique_ptr<Program> run = Play({option, path});
      ASSERT_EQ(WaitForState({"disarmed"}), "disarmed") << run->text();
      usleep(1'000'000);  // The pipe has been full for long.
      ExpectDone({"start"});
      ASSERT_NE(WaitForState({"running", "settling"}), "disarmed");
      ExpectDone({"stop"});
      ASSERT_EQ(WaitForState({"holding", "disarmed"}), "holding");
      ExpectDone({"disarm"});
      for (int i = 0; i < 3; ++i) run->Signal(SIGINT);
      EXPECT_EQ(run->Wait(), 130) << run->text();
      EXPECT_THAT(run->text(), HasSubstr(path + ": could not be written whole"));
    });
  }
}

/// A program on a terminal of its own.
class OnTerminal {
 public:
  explicit OnTerminal(const std::vector<std::string>& given) {
    std::vector<std::string> arguments = testing::WithCommandApart(given);
    pid_ = forkpty(&terminal_, nullptr, nullptr, nullptr);
    if (pid_ != 0) return;
    std::vector<char*> pointers;
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    execv(pointers[0], pointers.data());
    _exit(127);
  }
  ~OnTerminal() {
    if (!Ended()) kill(pid_, SIGKILL);
    if (!ended_) waitpid(pid_, nullptr, 0);
    close(terminal_);
  }
  OnTerminal(const OnTerminal&) = delete;
  OnTerminal& operator=(const OnTerminal&) = delete;

  void Type(char key) const { EXPECT_EQ(write(terminal_, &key, 1), 1); }
  void Signal(int signal) const { kill(pid_, signal); }
  [[nodiscard]] bool Ended() {
    ended_ = ended_ || waitpid(pid_, nullptr, WNOHANG) == pid_;
    return ended_;
  }

 private:
  pid_t pid_ = -1;
  int terminal_ = -1;
  bool ended_ = false;
};

TEST_F(TumblerCtl, ATerminalThatWasStoppedKeepsNeitherRequestsNorTheEndWaiting) {
  testing::InSteadyTime([this] {
    OnTerminal run(PlayArguments());
    ASSERT_EQ(WaitForState({"disarmed"}), "disarmed");
    constexpr char kStopKey = '\x13';  // Ctrl-S
    run.Type(kStopKey);
    command_t refused{};
    refused.id = 1;
    refused.run = 1;
    refused.command = command_t::STOP;
    lcm::LCM(kUrl).publish(kCommandChannel, &refused);  // It is for another run, which is said.
    usleep(200'000);
    ExpectDone({"start"});
    ASSERT_NE(WaitForState({"running", "settling"}), "disarmed");
    ExpectDone({"stop"});
    ASSERT_EQ(WaitForState({"holding", "disarmed"}), "holding");
    ExpectDone({"disarm"});
    for (int i = 0; i < 3; ++i) run.Signal(SIGINT);
    EXPECT_TRUE(testing::Eventually([&run] { return run.Ended(); }));
  });
}

TEST_F(TumblerCtl, SignsWithAKeyWhatMayBeginAMotion) {
  testing::InSteadyTime([this] {
    const testing::TemporaryFolder folder;
    const std::string key = folder / "robot.key", other = folder / "other.key";
    WriteFile(key, std::string(64, 'a') + '\n');
    WriteFile(other, std::string(64, 'b') + '\n');
    chmod(key.c_str(), 0600);
    chmod(other.c_str(), 0600);
    const std::unique_ptr<Program> run = Play({"--key", key});
    ASSERT_EQ(WaitForState({"disarmed"}), "disarmed") << run->text();
    const Outcome unsigned_start = Ctl({"start"});
    EXPECT_EQ(unsigned_start.exit_code, 1);
    EXPECT_THAT(unsigned_start.text, HasSubstr("only when it is signed with its key: --key FILE"));
    EXPECT_THAT(Ctl({"start", "--key", other}).text, HasSubstr("must be the same as here"));
    EXPECT_EQ(State(), "disarmed");
    ExpectDone({"start", "--key", key});
    ASSERT_NE(WaitForState({"running", "settling"}), "disarmed");
    ExpectDone({"stop"});
    ExpectDone({"disarm", "--key", other});
    ExpectDone({"stop", "--key", other + "_that_is_lost"});
    chmod(key.c_str(), 0644);
    const Outcome open_key = Ctl({"start", "--key", key});
    EXPECT_EQ(open_key.exit_code, 1);
    EXPECT_THAT(open_key.text, HasSubstr(key + ": is open to others"));
  });
}

}  // namespace
}  // namespace tumbler
