#include "common/files/command_text.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

CommandDescription Player() {
  CommandDescription player;
  player.name = "tumbler-play";
  player.description = "Plays a motion. It says `hello' first.";
  player.footer = ".dots\\and'quotes begin lines";
  OptionDescription motion;
  motion.names = {"MOTION"};
  motion.value = "TEXT";
  motion.help = "what is played";
  motion.positional = motion.required = true;
  OptionDescription mode;
  mode.names = {"-m", "--mode"};
  mode.value = "TEXT";
  mode.choices = {"slow", "fast"};
  mode.default_value = "slow";
  mode.help = std::string(90, 'x') + " " + std::string(40, 'y');
  OptionDescription cpu;
  cpu.names = {"--cpu"};
  cpu.value = "INT";
  cpu.range = "0 ... 7";
  OptionDescription arm;
  arm.names = {"--arm"};
  player.options = {motion, mode, cpu, arm};
  return player;
}

TEST(CommandText, HelpTellsWhatIsNeededAllowedAndDefault) {
  const std::string help = HelpText(Player());
  for (const char* part : {"Usage: tumbler-play [OPTIONS] MOTION\n", "\n  MOTION ",
                           "\n  -m, --mode TEXT           xxx", "yyy [slow, fast; default slow]\n",
                           "\n  --cpu INT                 [0 ... 7]\n", "\n  --arm"}) {
    EXPECT_THAT(help, HasSubstr(part));
  }
}

TEST(CommandText, HelpIsAHundredCharactersWideWhereWordsCanBeSplit) {
  CommandDescription player = Player();
  player.options[1].help = "";
  for (int i = 0; i < 60; ++i) player.options[1].help += "word ";
  player.description = player.options[1].help;
  std::istringstream help(HelpText(player));
  std::size_t widest = 0;
  for (std::string line; std::getline(help, line);) widest = std::max(widest, line.size());
  EXPECT_LE(widest, 100);
  EXPECT_GT(widest, 90);
  std::istringstream narrow(HelpText(player, 72));
  for (std::string line; std::getline(narrow, line);) EXPECT_LE(line.size(), 72U) << line;
}

TEST(CommandText, EndsOfLinesInAParagraphOfTheSourceAreNotThoseOfTheHelp) {
  CommandDescription player = Player();
  const std::string wide(59, 'w');
  player.footer = "One paragraph " + wide + " " + wide +
                  "\nof two lines.\n\nStatuses:\n  0    done\n" + "  12   " + wide + " and " +
                  wide + "\n       goes on\nA paragraph\nof two lines.\n";
  EXPECT_THAT(HelpText(player),
              HasSubstr("\n\nOne paragraph " + wide + "\n" + wide + " of two lines.\n\n" +
                        "Statuses:\n  0    done\n  12   " + wide + " and\n       " + wide +
                        " goes on\nA paragraph of two lines.\n"));
  EXPECT_THAT(ManPage(player, "1"), HasSubstr(".TP\n12\n" + wide + " and " + wide +
                                              " goes on\n.PP\n" + "A paragraph of two lines.\n"));
}

TEST(CommandText, ManualPageHasNoLineThatTroffTakesForARequestOrAnEscape) {
  const std::string page = ManPage(Player(), "1.2.3");
  EXPECT_THAT(page, HasSubstr(".TH TUMBLER\\-PLAY 1 \"\" \"Tumbler 1.2.3\""));
  EXPECT_THAT(page, HasSubstr("tumbler\\-play \\- Plays a motion\n"));
  EXPECT_THAT(page, HasSubstr("\\&.dots\\eand\\(aqquotes"));
  EXPECT_THAT(page, HasSubstr("\\fB\\-m\\fR, \\fB\\-\\-mode\\fR \\fITEXT\\fR"));
  EXPECT_THAT(page, Not(HasSubstr("\n.dots")));
}

TEST(CommandText, ANameOfSeveralWordsIsThatOfAPageWithoutSpacesAndOfAFunctionOfTheCompletion) {
  CommandDescription player = Player();
  player.name = "tumbler play";
  EXPECT_THAT(HelpText(player), HasSubstr("Usage: tumbler play [OPTIONS] MOTION\n"));
  const std::string page = ManPage(player, "1");
  EXPECT_THAT(page, HasSubstr(".TH TUMBLER\\-PLAY 1 "));
  EXPECT_THAT(page,
              HasSubstr("\ntumbler\\-play \\- Plays a motion\n.SH SYNOPSIS\n.B tumbler play "));
  EXPECT_THAT(BashCompletion(player), HasSubstr("\n_tumbler_play() {\n"));
  EXPECT_THAT(BashCompletion(player), Not(HasSubstr("complete -o")));
  EXPECT_THAT(BashCompletion(Player()),
              HasSubstr("complete -o default -F _tumbler_play tumbler-play\n"));
}

TEST(CommandText, AFirstSentenceEndsWhereTheNextOneBegins) {
  EXPECT_EQ(FirstSentence("Plays. Or not."), "Plays");
  EXPECT_EQ(FirstSentence("Plays\na motion: this one"), "Plays a motion");
  EXPECT_EQ(FirstSentence("Shows can0.log."), "Shows can0.log");
}

}  // namespace
}  // namespace tumbler
