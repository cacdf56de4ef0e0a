// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/covariance.h"

#include <algorithm>
#include <cmath>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/small_matrix.h"

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

/// The response of the unknowns to motions that only one view shows.
class Response {
 public:
  Response(const Observation& observation, const Problem& problem)
      : observation_(observation), problem_(problem), information_(problem.prior) {
    for (std::size_t i = 0; i < observation.views.size(); ++i)
      if (takes_part(problem.views, i))
        information_ += reduced(observation.views[i], problem.map).information;
  }

  MatrixXd to(std::size_t view, const MatrixXd& motions) const {
    const Eigen::Index n = problem_.map.cols();
    MatrixXd both(affine_parameters, n + motions.cols());
    both << problem_.map, motions;
    const MatrixXd of_view = reduced(observation_.views[view], both).information;
    return geometry::solve_spd(information_, of_view.topRightCorner(n, motions.cols())).solution;
  }

 private:
  const Observation& observation_;
  const Problem& problem_;
  MatrixXd information_;
};

}  // namespace

MatrixXd Linearised::covariance() const {
  const MatrixXd half = geometry::solve_spd(information, meat).solution;
  return geometry::solve_spd(information, half.transpose()).solution;
}

Linearised linearised(const Observation& observation, const Problem& problem,
                      const std::vector<double>& correlation_px) {
  const MatrixXd& map = problem.map;
  const Eigen::Index n = map.cols();
  Linearised sum{problem.prior, VectorXd::Zero(n), MatrixXd::Zero(n, n), 0};
  for (std::size_t v = 0; v < observation.views.size(); ++v) {
    if (!takes_part(problem.views, v)) continue;
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

MatrixXd ErrorModel::of_cameras(const Observation& observation, const Vector3d& centre,
                                const Problem& problem) const {
  constexpr Eigen::Index each = calibration::view_parameters;
  const Response response(observation, problem);
  MatrixXd by_cameras = MatrixXd::Zero(problem.map.cols(), each * Eigen::Index(views.size()));
  for (std::size_t i = 0; i < views.size(); ++i)
    if (takes_part(problem.views, i))
      by_cameras.middleCols(each * Eigen::Index(i), each) =
          response.to(i, affine_from_camera(views[i].view, centre));
  return by_cameras * cameras * by_cameras.transpose();
}

MatrixXd ErrorModel::of_edges(const Observation& observation, const Vector3d& centre,
                              const Problem& problem) const {
  const Response response(observation, problem);
  MatrixXd sum = MatrixXd::Zero(problem.map.cols(), problem.map.cols());
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (!takes_part(problem.views, i)) continue;
    const geometry::View& view = views[i].view;
    const double sigma_px = edge.shift_mm * std::abs(view.intrinsics.fy) / view.depth(centre);
    const MatrixXd by_shift = sigma_px * response.to(i, image_shifts(view, centre));
    // All edges further out: the model is taken for nearer than it is.
    const MatrixXd by_size = edge.outward_mm / radius_mm * response.to(i, growth());
    sum += by_shift * by_shift.transpose() + by_size * by_size.transpose();
  }
  return sum;
}

VectorXd ErrorModel::by_size(const Observation& observation, const Problem& problem) const {
  const Response response(observation, problem);
  VectorXd sum = VectorXd::Zero(problem.map.cols());
  for (std::size_t i = 0; i < views.size(); ++i)
    if (takes_part(problem.views, i)) sum += response.to(i, growth());
  return sum;
}

MatrixXd ErrorModel::covariance(const Observation& observation, const Vector3d& centre,
                                const Problem& problem, const Linearised& sum) const {
  return sum.covariance() + of_cameras(observation, centre, problem) + of_edges(observation, centre, problem);
}

MatrixXd ErrorModel::covariance(const Observation& observation, const Vector3d& centre,
                                const Problem& problem) const {
  return covariance(observation, centre, problem, linearised(observation, problem, correlation_px));
}

double local_shift_px(const ViewObservation& view, const geometry::View& camera, const Vector3d& centre) {
  const auto shifts = image_shifts(camera, centre);
  double sum = 0, weights = 0;
  for (const Comparison& comparison : view.comparisons) {
    const Eigen::Matrix2d information =
        shifts.transpose() * comparison.information.topLeftCorner<12, 12>() * shifts;
    const Eigen::Vector2d gradient = shifts.transpose() * comparison.gradient.head<12>();
    const auto axes = geometry::symmetric_eigen(information);
    const double strength = axes.values[1];
    if (!(strength > 0)) continue;
    const double shift = axes.vectors.col(1).dot(gradient) / strength;
    sum += strength * shift * shift;
    weights += strength;
  }
  return weights > 0 ? std::sqrt(sum / weights) : 0;
}

}  // namespace helicarm::registration
