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
  return BuildBitStream(frame).count + kFrameTailBits + kIntermissionBits;
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
