// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/phantom_calibration/bundle.h"

namespace helicarm::phantom_calibration {

/// An image that the others contradict.
struct RejectedImage {
  std::size_t view;
  FiducialImage image;
  double fall;                                       ///< of chi2 without it
  Eigen::Vector2d off_px = Eigen::Vector2d::Zero();  ///< image less the prediction of the fit without it
};

struct ConsistentFit {
  BundleProblem problem;  ///< without the rejected images
  BundleFit fit;
  std::vector<RejectedImage> rejected;
};

/// `adjust`, with the image of largest fall of chi2 removed while chance would not give it (probability 1e-5
/// for one image); at most a third of all, and none that leaves a fiducial fewer than two images.
Expected<ConsistentFit> adjust_without_outliers(BundleProblem problem);

/// Per axis, each view's rms of the images that the others predict: phantom and C-arm are adjusted without
/// the view, then its pose alone. Nothing where the others do not determine the phantom.
std::vector<std::optional<double>> left_out_rms(const ConsistentFit& fit, unsigned threads);

/// A fiducial at different places in different views, by the images that were rejected: its index, how far
/// (mm) and in which views.
struct MovedFiducial {
  std::size_t fiducial;
  double moved_mm;
  std::vector<std::size_t> views;
};

/// The fiducial that moved most, of those with two rejected images or more that agree with each other, or one
/// in the first or last view, that is off by more than `least_mm`. The views are in the order of acquisition.
std::optional<MovedFiducial> moved_fiducial(const ConsistentFit& fit, double least_mm);

}  // namespace helicarm::phantom_calibration
