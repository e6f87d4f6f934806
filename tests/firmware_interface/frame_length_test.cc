#include "firmware_interface/can/frame_length.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace tumbler {
namespace {

CanFrame Frame(std::uint32_t id, std::vector<std::uint8_t> data, bool extended = false) {
  CanFrame frame;
  frame.id = id;
  frame.extended = extended;
  frame.size = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), frame.data.begin());
  return frame;
}

CanFrame RandomFrame(std::mt19937_64& random) {
  CanFrame frame;
  frame.extended = random() % 2 == 0;
  frame.remote = random() % 8 == 0;
  frame.id = static_cast<std::uint32_t>(random()) & (frame.extended ? 0x1fffffffU : 0x7ffU);
  frame.size = static_cast<std::uint8_t>(random() % 9);
  for (auto& byte : frame.data) {
    // Stuffing happens in long runs of equal bits, so the data has many of them.
    byte =
        random() % 2 == 0 ? static_cast<std::uint8_t>(random()) : (random() % 2 == 0 ? 0x00 : 0xff);
  }
  return frame;
}

std::vector<std::uint8_t> Bits(const std::string& text) {
  std::vector<std::uint8_t> bits;
  for (const char c : text) {
    if (c == '0' || c == '1') bits.push_back(c == '1' ? 1 : 0);
  }
  return bits;
}

/// Polynomial long division, independent of the shift register under test: the remainder of bits *
/// x^15.
std::uint16_t DivisionCrc(std::vector<std::uint8_t> bits) {
  const std::vector<std::uint8_t> divisor =
      Bits("1100 0101 1001 1001");  // x^15+x^14+x^10+x^8+x^7+x^4+x^3+1
  const std::size_t count = bits.size();
  bits.resize(count + 15);
  for (std::size_t i = 0; i < count; ++i) {
    if (bits[i] == 0) continue;
    for (std::size_t k = 0; k < divisor.size(); ++k) bits[i + k] ^= divisor[k];
  }
  std::uint16_t remainder = 0;
  for (std::size_t i = count; i < count + 15; ++i)
    remainder = static_cast<std::uint16_t>(remainder << 1 | bits[i]);
  return remainder;
}

/// Removes stuff bits, as a receiver does. @returns false when there are six equal bits in a row.
bool Unstuff(std::span<const std::uint8_t> bits, std::vector<std::uint8_t>& plain) {
  int run = 0;
  int last = -1;
  plain.clear();
  for (std::size_t i = 0; i < bits.size(); ++i) {
    const bool stuffed = run == 5;
    if (stuffed && bits[i] == last) return false;
    run = bits[i] == last ? run + 1 : 1;
    last = bits[i];
    if (!stuffed) plain.push_back(bits[i]);
  }
  return true;
}

TEST(CanCrc15, HasTheCheckValueOfTheCatalogue) {
  // CRC-15/CAN: check value 0x059e for the ASCII digits 1 to 9 (G. Cook, Catalogue of parametrised
  // CRC algorithms).
  std::vector<std::uint8_t> bits;
  for (const char c : std::string("123456789")) {
    for (int i = 7; i >= 0; --i) bits.push_back(static_cast<std::uint8_t>((c >> i) & 1));
  }
  EXPECT_EQ(CanCrc15(bits), 0x059e);
}

TEST(CanCrc15, IsTheRemainderOfPolynomialDivision) {
  std::mt19937_64 random(1);
  for (int trial = 0; trial < 500; ++trial) {
    std::vector<std::uint8_t> bits(1 + random() % 118);
    for (auto& bit : bits) bit = static_cast<std::uint8_t>(random() % 2);
    EXPECT_EQ(CanCrc15(bits), DivisionCrc(bits));
  }
}

TEST(BitStream, OfAKnownFrameIsTheOneWorkedOutByHand) {
  const FrameBitStream stream = BuildBitStream(Frame(0x014, {0x01}));
  // SOF 0, id 00000010100, RTR 0, IDE 0, r0 0, DLC 0001, data 00000001, CRC. A stuff bit follows
  // every fifth equal bit.
  const std::vector<std::uint8_t> plain = Bits("0 00000010100 000 0001 00000001");
  EXPECT_EQ(stream.crc, DivisionCrc(plain));
  const std::vector<std::uint8_t> front = Bits("00000 1 00 1 0 1 00000 1 0001 00000 1 00 1");
  ASSERT_GE(stream.count, static_cast<int>(front.size()));
  EXPECT_TRUE(std::equal(front.begin(), front.end(), stream.bits.begin()));
}

