// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/blobs.h"
#include "helicarm/detection/dot.h"
#include "helicarm/detection/fit_dot.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::detection {

struct DotOptions {
  Polarity polarity = Polarity::dark;
  double min_radius_px = 2;
  double max_radius_px = 32;
  double max_sigma_px = 0.6;
  double max_misfit = 0.35;           ///< rms residual over contrast
  double min_contrast_share = 0.012;  ///< contrast over the image's range of grey values
};

/// Least radius of a fitted dot over the smallest that is searched for.
inline constexpr double fit_reach = 0.8;

/// Fit options for one image: its clipping limits.
DotFitOptions fit_options_for(const xray::XrayImage& xray_image);

/// Appearance of dots of one size and material in one image.
struct DotAppearance {
  BallProfile profile;
  DotFitOptions options;
};

/// The appearance (blur and absorbance of least total sigma) of the given dots of one size.
DotAppearance estimate_appearance(const xray::XrayImage& xray_image, const NoiseCorrelation& noise,
                                  std::vector<Dot> dots);

/// All round dots of one polarity, each with sub-pixel centre, standard deviation and radius.
std::vector<Dot> find_dots(const xray::XrayImage& xray_image, const DotOptions& options);

/// The dots that are not in `taken`: farther from each than 0.7 of the larger radius.
std::vector<Dot> dots_except(const std::vector<Dot>& dots, const std::vector<Dot>& taken);

/// Like `find_dots`, without uncertain dots: dots of one size are fitted again with their common appearance,
/// and those with sigma over `clear_sigma_px` are dropped.
std::vector<Dot> find_clear_dots(const xray::XrayImage& xray_image, const DotOptions& options,
                                 double clear_sigma_px = 0.15);

/// Refits every dot with the appearance of its kind and its neighbours masked; nothing where the fit fails.
std::vector<std::optional<Dot>> refit_each(const xray::XrayImage& xray_image, const std::vector<Dot>& dots,
                                           const DotAppearance& appearance,
                                           const std::vector<Dot>& neighbours);

/// `refit_each` without the dots whose fit fails.
std::vector<Dot> refit_dots(const xray::XrayImage& xray_image, const std::vector<Dot>& dots,
                            const DotAppearance& appearance, const std::vector<Dot>& neighbours);

}  // namespace helicarm::detection
