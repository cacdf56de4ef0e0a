// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/markup.h"

#include <limits>

#include <gtest/gtest.h>

namespace helicarm::report {
namespace {

TEST(Escaped, MarkupAndControlCharactersAreEscaped) {
  EXPECT_EQ(escaped("<script a='1' b=\"2\">&"), "&lt;script a=&#39;1&#39; b=&quot;2&quot;&gt;&amp;");
  EXPECT_EQ(escaped(std::string_view("a\0\x1b", 3)), "a\xef\xbf\xbd\xef\xbf\xbd");
}

TEST(Escaped, OtherCharactersAreKept) { EXPECT_EQ(escaped("Kniegelenk größer"), "Kniegelenk größer"); }

TEST(Base64, KnownVectors) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64("\xff\xfe\xfd"), "//79");
}

TEST(Fixed, MissingValueIsADash) {
  EXPECT_EQ(fixed(1.2345, 2), "1.23");
  EXPECT_EQ(fixed(std::nullopt, 2), "–");
  EXPECT_EQ(fixed(std::numeric_limits<double>::quiet_NaN(), 2), "–");
}

}  // namespace
}  // namespace helicarm::report
