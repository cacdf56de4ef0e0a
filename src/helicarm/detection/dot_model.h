// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include <Eigen/Core>

#include "helicarm/detection/ball_profile.h"
#include "helicarm/detection/dot_patch.h"
#include "helicarm/detection/normal_equations.h"

namespace helicarm::detection {

/// Model of a few dots on a quadratic background. Parameters: background b0 bx by bxx bxy byy (patch
/// coordinates in units of the window) and the hidden share; contrast, centre, radius of each dot; the
/// overlap term of each pair of dots.
struct DotModel {
  static constexpr Eigen::Index hidden = 6;
  static constexpr Eigen::Index first_dot = 7;
  static constexpr Eigen::Index per_dot = 4;
  static constexpr Eigen::Index max_parameters =
      first_dot + per_dot * max_dots_together + max_dots_together * (max_dots_together - 1) / 2;
  using Parameters = Eigen::Matrix<float, Eigen::Dynamic, 1, 0, max_parameters, 1>;
  using Normal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_parameters, max_parameters>;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_parameters, 1>;

  DotModel(std::span<const BallProfile> profiles, const DotPatch& patch);

  std::size_t dots() const { return profiles.size(); }
  static Eigen::Index contrast_of(std::size_t dot) {
    return first_dot + per_dot * static_cast<Eigen::Index>(dot);
  }
  Eigen::Index overlap_of(std::size_t i, std::size_t j) const {  // i < j
    return contrast_of(dots()) + static_cast<Eigen::Index>(j * (j - 1) / 2 + i);
  }

  /// Residuals and derivatives at the given parameters.
  void evaluate(const DotPatch& patch, const Parameters& p);

  std::span<const BallProfile> profiles;
  PixelRows rows;  ///< the model's derivatives, then the residuals
  Eigen::Index parameters() const { return rows.rows() - 1; }
  const float* residual() const { return rows.row(parameters()).data(); }

 private:
  Floats open_, scratch_;
};

/// Normal equations of weighted pixels.
struct DotSums {
  DotModel::Normal normal;
  DotModel::Vector right;
  double squares = 0;  ///< weighted sum of squared residuals
};

DotSums accumulate(const DotModel& model, const DotPatch& patch);

}  // namespace helicarm::detection
