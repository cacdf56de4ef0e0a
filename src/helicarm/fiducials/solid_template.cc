// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/solid_template.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>
#include <opencv2/imgproc.hpp>

#include "helicarm/image/opencv.h"

namespace helicarm::fiducials {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

struct Span {
  double from = -std::numeric_limits<double>::infinity();
  double to = std::numeric_limits<double>::infinity();
  double length() const { return std::max(0.0, to - from); }
  void keep(double low, double high) {
    from = std::max(from, low);
    to = std::min(to, high);
  }
};

Span in_sphere(const Vector3d& start, const Vector3d& along, double radius) {
  const double middle = -start.dot(along);
  const double square = radius * radius - (start + middle * along).squaredNorm();
  if (square <= 0) return {0, 0};
  return {middle - std::sqrt(square), middle + std::sqrt(square)};
}

/// Cylinder about `axis` through the origin, between two places on the axis.
Span in_cylinder(const Vector3d& start, const Vector3d& along, const Vector3d& axis, double radius,
                 double low, double high) {
  const Vector3d p = start - start.dot(axis) * axis;
  const Vector3d d = along - along.dot(axis) * axis;
  const double a = d.squaredNorm();
  Span span;
  if (a < 1e-12) {  // along the axis
    if (p.norm() >= radius) return {0, 0};
  } else {
    const double b = p.dot(d) / a;
    const double square = b * b - (p.squaredNorm() - radius * radius) / a;
    if (square <= 0) return {0, 0};
    span = {-b - std::sqrt(square), -b + std::sqrt(square)};
  }
  const double rise = along.dot(axis);
  const double foot = start.dot(axis);
  if (std::abs(rise) < 1e-12) return foot < low || foot > high ? Span{0, 0} : span;
  const double t0 = (low - foot) / rise;
  const double t1 = (high - foot) / rise;
  span.keep(std::min(t0, t1), std::max(t0, t1));
  return span;
}

}  // namespace

double path_in_target(const phantom::CalibratorTarget& target, const Vector3d& point, const Vector3d& along) {
  const Vector3d start = point - target.point_in_calibrator;
  const double radius = 0.5 * target.diameter_mm;
  const double unlimited_mm = 1e6;
  const double length = target.length_mm > 0 ? target.length_mm : unlimited_mm;
  switch (target.kind) {
    case phantom::TargetKind::ball:
      return in_sphere(start, along, radius).length();
    case phantom::TargetKind::line_end:
      return in_cylinder(start, along, target.directions[0], radius, 0, length).length();
    case phantom::TargetKind::cross: {
      const Span first = in_cylinder(start, along, target.directions[0], radius, -0.5 * length, 0.5 * length);
      const Span second =
          in_cylinder(start, along, target.directions[1], radius, -0.5 * length, 0.5 * length);
      const double shared = std::min(first.to, second.to) - std::max(first.from, second.from);
      const bool both = first.length() > 0 && second.length() > 0;
      return first.length() + second.length() - (both ? std::max(0.0, shared) : 0);
    }
  }
  return 0;
}

PathImage image_of_target(const phantom::CalibratorTarget& target, const geometry::View& view,
                          double half_width_px) {
  const int middle = static_cast<int>(std::ceil(half_width_px * PathImage::per_pixel));
  const int side = 2 * middle + 1;
  PathImage view_image{image::Image<float>(side, side), middle};
  const Vector2d centre = view.project(target.point_in_calibrator);
  const Vector3d source = view.source_in_world();
  const Eigen::Matrix3d direction_from_pixel =
      view.camera_from_world.rotation.transpose() * view.intrinsics.matrix().inverse();
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const Vector2d pixel = centre + Vector2d(i - middle, j - middle) / PathImage::per_pixel;
      const Vector3d along = (direction_from_pixel * pixel.homogeneous()).normalized();
      view_image.path_mm(i, j) = static_cast<float>(path_in_target(target, source, along));
    }
  return view_image;
}

SolidTemplate::SolidTemplate(const PathImage& view_image, double attenuation_per_mm, double blur_px)
    : absorbed_(view_image.path_mm), middle_(view_image.middle) {
  for (float& path : absorbed_.pixels())
    if (path > 0) path = -std::expm1(-static_cast<float>(attenuation_per_mm) * path);
  cv::Mat mat = image::as_mat(absorbed_);
  cv::GaussianBlur(mat, mat, {}, blur_px * PathImage::per_pixel, 0, cv::BORDER_REPLICATE);
}

SolidTemplate::Sample SolidTemplate::at(const Vector2d& offset) const {
  const double x = offset.x() * PathImage::per_pixel + middle_;
  const double y = offset.y() * PathImage::per_pixel + middle_;
  const int i = static_cast<int>(std::floor(x));
  const int j = static_cast<int>(std::floor(y));
  if (i < 0 || j < 0 || i + 1 >= absorbed_.width() || j + 1 >= absorbed_.height())
    return {0, Vector2d::Zero()};
  const double s = x - i;
  const double t = y - j;
  const double a = double(absorbed_(i, j));
  const double b = double(absorbed_(i + 1, j));
  const double c = double(absorbed_(i, j + 1));
  const double d = double(absorbed_(i + 1, j + 1));
  return {(1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * c + s * d),
          PathImage::per_pixel * Vector2d((1 - t) * (b - a) + t * (d - c), (1 - s) * (c - a) + s * (d - b))};
}

}  // namespace helicarm::fiducials
