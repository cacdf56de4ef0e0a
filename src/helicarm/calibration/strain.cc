// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/strain.h"

#include <array>
#include <cmath>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::calibration {
namespace {

constexpr double prior_sigma = 0.05;  // of the strain of a manufactured calibrator

/// Orthonormal basis of the symmetric traceless matrices.
std::array<Eigen::Matrix3d, 5> strain_modes() {
  const double a = std::sqrt(0.5), b = std::sqrt(1.0 / 6);
  std::array<Eigen::Matrix3d, 5> modes;
  for (Eigen::Matrix3d& mode : modes) mode.setZero();
  modes[0].diagonal() << a, -a, 0;
  modes[1].diagonal() << -b, -b, 2 * b;
  modes[2](0, 1) = modes[2](1, 0) = a;
  modes[3](0, 2) = modes[3](2, 0) = a;
  modes[4](1, 2) = modes[4](2, 1) = a;
  return modes;
}

Eigen::Vector3d centre_of(const std::vector<ViewProblem>& problems) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0;
  for (const ViewProblem& problem : problems)
    for (const Observation& observation : problem.observations) {
      sum += observation.point_in_world;
      ++count;
    }
  return sum / std::max(1.0, count);
}

}  // namespace

Strain strain_of(const std::vector<ViewProblem>& problems, const Refinement& fit) {
  const auto modes = strain_modes();
  const Eigen::Vector3d centre = centre_of(problems);
  std::vector<Eigen::MatrixXd> by_strain;  // of each view's observations
  for (std::size_t i = 0; i < problems.size(); ++i) {
    Eigen::MatrixXd& columns = by_strain.emplace_back(2 * problems[i].observations.size(), modes.size());
    Eigen::Index row = 0;
    for (const Observation& observation : problems[i].observations) {
      const ImageCoordinates image = image_of(fit.views[i], observation.point_in_world);
      for (std::size_t k = 0; k < modes.size(); ++k)
        columns.block<2, 1>(row, Eigen::Index(k)) =
            image.by_point * (modes[k] * (observation.point_in_world - centre)) / observation.sigma_px;
      row += 2;
    }
  }
  Eigen::Matrix<double, 5, 5> information = information_beyond(fit, by_strain);
  information.diagonal().array() += 1 / (prior_sigma * prior_sigma);
  const Eigen::Vector<double, 5> slope = slope_along(fit, by_strain);
  const Eigen::Vector<double, 5> amounts = -geometry::solve_spd(information, slope).solution;
  Strain result;
  for (std::size_t k = 0; k < modes.size(); ++k) result.strain += amounts[Eigen::Index(k)] * modes[k];
  result.chi2_gain = -slope.dot(amounts);
  constexpr double longest = 2.0 / 3;  // squared extension of a strain of unit norm along one axis
  result.sigma = std::sqrt(longest / geometry::symmetric_eigen(information).values[0]);
  const auto [values, vectors] = geometry::symmetric_eigen(result.strain);
  Eigen::Index largest = 0;
  values.cwiseAbs().maxCoeff(&largest);
  result.extension = values[largest];
  result.axis = vectors.col(largest);
  return result;
}

}  // namespace helicarm::calibration
