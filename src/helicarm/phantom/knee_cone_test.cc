// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/knee_cone.h"

#include <tuple>

#include <gtest/gtest.h>

#include "helicarm/phantom/rules.h"

namespace helicarm::phantom {
namespace {

TEST(KneeCone, PaperKneeGivesThePublishedCone) {
  const auto cone = cone_for_knee(60, 87.5 / 1.5);
  ASSERT_TRUE(cone);
  EXPECT_DOUBLE_EQ(cone->base_diameter_mm, 120);
  EXPECT_DOUBLE_EQ(cone->top_diameter_mm, 60);
  EXPECT_DOUBLE_EQ(cone->height_mm, 87.5);
  const ConicalHelix helix = helix_on(*cone);
  EXPECT_NEAR(helix.h, 3.979, 5e-4);
  EXPECT_NEAR(helix.pp, 31.727, 5e-4);  // published 31.529: its radius ends at 29.87 mm
  const Calibrator calibrator = calibrator_on(helix, "knee");
  for (std::size_t k = 0; k < 12; ++k)
    EXPECT_LT((calibrator.balls[k].centre_in_calibrator - udcsc().balls[k].centre_in_calibrator).norm(), 0.2);
}

TEST(KneeCone, EndsOfTheHelixLieOnTheCone) {
  const ConicalHelix helix = helix_on({130, 66, 86});
  EXPECT_NEAR(helix.point(0).head<2>().norm(), 65, 1e-9);
  EXPECT_NEAR(helix.point(helix.t_end).head<2>().norm(), 33, 1e-9);
  EXPECT_NEAR(helix.point(helix.t_end).z(), 86, 1e-9);
}

/// The six balls of a plane are only nearly in it, by an amount that grows with the cone: the limits in mm
/// are udcsc's.
TEST(KneeCone, CalibratorsOfMeasuredKneesKeepTheRulesUpToTheirSize) {
  for (const auto& [d1, d2, excess] :
       {std::tuple{64.58, 55.34, 1.0}, {66.7, 57.2, 1.0}, {68.89, 59.02, 1.04}}) {
    const Calibrator calibrator = calibrator_on(helix_on(*cone_for_knee(d1, d2)), "knee");
    for (const RuleFinding& rule : check_rules(calibrator))
      EXPECT_TRUE(rule.passed() || (rule.bound == Bound::at_most && rule.figure <= excess * rule.limit))
          << d1 << ": " << rule.rule << " " << rule.figure;
  }
}

TEST(KneeCone, ImpossibleKneeIsRefused) {
  const auto refused = cone_for_knee(60, 5);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::phantom
