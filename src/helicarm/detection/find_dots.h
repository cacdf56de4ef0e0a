// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/blobs.h"
#include "helicarm/detection/dot.h"
#include "helicarm/detection/fit_dot.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm {

struct DotOptions {
  Polarity polarity = Polarity::dark;
  double min_radius_px = 2;
  double max_radius_px = 32;
  double max_sigma_px = 0.6;
  double max_misfit = 0.35;           ///< rms residual over contrast
  double min_contrast_share = 0.012;  ///< contrast over the image's range of grey values
};

/// Fit options for one exposure: where its grey values are clipped.
DotFitOptions fit_options_for(const XrayImage& xray_image);

/// How dots of one size and make look in one exposure.
struct DotLook {
  BallProfile profile;
  DotFitOptions options;
};

/// The look that fits the given dots of one size best: blur and absorbance of least total sigma.
DotLook estimate_look(const XrayImage& xray_image, const NoiseCorrelation& noise, std::vector<Dot> dots);

/// All round dots of one polarity, each with the fitted sub-pixel centre, its standard deviation and its
/// radius.
std::vector<Dot> find_dots(const XrayImage& xray_image, const DotOptions& options);

/// The dots that are none of `taken`: farther from each than 0.7 of the larger radius.
std::vector<Dot> dots_except(const std::vector<Dot>& dots, const std::vector<Dot>& taken);

/// As `find_dots`, for a reader who wants no doubtful ones: dots of one size are fitted again with a look of
/// their own, and what then stays uncertain (sigma over `clear_sigma_px`) is left out.
std::vector<Dot> find_clear_dots(const XrayImage& xray_image, const DotOptions& options,
                                 double clear_sigma_px = 0.15);

/// Fits every dot again with the look of its kind and with its neighbours masked; those that fail are left
/// out.
std::vector<Dot> refit_dots(const XrayImage& xray_image, const std::vector<Dot>& dots, const DotLook& look,
                            const std::vector<Dot>& neighbours);

}  // namespace helicarm
