#include "firmware_interface/can/frame_length.h"

namespace tumbler {

namespace {

constexpr std::uint16_t kCrcPolynomial = 0x4599;
constexpr std::uint16_t kCrcMask = 0x7fff;

constexpr std::uint16_t CrcStep(std::uint16_t crc, std::uint8_t bit) noexcept {
  const bool feedback = bit != ((crc >> 14) & 1U);
  const auto shifted = static_cast<std::uint16_t>((crc << 1) & kCrcMask);
  return feedback ? static_cast<std::uint16_t>(shifted ^ kCrcPolynomial) : shifted;
}

// Appends bits with their stuff bits, and keeps the CRC of the bits that are no stuff bits.
class BitWriter {
 public:
  explicit BitWriter(FrameBitStream& stream) noexcept : stream_(stream) {}

  void Append(std::uint32_t value, int width) noexcept {
    for (int i = width - 1; i >= 0; --i) AppendBit(static_cast<std::uint8_t>((value >> i) & 1U));
  }

  void AppendBit(std::uint8_t bit) noexcept {
    stream_.crc = CrcStep(stream_.crc, bit);
    Put(bit);
    if (run_ == 5) {
      ++stream_.stuff_bits;
      Put(bit == 0 ? 1 : 0);  // The stuff bit counts as the first of the next run.
    }
  }

 private:
  void Put(std::uint8_t bit) noexcept {
    run_ = bit == last_ ? run_ + 1 : 1;
    last_ = bit;
    stream_.bits[static_cast<std::size_t>(stream_.count++)] = bit;
  }

  FrameBitStream& stream_;
  std::uint8_t last_ = 2;  // neither 0 nor 1: no bit yet
  int run_ = 0;
};

// FrameBits only counts, and takes eight bits at a time. BuildBitStream is what it has to agree
// with.

/// The CRC of a byte after zeros, by the byte.
constexpr auto kCrcOfByte = [] {
  std::array<std::uint16_t, 256> table{};
  for (std::size_t byte = 0; byte < 256; ++byte) {
    std::uint16_t crc = 0;
    for (int i = 7; i >= 0; --i) crc = CrcStep(crc, static_cast<std::uint8_t>(byte >> i & 1U));
    table[byte] = crc;
  }
  return table;
}();
constexpr std::uint16_t CrcAfter(std::uint16_t crc, unsigned byte) noexcept {
  return static_cast<std::uint16_t>((crc << 8 & kCrcMask) ^ kCrcOfByte[(crc >> 7 ^ byte) & 0xff]);
}

/// How stuffing goes on: the last bit, and how many equal ones there were, at most four: with the
/// fifth comes a stuff bit, which is the first of the next run. 4 bit + run - 1, or kNoBit.
constexpr std::uint8_t kNoBit = 8;
struct Stuffing {
  std::uint8_t state = kNoBit;
  std::uint8_t stuff_bits = 0;
};
constexpr Stuffing StuffBit(Stuffing at, unsigned bit) noexcept {
  const unsigned last = at.state / 4U, run = at.state % 4U + 1;
  if (at.state == kNoBit || bit != last) return {static_cast<std::uint8_t>(4 * bit), at.stuff_bits};
  if (run < 4) return {static_cast<std::uint8_t>(4 * bit + run), at.stuff_bits};
  return {static_cast<std::uint8_t>(4 * (1 - bit)), static_cast<std::uint8_t>(at.stuff_bits + 1)};
}
/// The same after the eight bits of a byte, by the state before and the byte.
constexpr auto kStuffByte = [] {
  std::array<std::array<Stuffing, 256>, kNoBit> table{};
  for (std::uint8_t state = 0; state < kNoBit; ++state) {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      Stuffing at{state, 0};
      for (int i = 7; i >= 0; --i) at = StuffBit(at, static_cast<unsigned>(byte >> i & 1U));
      table[state][byte] = at;
    }
  }
  return table;
}();

/// Counts the bits that are exposed to stuffing, and their stuff bits.
class BitCounter {
 public:
  /// The first bits, the most significant first. Leading zeros do not change a CRC.
  void Begin(std::uint64_t bits, int count) noexcept {
    count_ = count;
    for (int i = count - 1; i >= count - count % 8; --i)
      Stuff(static_cast<unsigned>(bits >> i & 1));
    for (int i = count / 8 * 8 - 8; i >= 0; i -= 8) StuffEight(static_cast<unsigned>(bits >> i));
    for (int i = (count + 7) / 8 * 8 - 8; i >= 0; i -= 8)
      crc_ = CrcAfter(crc_, static_cast<unsigned>(bits >> i) & 0xff);
  }
  void Append(std::uint8_t byte) noexcept {
    count_ += 8;
    crc_ = CrcAfter(crc_, byte);
    StuffEight(byte);
  }
  /// Appends the CRC. @returns how many bits there are, with stuff bits.
  int End() noexcept {
    for (int i = 14; i >= 8; --i) Stuff(crc_ >> i & 1U);
    StuffEight(crc_);
    return count_ + 15 + stuffing_.stuff_bits;
  }

