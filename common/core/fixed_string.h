#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace tumbler {

/// A string of at most `kCapacity` bytes stored in place, for names in structures that must not
/// allocate.
template <std::size_t kCapacity>
class FixedString {
 public:
  constexpr FixedString() = default;

  /// Keeps the first `kCapacity` bytes of `text`; `fits(text)` tells beforehand whether all of them
  /// are kept.
  constexpr explicit FixedString(std::string_view text) noexcept
      : size_(text.size() < kCapacity ? text.size() : kCapacity) {
    for (std::size_t i = 0; i < size_; ++i) bytes_[i] = text[i];
  }

  /// Whether `text` has at most `kCapacity` bytes.
  [[nodiscard]] static constexpr bool fits(std::string_view text) noexcept {
    return text.size() <= kCapacity;
  }
  [[nodiscard]] constexpr std::string_view view() const noexcept { return {bytes_.data(), size_}; }
  [[nodiscard]] constexpr bool operator==(const FixedString& other) const noexcept {
    return view() == other.view();
  }

 private:
  std::array<char, kCapacity> bytes_{};
  std::size_t size_ = 0;
};

}  // namespace tumbler
