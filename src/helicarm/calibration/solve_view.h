// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/fiducials/fiducial.h"
#include "helicarm/geometry/dlt.h"

namespace helicarm::calibration {

enum class SolveMethod { most_likely, dlt, homogeneous };

/// "ml", "dlt", "homogeneous"; refuses other words (usage). `what` begins the message.
Expected<SolveMethod> solve_method(std::string_view word, const std::string& what);

/// A view by points of known place alone.
struct SolvedView {
  geometry::View view;
  std::optional<geometry::DltFactors> dlt;
  /// 11 x 11, of focal lengths, u0, v0, skew (px), translation (mm) and rotation (rad); of the most likely
  /// view.
  std::optional<Eigen::MatrixXd> covariance;
  double condition = 0;  ///< as `geometry::dlt_condition`
  double reprojection_rms_px = 0;
  std::vector<Warning> warnings;  ///< residual_too_large, ambiguous_handedness
};

/// Where points and their places come from, for messages.
struct PointsOrigin {
  std::string file;    ///< or argument
  std::string places;  ///< the columns of the places, or words for them
};

/// Eq. 4-7 with every point, none of which is rejected: by maximum likelihood, by least squares of Eq. 7 or
/// by its normalised homogeneous form. `sigmas_given`: of the points' `sigma_px`; else they are alike, and
/// follow from the residuals. Fails as `calibrate`, `dlt_least_squares` and `dlt_homogeneous`, and with
/// `usage` where the source lies so near that the places are hardly in mm.
Expected<SolvedView> solve_view(const std::vector<fiducials::Fiducial>& points, SolveMethod method,
                                bool sigmas_given, const PointsOrigin& origin);

}  // namespace helicarm::calibration
