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

/// Result of stage 1 for one image of the plate.
struct Rectification {
  DistortionMap map;
  std::vector<Dot> plate_dots;      ///< used for the map
  std::vector<double> residual_px;  ///< of each
  int dots_found = 0;
  std::optional<int> dots_expected;  ///< nothing for an unbounded lattice
  double raw_mean_px = 0;  ///< mean distance from raw to rectified over the dots used: the distortion
  double raw_max_px = 0;
  Polarity metal = Polarity::dark;  ///< polarity of metal in this image
  /// Metal dots that are not the plate's; nothing if metal was not searched for.
  std::optional<std::vector<Dot>> other_dots;
  NoiseCorrelation noise;  ///< of the image
  std::vector<Warning> warnings;
};

struct RectificationOptions {
  Method method = Method::best;
  std::optional<int> order;  ///< fixed polynomial order; otherwise chosen by held-out error
};

/// Finds the plate in the image and fits the map (2.1). Refuses a blank or saturated image, a missing plate,
/// and a plate whose lattice or pitch differs from the file's.
Expected<Rectification> rectify(const XrayImage& xray_image, const Plate& plate,
                                const RectificationOptions& options);

/// For a known map (from a separate plate image, a file, or `flat_panel_map`). plate_mismatch if it is for
/// another image size, or if a plate in the image does not form a lattice after rectification.
Expected<Rectification> with_map(const XrayImage& xray_image, const DistortionMap& map,
                                 const std::optional<Plate>& plate);

/// The identity, with the file's pixel size.
DistortionMap flat_panel_map(const XrayImage& xray_image);

/// Options to search for metal dots up to the largest ball.
DotOptions metal_search(const XrayImage& xray_image, Polarity metal);

/// The image resampled to rectified pixels (Eq. 3), same size; `lowest` outside the raw image.
Image<float> resample(const XrayImage& xray_image, const DistortionMap& map);

}  // namespace helicarm