TEST(BitStream, AStuffBitCountsTowardsTheNextRun) {
  // All zero: SOF, identifier and control field of a frame with DLC 0 are 19 zeros, the CRC of
  // zeros is zero: 34 zeros. After five come stuff bits at once, then after every five further
  // ones: 0^5 1 0^5 1 ..., six whole groups of five.
  const FrameBitStream zeros = BuildBitStream(Frame(0, {}));
  EXPECT_EQ(zeros.crc, 0);
  EXPECT_EQ(zeros.stuff_bits, 6);
  EXPECT_EQ(FrameBits(Frame(0, {})), 47 + 6);
  // 11111 0 0000 1: the stuff bit 0 and four zeros make five, so a second stuff bit follows.
  const FrameBitStream next = BuildBitStream(Frame(0x7c1, {}));
  const std::vector<std::uint8_t> front = Bits("0 11111 0 0000 1 0 1");  // 0x7c1 = 11111 00000 1
  EXPECT_TRUE(std::equal(front.begin(), front.end(), next.bits.begin()));
}

TEST(BitStream, ReceiverRecoversTheFieldsOfEveryFrame) {
  std::mt19937_64 random(2);
  for (int trial = 0; trial < 20'000; ++trial) {
    const CanFrame frame = RandomFrame(random);
    const FrameBitStream stream = BuildBitStream(frame);
    std::vector<std::uint8_t> plain;
    ASSERT_TRUE(Unstuff(stream.view(), plain));
    ASSERT_EQ(static_cast<int>(plain.size()), stream.count - stream.stuff_bits);
    std::size_t at = 0;
    const auto take = [&plain, &at](int width) {
      std::uint32_t value = 0;
      for (int i = 0; i < width; ++i) value = value << 1 | plain[at++];
      return value;
    };
    ASSERT_EQ(take(1), 0U);
    std::uint32_t id = take(11);
    std::uint32_t remote = take(1);
    const bool extended = take(1) == 1;
    if (extended) {
      ASSERT_EQ(remote, 1U);  // SRR
      id = id << 18 | take(18);
      remote = take(1);
      ASSERT_EQ(take(1), 0U);
    }
    ASSERT_EQ(take(1), 0U);
    ASSERT_EQ(take(4), frame.size);
    ASSERT_EQ(id, frame.id);
    ASSERT_EQ(extended, frame.extended);
    ASSERT_EQ(remote == 1, frame.remote);
    for (std::size_t i = 0; !frame.remote && i < frame.size; ++i) ASSERT_EQ(take(8), frame.data[i]);
    const std::vector<std::uint8_t> covered(plain.begin(),
                                            plain.begin() + static_cast<std::ptrdiff_t>(at));
    ASSERT_EQ(take(15), DivisionCrc(covered));
    ASSERT_EQ(at, plain.size());
  }
}

TEST(FrameBits, LieBetweenUnstuffedAndWorstCase) {
  std::mt19937_64 random(3);
  for (int trial = 0; trial < 100'000; ++trial) {
    const CanFrame frame = RandomFrame(random);
    const CanIdKind kind = frame.extended ? CanIdKind::kExtended : CanIdKind::kStandard;
    const int size = frame.remote ? 0 : frame.size;
    ASSERT_GE(FrameBits(frame), UnstuffedFrameBits(kind, size));
    ASSERT_LE(FrameBits(frame), WorstCaseFrameBits(kind, size));
  }
}

TEST(FrameBits, AreThoseOfTheBitStream) {
  std::mt19937_64 random(5);
  for (int i = 0; i < 200'000; ++i) {
    const CanFrame frame = RandomFrame(random);
    ASSERT_EQ(FrameBits(frame), BuildBitStream(frame).count + kFrameTailBits + kIntermissionBits);
  }
}

TEST(WorstCaseFrameBits, AreThePublishedFormulas) {
  for (int n = 0; n <= 8; ++n) {
    EXPECT_EQ(WorstCaseFrameBits(CanIdKind::kStandard, n), 55 + 10 * n);
    EXPECT_EQ(WorstCaseFrameBits(CanIdKind::kExtended, n), 80 + 10 * n);
  }
}

