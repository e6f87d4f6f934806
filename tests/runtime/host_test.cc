// What a computer needs for driving motors: tumbler run --doctor, scripts/host-setup, the hold on
// /dev/cpu_dma_latency, and what a service manager is told.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "runtime/assembly/doctor.h"
#include "runtime/assembly/operator_voice.h"
#include "runtime/assembly/realtime_thread.h"
#include "runtime/assembly/run_checks.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/assembly/service_notice.h"
#include "runtime/run/known_pose.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/sequence_files.h"
#include "tests/support/steady_time.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::Outcome;
using testing::ReadFile;
using testing::Replaced;

HostFacts GoodHost() {
  HostFacts facts;
  facts.interface = "can0";
  facts.can_in_kernel = true;
  CanLink link;
  link.is_can = link.up = link.confirms_on_the_wire = link.has_queue = true;
  link.reports_bus_errors = true;
  link.queue_frames_max = 10;
  link.bit_rate = 1'000'000;
  facts.link = link;
  facts.may_restart_link = facts.may_keep_awake = true;
  facts.kernel = "PREEMPT_RT";
  facts.priority_max = 90;
  facts.locked_bytes_max = -1;
  facts.governor = "performance";
  facts.isolated = "3";
  facts.processors = 4;
  return facts;
}

TEST(Doctor, FindsNothingAmissWithAGoodHost) {
  const std::vector<HostFinding> findings = Diagnose(GoodHost());
  EXPECT_GE(findings.size(), 15U);
  for (const HostFinding& finding : findings) {
    EXPECT_EQ(finding.level, HostFinding::Level::kGood) << finding.what << ": " << finding.state;
    EXPECT_TRUE(finding.remedy.empty());
  }
  EXPECT_THAT(Describe(findings), HasSubstr("0 missing, 0 to improve"));
}

TEST(Doctor, NamesEachThingThatIsAmissWithWhatToDo) {
  using Level = HostFinding::Level;
  struct Case {
    const char* what;
    Level level;
    const char* remedy;
    std::function<void(HostFacts&)> spoil;
  };
  const std::vector<Case> cases = {
      {"CAN in the kernel", Level::kMissing, "modprobe can",
       [](HostFacts& f) { f.can_in_kernel = false; }},
      {"interface", Level::kMissing, "ip link",
       [](HostFacts& f) {
         f.link.reset();
         f.link_problem = "can0: No such device";
       }},
      {"interface", Level::kMissing, "type can", [](HostFacts& f) { f.link->is_can = false; }},
      {"bit rate", Level::kAdvice, "bitrate 1000000", [](HostFacts& f) { f.link->bit_rate = 0; }},
      {"state", Level::kMissing, "ip link set can0 up", [](HostFacts& f) { f.link->up = false; }},
      {"listen-only", Level::kMissing, "listen-only off",
       [](HostFacts& f) { f.link->listen_only = true; }},
      {"transmit queue", Level::kMissing, "txqueuelen 10",
       [](HostFacts& f) { f.link->queue_frames_max = 1000; }},
      {"waiting frames", Level::kAdvice, "nobody acknowledges",
       [](HostFacts& f) { f.link->waiting_frames = 7; }},
      {"bus errors", Level::kAdvice, "berr-reporting on",
       [](HostFacts& f) { f.link->reports_bus_errors = false; }},
      {"restart after bus-off", Level::kAdvice, "restart-ms 0",
       [](HostFacts& f) { f.link->restart_ms = 100; }},
      {"confirmation", Level::kAdvice, "gs_usb",
       [](HostFacts& f) { f.link->confirms_on_the_wire = false; }},
      {"discarding stale frames", Level::kAdvice, "CAP_NET_ADMIN",
       [](HostFacts& f) { f.may_restart_link = false; }},
      {"SCHED_FIFO", Level::kMissing, "rtprio", [](HostFacts& f) { f.priority_max = 0; }},
      {"SCHED_FIFO", Level::kMissing, "rtprio", [](HostFacts& f) { f.priority_max = 79; }},
      {"locked memory", Level::kMissing, "memlock unlimited",
       [](HostFacts& f) { f.locked_bytes_max = 8 << 20; }},
      {"preemption", Level::kAdvice, "PREEMPT_RT", [](HostFacts& f) { f.kernel = "PREEMPT"; }},
      {"processor sleep", Level::kAdvice, "cpu_dma_latency",
       [](HostFacts& f) { f.may_keep_awake = false; }},
      {"governor", Level::kAdvice, "performance", [](HostFacts& f) { f.governor = "powersave"; }},
      {"isolated processors", Level::kAdvice, "isolcpus=3",
       [](HostFacts& f) { f.isolated.clear(); }},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.what);
    HostFacts facts = GoodHost();
    c.spoil(facts);
    std::vector<HostFinding> amiss;
    for (HostFinding& finding : Diagnose(facts)) {
      if (finding.level != Level::kGood) amiss.push_back(std::move(finding));
    }
    ASSERT_EQ(amiss.size(), 1U) << Describe(Diagnose(facts));
    EXPECT_EQ(amiss[0].what, c.what);
    EXPECT_EQ(amiss[0].level, c.level);
    EXPECT_THAT(amiss[0].remedy, HasSubstr(c.remedy));
  }
}

