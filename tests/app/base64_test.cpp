#include "app/base64.h"

#include <gtest/gtest.h>

#include <string_view>

namespace parallax {
namespace {

std::string of(std::string_view text) { return to_base64({text.begin(), text.end()}); }

// The vectors of RFC 4648, section 10.
TEST(Base64, IsThatOfTheStandard) {
  EXPECT_EQ(of(""), "");
  EXPECT_EQ(of("f"), "Zg==");
  EXPECT_EQ(of("fo"), "Zm8=");
  EXPECT_EQ(of("foo"), "Zm9v");
  EXPECT_EQ(of("foob"), "Zm9vYg==");
  EXPECT_EQ(of("fooba"), "Zm9vYmE=");
  EXPECT_EQ(of("foobar"), "Zm9vYmFy");
  EXPECT_EQ(to_base64({0xff, 0xfe, 0xfb}), "//77");
}

}  // namespace
}  // namespace parallax
