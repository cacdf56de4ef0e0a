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

namespace helicarm {

enum class RectifiedPlane { detector, plate };

/// The intensifier's distortion: rectified (x, y) -> raw (u, v) as in Eq. 1, by a polynomial of any order
/// and, where the data carry it, a smooth remainder (Matern kernels at knots: universal kriging). Points go
/// the other way by numerical inversion, so both directions agree. Rectified pixels have the raw scale and no
/// rotation at the image centre.
struct DistortionMap {
  std::string model = "identity";
  int order = 0;                                     ///< of the polynomial; 0: the identity (flat panel)
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< normalisation: t = (p - centre) / scale
  double scale = 1;
  Eigen::MatrixX2d coefficients;  ///< terms x 2, in the order of monomials of docs/method.md
  Eigen::MatrixX2d knots;         ///< m x 2, normalised
  double kernel_length = 0;       ///< normalised
  double kernel_sigma_px = 0;     ///< of the remainder itself, before any dot is seen, per axis
  Eigen::MatrixX2d weights;       ///< m x 2
  double residual_rms_px = 0;     ///< per point, over the dots used
  double residual_max_px = 0;
  double held_out_rms_px = 0;
  /// Per axis, px^2; empty: taken as exact. With b(p) the basis (terms, then kernels) the map's covariance
  /// between p and q is kernel_sigma_px^2 k(p, q) + b(p)' C b(q): C is what the dots took away, and away from
  /// them the remainder is as uncertain as before.
  Eigen::MatrixXd coefficient_covariance;
  Eigen::Vector2d hull_low = Eigen::Vector2d::Zero();  ///< rectified box that the dots cover
  Eigen::Vector2d hull_high = Eigen::Vector2d::Zero();
  std::optional<double> rectified_pixel_mm;
  std::optional<RectifiedPlane> rectified_plane;
  int width = 0;  ///< of the image it belongs to
  int height = 0;

  /// Whether a raw place lies on the image.
  bool shows(const Eigen::Vector2d& raw) const;
  bool is_identity() const { return order == 0; }
  Eigen::Vector2d raw_from_rectified(const Eigen::Vector2d& rectified) const;
  /// Newton on the map above; nothing where it does not converge (far outside the plate).
  std::optional<Eigen::Vector2d> rectified_from_raw(const Eigen::Vector2d& raw) const;
  /// d raw / d rectified.
  Eigen::Matrix2d jacobian(const Eigen::Vector2d& rectified) const;
  /// Standard deviation per axis of the map itself at a point, rectified pixels.
  double sigma_px(const Eigen::Vector2d& rectified) const;
  /// Covariance per axis of the map itself among points (n x n, px^2): near ones err together.
  Eigen::MatrixXd covariance_px2(std::span<const Eigen::Vector2d> rectified) const;
};

/// Places carried across the map, and nothing for those off the image or where the map folds: it is not
/// extrapolated, and what is given leads back.
std::optional<Eigen::Vector2d> rectified_in_image(const DistortionMap& map, const Eigen::Vector2d& raw);
std::optional<Eigen::Vector2d> raw_in_image(const DistortionMap& map, const Eigen::Vector2d& rectified);

DistortionMap identity_map(int width, int height, std::optional<double> pixel_mm);

Json to_json(const DistortionMap& map);
Expected<DistortionMap> distortion_map_from_json(const Json& json, const std::string& origin);

}  // namespace helicarm