TEST(Doctor, ExaminesAnInterfaceThatIsNotThereAndAsksForNeitherBusNorMotion) {
  const Outcome run = testing::RunProgram({"tumbler run", "--doctor", "nocan7"});
  EXPECT_EQ(run.exit_code, 2) << run.text;
  EXPECT_THAT(run.text, HasSubstr("MISSING  interface: nocan7: No such device"));
  EXPECT_THAT(run.text, HasSubstr("preemption: "));
  EXPECT_EQ(testing::RunProgram({"tumbler run", "--doctor", "can0", "sim"}).exit_code, 1);
}

TEST(CpuAwake, HoldsTheLatencyAtZeroWhereItMay) {
  const testing::TemporaryFolder folder;
  const std::string device = folder / "cpu_dma_latency";
  testing::WriteFile(device, "");
  {
    const CpuAwake awake(device.c_str());
    EXPECT_TRUE(awake.held());
    EXPECT_EQ(ReadFile(device), std::string(4, '\0'));
  }
  EXPECT_FALSE(CpuAwake((folder / "not there").c_str()).held());
}

/// The socket of a service manager, played by the test.
class NotifySocket {
 public:
  /// @param name  a file's, or one that begins with '@'.
  explicit NotifySocket(const std::string& name)
      : socket_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::copy(name.begin(), name.end(), address.sun_path);
    if (name.front() == '@') address.sun_path[0] = '\0';
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size() +
                                             (name.front() == '@' ? 0 : 1));
    if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), size) != 0) {
      throw std::runtime_error("no socket " + name);
    }
  }
  ~NotifySocket() { close(socket_); }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  /// What has come since it was asked last.
  [[nodiscard]] std::vector<std::string> Heard() const {
    std::vector<std::string> all;
    std::array<char, 256> buffer{};
    for (;;) {
      const ssize_t size = recv(socket_, buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (size < 0) return all;
      all.emplace_back(buffer.data(), static_cast<std::size_t>(size));
    }
  }

 private:
  int socket_;
};

TEST(ServiceNotice, IsReadyAfterTheFirstTickAliveWhileThereAreTicksAndSilentWhenTheLoopHangs) {
  const testing::TemporaryFolder folder;
  const std::string abstract = "@tumbler-" + std::to_string(getpid());
  for (const std::string& name : {folder / "notify", abstract}) {
    const NotifySocket manager(name);
    {
      ServiceNotice notice({name, 1'000'000});
      notice.Look();
      EXPECT_THAT(manager.Heard(), IsEmpty()) << "no tick yet";
      notice.NoteTick();
      notice.Look();
      EXPECT_THAT(manager.Heard(), ElementsAre("READY=1", "WATCHDOG=1"));
      for (int i = 0; i < 3; ++i) {
        notice.NoteTick();
        notice.NoteTick();
        notice.Look();
        EXPECT_THAT(manager.Heard(), ElementsAre("WATCHDOG=1"));
      }
      for (int i = 0; i < 10; ++i) notice.Look();
      EXPECT_THAT(manager.Heard(), IsEmpty()) << "the loop hangs";
      notice.NoteTick();
      notice.Look();
      EXPECT_THAT(manager.Heard(), ElementsAre("WATCHDOG=1")) << "it goes on";
    }
    EXPECT_THAT(manager.Heard(), ElementsAre("STOPPING=1"));
  }
}

TEST(ServiceNotice, WithoutAWatchdogSaysReadyAndStoppingAndWithoutATickNothing) {
  const testing::TemporaryFolder folder;
  const NotifySocket manager(folder / "notify");
  { const ServiceNotice notice({folder / "notify", 1'000'000}); }
  EXPECT_THAT(manager.Heard(), IsEmpty()) << "a loop that never ran is neither ready nor over";
  {
    ServiceNotice notice({folder / "notify", 0});
    for (int i = 0; i < 5; ++i) {
      notice.NoteTick();
      notice.Look();
    }
  }
  EXPECT_THAT(manager.Heard(), ElementsAre("READY=1", "STOPPING=1"));
}

