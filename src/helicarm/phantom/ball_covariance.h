// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/core/json.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm::phantom {

inline constexpr std::size_t most_correlated_balls = 100;

/// A covariance made exactly symmetric. Refuses (`bad_value`) one that is asymmetric or has a negative
/// eigenvalue, beyond rounding.
Expected<Eigen::MatrixXd> checked_covariance(const Eigen::MatrixXd& covariance_mm2);

/// The size x size matrix (mm^2) under a key, which must be symmetric and without negative eigenvalues, to
/// rounding.
Eigen::MatrixXd covariance_from(JsonReader& reader, const char* key, std::size_t size);

/// Reads `joint_covariance` of calibrator.json: it must cover all balls, and agree with their own
/// covariances.
JointCovariance joint_covariance_from(JsonReader reader, const std::vector<CalibratorBall>& balls);

Json to_json(const JointCovariance& joint);

}  // namespace helicarm::phantom
