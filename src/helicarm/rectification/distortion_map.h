// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/rectification/distortion_model.h"

namespace helicarm::rectification {

enum class RectifiedPlane { detector, plate };

/// The intensifier's distortion: rectified (x, y) -> raw (u, v) as in Eq. 1, by any DistortionModel.
/// Rectified pixels have the raw scale and no rotation at the image centre.
struct DistortionMap {
  ModelPointer model = identity_model();
  double residual_rms_px = 0;  ///< per point, over the dots used
  double residual_max_px = 0;
  double held_out_rms_px = 0;
  Eigen::Vector2d hull_low = Eigen::Vector2d::Zero();  ///< rectified box that contains the dots
  Eigen::Vector2d hull_high = Eigen::Vector2d::Zero();
  std::optional<double> rectified_pixel_mm;
  std::optional<RectifiedPlane> rectified_plane;
  int width = 0;  ///< of its image
  int height = 0;

  /// Whether a raw position lies in the image.
  bool shows(const Eigen::Vector2d& raw) const;
  bool is_identity() const { return model->is_identity(); }
  Eigen::Vector2d raw_from_rectified(const Eigen::Vector2d& rectified) const {
    return model->raw_from_rectified(rectified);
  }
  /// The inverse of raw_from_rectified; nothing far outside the plate.
  std::optional<Eigen::Vector2d> rectified_from_raw(const Eigen::Vector2d& raw) const {
    return model->rectified_from_raw(raw);
  }
  /// d raw / d rectified.
  Eigen::Matrix2d jacobian(const Eigen::Vector2d& rectified) const { return model->jacobian(rectified); }
  /// Standard deviation per axis of the map at a point, rectified pixels.
  double sigma_px(const Eigen::Vector2d& rectified) const;
  /// Covariance per axis of the map among points (n x n, px^2): errors of near points are correlated.
  Eigen::MatrixXd covariance_px2(std::span<const Eigen::Vector2d> rectified) const {
    return model->covariance_px2(rectified);
  }
};

/// Mapped positions; nothing outside the image or where the map folds. No extrapolation, and a result always
/// maps back.
std::optional<Eigen::Vector2d> rectified_in_image(const DistortionMap& map, const Eigen::Vector2d& raw);
std::optional<Eigen::Vector2d> raw_in_image(const DistortionMap& map, const Eigen::Vector2d& rectified);

DistortionMap identity_map(int width, int height, std::optional<double> pixel_mm);

Json to_json(const DistortionMap& map);
Expected<DistortionMap> distortion_map_from_json(const Json& json, const std::string& origin);

}  // namespace helicarm::rectification
