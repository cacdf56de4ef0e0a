// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/detection/blobs.h"
#include "helicarm/detection/dot.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/detection/noise.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/rectification/fit_map.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm {

enum class Method { best, paper };

/// What stage 1 learns from one image of the plate.
struct Rectification {
  DistortionMap map;
  std::vector<Dot> plate_dots;      ///< used for the map
  std::vector<double> residual_px;  ///< of each
  int dots_found = 0;
  std::optional<int> dots_expected;  ///< nothing for an unbounded lattice
  double raw_mean_px = 0;  ///< distance from raw to rectified over the dots used: the distortion itself
  double raw_max_px = 0;
  Polarity metal = Polarity::dark;  ///< how metal shows in this image
  /// Metal dots found on the way that are not the plate's; nothing where metal was not searched for.
  std::optional<std::vector<Dot>> other_dots;
  NoiseCorrelation noise;  ///< of the image
  std::vector<Warning> warnings;
};

struct RectificationOptions {
  Method method = Method::best;
  std::optional<int> order;  ///< fixed polynomial order; otherwise chosen by held-out error
};

/// Finds the plate in the image and fits the map (2.1). Refuses a blank or saturated image, a missing
/// plate and a plate whose lattice or pitch is not the file's.
Expected<Rectification> rectify(const XrayImage& xray_image, const Plate& plate,
                                const RectificationOptions& options);

/// For a map known already (from a plate image taken apart, a file, or `flat_panel_map`). plate_mismatch
/// where it is for another image size, or where a plate in the image does not stand on a lattice after it.
Expected<Rectification> with_map(const XrayImage& xray_image, const DistortionMap& map,
                                 const std::optional<Plate>& plate);

/// The identity, with the file's pixel size.
DistortionMap flat_panel_map(const XrayImage& xray_image);

/// How a dot search looks for metal of any size up to the largest ball's.
DotOptions metal_search(const XrayImage& xray_image, Polarity metal);

/// The image resampled to rectified pixels (Eq. 3), same size; outside the raw image it is `lowest`.
Image<float> resample(const XrayImage& xray_image, const DistortionMap& map);

}  // namespace helicarm
