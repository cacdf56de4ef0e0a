// SPDX-License-Identifier: Apache-2.0
// Calibrates two views of the built-in calibrator from its fiducials' pixels and locates a point with its
// error.
#include <iostream>

#include <Eigen/Geometry>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/localization/locate.h"
#include "helicarm/phantom/calibrator.h"

using namespace helicarm;

// The library fixes Eigen's alignment, so that its instruction set need not be the program's.
static_assert(alignof(Eigen::Matrix2d) == 32 && alignof(Eigen::Vector4d) == 32);

namespace {

geometry::View view_along(const Eigen::Vector3d& direction, const Eigen::Vector3d& centre) {
  geometry::View view;
  view.intrinsics = {4500, 4500, 511.5, 511.5, 0};
  const Eigen::Vector3d z = direction.normalized();
  const Eigen::Vector3d x = Eigen::Vector3d::UnitZ().cross(z).normalized();
  view.camera_from_world.rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
  view.camera_from_world.translation = -(view.camera_from_world.rotation * (centre - 800 * z));
  return view;
}

calibration::ViewFiducials seen(const std::string& name, const geometry::View& view,
                                const phantom::Calibrator& calibrator) {
  calibration::ViewFiducials given{name, {}};
  for (const phantom::CalibratorBall& ball : calibrator.balls) {
    const Eigen::Vector2d pixel = view.project(ball.centre_in_calibrator);
    given.fiducials.push_back(
        {ball.label, ball.centre_in_calibrator, fiducials::FiducialStatus::used, pixel, pixel, 0.05});
  }
  return given;
}

}  // namespace

int main() {
  const phantom::Calibrator calibrator = phantom::udcsc();
  const Eigen::Vector3d centre = phantom::middle_of(calibrator), point = centre + Eigen::Vector3d(5, -8, 12);
  const geometry::View ap = view_along({0, 1, 0.05}, centre), lateral = view_along({1, 0, 0.05}, centre);
  const auto calibration = calibration::calibrate(
      {seen("AP", ap, calibrator), seen("LAT", lateral, calibrator)}, calibration::CalibrationOptions{});
  if (!calibration) {
    std::cerr << code(calibration.error().reason) << ": " << calibration.error().message << '\n';
    return exit_code(calibration.error().reason);
  }
  const Eigen::Matrix2d noise = 0.25 * Eigen::Matrix2d::Identity();  // 0.5 px
  const localization::PointObservation images[] = {{0, ap.project(point), noise},
                                                   {1, lateral.project(point), noise}};
  const auto located = localization::locate("point", localization::PointSource::pick, images, *calibration);
  if (!located) {
    std::cerr << code(located.error().reason) << ": " << located.error().message << '\n';
    return exit_code(located.error().reason);
  }
  const double error = (located->point_in_anchor - point).norm();
  std::cout << "point " << located->point_in_anchor.transpose() << " mm, predicted error "
            << located->predicted_rms_mm() << " mm rms, off by " << error << " mm\n";
  return error < 1e-6 ? 0 : 1;
}
