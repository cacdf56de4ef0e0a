// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/labelled_views.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "helicarm/calibration/views_test.h"

namespace helicarm::calibration {
namespace {

std::vector<ViewFiducials> two_views() {
  RandomStream random(21, 0);
  return {observed_fiducials("AP", paper_view(0), 0.1, random),
          observed_fiducials("LAT", paper_view(1.5), 0.1, random)};
}

TEST(AlignedByLabel, PermutedViewIsInTheOrderOfTheFirst) {
  auto views = two_views();
  const auto expected = views[1].fiducials;
  std::ranges::reverse(views[1].fiducials);
  const auto aligned = aligned_by_label(views);
  ASSERT_TRUE(aligned) << aligned.error().message;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ((*aligned)[1].fiducials[i].label, expected[i].label);
    EXPECT_EQ((*aligned)[1].fiducials[i].uv, expected[i].uv);
  }
}

TEST(AlignedByLabel, CovarianceOfTheMapFollowsItsFiducials) {
  auto views = two_views();
  std::ranges::reverse(views[1].fiducials);
  views[1].map_covariance_px2 = Eigen::VectorXd::LinSpaced(12, 1, 12).asDiagonal();
  const auto aligned = aligned_by_label(views);
  ASSERT_TRUE(aligned);
  EXPECT_EQ((*aligned)[1].map_covariance_px2(0, 0), 12);
  EXPECT_EQ((*aligned)[1].map_covariance_px2(11, 11), 1);
}

TEST(AlignedByLabel, FiducialThatAViewLacksIsNotFoundThere) {
  auto views = two_views();
  views[0].fiducials.erase(views[0].fiducials.begin() + 3);
  const auto aligned = aligned_by_label(views);
  ASSERT_TRUE(aligned);
  const fiducials::Fiducial &lacking = (*aligned)[0].fiducials.back(), &seen = (*aligned)[1].fiducials.back();
  EXPECT_EQ(lacking.label, "P4");
  EXPECT_EQ(lacking.status, fiducials::FiducialStatus::not_found);
  EXPECT_EQ(lacking.centre_in_calibrator, views[1].fiducials[3].centre_in_calibrator);
  EXPECT_EQ(seen.label, "P4");
  EXPECT_EQ(seen.status, fiducials::FiducialStatus::used);
}

TEST(AlignedByLabel, OneLabelAtTwoPlacesIsRefusedWithTheDistance) {
  auto views = two_views();
  views[1].fiducials[4].centre_in_calibrator.x() += 2;
  const auto aligned = aligned_by_label(views);
  ASSERT_FALSE(aligned);
  EXPECT_EQ(aligned.error().reason, Reason::bad_value);
  EXPECT_EQ(aligned.error().view, "LAT");
  EXPECT_NEAR(aligned.error().figures.at("distance_mm"), 2, 1e-9);
}

TEST(AlignedByLabel, NamesGivenTwiceClash) {
  auto views = two_views();
  views[1].name = "AP";
  EXPECT_EQ(aligned_by_label(views).error().reason, Reason::name_clash);
  views = two_views();
  views[1].fiducials[1].label = "P1";
  EXPECT_EQ(aligned_by_label(views).error().reason, Reason::name_clash);
}

std::vector<CalibratedView> views_of(const std::vector<double>& fx) {
  std::vector<CalibratedView> views;
  for (const double f : fx) {
    geometry::View view = paper_view(0.3 * double(views.size()));
    view.intrinsics.fx = f;
    views.push_back({std::string(1, char('A' + views.size())), view, {}});
  }
  return views;
}

TEST(CheckHandedness, MirroredViewsWithoutAStatementAreAmbiguous) {
  const std::vector<std::optional<bool>> none(2), stated{true, std::nullopt};
  EXPECT_TRUE(check_handedness(views_of({6000, 6000}), none)->empty());
  EXPECT_EQ(check_handedness(views_of({-6000, -6000}), none).error().reason, Reason::ambiguous_handedness);
  const auto one = check_handedness(views_of({6000, -6000}), none);
  ASSERT_TRUE(one);
  ASSERT_EQ(one->size(), 1u);
  EXPECT_EQ(one->front().view, "B");
  EXPECT_TRUE(check_handedness(views_of({-6000, 6000}), stated)->empty());
}

TEST(CheckHandedness, ViewThatContradictsItsStatementIsRefused) {
  const auto refused =
      check_handedness(views_of({6000, 6000}), std::vector<std::optional<bool>>{false, true});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().view, "B");
}

}  // namespace
}  // namespace helicarm::calibration
