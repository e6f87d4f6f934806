// tumbler record as a user meets it, with logs of tumbler run and with damaged ones.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <sstream>
#include <string>
#include <tumbler/run_t.hpp>
#include <tumbler/state_t.hpp>
#include <vector>

#include "runtime/record/channels.h"
#include "runtime/record/telemetry.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::Outcome;
using testing::RunProgram;

const std::string kMotion = testing::SourcePath("primitives/nominal/handstand.toml");

class TumblerLog : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<testing::TemporaryFolder>();
    const Outcome run = RunProgram({"tumbler run", "sim", kMotion, "--hold-s", "0.1", "--log",
                                    Path("run.lcm"), "--csv", Path("trace.csv")});
    ASSERT_EQ(run.exit_code, 0) << run.text;
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static std::string Path(const std::string& name) { return *folder_ / name; }
  static std::string Read(const std::string& name) { return testing::ReadFile(Path(name)); }
  int Log(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "tumbler record");
    const Outcome outcome = RunProgram(arguments);
    text_ = outcome.text;
    return outcome.exit_code;
  }
  /// Copies the messages of the log that `keep` wants.
  /// @param keep  is given the channel, and the number of the message on it.
  template <typename Keep>
  static void Copy(const std::string& name, Keep keep) {
    lcm::LogFile from(Path("run.lcm"), "r");
    lcm::LogFile to(Path(name), "w");
    int number = 0;
    while (const lcm::LogEvent* event = from.readNextEvent()) {
      const bool state = event->channel == kStateChannel;
      if (!keep(event->channel, number)) {
        number += state ? 1 : 0;
        continue;
      }
      number += state ? 1 : 0;
      lcm::LogEvent copy = *event;
      to.writeEvent(&copy);
    }
  }

  static std::unique_ptr<testing::TemporaryFolder> folder_;
  std::string text_;
};
std::unique_ptr<testing::TemporaryFolder> TumblerLog::folder_;

TEST_F(TumblerLog, ConvertsToTheTableThatTheRunItselfWrites) {
  ASSERT_EQ(Log({Path("run.lcm"), "--csv", Path("log.csv")}), 0) << text_;
  EXPECT_THAT(text_, HasSubstr("0 missing"));
  const std::string table = Read("log.csv");
  EXPECT_GT(table.size(), 10000U);
  EXPECT_TRUE(table == Read("trace.csv"));
  EXPECT_THAT(table.substr(0, table.find('\n')), HasSubstr("leg1_measured_position_rad"));
}

TEST_F(TumblerLog, WritesEveryNumberSoThatItReadsBackExactly) {
  ASSERT_EQ(Log({Path("run.lcm"), "--csv", Path("log.csv")}), 0) << text_;
  std::istringstream table(Read("log.csv"));
  std::string line;
  std::getline(table, line);
  std::vector<std::string> header;
  for (std::istringstream names(line); std::getline(names, line, ',');) header.push_back(line);
  const auto column = static_cast<std::size_t>(
      std::find(header.begin(), header.end(), "leg2_measured_position_rad") - header.begin());
  ASSERT_LT(column, header.size());
  lcm::LogFile log(Path("run.lcm"), "r");
  int rows = 0;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    if (event->channel != kStateChannel) continue;
    state_t state;
    ASSERT_EQ(state.decode(event->data, 0, event->datalen), event->datalen);
    ASSERT_TRUE(std::getline(table, line));
    std::vector<std::string> cells;
    std::string cell;
    for (std::istringstream row(line); std::getline(row, cell, ',');) cells.push_back(cell);
    ASSERT_EQ(cells.size(), header.size());
    float value = 0;
    std::from_chars(cells[column].data(), cells[column].data() + cells[column].size(), value);
    EXPECT_EQ(value, state.joints[1].measured_position_rad);
    ++rows;
  }
  EXPECT_GT(rows, 300);
  EXPECT_FALSE(std::getline(table, line));
}

TEST_F(TumblerLog, ReadsALogOfBeforeItWasKnownWhenRepliesWereSampled) {
  const std::string log = testing::SourcePath("tests/data/records/states_of_0_1.lcm");
  ASSERT_EQ(Log({log, "--csv", Path("former.csv")}), 4) << "most of it is left out:" << text_;
  EXPECT_THAT(text_, HasSubstr("missing"));
  EXPECT_THAT(text_, HasSubstr("0 messages damaged"));
  std::istringstream table(Read("former.csv"));
  std::vector<std::vector<std::string>> rows;
  for (std::string line; std::getline(table, line);) {
    rows.emplace_back();
    std::string cell;
    for (std::istringstream row(line); std::getline(row, cell, ',');) rows.back().push_back(cell);
  }
  ASSERT_EQ(rows.size(), 9U);
  for (const std::string leg : {"leg1", "leg2"}) {
    const auto column = [&](const std::string& name) {
      const std::string column_name = fmt::format("{}_{}", leg, name);
      return static_cast<std::size_t>(std::ranges::find(rows[0], column_name) - rows[0].begin());
    };
    // As tumbler run wrote them then; the fields after it have to be in their places, too.
    EXPECT_EQ(rows[8][column("limited_position_rad")], leg == "leg1" ? "-1.5708803" : "1.570904");
    EXPECT_EQ(rows[8][column("correction_rad")], "0");
    EXPECT_EQ(rows[8][column("reply_sampled_us")], "") << "not known";
  }
  EXPECT_EQ(Log({log, "--mcap", Path("former.mcap")}), 4) << text_;
  EXPECT_GT(Read("former.mcap").size(), 1000U);
}

