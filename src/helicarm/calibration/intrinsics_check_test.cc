// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/intrinsics_check.h"

#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/calibration/views_test.h"

namespace helicarm::calibration {
namespace {

const CommonPrior c_arm{{IntrinsicsVariation{10, 1.4}, IntrinsicsVariation{7, 4.2}}};

/// Two views of a C-arm with a source distance of 900 mm (6000 px); the first image is magnified.
std::vector<ViewFiducials> magnified(double factor, std::optional<double> file_focal_px, double sigma_px,
                                     std::uint64_t trial = 0) {
  RandomStream random(43, 0, trial);
  std::vector<ViewFiducials> views;
  for (const double alpha : {0.0, std::numbers::pi / 2}) {
    geometry::View view = paper_view(alpha);
    const double own = views.empty() ? factor : 1;
    view.intrinsics.fx *= own;
    view.intrinsics.fy *= own;
    views.push_back(observed_fiducials(views.empty() ? "AP" : "LAT", view, sigma_px, random));
    views.back().prior = {file_focal_px, Eigen::Vector2d(512, 512), 1 / 0.15, geometry::NormalPrior{1, 1e-3}};
  }
  return views;
}

TEST(CheckIntrinsics, RightViewsGiveNoWarning) {
  for (std::uint64_t trial = 0; trial < 50; ++trial) {
    EXPECT_TRUE(check_intrinsics(magnified(1, 6000, 0.1, trial), c_arm).empty());
    EXPECT_TRUE(check_intrinsics(magnified(1, {}, 0.1, trial), c_arm).empty());
  }
}

TEST(CheckIntrinsics, FocalLengthThatContradictsTheTagIsNamed) {
  const auto warnings = check_intrinsics(magnified(1.08, 6000, 0.1), c_arm);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].reason, Reason::intrinsics_inconsistent);
  EXPECT_EQ(warnings[0].view, "AP");
  EXPECT_NEAR(warnings[0].figures.at("amount"), 0.08, 0.02);
}

TEST(CheckIntrinsics, FocalLengthsThatContradictEachOtherAreNamedWithoutTags) {
  const auto warnings = check_intrinsics(magnified(1.08, {}, 0.1), c_arm);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].view, "LAT");
  EXPECT_NEAR(warnings[0].figures.at("amount"), 1 / 1.08 - 1, 0.02);
}

TEST(CheckIntrinsics, FiducialsThatDoNotDetermineTheFocalLengthGiveNoWarning) {
  EXPECT_TRUE(check_intrinsics(magnified(1.08, 6000, 3), c_arm).empty());
}

}  // namespace
}  // namespace helicarm::calibration