TEST(ServiceNotice, ASocketThatIsNotThereOrCannotBeIsNoTrouble) {
  for (const std::string& name :
       {std::string(), std::string("/"), std::string("notify"), std::string("/no/such/socket"),
        "@" + std::string(107, 'x'), "/" + std::string(5000, 'x')}) {
    ServiceNotice notice({name, 1});
    notice.Start();
    notice.NoteTick();
    notice.Look();
  }
}

TEST(ServiceNotice, TakesFromTheEnvironmentAWatchdogThatIsForThisProcess) {
  const auto with = [](const char* usec, const std::string& pid) {
    // NOLINTBEGIN(concurrency-mt-unsafe)
    setenv("NOTIFY_SOCKET", "/run/notify", 1);
    setenv("WATCHDOG_USEC", usec, 1);
    setenv("WATCHDOG_PID", pid.c_str(), 1);
    const ServiceManager manager = ServiceManager::FromEnvironment();
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) unsetenv(name);
    // NOLINTEND(concurrency-mt-unsafe)
    EXPECT_EQ(manager.socket, "/run/notify");
    return manager.watchdog_us;
  };
  EXPECT_EQ(with("250000", std::to_string(getpid())), 250'000);
  EXPECT_EQ(with("250000", ""), 250'000);
  EXPECT_EQ(with("250000", std::to_string(getpid() + 1)), 0);
  EXPECT_EQ(with("250000", "x"), 0);
  for (const char* nonsense : {"", "0", "-5", "1e6", "250000 ", "99999999999999999999"}) {
    EXPECT_EQ(with(nonsense, ""), 0) << nonsense;
  }
  EXPECT_EQ(ServiceManager::FromEnvironment().socket, "");
}

TEST(ServiceNotice, AServiceManagerHearsOfARunFromItsFirstTickToItsLast) {
  const testing::TemporaryFolder folder;
  testing::WriteFile(
      folder / "drives.toml",
      Replaced(ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml")),
               "rate_hz = 1000.0", "rate_hz = 200.0"));
  int runs = 0;
  testing::InSteadyTime([&] {
    const std::string name = folder / ("notify" + std::to_string(++runs));
    const NotifySocket manager(name);
    testing::Program run({"/bin/sh", "-c",
                          "NOTIFY_SOCKET=" + name + " WATCHDOG_USEC=200000 exec " +
                              testing::ProgramPath("tumbler run") + " sim " +
                              testing::SourcePath("primitives/nominal/handstand.toml") +
                              " --drives " + (folder / "drives.toml") +
                              " --realtime --end torque-off"});
    std::vector<std::string> heard;  // The kernel keeps few datagrams that nobody has read.
    EXPECT_TRUE(testing::Eventually([&] {
      for (std::string& text : manager.Heard()) heard.push_back(std::move(text));
      return !heard.empty() && heard.back() == "STOPPING=1";
    }));
    EXPECT_EQ(run.Wait(), 0) << run.text();
    ASSERT_GE(heard.size(), 5U);
    EXPECT_EQ(heard.front(), "READY=1");
    EXPECT_EQ(std::count(heard.begin(), heard.end(), "WATCHDOG=1"),
              static_cast<std::ptrdiff_t>(heard.size()) - 2);
  });
}

TEST(DrivesOfARun, HaveTheGainsOfTheMotionUnlessAFileSaysOthersWhichIsTold) {
  const auto gains_of = [](const DrivesConfig& drives) {
    return std::pair(drives.drives[1].kp_nm_per_rad, drives.drives[1].kd_nm_s_per_rad);
  };
  const std::vector<std::string> joints = {"leg1", "leg2"};
  EXPECT_EQ(gains_of(LoadDrivesOf(joints, "", ReadTextFile)), std::pair(200.0F, 4.0F));
  const DriveGains found{61.5, 4.5};
  const DrivesConfig own = LoadDrivesOf(joints, "", ReadTextFile, found);
  EXPECT_EQ(gains_of(own), std::pair(61.5F, 4.5F));
  // A frame of the default drives carries up to 500 and 5.
  EXPECT_THROW(static_cast<void>(LoadDrivesOf(joints, "", ReadTextFile, DriveGains{61.5, 5.5})),
               std::runtime_error);
  EXPECT_THROW(static_cast<void>(LoadDrivesOf(joints, "", ReadTextFile, DriveGains{501, 4})),
               std::runtime_error);
  const std::string file = testing::SourcePath("primitives/robots/tumbler_drives.toml");
  const DrivesConfig given = LoadDrivesOf(joints, file, ReadTextFile, found);
  EXPECT_EQ(gains_of(given), gains_of(LoadDrivesOf(joints, file, ReadTextFile)));

  const testing::SequenceFolder folder(testing::GaitText(), [&found] {
    auto primitives = testing::GaitPrimitives();
    primitives[0].drives = found;
    return primitives;
  }());
  std::vector<std::string> said;
  const auto say = [&said](const std::string& text) { said.push_back(text); };
  const SequenceFile motion = LoadSequence(folder.file());
  CompareGains(motion, own, say);
  EXPECT_TRUE(said.empty());
  DrivesConfig other = own;
  other.drives[1].kd_nm_s_per_rad = 4.0F;
  CompareGains(motion, other, say);
  ASSERT_EQ(said.size(), 1U);
  EXPECT_EQ(said[0],
            "joint leg2: its drive has 61.5 N m/rad and 4 N m s/rad; the motion was found for 61.5 "
            "and 4.5");
}

TEST(KnownPose, IsReadAsItWasWrittenWithTheZeroOfNow) {
  const testing::TemporaryFolder folder;
  const std::string file = folder / "state/pose.json";
  DrivesConfig drives = DefaultDrives({"leg1", "leg2"});
  EXPECT_FALSE(ReadKnownPose(file, drives)[0].known) << "there is no file yet";
  TickRecord record;
  record.joint_count = 2;
  record.joints[0].measured.position_rad = 0.75F;
  record.joints[0].reply_age_ticks = 1;
  record.joints[1].measured.position_rad = -0.5F;  // never heard
  WriteKnownPose(file, record, drives);
  std::get<MitConfig>(drives.drives[0].config).joint.zero_offset_rad = 0.25F;
  const auto known = ReadKnownPose(file, drives);
  EXPECT_TRUE(known[0].known);
  EXPECT_FLOAT_EQ(known[0].position_rad, 1.0F) << "the shaft is where it was";
  EXPECT_FLOAT_EQ(known[0].turn_rad, 6.2831853F);
  EXPECT_FALSE(known[1].known);
}

TEST(KnownPose, AFileThatCannotBeUsedIsNamedWithWhatToDo) {
  const testing::TemporaryFolder folder;
  const std::string file = folder / "pose.json";
  const DrivesConfig drives = DefaultDrives({"leg1"});
  for (const char* text : {"", "{}", "[1]", "{\"format\": \"tumbler-pose\"}",
                           "{\"format\": \"tumbler-pose\", \"shafts_rad\": {\"leg1\": true}}"}) {
    testing::WriteFile(file, text);
    try {
      static_cast<void>(ReadKnownPose(file, drives));
      FAIL() << text;
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), HasSubstr(file));
      EXPECT_THAT(error.what(), HasSubstr("--forget-pose"));
    }
  }
}

