// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/phantom_calibration/consistent_fit.h"
#include "helicarm/phantom_calibration/observe.h"

namespace helicarm::phantom_calibration {

/// Views with their fiducials observed, and the adjustment of all.
struct AdjustedViews {
  ConsistentFit consistent;  ///< its fiducials are those of `labels`
  std::vector<std::string> labels;
  std::vector<std::size_t> order;  ///< in which they are listed
  std::vector<double> diameters_mm;
  std::vector<std::size_t> ball_of_nominal;                    ///< empty from scratch
  std::vector<std::size_t> view_of_case;                       ///< of each adjusted view
  std::vector<std::vector<std::optional<Observed>>> observed;  ///< per adjusted view and fiducial
  std::vector<std::string> digests;                            ///< of the images
};

/// What is known of the centres before the images are seen.
enum class KnownCentres {
  none,     ///< only the diameters
  nominal,  ///< the calibrator file's, off by millimetres
  file      ///< the calibrator file's; single balls may have moved
};

/// Labels (by the calibrator file) or finds (`KnownCentres::none`) the fiducials, observes them in the pixels
/// and adjusts them. Warns of views and balls that are not part of it; `too_few_views` where fewer than
/// `least_views` are.
Expected<AdjustedViews> adjusted_views(const std::vector<pipeline::RectifiedView>& detected,
                                       const pipeline::Case& the_case, KnownCentres known,
                                       std::size_t least_views, unsigned threads,
                                       std::vector<Warning>& warnings);

/// `ambiguous_handedness` where every image is mirrored and neither the case nor a tag says so: the
/// calibrator file may be a mirror image.
Expected<void> check_handedness(const AdjustedViews& found, const pipeline::Case& the_case,
                                const std::vector<pipeline::RectifiedView>& detected);

/// The note that an explained mirror image of every view calls for.
std::vector<Warning> handedness_notes(const AdjustedViews& found);

}  // namespace helicarm::phantom_calibration
