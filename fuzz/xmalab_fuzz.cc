// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/pixel_map.h"
#include "helicarm/track/xmalab_points.h"
#include "target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  const auto file = put_file("input.csv", bytes);
  constexpr std::size_t cameras = 2;
  if (const auto points = track::read_xmalab_points2d(file, cameras)) {
    check(!points->markers.empty(), "a table of points has markers");
    for (const auto& row : points->rows) {
      check(row.size() == cameras * points->markers.size(), "each marker has a point or none in each camera");
      for (const auto& point : row) check(!point || point->allFinite(), "points are finite");
    }
  }
  if (const auto places = track::read_xmalab_points3d(file, {"a", "b"}); places && *places)
    check((**places)[0].allFinite() && (**places)[1].allFinite(), "places are finite");
  if (const auto dots = rectification::read_xmalab_grid(file, file))
    for (const rectification::Correspondence& dot : *dots)
      check(dot.raw_px.allFinite() && dot.place_mm == dot.raw_px,
            "dots are finite, and the same in both files");
}

std::vector<std::string> seeds() {
  return {
      "a_cam1_X,a_cam1_Y,a_cam2_X,a_cam2_Y,b_cam1_X,b_cam1_Y,b_cam2_X,b_cam2_Y\n1,2,3,4,NaN,NaN,7.5,8e2\n",
      "cam0_offsetcam1_offseta_cam1_X,a_cam1_Y,a_cam2_X,a_cam2_Y\r\n0,0,1,2,3,4\r\n",
      "Frame,a_X,a_Y,a_Z,b_X,b_Y,b_Z\n1,1,2,3,4,5,6\n", "12.5,40\n13,-41.25\n"};
}

}  // namespace helicarm::fuzz
