#pragma once

#include <array>
#include <cstdint>
#include <string>

#include <tumbler/command_t.hpp>

namespace tumbler {

/// The key that the senders and the taker of requests share: 32 bytes, for HMAC-SHA-256.
///
/// A signature covers a whole command_t, with the fingerprint of its type: its number, the run that
/// it is for, the state that its sender saw, and what it asks for. So nobody without the key can
/// make a request, or change one. Whether one that was seen can be sent again is the taker's
/// concern (`LcmCommands`).
class RequestKey {
 public:
  static constexpr std::size_t kBytes = 32;

  /// Reads a file with 64 hexadecimal digits, as `openssl rand -hex 32` writes them.
  /// @throws FileError  when it is not such a file, or others than its owner may read or write it.
  explicit RequestKey(const std::string& path);
  explicit RequestKey(const std::array<std::uint8_t, kBytes>& bytes);
  ~RequestKey();  ///< Leaves nothing of it in memory.
  RequestKey(const RequestKey& other);
  RequestKey& operator=(const RequestKey&) = delete;

  /// Sets `mac`, when everything else is set.
  void Sign(command_t& message) const;
  /// Whether `mac` is that of the rest. Takes equally long for all that are not.
  [[nodiscard]] bool Signed(const command_t& message) const;

 private:
  std::array<std::uint8_t, kBytes> bytes_;
};

}  // namespace tumbler
