// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/rtk_projection.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

namespace helicarm::exchange {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr double rounding_px = 1e-6;  // skew of an estimate without skew

/// The opposite angles x (out of plane), y (gantry), z (in plane) of Rz Rx Ry, in degrees.
Eigen::Vector3d rtk_angles(const Eigen::Matrix3d& rotation) {
  constexpr double locked_cosine = 5e-5;  // as ITK's Euler3DTransform
  const double x = std::asin(std::clamp(rotation(2, 1), -1.0, 1.0));
  const bool locked = std::cos(x) <= locked_cosine;
  const double y =
      locked ? std::atan2(rotation(0, 2), rotation(0, 0)) : std::atan2(-rotation(2, 0), rotation(2, 2));
  const double z = locked ? 0 : std::atan2(-rotation(0, 1), rotation(1, 1));
  return -Eigen::Vector3d(x, y, z) / degree;
}

}  // namespace

geometry::Projection RtkProjection::matrix() const {
  const auto turn = [](double degrees, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(-degrees * degree, axis);
  };
  geometry::Projection turned;
  turned << (turn(in_plane_angle, Eigen::Vector3d::UnitZ()) *
             turn(out_of_plane_angle, Eigen::Vector3d::UnitX()) *
             turn(gantry_angle, Eigen::Vector3d::UnitY()))
                .toRotationMatrix(),
      Eigen::Vector3d(-source_offset.x(), -source_offset.y(), -source_to_isocenter);
  const Eigen::Vector2d shift = source_offset - projection_offset;
  Eigen::Matrix3d detector;
  detector << -source_to_detector, 0, shift.x(), 0, -source_to_detector, shift.y(), 0, 0, 1;
  return detector * turned;
}

RtkPixels RtkPixels::centred(const Eigen::Vector2d& spacing_mm, const Eigen::Vector2i& image_size) {
  const Eigen::Vector2d last = (image_size - Eigen::Vector2i::Ones()).cast<double>();
  return {spacing_mm, -last.cwiseProduct(spacing_mm) / 2};
}

Eigen::Matrix3d RtkPixels::pixels_from_mm() const {
  Eigen::Matrix3d pixels = Eigen::Matrix3d::Identity();
  pixels.diagonal().head<2>() = spacing_mm.cwiseInverse();
  pixels.topRightCorner<2, 1>() = -origin_mm.cwiseQuotient(spacing_mm);
  return pixels;
}

Expected<RtkView> rtk_view(const geometry::View& view, const Eigen::Vector2i& image_size, double pixel_mm) {
  const geometry::Intrinsics& k = view.intrinsics;
  if (std::abs(k.skew) > rounding_px)
    return fail(Reason::unsupported,
                fmt::format("RTK's geometry has no skew; the camera's is {:g} px", k.skew));
  const Eigen::Vector3d& t = view.camera_from_world.translation;
  if (!(t.z() > 0))
    return fail(
        Reason::behind_source,
        fmt::format("RTK's isocenter, the origin, is not in front of the source (depth {:.1f} mm)", t.z()));
  // RTK's detector: x right and y up as seen from the source, z towards it. A mirrored image (fx < 0) is the
  // one whose rows run along y.
  const bool mirrored = k.fx < 0;
  const Eigen::Vector3d axes = mirrored ? Eigen::Vector3d(-1, 1, -1) : Eigen::Vector3d(1, -1, -1);
  RtkView result;
  result.rows_upwards = !mirrored;
  RtkProjection& p = result.projection;
  p.source_to_isocenter = t.z();
  p.source_to_detector = k.fy * pixel_mm;
  p.source_offset = -axes.cwiseProduct(t).head<2>();
  const Eigen::Vector3d angles = rtk_angles(axes.asDiagonal() * view.camera_from_world.rotation);
  p.out_of_plane_angle = angles.x();
  p.gantry_angle = angles.y();
  p.in_plane_angle = angles.z();
  result.pixels = RtkPixels::centred({p.source_to_detector / std::abs(k.fx), pixel_mm}, image_size);
  const Eigen::Vector2d principal(k.u0, mirrored ? k.v0 : image_size.y() - 1 - k.v0);
  p.projection_offset =
      p.source_offset - result.pixels.origin_mm - principal.cwiseProduct(result.pixels.spacing_mm);
  return result;
}

}  // namespace helicarm::exchange
