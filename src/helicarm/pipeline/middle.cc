// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/middle.h"

#include "helicarm/geometry/nearest_point.h"

namespace helicarm::pipeline {
namespace {

geometry::Ray central_ray(const geometry::View& view, const image::Image<float>& pixels) {
  return geometry::central_ray(view, pixels.width(), pixels.height());
}

}  // namespace

Eigen::Vector3d middle_of(const phantom::Calibrator& calibrator, const CaseCalibration& calibration) {
  if (!calibrator.balls.empty()) return phantom::middle_of(calibrator);
  std::vector<geometry::Ray> rays;
  for (std::size_t i = 0; i < calibration.views.size(); ++i)
    rays.push_back(central_ray(calibration.views[i].view, calibration.images[i].xray_image->pixels));
  return geometry::middle_of(rays);
}

Eigen::Vector3d middle_of(const phantom::Calibrator& calibrator, const std::vector<ViewResult>& views) {
  if (!calibrator.balls.empty()) return phantom::middle_of(calibrator);
  std::vector<geometry::Ray> rays;
  for (const ViewResult& view : views)
    if (view.calibrated && view.xray_image)
      rays.push_back(central_ray(view.calibrated->view, view.xray_image->pixels));
  return geometry::middle_of(rays);
}

}  // namespace helicarm::pipeline