TEST_F(TumblerLog, CountsWhatWasLost) {
  Copy("holes.lcm", [](const std::string& channel, int number) {
    return channel != kStateChannel || (number != 0 && (number < 50 || number >= 57));
  });
  EXPECT_EQ(Log({Path("holes.lcm"), "--csv", Path("holes.csv")}), 4);
  EXPECT_THAT(text_, HasSubstr("8 missing"));
}

TEST_F(TumblerLog, NamesJointsByNumberWhereTheLogDoesNotSayTheirNames) {
  Copy("anonymous.lcm", [](const std::string& channel, int) { return channel != kRunChannel; });
  EXPECT_EQ(Log({Path("anonymous.lcm"), "--csv", Path("anonymous.csv")}), 0) << text_;
  const std::string named = Read("trace.csv");
  const std::string table = Read("anonymous.csv");
  EXPECT_THAT(table, HasSubstr(",joint1_planned_position_rad,"));
  EXPECT_EQ(table.substr(table.find('\n')), named.substr(named.find('\n')));
}

TEST_F(TumblerLog, PrintsEventsAndTheEnd) {
  EXPECT_EQ(Log({Path("run.lcm")}), 0);
  EXPECT_THAT(text_, HasSubstr("holding -> running"));
  EXPECT_THAT(text_, HasSubstr("state   disarmed"));
}

TEST_F(TumblerLog, CountsMessagesThatAreNotWhatTheirChannelSays) {
  Copy("damaged.lcm", [](const std::string&, int) { return true; });
  {
    lcm::LogFile log(Path("damaged.lcm"), "a");
    lcm::LogEvent event{};
    event.channel = kStateChannel;
    std::string bytes = "not a state";
    event.data = bytes.data();
    event.datalen = static_cast<int>(bytes.size());
    ASSERT_EQ(log.writeEvent(&event), 0);
  }
  EXPECT_EQ(Log({Path("damaged.lcm"), "--csv", "-"}), 4);
  EXPECT_THAT(text_, HasSubstr("1 messages damaged"));
}

TEST_F(TumblerLog, SaysWhatIsNotWholeAndGoesOnBehindIt) {
  const std::string whole = Read("run.lcm");
  ASSERT_EQ(Log({Path("run.lcm"), "--csv", "-"}), 0);
  const auto rows = [this] { return std::count(text_.begin(), text_.end(), '\n'); };
  const auto all = rows();
  const std::size_t event = whole.find("\xED\xA1\xDA\x01", whole.size() / 2);
  ASSERT_NE(event, std::string::npos);
  const auto damaged = [&](const std::string& bytes) {
    testing::WriteFile(Path("damaged.lcm"), bytes);
    return Log({Path("damaged.lcm"), "--csv", "-"});
  };
  std::string flipped = whole, longer = whole, shorter = whole;
  flipped[event] = '\x6D';
  longer[event + 24] = '\0';
  longer[event + 25] = '\1';
  longer[event + 26] = '\xff';
  shorter.erase(event + 40, 60);
  for (const std::string& bytes : {flipped, longer, shorter}) {
    EXPECT_EQ(damaged(bytes), 4);
    EXPECT_THAT(text_, HasSubstr("damaged.lcm: NOT whole: "));
    EXPECT_GT(rows(), all * 3 / 4) << "what comes behind is there";
    EXPECT_LT(rows(), all + 2);
  }
  EXPECT_EQ(damaged(whole.substr(0, event + 10)), 4) << "cut off";
  EXPECT_THAT(text_, HasSubstr(fmt::format("NOT whole: 10 bytes are in no whole event, the first "
                                           "at byte {}",
                                           event)));
  EXPECT_EQ(damaged(whole + "rubbish"), 4);
  EXPECT_THAT(text_, HasSubstr("damaged.lcm: NOT whole: "));
  EXPECT_EQ(Log({"/dev/zero"}), 1);
  EXPECT_THAT(text_, HasSubstr("/dev/zero: cannot be read"));
}

TEST_F(TumblerLog, RefusesWhatItCannotUseAndWritesNothing) {
  EXPECT_EQ(Log({Path("none.lcm")}), 1);
  EXPECT_THAT(text_, HasSubstr("none.lcm: cannot be read"));
  EXPECT_EQ(Log({kMotion, "--csv", Path("x.csv")}), 1);
  EXPECT_THAT(text_, HasSubstr("is neither a flight record nor an LCM log"));
  {
    lcm::LogFile others(Path("others.lcm"), "w");
    lcm::LogEvent event{};
    event.channel = "OTHER";
    std::string bytes = "not ours";
    event.data = bytes.data();
    event.datalen = static_cast<int>(bytes.size());
    ASSERT_EQ(others.writeEvent(&event), 0);
  }
  EXPECT_EQ(Log({Path("others.lcm"), "--csv", Path("x.csv")}), 1);
  EXPECT_THAT(text_, HasSubstr("has no message of tumbler run"));
  for (const char* const option : {"--candump", "--log", "--truth-csv"}) {
    EXPECT_EQ(Log({Path("run.lcm"), option, Path("x.csv")}), 1);
    EXPECT_THAT(text_, HasSubstr(std::string(option) + ": is for flight records"));
  }
  for (const auto& entry : std::filesystem::directory_iterator(Path("")))
    EXPECT_FALSE(entry.path().filename().string().starts_with("x.csv")) << entry.path();
  EXPECT_EQ(Log({Path("run.lcm"), "--csv", "/proc/nowhere/x.csv"}), 1);
  EXPECT_THAT(text_, HasSubstr("/proc/nowhere/x.csv: cannot be written"));
  EXPECT_EQ(Log({}), 1);
}

}  // namespace
}  // namespace tumbler
