// SPDX-License-Identifier: Apache-2.0
#include "several_cases.h"

#include <gtest/gtest.h>

namespace helicarm::cli {
namespace {

using Names = std::vector<std::string>;

TEST(NamesOfCases, AreThoseOfTheirFolders) {
  EXPECT_EQ(names_of({"/data/monday", "/data/tuesday/", "/data/friday/case.json"}),
            (Names{"monday", "tuesday", "friday"}));
}

TEST(NamesOfCases, ThatRepeatAreNumbered) {
  EXPECT_EQ(names_of({"/a/knee", "/b/knee", "/b/knee_2", "/c/knee"}),
            (Names{"knee", "knee_2", "knee_2_2", "knee_3"}));
}

}  // namespace
}  // namespace helicarm::cli
