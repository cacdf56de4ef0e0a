// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/view_map.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/track/case_points.h"
#include "helicarm/track/half_map_test.h"
#include "helicarm/track/rows.h"
#include "helicarm/track/two_cameras_test.h"

namespace helicarm::track {
namespace view_map_test {

constexpr double last = 300;

/// One marker, images of 500 x 500; the second view's map ends at a column.
TrackCase half_mapped() {
  TrackCase the_case;
  for (const geometry::View& camera : two_cameras()) {
    TrackView& view = the_case.views.emplace_back();
    view.images.name = the_case.views.size() == 1 ? "A" : "B";
    view.camera = camera;
  }
  the_case.views[1].map = half_map(last, 500);
  the_case.markers = {"J1"};
  return the_case;
}

TEST(ViewMap, RawAndRectifiedAreOneWithoutAMap) {
  const TrackView view;
  EXPECT_EQ(*rectified_in(view, {12, 34}), Eigen::Vector2d(12, 34));
  EXPECT_EQ(*raw_in(view, {12, 34}), Eigen::Vector2d(12, 34));
}

TEST(ViewMap, OutsideItThereIsNeither) {
  const TrackCase the_case = half_mapped();
  EXPECT_TRUE(rectified_in(the_case.views[1], {last, 10}));
  EXPECT_FALSE(rectified_in(the_case.views[1], {last + 1, 10}));
  EXPECT_TRUE(raw_in(the_case.views[1], {last, 10}));
  EXPECT_FALSE(raw_in(the_case.views[1], {last + 1, 10}));
}

TEST(ViewMap, PickOutsideItIsRefused) {
  TrackCase the_case = half_mapped();
  the_case.picks = {{0, 0, {400, 250}}, {0, 1, {200, 250}}};
  EXPECT_NO_THROW(check_picks_in_maps(the_case, 7));
  the_case.corrections = {{0, 1, {400, 250}, 9}};
  try {
    check_picks_in_maps(the_case, 7);
    ADD_FAILURE();
  } catch (const BadInput& bad) {
    EXPECT_EQ(bad.failure().reason, Reason::bad_value);
    EXPECT_NE(
        bad.failure().message.find("picks: \"J1\" in B, frame 9: at 400.0, 250.0, outside the distortion "
                                   "map of B, whose dots cover 0, 0 to 300, 499"),
        std::string::npos)
        << bad.failure().message;
  }
  the_case.corrections.clear();
  the_case.picks[1].uv_raw.x() = 400;
  EXPECT_THROW(check_picks_in_maps(the_case, 7), BadInput);
}

TEST(ViewMap, PointOfAFileOutsideItIsRefused) {
  const TemporaryFolder folder;
  PointsFile points;
  points.file = folder.path() / "points.csv";
  points.of_all_frames = true;
  ASSERT_TRUE(write_file(points.file,
                         "a_cam1_X,a_cam1_Y,a_cam2_X,a_cam2_Y\n250,250,250,250\n"
                         "250,250,301,250\n"));
  TrackCase the_case = half_mapped();
  EXPECT_NO_THROW(take_points(the_case, points, {1, 1, 1}));
  the_case = half_mapped();
  try {
    take_points(the_case, points, {1, 2, 1});
    ADD_FAILURE();
  } catch (const BadInput& bad) {
    EXPECT_EQ(bad.failure().reason, Reason::bad_value);
    EXPECT_NE(bad.failure().message.find("points.csv: \"a\" of frame 2: at 301.0, 250.0, outside"),
              std::string::npos)
        << bad.failure().message;
  }
}

TEST(ViewMap, KeptDiscOutsideItIsLeftOut) {
  const TrackCase the_case = half_mapped();
  FrameSights sights{
      1, {{MarkerImage{{400, 250}, 0.1, 2, 60, 120}, MarkerImage{{400, 250}, 0.1, 2, 60, 120}}}, 0};
  const auto read = sights_from(sights_header() + sights_rows(sights, the_case), the_case, {1});
  ASSERT_EQ(read.size(), 1u);
  EXPECT_TRUE(read[0].of[0][0]);
  EXPECT_FALSE(read[0].of[0][1]);
}

}  // namespace view_map_test
}  // namespace helicarm::track