class HostSetUp : public ::testing::Test {
 protected:
  [[nodiscard]] Outcome Run(const std::string& options) const {
    return testing::RunInShell(testing::SourcePath("scripts/host-setup") + " --user anna " +
                               options);
  }
  [[nodiscard]] std::string Root() const { return folder_ / "root"; }
  [[nodiscard]] std::string Written(const std::string& file) const {
    return ReadFile(Root() + file);
  }
  testing::TemporaryFolder folder_;
};

TEST_F(HostSetUp, SaysWhatItWouldWriteAndWritesNothing) {
  const Outcome run = Run("--dry-run --root " + Root());
  EXPECT_EQ(run.exit_code, 0) << run.text;
  for (const char* part :
       {"limits.d/90-tumbler.conf", "anna - rtprio 90", "anna - memlock unlimited",
        "rules.d/90-tumbler.rules", "cpu_dma_latency", "tumbler-can0.service",
        "type can bitrate 1000000 restart-ms 0", "txqueuelen 10", "would run: systemctl"}) {
    EXPECT_THAT(run.text, HasSubstr(part));
  }
  EXPECT_FALSE(std::filesystem::exists(Root()));
}

TEST_F(HostSetUp, WritesOnceAndThenOnlyWhatChanges) {
  EXPECT_THAT(Run("--root " + Root()).text, HasSubstr("3 changes"));
  EXPECT_EQ(Written("/etc/udev/rules.d/90-tumbler.rules"),
            "# tumbler run keeps the processors awake while it drives motors.\n"
            "KERNEL==\"cpu_dma_latency\", OWNER=\"anna\", MODE=\"0600\"\n");
  EXPECT_THAT(Written("/etc/security/limits.d/90-tumbler.conf"), HasSubstr("anna - rtprio 90\n"));
  EXPECT_THAT(Run("--root " + Root()).text, HasSubstr("0 changes"));
  EXPECT_THAT(Run("--bit-rate 500000 --root " + Root()).text, HasSubstr("1 changes"));
  EXPECT_THAT(Written("/etc/systemd/system/tumbler-can0.service"), HasSubstr("bitrate 500000"));
}

