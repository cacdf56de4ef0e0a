// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/detection/blobs.h"
#include "helicarm/detection/dot.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/detection/noise.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/rectification/fit_map.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::rectification {

enum class Method { best, paper };

/// Result of stage 1 for one image of the plate.
struct Rectification {
  DistortionMap map;
  std::vector<detection::Dot> plate_dots;  ///< used for the map
  std::vector<double> residual_px;         ///< of each
  int dots_found = 0;
  std::optional<int> dots_expected;  ///< nothing for an unbounded lattice
  double raw_mean_px = 0;  ///< mean distance from raw to rectified over the dots used: the distortion
  double raw_max_px = 0;
  detection::Polarity metal = detection::Polarity::dark;  ///< polarity of metal in this image
  /// Metal dots that are not the plate's; nothing if metal was not searched for.
  std::optional<std::vector<detection::Dot>> other_dots;
  bool map_confirmed = false;         ///< of a given map: a plate in the image is straight in it
  double other_dots_from_px = 2;      ///< smallest radius that was searched for them
  detection::NoiseCorrelation noise;  ///< of the image
  std::vector<Warning> warnings;
};

struct RectificationOptions {
  Method method = Method::best;
  std::optional<int> order;  ///< fixed polynomial order; otherwise chosen by held-out error
  std::string model = {};    ///< distortion model by name (MapOptions), of method best; "": automatic
};

/// Finds the plate in the image and fits the map (2.1). Refuses a blank or saturated image, a missing plate,
/// and a plate whose lattice or pitch differs from the file's.
Expected<Rectification> rectify(const xray::XrayImage& xray_image, const phantom::Plate& plate,
                                const RectificationOptions& options);

/// For a known map (from a separate plate image, a file, or `flat_panel_map`). plate_mismatch if it is for
/// another image size, or if a plate in the image does not form a lattice after rectification. Dots are
/// searched from 4.5 px radius or the plate's size on: the first octave takes most of the time and shows few
/// balls.
Expected<Rectification> with_map(const xray::XrayImage& xray_image, const DistortionMap& map,
                                 const std::optional<phantom::Plate>& plate);

/// The identity, with the file's pixel size.
DistortionMap flat_panel_map(const xray::XrayImage& xray_image);

/// Options to search for metal dots up to the largest ball.
detection::DotOptions metal_search(const xray::XrayImage& xray_image, detection::Polarity metal);

/// The image resampled to rectified pixels (Eq. 3), same size; `lowest` outside the raw image.
image::Image<float> resample(const xray::XrayImage& xray_image, const DistortionMap& map);

}  // namespace helicarm::rectification
