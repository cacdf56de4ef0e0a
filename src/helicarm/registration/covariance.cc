// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/covariance.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::registration {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

bool takes_part(const std::vector<bool>& views, std::size_t i) { return views.empty() || views[i]; }

/// A view's comparisons over the parameters of `map`, the edge offset eliminated.
struct Reduced {
  MatrixXd information;
  std::vector<VectorXd> gradients;
};

Reduced reduced(const ViewObservation& view, const MatrixXd& map) {
  Information sum = Information::Zero();
  for (const Comparison& comparison : view.comparisons) sum += comparison.information;
  const double offset = sum(edge_offset, edge_offset) + 1 / std::pow(edge_offset_sigma_px, 2);
  const Gradient cross = sum.col(edge_offset);
  sum -= cross * cross.transpose() / offset;
  Reduced out{map.transpose() * sum.topLeftCorner<affine_parameters, affine_parameters>() * map, {}};
  for (const Comparison& comparison : view.comparisons) {
    const Gradient gradient = comparison.gradient - cross * (comparison.gradient[edge_offset] / offset);
    out.gradients.push_back(map.transpose() * gradient.head<affine_parameters>());
  }
  return out;
}

/// Columns: motions of the model that shift its image by one pixel along u and along v.
using ImageShifts = Eigen::Matrix<double, affine_parameters, 2>;
ImageShifts image_shifts(const geometry::View& camera, const Vector3d& centre) {
  ImageShifts map = ImageShifts::Zero();
  const double depth = camera.depth(centre);
  const Eigen::Matrix3d& rotation = camera.camera_from_world.rotation;
  map.topRows<3>().col(0) = rotation.row(0).transpose() * depth / camera.intrinsics.fx;
  map.topRows<3>().col(1) = rotation.row(1).transpose() * depth / camera.intrinsics.fy;
  return map;
}

/// The model grown about its centre, by its own size.
Eigen::Matrix<double, affine_parameters, 1> growth() {
  return affine_from_strain(Eigen::Matrix3d::Identity()).leftCols<3>().rowwise().sum();
}

/// The response of the pose to motions that only one view shows.
MatrixXd response(const Observation& observation, std::size_t view, const MatrixXd& motions,
                  const Part& part) {
  const auto map = affine_from_rigid();
  RigidCovariance information = part.prior;
  for (std::size_t i = 0; i < observation.views.size(); ++i)
    if (takes_part(part.views, i)) information += reduced(observation.views[i], map).information;
  MatrixXd both(affine_parameters, 6 + motions.cols());
  both << map, motions;
  const MatrixXd of_view = reduced(observation.views[view], both).information;
  return geometry::solve_spd(information, of_view.topRightCorner(6, motions.cols())).solution;
}

}  // namespace

MatrixXd Linearised::covariance() const {
  const MatrixXd half = geometry::solve_spd(information, meat).solution;
  return geometry::solve_spd(information, half.transpose()).solution;
}

Linearised linearised(const Observation& observation, const std::vector<bool>& views, const MatrixXd& map,
                      const MatrixXd& prior, const std::vector<double>& correlation_px) {
  const Eigen::Index n = map.cols();
  Linearised sum{prior, VectorXd::Zero(n), MatrixXd::Zero(n, n), 0};
  for (std::size_t v = 0; v < observation.views.size(); ++v) {
    if (!takes_part(views, v)) continue;
    const ViewObservation& view = observation.views[v];
    const Reduced parts = reduced(view, map);
    sum.information += parts.information;
    double weight = 0, joint = 0;
    for (std::size_t i = 0; i < parts.gradients.size(); ++i) {
      sum.gradient += parts.gradients[i];
      const Comparison& at = view.comparisons[i];
      weight += at.weight;
      VectorXd around = VectorXd::Zero(n);
      for (std::size_t j = 0; j < parts.gradients.size(); ++j) {
        const Eigen::Vector2d apart = (view.comparisons[j].pixel - at.pixel).cwiseAbs() / correlation_px[v];
        if (apart.maxCoeff() >= 1) continue;
        const double kernel = (1 - apart.x()) * (1 - apart.y());
        around += kernel * parts.gradients[j];
        joint += kernel * at.weight * view.comparisons[j].weight;
      }
      sum.meat += parts.gradients[i] * around.transpose();
    }
    if (joint > 0) sum.clusters += weight * weight / joint;
  }
  sum.meat = 0.5 * (sum.meat + sum.meat.transpose()).eval();
  // As for a variance from residuals: the fit has taken up n degrees of freedom.
  sum.meat *= sum.clusters / std::max(sum.clusters - double(n), 0.25 * sum.clusters);
  return sum;
}

RigidCovariance camera_part(const Observation& observation, const std::vector<RegistrationView>& views,
                            const Vector3d& centre, const MatrixXd& camera_covariance, const Part& part) {
  constexpr Eigen::Index each = calibration::view_parameters;
  MatrixXd by_cameras = MatrixXd::Zero(6, each * Eigen::Index(views.size()));
  for (std::size_t i = 0; i < views.size(); ++i)
    if (takes_part(part.views, i))
      by_cameras.middleCols(each * Eigen::Index(i), each) =
          response(observation, i, affine_from_camera(views[i].view, centre), part);
  return by_cameras * camera_covariance * by_cameras.transpose();
}

RigidCovariance edge_part(const Observation& observation, const std::vector<RegistrationView>& views,
                          const Vector3d& centre, double radius_mm, const EdgeSigma& sigma,
                          const Part& part) {
  RigidCovariance sum = RigidCovariance::Zero();
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (!takes_part(part.views, i)) continue;
    const geometry::View& view = views[i].view;
    const double sigma_px = sigma.shift_mm * std::abs(view.intrinsics.fy) / view.depth(centre);
    const MatrixXd by_shift = response(observation, i, image_shifts(view, centre), part);
    sum += sigma_px * sigma_px * by_shift * by_shift.transpose();
    // All edges further out: the model is taken for nearer than it is.
    const MatrixXd by_size = response(observation, i, growth(), part) / radius_mm;
    sum += sigma.outward_mm * sigma.outward_mm * by_size * by_size.transpose();
  }
  return sum;
}

double local_shift_px(const ViewObservation& view, const geometry::View& camera, const Vector3d& centre) {
  const auto shifts = image_shifts(camera, centre);
  double sum = 0, weights = 0;
  for (const Comparison& comparison : view.comparisons) {
    const Eigen::Matrix2d information =
        shifts.transpose() * comparison.information.topLeftCorner<12, 12>() * shifts;
    const Eigen::Vector2d gradient = shifts.transpose() * comparison.gradient.head<12>();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(information);
    const double strength = axes.eigenvalues()[1];
    if (!(strength > 0)) continue;
    const double shift = axes.eigenvectors().col(1).dot(gradient) / strength;
    sum += strength * shift * shift;
    weights += strength;
  }
  return weights > 0 ? std::sqrt(sum / weights) : 0;
}

}  // namespace helicarm::registration
