#include "firmware_interface/can/bus_schedule.h"

#include <gtest/gtest.h>

#include "firmware_interface/can/frame_length.h"

namespace tumbler {
namespace {

BusSchedule TwoDrives(double rate_hz) {
  BusSchedule schedule;
  schedule.rate_hz = rate_hz;
  schedule.longest_frame_bits = WorstCaseFrameBits(CanIdKind::kStandard, 8);
  schedule.tick_bits = 4 * schedule.longest_frame_bits;
  return schedule;
}

TEST(BusSchedule, TwoDrivesAtOneKilohertzTakeFiftyFourPercent) {
  const BusSchedule schedule = TwoDrives(1000);
  EXPECT_EQ(schedule.tick_bits, 540);
  EXPECT_DOUBLE_EQ(schedule.load(), 0.54);
  EXPECT_TRUE(schedule.feasible());
}

TEST(BusSchedule, KeepsRoomInEachTickForOneErrorAndTheFrameAgain) {
  // A tick has 540 + 31 + 135 = 706 bits, so that 1e6 / 706 = 1416.4 Hz are possible.
  const BusSchedule schedule = TwoDrives(1416);
  EXPECT_TRUE(schedule.feasible());
  EXPECT_NEAR(schedule.ceiling_hz(), 1416.43, 0.01);
  EXPECT_NEAR(schedule.load_allowed(), 540.0 / 706.0, 1e-12);
  EXPECT_FALSE(TwoDrives(1417).feasible());
  EXPECT_LT(TwoDrives(1417).load(), 1) << "although the frames alone would fit";
}

TEST(BusSchedule, ASlowerBusCarriesLess) {
  BusSchedule schedule = TwoDrives(1000);
  schedule.bit_rate = 500'000;
  EXPECT_FALSE(schedule.feasible());
  schedule.rate_hz = 700;
  EXPECT_TRUE(schedule.feasible());
}

TEST(BusSchedule, PrintsItsArithmetic) {
  EXPECT_EQ(
      TwoDrives(1000).Describe(),
      "540 bits a tick at worst; at 1000 Hz 54.0 % of 1000000 bit/s\n"
      "  allowed 76.5 % (1416 Hz): each tick keeps 31 + 135 bits for an error and the longest "
      "frame again");
}

}  // namespace
}  // namespace tumbler
