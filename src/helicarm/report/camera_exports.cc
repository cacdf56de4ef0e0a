// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/camera_exports.h"

#include <cmath>

#include <fmt/format.h>

#include "helicarm/exchange/import_matrix.h"
#include "helicarm/exchange/itk_transform.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::report {
namespace {

std::string rows_of(const Eigen::MatrixXd& matrix, std::string_view between) {
  std::string rows;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j)
      rows += fmt::format("{}{}", matrix(i, j), j + 1 < matrix.cols() ? between : "\n");
  return rows;
}

Eigen::Vector2i image_size(const pipeline::ViewResult& view) {
  return {view.xray_image->pixels.width(), view.xray_image->pixels.height()};
}

std::string opencv_matrix(std::string_view name, const Eigen::MatrixXd& matrix) {
  std::string numbers;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j)
      numbers += fmt::format("{}{:.17g}", numbers.empty() ? "" : ", ", matrix(i, j));
  return fmt::format("{}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [ {} ]\n", name,
                     matrix.rows(), matrix.cols(), numbers);
}

/// Of RTK's detector: known for a detector's pixels, else the unit of its mm is a pixel.
double detector_pixel_mm(const pipeline::ViewResult& view) {
  if (!view.rectification) return 1;
  const rectification::DistortionMap& map = view.rectification->map;
  const bool of_detector = map.rectified_plane == rectification::RectifiedPlane::detector;
  return of_detector ? map.rectified_pixel_mm.value_or(1) : 1;
}

}  // namespace

std::string maya_cam(const pipeline::ViewResult& view) {
  const geometry::View& of = view.calibrated->view;
  const Eigen::Vector2i size = image_size(view);
  return fmt::format("image size\n{},{}\n\ncamera matrix\n{}\nrotation\n{}\ntranslation\n{}", size.x(),
                     size.y(), rows_of(of.intrinsics.matrix(), ","),
                     rows_of(of.camera_from_world.rotation, ","),
                     rows_of(of.camera_from_world.translation, ","));
}

std::string matrix_text(const pipeline::ViewResult& view) {
  return "# 3x4: calibrator (mm) to rectified pixels, (0, 0) is the centre of the top-left one\n" +
         rows_of(view.calibrated->view.projection(), " ");
}

std::string opencv_yaml(const pipeline::ViewResult& view) {
  const geometry::View& of = view.calibrated->view;
  const geometry::RigidTransform& pose = of.camera_from_world;
  const Eigen::Vector2i size = image_size(view);
  return fmt::format("%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n", size.x(), size.y()) +
         opencv_matrix("camera_matrix", of.intrinsics.matrix()) +
         opencv_matrix("distortion_coefficients", Eigen::VectorXd::Zero(5)) +
         opencv_matrix("rvec", geometry::vector_from_rotation(pose.rotation)) +
         opencv_matrix("tvec", pose.translation) + opencv_matrix("R", pose.rotation);
}

std::string rtk_geometry(const pipeline::ViewResult& view) {
  return value_or_throw(exchange::rtk_geometry(
      {{{view.name, view.calibrated->view}}, image_size(view), detector_pixel_mm(view)}));
}

std::string itk_pose(const pipeline::ViewResult& view) {
  return exchange::itk_transform_text(view.calibrated->view.camera_from_world);
}

std::string dlt_csv(std::span<const pipeline::ViewResult* const> views) {
  Eigen::MatrixXd columns(11, Eigen::Index(views.size()));
  for (Eigen::Index i = 0; i < columns.cols(); ++i) {
    const pipeline::ViewResult& view = *views[std::size_t(i)];
    const geometry::Projection p =
        exchange::xmalab_from_pixels(view.xray_image->pixels.height()) * view.calibrated->view.projection();
    if (!geometry::factors_from_projection(p))
      throw BadInput(
          {Reason::point_at_infinity,
           "has no DLT coefficients: the calibrator's origin lies in the plane of the X-ray source",
           view.name,
           {}});
    const geometry::Projection scaled = p / p(2, 3);
    columns.col(i) << scaled.row(0).transpose(), scaled.row(1).transpose(),
        scaled.row(2).head<3>().transpose();
  }
  return rows_of(columns, ",");
}

exchange::RunGeometry run_geometry(std::span<const pipeline::ViewResult* const> views) {
  constexpr double tolerance = 1e-3;  // of the pixel size
  exchange::RunGeometry run;
  for (const pipeline::ViewResult* view : views) {
    if (run.images.empty()) {
      run.size = image_size(*view);
      run.pixel_mm = detector_pixel_mm(*view);
    }
    if (image_size(*view) != run.size || std::abs(detector_pixel_mm(*view) / run.pixel_mm - 1) > tolerance)
      throw BadInput({Reason::unsupported,
                      fmt::format("has another image or pixel size than {}: one file is of one detector",
                                  views.front()->name),
                      view->name,
                      {}});
    run.images.push_back({view->name, view->calibrated->view});
  }
  return run;
}

}  // namespace helicarm::report
