// Feeds arbitrary bytes to the reader of the operator's requests. It refuses them, or they are
// exactly one message, which gives the same bytes again.

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "runtime/record/lcm_commands.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto require = [](bool holds, const char* what) {
    if (holds) return;
    std::fprintf(stderr, "the reader of requests lets through what it must not: %s\n", what);
    std::abort();
  };
  // With the fingerprint before them, inputs need not find it.
  std::vector<std::uint8_t> bytes(8);
  const std::int64_t hash = tumbler::command_t::getHash();
  for (std::size_t i = 0; i < 8; ++i)
    bytes[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(hash) >> (56 - 8 * i));
  bytes.insert(bytes.end(), data, data + size);
  for (const std::size_t skip : {std::size_t{0}, std::size_t{8}}) {
    const std::span<const std::uint8_t> input = std::span(bytes).subspan(skip);
    tumbler::command_t message;
    if (!tumbler::ReadCommand(input, message)) continue;
    require(message.getEncodedSize() == static_cast<int>(input.size()), "another length");
    std::vector<std::uint8_t> again(input.size());
    message.encode(again.data(), 0, static_cast<int>(again.size()));
    // A zero inside the text ends it.
    if (message.branch.find('\0') == std::string::npos) {
      require(std::memcmp(again.data(), input.data(), input.size()) == 0, "other bytes");
    }
  }
  return 0;
}
