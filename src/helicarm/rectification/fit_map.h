// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "helicarm/rectification/distortion_map.h"

namespace helicarm::rectification {

/// A plate dot: position on the plate and in the raw image.
struct Correspondence {
  Eigen::Vector2d place_mm;
  Eigen::Vector2d raw_px;
  double sigma_px = 0.05;
};

struct MapOptions {
  std::optional<int> order;  ///< of the polynomial, 1..7; otherwise chosen by held-out error
  std::string model;         ///< of `model_kinds`; "": polynomial if `order` is given, else automatic_fit
  bool reject_outliers = true;
};

struct MapFit {
  DistortionMap map;
  std::vector<bool> used;           ///< per correspondence
  std::vector<double> residual_px;  ///< per correspondence, distance in raw pixels
  double px_per_mm = 0;             ///< rectified pixels per plate millimetre
  Eigen::Affine2d rectified_from_plate = Eigen::Affine2d::Identity();  ///< a similarity
};

/// Fits the map of Eq. 1 by (penalised) least squares. Model and order minimise the held-out error of
/// each dot predicted from the others (closed-form leave-one-out). plate_not_found below 6 correspondences or
/// if they do not determine the model; bad_value for an unknown model.
Expected<MapFit> fit_map(const std::vector<Correspondence>& dots, int width, int height,
                         const MapOptions& options);

}  // namespace helicarm::rectification
