// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/detection/fit_dot.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::track {

/// A disc in one image that may be a marker's, raw pixels.
struct MarkerImage {
  Eigen::Vector2d uv_raw = Eigen::Vector2d::Zero();
  double sigma_px = 0;  ///< per axis
  double radius_px = 0;
  double contrast = 0;    ///< grey levels, background minus marker: negative where markers are bright
  double background = 0;  ///< grey level around it
};

/// The absolute contrast that is likely for a marker on a background: a line over its grey level.
struct ContrastModel {
  double at_zero = 0, share = 0;
  double spread = 0.35;  ///< relative
  bool is_known = false;
  double at(double background) const {
    return std::max(at_zero + share * background, 0.01 * std::abs(background) + 1e-6);
  }
};

/// What markers of one size look like in one view.
struct MarkerAppearance {
  detection::BallProfile profile{0.4, 0.7};
  detection::DotFitOptions options = {};
  double polarity = 1;       ///< 1: dark, -1: bright
  double radius_factor = 1;  ///< of the fitted radius over the stated one
};

/// Where to look.
struct SearchWindow {
  Eigen::Vector2d centre;  ///< raw px
  double reach_px;         ///< half side
  double radius_px;        ///< of the marker
  double contrast;         ///< expected, absolute; 0: unknown
};

/// Whether a disc may be the image of a marker of this radius.
bool has_marker_size(const MarkerImage& image, double radius_px);

/// The marker nearest to a place that was picked, with the sharpness that fits it best; nothing where there
/// is none within `reach_px`. `polarity`: 1, -1, or 0 for the stronger one.
struct PickedMarker {
  MarkerImage image;
  double misfit = 0;
};
std::optional<PickedMarker> picked_marker(const xray::XrayImage& image, const Eigen::Vector2d& at,
                                          double radius_px, double reach_px,
                                          const MarkerAppearance& appearance);

/// All discs of about the markers' size in the windows, each once. Discs that overlap are fitted together,
/// and so are two markers that are expected closer than two discs can be resolved.
std::vector<MarkerImage> find_markers(const xray::XrayImage& image, std::span<const SearchWindow> windows,
                                      const MarkerAppearance& appearance);

/// Blur of the profiles that are tried, over the radius.
std::span<const double> profile_blurs();

}  // namespace helicarm::track
