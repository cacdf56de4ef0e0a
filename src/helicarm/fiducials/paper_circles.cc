// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/paper_circles.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/rectification/paper_dots.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm::fiducials {

std::vector<detection::Dot> find_circles_paper(const xray::XrayImage& xray_image,
                                               const rectification::DistortionMap& map, Range radii_px) {
  return rectification::find_dots_paper(rectification::resample(xray_image, map), xray_image.lowest,
                                        xray_image.highest, radii_px.low, radii_px.high);
}

ImagePoint point_of_circle(const detection::Dot& circle, const rectification::DistortionMap& map) {
  return {map.raw_from_rectified(circle.centre_px), circle.centre_px,
          std::hypot(circle.sigma_px, map.sigma_px(circle.centre_px))};
}

Expected<ImagePoint> circle_near(const xray::XrayImage& xray_image, const rectification::DistortionMap& map,
                                 const Eigen::Vector2d& uv, double radius_px) {
  const auto circles = find_circles_paper(xray_image, map, {0.8 * radius_px, 1.2 * radius_px});
  const auto distance = [&](const detection::Dot& circle) { return (circle.centre_px - uv).norm(); };
  const auto nearest = std::ranges::min_element(circles, {}, distance);
  const double reach = std::max(5.0, radius_px);
  if (nearest == circles.end() || distance(*nearest) > reach)
    return fail(Reason::target_not_found,
                fmt::format("no circle of about {:.1f} px radius within {:.0f} px of ({:.1f}, {:.1f}), "
                            "rectified",
                            radius_px, reach, uv.x(), uv.y()));
  return point_of_circle(*nearest, map);
}

}  // namespace helicarm::fiducials
