// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/pick_checks.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/localization/error_bound.h"

namespace helicarm::localization {
namespace {

calibration::SavedCalibration two_views() {
  calibration::SavedCalibration saved;
  for (const double alpha : {0.0, 1.5}) {
    calibration::CalibratedView view;
    view.name = fmt::format("V{}", saved.views.size());
    view.view = {{6000, 6000, 512, 512, 0}, {geometry::rotation_from_euler(alpha, 0, 0), {0, 0, 800}}};
    saved.views.push_back(view);
    saved.maps.emplace_back();
  }
  return saved;
}

/// Raw pixels lie (3, 4) px from rectified ones.
class ShiftedModel final : public rectification::DistortionModel {
 public:
  std::string name() const override { return "shifted"; }
  Eigen::Vector2d raw_from_rectified(const Eigen::Vector2d& rectified) const override {
    return rectified + Eigen::Vector2d(3, 4);
  }
  Eigen::Matrix2d jacobian(const Eigen::Vector2d&) const override { return Eigen::Matrix2d::Identity(); }
  double extent_px() const override { return 500; }
  void write(Json&) const override {}
};

/// A point whose second image is displaced across the first view's ray.
Expected<LocatedPoint> located(const calibration::SavedCalibration& saved, const Eigen::Vector3d& point,
                               double across_px) {
  std::vector<PointObservation> seen;
  for (std::size_t i = 0; i < 2; ++i)
    seen.push_back({i, saved.views[i].view.project(point), 0.25 * Eigen::Matrix2d::Identity()});
  seen[1].uv.x() += across_px;
  return locate("P", PointSource::pick, seen, saved);
}

TEST(InflateIfViewsContradict, PointsWhoseRaysMeetDoNotVouchForViewsThatContradictElsewhere) {
  const auto saved = two_views();
  std::vector<Expected<LocatedPoint>> points{located(saved, {10, 20, 5}, 12), located(saved, {-10, 5, 9}, 0),
                                             located(saved, {0, 0, 0}, 14), fail(Reason::not_seen, "")};
  ASSERT_TRUE(points[0]->missing_rays);
  ASSERT_FALSE(points[1]->missing_rays);
  const double before = length_at_95(points[1]->covariance_in_anchor);
  inflate_if_views_contradict(points);
  ASSERT_TRUE(points[1]->missing_rays);
  EXPECT_EQ(points[1]->missing_rays->reason, Reason::residual_too_large);
  EXPECT_GT(length_at_95(points[1]->covariance_in_anchor), 3 * before);
}

TEST(InflateIfViewsContradict, OneWrongPickOfThreeLeavesTheOthers) {
  const auto saved = two_views();
  std::vector<Expected<LocatedPoint>> points{located(saved, {10, 20, 5}, 12), located(saved, {-10, 5, 9}, 0),
                                             located(saved, {0, 0, 0}, 0)};
  inflate_if_views_contradict(points);
  EXPECT_TRUE(points[0]->missing_rays);
  EXPECT_FALSE(points[1]->missing_rays);
  EXPECT_FALSE(points[2]->missing_rays);
}

TEST(PixelsTakenAsRectified, StateHowFarRawOnesAre) {
  auto saved = two_views();
  saved.maps[0] = rectification::identity_map(1024, 1024, std::nullopt);
  saved.maps[0]->model = std::make_shared<ShiftedModel>();
  const std::vector<PointObservation> picks{{0, {100, 100}, Eigen::Matrix2d::Identity()},
                                            {1, {100, 100}, Eigen::Matrix2d::Identity()}};
  const auto note = pixels_taken_as_rectified(picks, saved);
  ASSERT_TRUE(note);
  EXPECT_EQ(note->reason, Reason::pixels_taken_as_rectified);
  EXPECT_NEAR(note->figures.at("mean_px"), 5, 1e-9);
  EXPECT_NEAR(note->figures.at("max_px"), 5, 1e-9);
}

TEST(PixelsTakenAsRectified, NothingWithoutDistortion) {
  auto saved = two_views();
  const std::vector<PointObservation> picks{{0, {100, 100}, Eigen::Matrix2d::Identity()}};
  EXPECT_FALSE(pixels_taken_as_rectified(picks, saved));
  saved.maps[0] = rectification::identity_map(1024, 1024, std::nullopt);
  EXPECT_FALSE(pixels_taken_as_rectified(picks, saved));
}

}  // namespace
}  // namespace helicarm::localization
