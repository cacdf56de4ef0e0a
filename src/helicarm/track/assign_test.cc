// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/assign.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "helicarm/track/two_cameras_test.h"

namespace helicarm::track {
namespace assign_test {

ExpectedMarker expected_at(const Eigen::Vector3d& place, double sigma_mm) {
  ExpectedMarker marker;
  marker.place = place;
  marker.covariance = sigma_mm * sigma_mm * Eigen::Matrix3d::Identity();
  marker.images.assign(2, ExpectedImage{2, {80, 0, 0.35, true}});
  return marker;
}

Candidate disc_of(const geometry::View& view, const Eigen::Vector3d& place, double contrast = 80) {
  const Eigen::Vector2d uv = view.project(place);
  return {{uv, 0.03, 2, contrast}, uv};
}

TEST(Assign, RaysThatMeetDecideBetweenNearDiscs) {
  const auto views = two_cameras();
  // Both are nearer to the other's expected place in the first view.
  const Eigen::Vector3d a(0, 0, 0), b(1.5, 0, 3);
  const std::vector<ExpectedMarker> markers{expected_at({1.2, 0, 0.2}, 1), expected_at({0.3, 0, 2.8}, 1)};
  const std::vector<std::vector<Candidate>> discs{{disc_of(views[0], a), disc_of(views[0], b)},
                                                  {disc_of(views[1], b), disc_of(views[1], a)}};
  EXPECT_EQ(assign(views, markers, discs), (std::vector<std::vector<int>>{{0, 1}, {1, 0}}));
}

TEST(Assign, HiddenMarkerDoesNotTakeAnothersDisc) {
  const auto views = two_cameras();
  const Eigen::Vector3d a(0, 0, 0), b(1, 0.5, 0.5);
  const std::vector<ExpectedMarker> markers{expected_at(a, 0.5), expected_at(b, 0.5)};
  const std::vector<std::vector<Candidate>> discs{{disc_of(views[0], a)}, {disc_of(views[1], a)}};
  EXPECT_EQ(assign(views, markers, discs), (std::vector<std::vector<int>>{{0, 0}, {not_seen, not_seen}}));
}

TEST(Assign, DiscOfAnotherContrastIsNotTaken) {
  const auto views = two_cameras();
  const Eigen::Vector3d a(0, 0, 0);
  const std::vector<ExpectedMarker> markers{expected_at(a, 0.5)};
  const std::vector<std::vector<Candidate>> discs{{disc_of(views[0], a)}, {disc_of(views[1], a, 10)}};
  EXPECT_EQ(assign(views, markers, discs), (std::vector<std::vector<int>>{{0, not_seen}}));
}

TEST(Assign, DiscOffTheOtherViewsRayIsNotTaken) {
  const auto views = two_cameras();
  const std::vector<ExpectedMarker> markers{expected_at({0, 0, 0}, 1)};
  const std::vector<std::vector<Candidate>> discs{{disc_of(views[0], {0, 0, 0})},
                                                  {disc_of(views[1], {0, 0, 2})}};
  const auto assigned = assign(views, markers, discs);
  EXPECT_EQ(std::ranges::count(assigned[0], not_seen), 1);
}

}  // namespace assign_test
}  // namespace helicarm::track
