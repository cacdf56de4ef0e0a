// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "helicarm/phantom/calibrator.h"
#include "helicarm/sweep/estimate_frame.h"

/// Errors that all frames of a run share: an average over the frames does not reduce them.
namespace helicarm::sweep {

/// How each ball's position follows from independent unit errors of the phantom, its scale among them.
std::vector<Eigen::Matrix3Xd> phantom_errors(const phantom::Calibrator& calibrator);

/// The error of a plate's map between its dots is the same in all images: the pixels of frames as unit errors
/// of its modes over the field.
class SharedMap {
 public:
  /// `noise_factor`: of the map's standard deviations.
  SharedMap(const rectification::DistortionMap& map, double noise_factor);

  /// Whether the map has no errors.
  bool empty() const { return modes_.cols() == 0; }
  /// Pixels x modes, px.
  Eigen::MatrixXd errors_at(const std::vector<Eigen::Vector2d>& pixels) const;

 private:
  const rectification::DistortionMap& map_;
  double factor_;
  std::vector<Eigen::Vector2d> grid_;
  Eigen::MatrixXd modes_;
};

/// Of the map of the frame in the middle of those that have one, if it has errors; it refers to `estimates`.
std::optional<SharedMap> shared_map_of(const std::vector<FrameEstimate>& estimates, double noise_factor);

}  // namespace helicarm::sweep
