// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/exchanged_views.h"

#include <gtest/gtest.h>

#include "helicarm/track/two_cameras_test.h"

namespace helicarm::track {
namespace exchanged_views_test {

const std::vector<Eigen::Vector3d> markers{
    {-40, 12, 18}, {-21, -33, 41}, {8, 25, -30}, {30, -9, 7}, {52, 44, -52}};

std::vector<TrackView> views() {
  std::vector<TrackView> made;
  for (const geometry::View& camera : two_cameras()) {
    TrackView& view = made.emplace_back();
    view.images.name = made.size() == 1 ? "A" : "B";
    view.camera = camera;
  }
  return made;
}

/// Of the markers in the cameras, 0.1 px off; `is_exchanged`: each camera's under the other's name.
std::vector<ViewPoints> seen_points(bool is_exchanged, std::size_t count) {
  const auto cameras = two_cameras();
  ViewPoints points;
  for (std::size_t m = 0; m < count; ++m)
    for (std::size_t k = 0; k < 2; ++k)
      points.push_back(cameras[is_exchanged ? 1 - k : k].project(markers[m]) +
                       Eigen::Vector2d(0.1, k == 0 ? 0.1 : -0.1));
  return {points};
}

TEST(ExchangedViews, AreNamedWithBothGaps) {
  const auto found = exchanged_views(views(), seen_points(true, markers.size()));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->first, 0u);
  EXPECT_EQ(found->second, 1u);
  EXPECT_GT(found->gap_mm, 5 * found->exchanged_mm);
  EXPECT_LT(found->exchanged_mm, 0.2);
  EXPECT_TRUE(exchanged_text(views(), *found).ends_with("with A and B exchanged"));
}

TEST(ExchangedViews, ThoseInOrderAreNone) {
  EXPECT_FALSE(exchanged_views(views(), seen_points(false, markers.size())));
}

TEST(ExchangedViews, ThreeMarkersDoNotTell) { EXPECT_FALSE(exchanged_views(views(), seen_points(true, 3))); }

}  // namespace exchanged_views_test
}  // namespace helicarm::track