 private:
  void Stuff(unsigned bit) noexcept { stuffing_ = StuffBit(stuffing_, bit); }
  void StuffEight(unsigned bits) noexcept {
    const Stuffing after = kStuffByte[stuffing_.state][bits & 0xff];
    stuffing_ = {after.state, static_cast<std::uint8_t>(stuffing_.stuff_bits + after.stuff_bits)};
  }

  int count_ = 0;
  std::uint16_t crc_ = 0;
  Stuffing stuffing_;
};

}  // namespace

bool IsValid(const CanFrame& frame) noexcept {
  return frame.size <= 8 && frame.id <= (frame.extended ? 0x1fffffffU : 0x7ffU);
}

FrameBitStream BuildBitStream(const CanFrame& frame) noexcept {
  FrameBitStream stream;
  BitWriter writer(stream);
  const std::uint32_t remote = frame.remote ? 1 : 0;
  writer.AppendBit(0);  // SOF
  if (frame.extended) {
    writer.Append(frame.id >> 18, 11);
    writer.Append(0b11, 2);  // SRR, IDE
    writer.Append(frame.id & 0x3ffffU, 18);
    writer.Append(remote, 1);
    writer.Append(0b00, 2);  // r1, r0
  } else {
    writer.Append(frame.id, 11);
    writer.Append(remote, 1);
    writer.Append(0b00, 2);  // IDE, r0
  }
  writer.Append(frame.size, 4);
  if (!frame.remote) {
    for (std::size_t i = 0; i < frame.size; ++i) writer.Append(frame.data[i], 8);
  }
  const std::uint16_t crc = stream.crc;
  writer.Append(crc, 15);
  stream.crc = crc;
  return stream;
}

int FrameBits(const CanFrame& frame) noexcept {
  const std::uint64_t remote = frame.remote ? 1 : 0;
  BitCounter counter;
  if (frame.extended) {
    // SOF, 11 bits of the identifier, SRR, IDE, 18 bits of it, RTR, r1, r0 and the size.
    counter.Begin(std::uint64_t{frame.id >> 18} << 27 | std::uint64_t{0b11} << 25 |
                      std::uint64_t{frame.id & 0x3ffffU} << 7 | remote << 6 | frame.size,
                  39);
  } else {
    // SOF, the identifier, RTR, IDE, r0 and the size.
    counter.Begin(std::uint64_t{frame.id} << 7 | remote << 6 | frame.size, 19);
  }
  if (!frame.remote) {
    for (std::size_t i = 0; i < frame.size; ++i) counter.Append(frame.data[i]);
  }
  return counter.End() + kFrameTailBits + kIntermissionBits;
}

std::uint32_t ArbitrationKey(const CanFrame& frame) noexcept {
  const std::uint32_t remote = frame.remote ? 1 : 0;
  if (frame.extended) {
    return (frame.id >> 18) << 21 | 0b11U << 19 | (frame.id & 0x3ffffU) << 1 | remote;
  }
  return frame.id << 21 | remote << 20;
}

std::uint16_t CanCrc15(std::span<const std::uint8_t> bits) noexcept {
  std::uint16_t crc = 0;
  for (const std::uint8_t bit : bits) crc = CrcStep(crc, bit);
  return crc;
}

}  // namespace tumbler
