// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/detection/image_dots.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/rectification/fit_map.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::rectification {

enum class Method { best, paper };
inline constexpr std::array<std::string_view, 2> method_words{"best", "paper"};
constexpr std::string_view word(Method method) { return method_words[std::size_t(method)]; }

/// Where a map comes from: nowhere (a flat panel), the plate in the image, a plate image of the same
/// position, a file, or a C-arm's record.
enum class MapSource { none, plate, plate_image, file, record };

/// The distortion map of one image, and which of its dots are the plate's.
struct Rectification {
  DistortionMap map;
  MapSource source = MapSource::none;
  std::vector<detection::Dot> plate_dots;  ///< used for the map
  std::vector<double> residual_px;         ///< of each
  int dots_found = 0;
  std::optional<int> dots_expected;  ///< nothing for an unbounded lattice
  /// Mean distance from raw to rectified over the dots used, of a known map over their field: the distortion.
  double raw_mean_px = 0;
  double raw_max_px = 0;
  detection::Polarity metal = detection::Polarity::dark;  ///< polarity of metal in this image
  bool map_confirmed = false;                   ///< of a given map: a plate in the image is straight in it
  std::vector<detection::Dot> confirming_dots;  ///< metal dots of that plate
  std::vector<Warning> warnings;
};

struct RectificationOptions {
  Method method = Method::best;
  std::optional<int> order;  ///< fixed polynomial order; otherwise chosen by held-out error
  std::string model = {};    ///< distortion model by name (MapOptions), of method best; "": automatic
};

/// Finds the plate among the image's dots and fits the map (2.1). Searches for dots of the other polarity
/// where those of the expected one form no lattice: an inverted image. Refuses a blank or saturated image, a
/// missing plate, and a plate whose lattice or pitch differs from the file's.
Expected<Rectification> rectify(const xray::XrayImage& xray_image, detection::ImageDots& dots,
                                const phantom::Plate& plate, const RectificationOptions& options);

/// Of an image that shows the plate alone.
Expected<Rectification> rectify(const xray::XrayImage& xray_image, const phantom::Plate& plate,
                                const RectificationOptions& options);

/// For a known map (from a separate plate image, a file, or `flat_panel_map`). plate_mismatch if it is for
/// another image size, or if a plate among the image's dots does not form a lattice after rectification.
Expected<Rectification> with_map(const xray::XrayImage& xray_image, detection::ImageDots& dots,
                                 const DistortionMap& map, const std::optional<phantom::Plate>& plate);
Expected<Rectification> with_map(const xray::XrayImage& xray_image, const DistortionMap& map,
                                 const std::optional<phantom::Plate>& plate);

/// Smallest radius (px) of the dots that may be of a plate in the image.
double least_dot_radius_px(const xray::XrayImage& xray_image, const phantom::Plate& plate);

/// Likewise of a plate, perhaps not described, that checks a known map. At most 4.5: the search's first
/// octave takes most of the time and shows few plates.
double least_checked_radius_px(const xray::XrayImage& xray_image, const std::optional<phantom::Plate>& plate);

/// The identity, with the file's pixel size.
DistortionMap flat_panel_map(const xray::XrayImage& xray_image);

/// The image resampled to rectified pixels (Eq. 3), same size; `lowest` outside the raw image.
image::Image<float> resample(const xray::XrayImage& xray_image, const DistortionMap& map);

}  // namespace helicarm::rectification
