// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/failure.h"

#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/reason_code.h"

namespace helicarm {
namespace {

TEST(Reason, EachCodeOccursOnce) {
  std::set<std::string_view> codes;
  for (const Reason reason : all_reasons()) codes.insert(code(reason));
  EXPECT_EQ(codes.size(), all_reasons().size());
}

TEST(Reason, UnusableInputEndsWith2AndARefusalWith3) {
  EXPECT_EQ(exit_code(Reason::bad_value), 2);
  EXPECT_EQ(exit_code(Reason::port_taken), 2);
  EXPECT_EQ(exit_code(Reason::blank_image), 3);
  EXPECT_EQ(exit_code(Reason::out_of_capture), 3);
}

TEST(Reason, IsThatOfItsCode) {
  for (const Reason reason : all_reasons()) EXPECT_EQ(reason_of(code(reason)), reason);
  EXPECT_FALSE(reason_of("no_such_code"));
}

}  // namespace
}  // namespace helicarm