TEST_F(HostSetUp, RefusesWhatCannotBe) {
  for (const char* options :
       {"--bit-rate 5", "--bit-rate 18446744073710551616", "--bit-rate 01000000", "--bit-rate 08",
        "--interface 'a b'", "--interface ..", "--interface -x", "--program /no/such/program",
        "--user 'x y'", "--frobnicate", "--root"}) {
    const Outcome run =
        Run(std::string(options) + (std::string(options) == "--root" ? "" : " --dry-run"));
    EXPECT_EQ(run.exit_code, 1) << options << run.text;
    EXPECT_THAT(run.text, Not(HasSubstr("would write")));
    EXPECT_THAT(run.text, Not(HasSubstr("line ")));  // as messages of the shell begin
  }
}

TEST_F(HostSetUp, WritesTheNameOfADeviceAsSystemdDoes) {
  EXPECT_THAT(Run("--dry-run --interface can-0 --root " + Root()).text,
              HasSubstr("BindsTo=sys-subsystem-net-devices-can\\x2d0.device"));
}

TEST_F(HostSetUp, GivesAProgramTheCapabilitiesThatItLacks) {
  const std::string program = folder_ / "program";
  testing::WriteFile(program, "");
  const std::string getcap = folder_ / "getcap";  // stands in for the system's
  for (const auto& [has, lacks] : {std::pair("", true), std::pair("cap_net_admin=ep", true),
                                   std::pair("cap_net_admin,cap_ipc_lock,cap_sys_nice=ep", false),
                                   std::pair("cap_net_admin,cap_ipc_lock,cap_sys_nice=p", true)}) {
    testing::WriteFile(getcap, std::string("#!/bin/sh\necho \"$1 ") + has + "\"\n");
    std::filesystem::permissions(getcap, std::filesystem::perms::owner_all);
    const Outcome run = testing::RunInShell(
        "PATH=" + folder_.path().string() + ":$PATH " + testing::SourcePath("scripts/host-setup") +
        " --dry-run --user anna --root " + Root() + " --program " + program);
    EXPECT_EQ(run.text.find("would run: setcap cap_net_admin,cap_sys_nice,cap_ipc_lock+ep") !=
                  std::string::npos,
              lacks)
        << run.text;
  }
}

TEST(OperatorVoice, NeverWaitsForWhoTakesNothingAndSaysHowMuchWasLeftOut) {
  std::array<int, 2> pipe_ends{};
  ASSERT_EQ(pipe(pipe_ends.data()), 0);
  std::signal(SIGPIPE, SIG_IGN);
  const std::string long_line(100'000, 'a');  // more than a pipe takes
  {
    OperatorVoice voice(pipe_ends[1], 4);
    voice.Say(long_line);
    EXPECT_FALSE(voice.Await(std::chrono::milliseconds(10)));
    for (int i = 0; i < 10; ++i) voice.Say(std::to_string(i));
    std::string text;
    std::array<char, 4096> buffer;
    while (text.find("left out)\n") == std::string::npos) {
      const ssize_t count = read(pipe_ends[0], buffer.data(), buffer.size());
      ASSERT_GT(count, 0);
      text.append(buffer.data(), static_cast<std::size_t>(count));
    }
    EXPECT_EQ(text, long_line + "\n0\n1\n2\n3\n(6 messages were left out)\n");
    voice.Say("again");
    EXPECT_TRUE(voice.Await(std::chrono::seconds(20)));
    EXPECT_EQ(read(pipe_ends[0], buffer.data(), buffer.size()), 6);
    EXPECT_FALSE(voice.failed());
    close(pipe_ends[0]);
    voice.Say("nobody reads");
    EXPECT_TRUE(voice.Await(std::chrono::seconds(20)));
    EXPECT_TRUE(voice.failed());
  }
  close(pipe_ends[1]);
}

}  // namespace
}  // namespace tumbler
