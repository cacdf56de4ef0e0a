// SPDX-License-Identifier: Apache-2.0
#include "helicarm/navigation/prior.h"

#include <optional>

namespace helicarm {
namespace {

constexpr double focal_sigma_share = 0.01;
constexpr double aspect_sigma = 0.001;
constexpr double principal_sigma_mm = 8;
constexpr double principal_sigma_share =
    0.05;  ///< of the picture's width, where the pixel's size is not known
constexpr double sag_focal_mm = 2;
constexpr double sag_principal_mm = 6;

/// Size of a rectified pixel on the receiver.
std::optional<double> receiver_pixel_mm(const Exposure& exposure, const DistortionMap& map) {
  if (map.rectified_plane == RectifiedPlane::detector && map.rectified_pixel_mm)
    return map.rectified_pixel_mm;
  if (const auto& pixel = exposure.acquisition.pixel_mm) return pixel->mean();
  return std::nullopt;
}

}  // namespace

IntrinsicsPrior intrinsics_prior(const Exposure& exposure, const DistortionMap& map) {
  const double width = exposure.pixels.width();
  const double height = exposure.pixels.height();
  const auto pixel_mm = receiver_pixel_mm(exposure, map);
  const auto& distance_mm = exposure.acquisition.source_detector_mm;
  IntrinsicsPrior prior;
  if (pixel_mm && distance_mm)
    prior.focal_px = Belief{*distance_mm / *pixel_mm, focal_sigma_share * *distance_mm / *pixel_mm};
  const auto& file_pixel = exposure.acquisition.pixel_mm;
  const bool flat = map.is_identity();
  prior.aspect = Belief{flat && file_pixel ? file_pixel->y() / file_pixel->x() : 1, aspect_sigma};
  prior.principal_px =
      PrincipalBelief{{(width - 1) / 2, (height - 1) / 2},
                      pixel_mm ? principal_sigma_mm / *pixel_mm : principal_sigma_share * width};
  return prior;
}

SpreadPrior spread_prior(const Exposure& exposure, const DistortionMap& map) {
  const auto pixel_mm = receiver_pixel_mm(exposure, map);
  if (!pixel_mm) return {};
  return {sag_focal_mm / *pixel_mm, sag_principal_mm / *pixel_mm};
}

}  // namespace helicarm
