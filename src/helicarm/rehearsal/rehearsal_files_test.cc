// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rehearsal/rehearsal_files.h"

#include <gtest/gtest.h>

namespace helicarm::rehearsal {
namespace {

const std::vector<Rehearsal> two_cases{
    {7, {{"FS", 0.3, 0.2, 0.4, true, 0.5}, {"FE", 0.1, 0.2, 0.4, true, std::nullopt}}, 0.1, 2, 1},
    {8, {{"TS", 0.5, 0.2, 0.4, false, 0.7}, {"TE", 0.2, 0.2, 0.4, true, 0.9}}, 0.1, 3, 2, 4}};

TEST(RehearsalFiles, Eq17StandsBesideTheTrueDistance) {
  const Json json = to_json(two_cases);
  EXPECT_DOUBLE_EQ(json["table"]["start"]["mean"], 0.4);
  EXPECT_DOUBLE_EQ(json["in_xrays"]["start"]["mean"], 0.6);
  EXPECT_EQ(json["in_xrays"]["end"]["n"], 1);  // one was not computed
  EXPECT_NE(table_of(two_cases).find("0.90"), std::string::npos);
}

TEST(RehearsalFiles, WithoutEq17TheTableHasNone) {
  auto cases = two_cases;
  for (Rehearsal& rehearsal : cases)
    for (EndError& end : rehearsal.ends) end.in_xrays_mm.reset();
  EXPECT_TRUE(to_json(cases)["in_xrays"]["all"].is_null());
  EXPECT_NE(table_of(cases).find(" - "), std::string::npos);
}

TEST(RehearsalFiles, AttemptsOfEachCaseAreCounted) {
  EXPECT_EQ(to_json(two_cases)["cases"][1]["attempts"], 2);
  EXPECT_NE(to_csv(two_cases).find("8,TE,0.2,0.2,0.4,1,0.9,2\n"), std::string::npos);
  EXPECT_EQ(to_json(two_cases)["cases"][1]["replans"], 4);
  EXPECT_NE(table_of(two_cases).find("3 attempts for 2 operations, 4 orders planned again"),
            std::string::npos);
}

}  // namespace
}  // namespace helicarm::rehearsal
