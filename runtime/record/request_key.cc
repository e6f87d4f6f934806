#include "runtime/record/request_key.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

static_assert(RequestKey::kBytes == crypto_auth_hmacsha256_KEYBYTES);
static_assert(sizeof(command_t::mac) == crypto_auth_hmacsha256_BYTES);

constexpr std::size_t kDigits = 2 * RequestKey::kBytes;
constexpr const char* kHowToMake = "`(umask 077; openssl rand -hex 32 > FILE)` makes one";

void Initialize() {
  if (sodium_init() < 0) throw std::runtime_error("libsodium cannot be used on this machine");
}

/// The message that is signed: with zeros in the place of the signature.
std::vector<std::uint8_t> SignedBytes(const command_t& message) {
  command_t unsigned_message = message;
  std::fill(std::begin(unsigned_message.mac), std::end(unsigned_message.mac), std::uint8_t{0});
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(unsigned_message.getEncodedSize()));
  unsigned_message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

/// The text of a key file that only its owner may use.
std::string ReadPrivately(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) {
    throw FileError(path, 0, "",
                    fmt::format("cannot be read: {}; a key is a file of {} hexadecimal digits: {}",
                                std::generic_category().message(errno), kDigits, kHowToMake));
  }
  struct stat status {};
  std::string text(kDigits + 16, '\0');
  const bool known = fstat(file, &status) == 0;
  const bool regular = known && S_ISREG(status.st_mode);
  const ssize_t size = regular ? read(file, text.data(), text.size()) : 0;
  close(file);
  if (!regular) throw FileError(path, 0, "", "is no regular file, as a key has to be");
  constexpr mode_t kOthers = S_IRWXG | S_IRWXO;
  if ((status.st_mode & kOthers) != 0) {
    throw FileError(path, 0, "",
                    fmt::format("is open to others than its owner (mode {:04o}, must be 0600 or "
                                "0400): chmod 600 {}; if others may have read it, make a new one",
                                status.st_mode & 07777U, path));
  }
  if (status.st_uid != geteuid() && status.st_uid != 0) {
    throw FileError(path, 0, "",
                    fmt::format("belongs to user {}, must belong to you (user {}) or to root",
                                status.st_uid, geteuid()));
  }
  text.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  return text;
}

}  // namespace

RequestKey::RequestKey(const std::string& path) {
  Initialize();
  std::string text = ReadPrivately(path);
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  std::size_t size = 0;
  const char* end = nullptr;
  const int read =
      sodium_hex2bin(bytes_.data(), bytes_.size(), text.data(), text.size(), nullptr, &size, &end);
  const bool whole = read == 0 && size == bytes_.size() && end == text.data() + text.size();
  const std::size_t length = text.size();
  sodium_memzero(text.data(), text.size());
  if (!whole) {
    throw FileError(path, 1, "",
                    fmt::format("has {} characters, must be one line of {} hexadecimal digits: {}",
                                length > kDigits ? fmt::format("more than {}", kDigits)
                                                 : fmt::format("{}", length),
                                kDigits, kHowToMake));
  }
}

RequestKey::RequestKey(const std::array<std::uint8_t, kBytes>& bytes) : bytes_(bytes) {
  Initialize();
}

RequestKey::RequestKey(const RequestKey& other) = default;

RequestKey::~RequestKey() { sodium_memzero(bytes_.data(), bytes_.size()); }

void RequestKey::Sign(command_t& message) const {
  const std::vector<std::uint8_t> bytes = SignedBytes(message);
  crypto_auth_hmacsha256(static_cast<unsigned char*>(message.mac), bytes.data(), bytes.size(),
                         bytes_.data());
}

bool RequestKey::Signed(const command_t& message) const {
  const std::vector<std::uint8_t> bytes = SignedBytes(message);
  return crypto_auth_hmacsha256_verify(static_cast<const unsigned char*>(message.mac), bytes.data(),
                                       bytes.size(), bytes_.data()) == 0;
}

}  // namespace tumbler
