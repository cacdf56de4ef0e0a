// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/tunnel_slices.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "helicarm/image/opencv.h"
#include "helicarm/image/png.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using registration::BoneCheck;

constexpr double slice_pixel_mm = 0.25;
constexpr double beside_mm = 18;  // of the wall, at least
constexpr double ends_mm = 12;    // beyond the tunnel's ends
constexpr double low_hu = -250, high_hu = 1250;
constexpr std::uint8_t inside_grey = 150;

/// Where a slice lies in the model: unit steps to the right and down.
struct Plane {
  Vector3d middle, right, down;
  double right_mm, down_mm;  ///< half widths

  Vector3d at(double u_mm, double v_mm) const { return middle + u_mm * right + v_mm * down; }
  int columns() const { return 2 * int(std::ceil(right_mm / slice_pixel_mm)) + 1; }
  int rows() const { return 2 * int(std::ceil(down_mm / slice_pixel_mm)) + 1; }
  Vector2d pixel(const Vector3d& point) const {
    const Vector3d from = (point - middle) / slice_pixel_mm;
    return {from.dot(right) + (columns() - 1) / 2, from.dot(down) + (rows() - 1) / 2};
  }
};

/// Trilinear; nothing outside.
std::optional<double> hu_at(const volume::Volume& ct, const Vector3d& voxel) {
  const Eigen::Vector3i low = voxel.array().floor().cast<int>();
  if ((low.array() < 0).any() || (low.array() + 1 >= ct.size.array()).any()) return {};
  const Vector3d part = voxel - low.cast<double>();
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3i one(corner & 1, (corner >> 1) & 1, corner >> 2);
    const Eigen::Vector3i at = low + one;
    double weight = 1;
    for (int axis = 0; axis < 3; ++axis) weight *= one[axis] != 0 ? part[axis] : 1 - part[axis];
    sum += weight *
           double(ct.voxels[std::size_t(at.x()) +
                            std::size_t(ct.size.x()) *
                                (std::size_t(at.y()) + std::size_t(ct.size.y()) * std::size_t(at.z()))]);
  }
  return sum;
}

/// Pixels inside the bone: between the crossings of each row.
image::Image<std::uint8_t> inside(const registration::BoneSurface& bone, const Plane& plane) {
  image::Image<std::uint8_t> mask(plane.columns(), plane.rows());
  const int half_columns = (plane.columns() - 1) / 2, half_rows = (plane.rows() - 1) / 2;
  const double length_mm = (plane.columns() - 1) * slice_pixel_mm;
  for (int v = 0; v < mask.height(); ++v) {
    const Vector3d begin = plane.at(-half_columns * slice_pixel_mm, (v - half_rows) * slice_pixel_mm);
    bool is_inside = bone.holds(begin);
    int from = 0;
    const auto fill_to = [&](int to) {
      if (is_inside) std::fill(mask.row(v) + from, mask.row(v) + std::max(from, to), std::uint8_t{255});
      from = std::max(from, to);
    };
    for (const registration::Crossing& crossing : bone.crossings(begin, plane.right, length_mm)) {
      fill_to(std::clamp(int(std::ceil(crossing.at_mm / slice_pixel_mm)), 0, mask.width()));
      is_inside = !crossing.leaves;
    }
    fill_to(mask.width());
  }
  return mask;
}

image::Image<std::uint8_t> grey_of(const volume::Volume& ct, const Plane& plane) {
  image::Image<std::uint8_t> grey(plane.columns(), plane.rows());
  const Eigen::Affine3d voxel_from_patient = ct.patient_from_voxel.inverse();
  const Vector3d step = voxel_from_patient.linear() * plane.right * slice_pixel_mm;
  for (int v = 0; v < grey.height(); ++v) {
    const Vector3d begin = voxel_from_patient * plane.at(-(plane.columns() - 1) / 2 * slice_pixel_mm,
                                                         (v - (plane.rows() - 1) / 2) * slice_pixel_mm);
    for (int u = 0; u < grey.width(); ++u)
      if (const auto hu = hu_at(ct, begin + u * step)) {
        const double share = std::clamp((*hu - low_hu) / (high_hu - low_hu), 0.0, 1.0);
        grey(u, v) = static_cast<std::uint8_t>(std::lround(255 * share));
      }
  }
  return grey;
}

TunnelSlice slice_of(const Plane& plane, const registration::BoneSurface& bone, const volume::Volume* ct) {
  TunnelSlice slice;
  image::Image<std::uint8_t> mask = inside(bone, plane);
  std::vector<std::vector<cv::Point>> curves;
  cv::findContours(image::as_mat(mask).clone(), curves, cv::RETR_CCOMP, cv::CHAIN_APPROX_TC89_L1);
  for (const auto& curve : curves) {
    auto& points = slice.outline.emplace_back();
    for (const cv::Point& at : curve) points.emplace_back(at.x, at.y);
  }
  if (!ct)
    for (std::uint8_t& grey : mask.pixels()) grey = std::min(grey, inside_grey);
  slice.grey = ct ? grey_of(*ct, plane) : std::move(mask);
  return slice;
}