/// The length of the longest frame with this many bytes that a greedy search finds, over many
/// identifiers. It chooses data bytes that continue 1111 0000 1111 ... after the control field; the
/// CRC cannot be chosen.
int LongestFound(int size, std::mt19937_64& random) {
  int longest = 0;
  for (int trial = 0; trial < 6000; ++trial) {
    CanFrame best;
    best.size = static_cast<std::uint8_t>(size);
    // 0x78 = 00001111000: with SOF five zeros first, then runs of four.
    best.id = trial % 2 == 0 ? 0x078 : static_cast<std::uint32_t>(random() % 0x800);
    for (auto& byte : best.data) byte = random() % 2 == 0 ? 0x3c : 0xc3;
    int bits = FrameBits(best);
    for (int step = 0; step < 60; ++step) {
      CanFrame next = best;
      const std::size_t byte = random() % static_cast<std::size_t>(std::max(size, 1));
      if (size > 0) next.data[byte] ^= static_cast<std::uint8_t>(1U << (random() % 8));
      if (random() % 8 == 0) next.id ^= 1U << (random() % 11);
      const int next_bits = FrameBits(next);
      if (next_bits >= bits) {
        best = next;
        bits = next_bits;
      }
    }
    longest = std::max(longest, bits);
  }
  return longest;
}

TEST(WorstCaseFrameBits, OfShortFramesAreExceededByNoFrameAtAll) {
  // Every identifier with 0 and 1 byte of data, remote or not.
  int longest[2] = {0, 0};
  for (std::uint32_t id = 0; id < 0x800; ++id) {
    longest[0] = std::max(longest[0], FrameBits(Frame(id, {})));
    for (int byte = 0; byte < 256; ++byte) {
      longest[1] = std::max(longest[1], FrameBits(Frame(id, {static_cast<std::uint8_t>(byte)})));
    }
  }
  EXPECT_LE(longest[0], WorstCaseFrameBits(CanIdKind::kStandard, 0));
  EXPECT_LE(longest[1], WorstCaseFrameBits(CanIdKind::kStandard, 1));
  EXPECT_GE(longest[1], WorstCaseFrameBits(CanIdKind::kStandard, 1) - 3);
}

TEST(WorstCaseFrameBits, AreNearlyReachedByFramesOfEightBytes) {
  std::mt19937_64 random(4);
  const int longest = LongestFound(8, random);
  RecordProperty("longest", longest);
  EXPECT_LE(longest, WorstCaseFrameBits(CanIdKind::kStandard, 8));
  // The bound is not tight, since it counts the control field and the CRC as bits that can be
  // chosen. The search finds 132 of 135.
  EXPECT_GE(longest, WorstCaseFrameBits(CanIdKind::kStandard, 8) - 3);
}

TEST(ArbitrationKey, OrdersFramesAsTheirBitsDoOnTheWire) {
  // Independent reference: the first bit at which the unstuffed arbitration fields differ.
  const auto field = [](const CanFrame& frame) {
    std::vector<std::uint8_t> plain;
    Unstuff(BuildBitStream(frame).view(), plain);
    plain.resize(33);  // SOF and up to 32 bits: longer than either field
    if (!frame.extended) std::fill(plain.begin() + 14, plain.end(), std::uint8_t{0});  // from r0 on
    return plain;
  };
  std::mt19937_64 random(5);
  for (int trial = 0; trial < 50'000; ++trial) {
    CanFrame a = RandomFrame(random);
    CanFrame b = RandomFrame(random);
    if (random() % 2 == 0) {  // The same leading bits, for then the rules matter.
      const std::uint32_t base = static_cast<std::uint32_t>(random() % 0x800);
      a.id = a.extended ? base << 18 | static_cast<std::uint32_t>(random() % 4) : base;
      b.id = b.extended ? base << 18 | static_cast<std::uint32_t>(random() % 4) : base;
    }
    ASSERT_EQ(ArbitrationKey(a) < ArbitrationKey(b), field(a) < field(b));
    ASSERT_EQ(ArbitrationKey(a) == ArbitrationKey(b), field(a) == field(b));
  }
}

TEST(IsValid, KnowsTheRangesOfBothFormats) {
  EXPECT_TRUE(IsValid(Frame(0x7ff, {})));
  EXPECT_FALSE(IsValid(Frame(0x800, {})));
  EXPECT_TRUE(IsValid(Frame(0x1fffffff, {}, true)));
  EXPECT_FALSE(IsValid(Frame(0x20000000, {}, true)));
  CanFrame frame;
  frame.size = 9;
  EXPECT_FALSE(IsValid(frame));
}

}  // namespace
}  // namespace tumbler
