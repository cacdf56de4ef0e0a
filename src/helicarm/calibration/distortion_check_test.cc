// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/distortion_check.h"

#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/calibration/views_test.h"
#include "helicarm/core/random_vectors.h"

namespace helicarm::calibration {
namespace {

const CommonPrior nominal_c_arm{{IntrinsicsVariation{10, 1.4}, IntrinsicsVariation{7, 4.2}}};

std::vector<ViewFiducials> views_with_noise(std::uint64_t trial) {
  RandomStream random(44, 0, trial);
  std::vector<ViewFiducials> views{observed_fiducials("AP", paper_view(0), 0.1, random),
                                   observed_fiducials("LAT", paper_view(std::numbers::pi / 2), 0.1, random)};
  for (ViewFiducials& view : views)
    view.prior = {{}, Eigen::Vector2d(512, 512), 1 / 0.15, geometry::NormalPrior{1, 1e-3}};
  return views;
}

TEST(CheckDistortion, MapOfAnotherPositionIsNamed) {
  auto views = views_with_noise(0);
  for (fiducials::Fiducial& ball : views[0].fiducials) {  // 8 px at the field's edge
    const Eigen::Vector2d p = (ball.uv - Eigen::Vector2d(512, 512)) / 512;
    ball.uv += 8 * Eigen::Vector2d(p.x() * p.x() - p.x() * p.y(), p.y() * p.y());
  }
  const auto warning = check_distortion(views, nominal_c_arm);
  ASSERT_TRUE(warning);
  EXPECT_EQ(warning->reason, Reason::residual_distortion);
  EXPECT_LT(warning->figures.at("chi2_after"), 0.2 * warning->figures.at("chi2_before"));
}

TEST(CheckDistortion, NeitherNoiseNorDisplacedFiducialsAreADistortion) {
  for (std::uint64_t trial = 0; trial < 100; ++trial) {
    auto views = views_with_noise(trial);
    EXPECT_FALSE(check_distortion(views, nominal_c_arm));
    RandomStream random(45, 0, trial);
    for (std::size_t k = 0; k < 12; ++k) {
      const Eigen::Vector3d offset = 0.2 * normal_3(random);
      for (ViewFiducials& view : views) view.fiducials[k].centre_in_calibrator += offset;
    }
    EXPECT_FALSE(check_distortion(views, nominal_c_arm)) << trial;
  }
}

}  // namespace
}  // namespace helicarm::calibration