TunnelSlices slices_of(const Vector3d& start, const Vector3d& end, const BoneCheck& check,
                       const registration::BoneSurface& bone, const volume::Volume* ct) {
  const Vector3d axis = (end - start).normalized();
  Vector3d outward = check.outward - check.outward.dot(axis) * axis;
  outward = outward.norm() > 1e-6 ? Vector3d(outward.normalized()) : axis.unitOrthogonal();
  const Vector3d beside = axis.cross(outward), middle = 0.5 * (start + end);
  const double half_mm = 0.5 * (end - start).norm() + ends_mm;
  const double radius_mm = 0.5 * check.diameter_mm.value_or(0);
  const double wide_mm = radius_mm + beside_mm;
  const Vector3d narrow = check.bridge_mm ? check.thinnest : middle;
  const Vector3d wall = narrow + radius_mm * outward;
  const std::array planes{Plane{middle, axis, outward, half_mm, wide_mm},
                          Plane{middle, axis, beside, half_mm, wide_mm},
                          Plane{narrow, beside, outward, wide_mm, wide_mm}};
  TunnelSlices made;
  made.pixel_mm = slice_pixel_mm;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    TunnelSlice& slice = made.slices[i] = slice_of(planes[i], bone, ct);
    slice.start = planes[i].pixel(start);
    slice.end = planes[i].pixel(end);
    slice.thinnest = planes[i].pixel(wall);
  }
  return made;
}

cv::Point2d point_of(const Vector2d& at) { return {at.x(), at.y()}; }

/// The wall's two lines and the axis, or the circle across it.
void draw_tunnel(cv::Mat& drawn, const TunnelSlice& slice, double radius_px, const cv::Scalar& colour) {
  const auto line = [&](const Vector2d& from, const Vector2d& to) {
    cv::line(drawn, point_of(from), point_of(to), colour, 1, cv::LINE_AA);
  };
  const Vector2d along = slice.end - slice.start;
  if (along.norm() < 1) {
    cv::circle(drawn, point_of(slice.start), std::max(1, int(std::lround(radius_px))), colour, 1,
               cv::LINE_AA);
    return;
  }
  const Vector2d across = Vector2d(-along.y(), along.x()).normalized() * radius_px;
  line(slice.start, slice.end);
  if (radius_px <= 0) return;
  line(slice.start + across, slice.end + across);
  line(slice.start - across, slice.end - across);
  line(slice.start + across, slice.start - across);
  line(slice.end + across, slice.end - across);
}

}  // namespace

std::vector<std::optional<TunnelSlices>> tunnel_slices(const MarkupPlan& plan,
                                                       const std::vector<std::optional<BoneCheck>>& checks,
                                                       const registration::BoneSurface& bone,
                                                       const volume::Volume* ct) {
  std::vector<std::optional<TunnelSlices>> slices(checks.size());
  for (std::size_t i = 0; i < checks.size(); ++i)
    if (checks[i])
      slices[i] = slices_of(plan.points[plan.tunnels[i].start].in_model,
                            plan.points[plan.tunnels[i].end].in_model, *checks[i], bone, ct);
  return slices;
}

std::string tunnel_slices_png(const TunnelSlices& slices, const BoneCheck& check) {
  constexpr int gap_px = 6;
  const cv::Scalar outline(86, 180, 233), red(255, 70, 60), yellow(240, 228, 66), green(80, 220, 120);
  int width = -gap_px, height = 0;
  for (const TunnelSlice& slice : slices.slices) {
    width += slice.grey.width() + gap_px;
    height = std::max(height, slice.grey.height());
  }
  cv::Mat sheet = cv::Mat::zeros(height, width, CV_8UC3);
  const cv::Scalar wall = check.is_breach() ? red : check.is_thin() ? yellow : green;
  int left = 0;
  for (const TunnelSlice& slice : slices.slices) {
    cv::Mat part =
        sheet(cv::Rect(left, (height - slice.grey.height()) / 2, slice.grey.width(), slice.grey.height()));
    cv::cvtColor(image::as_mat(slice.grey), part, cv::COLOR_GRAY2RGB);
    for (const auto& curve : slice.outline) {
      std::vector<cv::Point> points;
      for (const Vector2d& at : curve) points.emplace_back(int(at.x()), int(at.y()));
      cv::polylines(part, points, true, outline, 1);
    }
    draw_tunnel(part, slice, 0.5 * check.diameter_mm.value_or(0) / slices.pixel_mm, wall);
    if (check.bridge_mm)
      cv::drawMarker(part, point_of(slice.thinnest), wall, cv::MARKER_CROSS, 9, 1, cv::LINE_AA);
    left += slice.grey.width() + gap_px;
  }
  return image::encode_png(sheet);
}

}  // namespace helicarm::case_registration
