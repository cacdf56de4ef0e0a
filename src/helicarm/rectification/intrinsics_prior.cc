// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/intrinsics_prior.h"

namespace helicarm::rectification {
namespace {

constexpr double field_mm = 230;  // width of a detector, for an unknown pixel size
constexpr double aspect_sigma = 0.001;

/// Size of a rectified pixel on the detector.
std::optional<double> detector_pixel_mm(const xray::XrayImage& xray_image, const DistortionMap& map) {
  if (map.rectified_plane == RectifiedPlane::detector && map.rectified_pixel_mm)
    return map.rectified_pixel_mm;
  if (const auto& pixel = xray_image.acquisition.pixel_mm) return pixel->mean();
  return std::nullopt;
}

}  // namespace

geometry::IntrinsicsPrior intrinsics_prior(const xray::XrayImage& xray_image, const DistortionMap& map) {
  const auto pixel_mm = detector_pixel_mm(xray_image, map);
  const auto& distance_mm = xray_image.acquisition.source_detector_mm;
  const auto& file_pixel = xray_image.acquisition.pixel_mm;
  geometry::IntrinsicsPrior prior;
  prior.unit_px = pixel_mm ? 1 / *pixel_mm : xray_image.pixels.width() / field_mm;
  if (pixel_mm && distance_mm) prior.focal_px = *distance_mm / *pixel_mm;
  prior.principal_px = {(xray_image.pixels.width() - 1) / 2.0, (xray_image.pixels.height() - 1) / 2.0};
  prior.aspect = geometry::NormalPrior{
      map.is_identity() && file_pixel ? file_pixel->y() / file_pixel->x() : 1, aspect_sigma};
  return prior;
}

}  // namespace helicarm::rectification
