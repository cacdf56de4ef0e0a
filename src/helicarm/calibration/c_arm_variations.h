// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <utility>

#include "helicarm/calibration/c_arm_model.h"

namespace helicarm::calibration {

/// A standard deviation, mm, of greatest likelihood, with its 95 % interval by the profile of the likelihood
/// (Wilks 1938): of the recorded data alone, without what is expected of an unknown C-arm.
struct VariationEstimate {
  double sigma_mm = 0;
  double low_mm = 0;              ///< 0: the data agree with none
  std::optional<double> high_mm;  ///< nothing: the data set no upper limit

  /// Whether the data say anything of it.
  bool is_determined() const { return low_mm > 0 || high_mm; }
};

struct VariationEstimates {
  VariationEstimate smooth, repeat;  ///< as CArmVariation
};

struct CArmVariations {
  VariationEstimates focal, principal;
  /// Least and greatest of the focal length and the principal point that the model predicts at the recorded
  /// positions, mm; nothing where no entry states its angles.
  std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> at_positions;
};

/// Without entries nothing is determined. Time grows with the cube of their number: about 3 s for 150.
CArmVariations c_arm_variations(const CArmModel& model);

/// "1.9 mm (1.4 to 2.9)", "below 0.4 mm", "above 3 mm", or "not determined by these data".
std::string text_of(const VariationEstimate& estimate);

/// Natural logarithm of the density of the model's entries with its variations, without a constant; minus
/// infinity where they are impossible.
double log_likelihood(const CArmModel& model);

}  // namespace helicarm::calibration
