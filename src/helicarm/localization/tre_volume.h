// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/calibrated_view.h"

namespace helicarm::localization {

/// Predicted TRE (rms, mm) on a cubic lattice of points in the calibrator's frame; x is the fastest index.
/// NaN where no point can be located.
struct TreVolume {
  Eigen::Vector3d first;  ///< first point, mm
  double step_mm;
  int side;  ///< points along each edge
  std::vector<double> rms_mm;

  Eigen::Vector3d place(int i, int j, int k) const { return first + step_mm * Eigen::Vector3d(i, j, k); }
  double at(int i, int j, int k) const {
    return rms_mm[(std::size_t(k) * std::size_t(side) + std::size_t(j)) * std::size_t(side) + std::size_t(i)];
  }
};

/// Within `half_mm` of a centre, for points picked with the given noise in every view.
TreVolume predict_tre(const calibration::Calibration& calibration, const Eigen::Vector3d& centre,
                      double half_mm, double step_mm, double sigma_px, unsigned threads,
                      double motion_sigma_mm = 0);

/// x_mm,y_mm,z_mm,tre_mm: a line for each point; tre_mm is empty where no point can be located.
std::string to_csv(const TreVolume& volume);

/// Legacy VTK structured points, as text.
std::string to_vtk(const TreVolume& volume);

}  // namespace helicarm::localization
