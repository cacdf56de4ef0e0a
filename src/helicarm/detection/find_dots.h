// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/blobs.h"
#include "helicarm/detection/dot.h"
#include "helicarm/detection/fit_dot.h"
#include "helicarm/xray/exposure.h"

namespace helicarm {

struct DotOptions {
  Polarity polarity = Polarity::dark;
  double min_radius_px = 2;
  double max_radius_px = 32;
  double max_sigma_px = 0.6;
  double max_misfit = 0.35;     ///< rms residual over contrast
  double min_contrast_share = 0.012;  ///< contrast over the picture's range of grey values
};

/// How the grey values of one exposure are to be fitted: linear or logarithmic, and where they are clipped.
DotFitOptions fit_options_for(const Exposure& exposure);

/// The profile that best fits the given dots of one size (blur and absorbance by least misfit).
BallProfile estimate_profile(const Exposure& exposure, std::vector<Dot> dots, const DotFitOptions& options);

/// All round dots of one polarity, each with the fitted sub-pixel centre, its standard deviation and its radius.
std::vector<Dot> find_dots(const Exposure& exposure, const DotOptions& options);

/// Fits every dot again with the profile made for its size and with its neighbours masked.
std::vector<Dot> refit_dots(const Exposure& exposure, const std::vector<Dot>& dots, const BallProfile& profile,
                            const std::vector<Dot>& neighbours, const DotFitOptions& options);

}  // namespace helicarm
