#include "offline/model/urdf_source.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "tests/offline/robot_texts.h"
#include "tests/support/task_files.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::LineOf;
using testing::Refusal;
using testing::ShippedRobot;

TEST(UrdfSource, KnowsLinesOfElements) {
  const std::string text = ShippedRobot();
  const UrdfSource source(text, "robot.urdf");
  EXPECT_EQ(source.LineOfLink("middle", "mass"),
            static_cast<std::uint32_t>(LineOf(text, "<mass value=\"1.0\"")));
  EXPECT_EQ(source.LineOfJoint("leg1", "limit"),
            static_cast<std::uint32_t>(LineOf(text, "<limit")));
  EXPECT_EQ(source.LineOfJoint("leg1", "dynamics"),
            static_cast<std::uint32_t>(LineOf(text, "<joint name=\"leg1\"")))
      << "what is not there is at the line of the whole";
  EXPECT_EQ(source.LineOfLink("absent", ""), 0U);
  ASSERT_EQ(source.joints().size(), 2U);
  EXPECT_EQ(source.joints()[0].name, "leg1");
  EXPECT_EQ(source.joints()[1].name, "leg2");
}

TEST(UrdfSource, ElementsInElementsAreRefusedBeforeTheyExhaustTheStack) {
  constexpr int kDepth = 1'000'000;
  // The text before must not be taken for the end of something: it is inside of nothing, or no end
  // at all.
  for (const std::string before :
       {"<robot name=\"a\">", "<robot name=\"/>\">", "<robot name='>\"'>", "<1 \"><robot>",
        "<!-- </x></x> --><robot>", "<![CDATA[</x>]]><robot>", "<?xml version=\"1.0\"?>\r\n<robot>",
        "<robot/></robot></robot><robot>"}) {
    std::string text = before;
    for (int i = 0; i < kDepth; ++i) text += i % 2 == 0 ? "<b>" : "<a x='/>'>";
    EXPECT_THAT(Refusal(text), HasSubstr("elements are nested more than 100 deep")) << before;
  }
}

TEST(UrdfSource, MoreLinksThanARobotHasAreRefusedAndAsManyAreRead) {
  const auto chain = [](int links) {
    std::string text = "<robot name=\"chain\">\n";
    for (int i = 0; i < links; ++i) {
      text += "<link name=\"l" + std::to_string(i) + "\"/>\n";
      if (i == 0) continue;
      text += "<joint name=\"j" + std::to_string(i) + "\" type=\"" +
              (i == 1 ? "continuous" : "fixed") + "\"><parent link=\"l" + std::to_string(i - 1) +
              "\"/><child link=\"l" + std::to_string(i) + "\"/><axis xyz=\"0 1 0\"/></joint>\n";
    }
    return text + "</robot>";
  };
  EXPECT_EQ(ParseRobot(chain(1000), "robot.urdf", RootKind::kFixed).links.size(), 1000U);
  EXPECT_THAT(Refusal(chain(1001)), HasSubstr("link 'l1000': the robot has more than 1000 links"));
}

TEST(UrdfSource, NoTruncationOfAFileCrashesOrPasses) {
  const std::string text = ShippedRobot();
  const std::size_t whole = text.find("</robot>");
  for (std::size_t length = 0; length < whole + 8; length += 7) {
    EXPECT_NE(Refusal(text.substr(0, length)), "") << length;
  }
}

}  // namespace
}  // namespace tumbler
