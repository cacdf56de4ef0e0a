// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/prior.h"

#include <optional>

namespace helicarm::pipeline {
namespace {

// About 1 % of a source distance of 1000 mm; a principal point within 12 mm of the centre; sag between two
// views of up to 2 mm (source distance) and 6 mm (principal point).
constexpr calibration::IntrinsicsVariation focal_mm{10, 1.4};
constexpr calibration::IntrinsicsVariation principal_mm{7, 4.2};
constexpr double field_mm = 230;  // width of a detector, for an unknown pixel size
constexpr double aspect_sigma = 0.001;

/// Size of a rectified pixel on the detector.
std::optional<double> receiver_pixel_mm(const xray::XrayImage& xray_image,
                                        const rectification::DistortionMap& map) {
  if (map.rectified_plane == rectification::RectifiedPlane::detector && map.rectified_pixel_mm)
    return map.rectified_pixel_mm;
  if (const auto& pixel = xray_image.acquisition.pixel_mm) return pixel->mean();
  return std::nullopt;
}

}  // namespace

calibration::IntrinsicsPrior intrinsics_prior(const xray::XrayImage& xray_image,
                                              const rectification::DistortionMap& map) {
  const auto pixel_mm = receiver_pixel_mm(xray_image, map);
  const auto& distance_mm = xray_image.acquisition.source_detector_mm;
  const auto& file_pixel = xray_image.acquisition.pixel_mm;
  calibration::IntrinsicsPrior prior;
  prior.unit_px = pixel_mm ? 1 / *pixel_mm : xray_image.pixels.width() / field_mm;
  if (pixel_mm && distance_mm) prior.focal_px = *distance_mm / *pixel_mm;
  prior.principal_px = {(xray_image.pixels.width() - 1) / 2.0, (xray_image.pixels.height() - 1) / 2.0};
  prior.aspect = calibration::NormalPrior{
      map.is_identity() && file_pixel ? file_pixel->y() / file_pixel->x() : 1, aspect_sigma};
  return prior;
}

calibration::CArmPrior unknown_c_arm() { return {focal_mm, principal_mm}; }

}  // namespace helicarm::pipeline
