// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"

namespace helicarm::rectification {

enum class RectifiedPlane { detector, plate };

/// The intensifier's distortion: rectified (x, y) -> raw (u, v) as in Eq. 1, by a polynomial of any order
/// and, where the data support it, a smooth remainder (Matern kernels at knots: universal kriging). The
/// inverse is numerical, so both directions agree. Rectified pixels have the raw scale and no rotation at the
/// image centre.
struct DistortionMap {
  std::string model = "identity";
  int order = 0;                                     ///< of the polynomial; 0: the identity (flat panel)
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< normalisation: t = (p - centre) / scale
  double scale = 1;
  Eigen::MatrixX2d coefficients;  ///< terms x 2, in the order of monomials of docs/method.md
  Eigen::MatrixX2d knots;         ///< m x 2, normalised
  double kernel_length = 0;       ///< normalised
  double kernel_sigma_px = 0;     ///< prior standard deviation of the remainder per axis
  Eigen::MatrixX2d weights;       ///< m x 2
  double residual_rms_px = 0;     ///< per point, over the dots used
  double residual_max_px = 0;
  double held_out_rms_px = 0;
  /// Per axis, px^2; empty: taken as exact. With b(p) the basis (terms, then kernels) the map's covariance
  /// between p and q is kernel_sigma_px^2 k(p, q) + b(p)' C b(q): C is the reduction by the dots, so far from
  /// them the prior uncertainty of the remainder applies.
  Eigen::MatrixXd coefficient_covariance;
  Eigen::Vector2d hull_low = Eigen::Vector2d::Zero();  ///< rectified box that contains the dots
  Eigen::Vector2d hull_high = Eigen::Vector2d::Zero();
  std::optional<double> rectified_pixel_mm;
  std::optional<RectifiedPlane> rectified_plane;
  int width = 0;  ///< of its image
  int height = 0;

  /// Whether a raw position lies in the image.
  bool shows(const Eigen::Vector2d& raw) const;
  bool is_identity() const { return order == 0; }
  Eigen::Vector2d raw_from_rectified(const Eigen::Vector2d& rectified) const;
  /// Newton's method on the map above; nothing if it does not converge (far outside the plate).
  std::optional<Eigen::Vector2d> rectified_from_raw(const Eigen::Vector2d& raw) const;
  /// d raw / d rectified.
  Eigen::Matrix2d jacobian(const Eigen::Vector2d& rectified) const;
  /// Standard deviation per axis of the map at a point, rectified pixels.
  double sigma_px(const Eigen::Vector2d& rectified) const;
  /// Covariance per axis of the map among points (n x n, px^2): errors of near points are correlated.
  Eigen::MatrixXd covariance_px2(std::span<const Eigen::Vector2d> rectified) const;
};

/// Mapped positions; nothing outside the image or where the map folds. No extrapolation, and a result always
/// maps back.
std::optional<Eigen::Vector2d> rectified_in_image(const DistortionMap& map, const Eigen::Vector2d& raw);
std::optional<Eigen::Vector2d> raw_in_image(const DistortionMap& map, const Eigen::Vector2d& rectified);

DistortionMap identity_map(int width, int height, std::optional<double> pixel_mm);

Json to_json(const DistortionMap& map);
Expected<DistortionMap> distortion_map_from_json(const Json& json, const std::string& origin);

}  // namespace helicarm::rectification
