// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case_purpose.h"

#include <gtest/gtest.h>

namespace helicarm::pipeline {
namespace {

Purpose purpose(const char* json) { return purpose_of(Json::parse(json)); }

TEST(CasePurpose, ACameraOfAnyViewIsForTheRegistration) {
  EXPECT_EQ(purpose(R"({"views": [{"image": "a.png"}, {"image": "b.png", "camera": "b.json"}]})"),
            Purpose::registration);
  EXPECT_EQ(purpose(R"({"views": [{"image": "a.png"}], "models": []})"), Purpose::run);
}

TEST(CasePurpose, WhatIsNoCaseIsReadForARunWhichSaysSo) {
  for (const char* other : {"[]", "7", "{}", R"({"views": 3})", R"({"views": ["a", null]})"})
    EXPECT_EQ(purpose(other), Purpose::run) << other;
}

}  // namespace
}  // namespace helicarm::pipeline
