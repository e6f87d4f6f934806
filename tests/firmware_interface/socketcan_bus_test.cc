#include "firmware_interface/can/socketcan_bus.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <net/if.h>

#include <cerrno>

namespace tumbler {
namespace {

using ::testing::HasSubstr;

TEST(SocketCanBus, OpeningAMissingInterfaceNamesItAndTheCause) {
  SocketCanBus bus;
  const auto result = bus.Open("nocan7");
  EXPECT_EQ(result.status, Status::kLinkDown);
  EXPECT_EQ(result.error_number, ENODEV);
  EXPECT_THAT(result.message, HasSubstr("'nocan7' cannot be found"));
  EXPECT_EQ(bus.last_errno(), ENODEV);
}

TEST(SocketCanBus, OpeningAnInterfaceOfAnotherKindIsRefused) {
  if (if_nametoindex("lo") == 0) GTEST_SKIP() << "this machine has no loopback interface";
  SocketCanBus bus;
  const auto result = bus.Open("lo");
  EXPECT_EQ(result.status, Status::kInvalidArgument);
  EXPECT_THAT(result.message, HasSubstr("'lo' is not a CAN interface"));
}

TEST(SocketCanBus, RefusesNamesThatNoInterfaceCanHave) {
  SocketCanBus bus;
  EXPECT_EQ(bus.Open("").status, Status::kInvalidArgument);
  EXPECT_EQ(bus.Open("a-name-of-16-chr").status, Status::kInvalidArgument);
}

TEST(SocketCanBus, IsALostLinkUntilItIsOpen) {
  SocketCanBus bus;
  ReceivedFrame received;
  received.time_ns = 5;
  EXPECT_EQ(bus.Send(CanFrame{}), Status::kLinkDown);
  EXPECT_EQ(bus.Receive(received), Status::kLinkDown);
  EXPECT_EQ(received.time_ns, 5);
  EXPECT_NE(bus.Open("nocan7").status, Status::kOk);
  EXPECT_EQ(bus.Send(CanFrame{}), Status::kLinkDown);
}

TEST(SocketCanBus, ChecksFramesBeforeTheLink) {
  SocketCanBus bus;
  CanFrame frame;
  frame.id = 0x800;
  EXPECT_EQ(bus.Send(frame), Status::kInvalidArgument);
}

}  // namespace
}  // namespace tumbler
