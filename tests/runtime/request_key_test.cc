#include "runtime/record/request_key.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <array>
#include <cstdint>
#include <string>

#include "common/files/toml_reader.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

const std::string kDigits = "000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f";

class RequestKeyFile : public ::testing::Test {
 protected:
  /// What is wrong with such a file; empty: nothing.
  std::string Problem(const std::string& text, mode_t mode = 0600) {
    testing::WriteFile(path_, text);
    chmod(path_.c_str(), mode);
    try {
      const RequestKey key(path_);
    } catch (const FileError& error) {
      EXPECT_THAT(error.what(), HasSubstr(path_));
      return error.what();
    }
    return "";
  }

  testing::TemporaryFolder folder_;
  std::string path_ = folder_ / "robot.key";
};

TEST_F(RequestKeyFile, IsALineOf64HexadecimalDigitsThatOnlyItsOwnerMayUse) {
  EXPECT_EQ(Problem(kDigits), "");
  EXPECT_EQ(Problem(kDigits + "\n", 0400), "");
  EXPECT_EQ(Problem("FF" + kDigits.substr(2) + "\r\n"), "");
}

TEST_F(RequestKeyFile, IsRefusedWithWhatIsWrongAndWhatToDo) {
  for (const mode_t mode : {0640U, 0604U, 0660U, 0666U, 0611U}) {
    EXPECT_THAT(Problem(kDigits, mode), HasSubstr("is open to others")) << mode;
    EXPECT_THAT(Problem(kDigits, mode), HasSubstr("chmod 600")) << mode;
  }
  EXPECT_THAT(Problem(""), HasSubstr("has 0 characters, must be one line of 64 hexadecimal"));
  EXPECT_THAT(Problem(kDigits.substr(2)), HasSubstr("has 62 characters"));
  EXPECT_THAT(Problem(kDigits + "20"), HasSubstr("has more than 64 characters"));
  EXPECT_THAT(Problem("g" + kDigits.substr(1)), HasSubstr("hexadecimal digits"));
  EXPECT_THAT(Problem(kDigits.substr(32) + "\n" + kDigits.substr(32)), HasSubstr("one line"));
  for (const std::string& path :
       {folder_ / "none", folder_.path().string(), std::string("/dev/null")}) {
    try {
      const RequestKey key(path);
      FAIL() << path;
    } catch (const FileError& error) {
      EXPECT_THAT(error.what(), HasSubstr(path));
    }
  }
}

TEST_F(RequestKeyFile, SignsAsAnotherImplementationOfHmacSha256Does) {
  testing::WriteFile(path_, kDigits);
  chmod(path_.c_str(), 0600);
  const RequestKey key(path_);
  command_t message{};
  message.id = 4'000'000'000;
  message.run = 1'234'567;
  message.seen = 4990;
  message.command = command_t::BRANCH;
  message.branch = "roll";
  std::fill(std::begin(message.mac), std::end(message.mac), std::uint8_t{7});
  key.Sign(message);
  std::string signature;
  for (const std::uint8_t byte : message.mac) {
    constexpr const char* kHex = "0123456789abcdef";
    signature += kHex[byte >> 4U];
    signature += kHex[byte & 15U];
  }
  // Of Python's hmac and hashlib, over fingerprint, id, run, seen, command, 32 zeros, 5, "roll\0".
  EXPECT_EQ(signature, "77ed5e8293f4500177b50ca902ad162a0e7de0720fa417570e9b9728e3614340");
  EXPECT_TRUE(key.Signed(message));
  ++message.seen;
  EXPECT_FALSE(key.Signed(message));
}

}  // namespace
}  // namespace tumbler
