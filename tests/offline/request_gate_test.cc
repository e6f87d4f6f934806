#include "offline/pages/request_gate.h"

#include <gtest/gtest.h>

#include <string>

namespace tumbler {
namespace {

TEST(RequestGate, TakesARequestForWholeWithItsHeadersAndItsBody) {
  const std::string get = "GET / HTTP/1.1\r\nHost: a\r\n\r\n";
  for (std::size_t size = 0; size < get.size(); ++size)
    EXPECT_FALSE(IsWhole(get.substr(0, size))) << size;
  EXPECT_TRUE(IsWhole(get));
  for (const char* const name : {"Content-Length: ", "content-length:", "CONTENT-LENGTH:\t "}) {
    const std::string post = std::string("POST / HTTP/1.1\r\nA: b\r\n") + name + "3\r\n\r\n";
    EXPECT_FALSE(IsWhole(post)) << name;
    EXPECT_FALSE(IsWhole(post + "12")) << name;
    EXPECT_TRUE(IsWhole(post + "123")) << name;
  }
}

TEST(RequestGate, WaitsForNoBodyThatNobodyTakes) {
  for (const char* const length :
       {"-1", "x", "", "17000", "99999999999999999999", "18446744073709551615"}) {
    EXPECT_TRUE(IsWhole(std::string("POST / HTTP/1.1\r\nContent-Length: ") + length +
                        "\r\nHost: a\r\n\r\n"))
        << length;
  }
  EXPECT_TRUE(IsWhole("POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n5\r\n"));
}

}  // namespace
}  // namespace tumbler
