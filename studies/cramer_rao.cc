// SPDX-License-Identifier: Apache-2.0
#include "studies/cramer_rao.h"

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::study {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// fx, fy, u0, v0, skew, rotation vector, translation.
constexpr int numbers = 11;
using Numbers = Eigen::Vector<double, numbers>;
const Numbers steps =
    (Numbers() << 10, 10, 1, 1, 10, Vector3d::Constant(1e-3), Vector3d::Constant(1)).finished();

geometry::View changed(geometry::View view, int number, double step) {
  const Numbers change = step * Numbers::Unit(number);
  view.intrinsics.fx += change(0);
  view.intrinsics.fy += change(1);
  view.intrinsics.u0 += change(2);
  view.intrinsics.v0 += change(3);
  view.intrinsics.skew += change(4);
  view.camera_from_world.rotation =
      geometry::rotation_from_vector(change.segment<3>(5)) * view.camera_from_world.rotation;
  view.camera_from_world.translation += change.tail<3>();
  return view;
}

/// Derivative of a function of one variable at 0, fourth order in the step.
template <class Function>
Vector2d slope(const Function& at, double step) {
  return (8 * (at(step) - at(-step)) - (at(2 * step) - at(-2 * step))) / (12 * step);
}

Eigen::Matrix<double, 2, numbers> by_numbers(const geometry::View& view, const Vector3d& point) {
  Eigen::Matrix<double, 2, numbers> jacobian;
  for (int k = 0; k < numbers; ++k)
    jacobian.col(k) = slope([&](double step) { return changed(view, k, step).project(point); }, steps(k));
  return jacobian;
}

Eigen::Matrix<double, 2, 3> by_point(const geometry::View& view, const Vector3d& point) {
  Eigen::Matrix<double, 2, 3> jacobian;
  for (int k = 0; k < 3; ++k)
    jacobian.col(k) = slope([&](double step) { return view.project(point + step * Vector3d::Unit(k)); }, 1);
  return jacobian;
}

/// Adds the prior of one linear combination of each view's parameters; `covariance` is over all views.
void accept(Eigen::MatrixXd& information, const std::vector<Numbers>& combination,
            const Eigen::MatrixXd& covariance) {
  if (covariance.size() == 0) return;
  const Eigen::MatrixXd inverse = geometry::inverse(covariance);
  for (Eigen::Index i = 0; i < inverse.rows(); ++i)
    for (Eigen::Index j = 0; j < inverse.cols(); ++j)
      information.block<numbers, numbers>(numbers * i, numbers * j) +=
          inverse(i, j) * combination[std::size_t(i)] * combination[std::size_t(j)].transpose();
}

}  // namespace

Eigen::Matrix3d least_covariance(std::span<const geometry::View> views, std::span<const Vector3d> balls,
                                 const Vector3d& point, double ball_sigma_px, double point_sigma_px,
                                 const PriorInformation& prior) {
  const auto n = Eigen::Index(views.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(numbers * n + 3, numbers * n + 3);
  std::vector<Numbers> focal, u0, v0, aspect, skew;
  for (Eigen::Index i = 0; i < n; ++i) {
    const geometry::View& view = views[std::size_t(i)];
    const geometry::Intrinsics& k = view.intrinsics;
    Eigen::Matrix<double, numbers, numbers> own = Eigen::Matrix<double, numbers, numbers>::Zero();
    for (const Vector3d& ball : balls) {
      const auto jacobian = by_numbers(view, ball);
      own += jacobian.transpose() * jacobian / (ball_sigma_px * ball_sigma_px);
    }
    Eigen::Matrix<double, 2, numbers + 3> seen;
    seen << by_numbers(view, point), by_point(view, point);
    seen /= point_sigma_px;
    const Eigen::Matrix<double, numbers + 3, numbers + 3> of_point = seen.transpose() * seen;
    information.block<numbers, numbers>(numbers * i, numbers * i) +=
        own + of_point.topLeftCorner<numbers, numbers>();
    information.block<numbers, 3>(numbers * i, numbers * n) += of_point.topRightCorner<numbers, 3>();
    information.block<3, numbers>(numbers * n, numbers * i) += of_point.bottomLeftCorner<3, numbers>();
    information.bottomRightCorner<3, 3>() += of_point.bottomRightCorner<3, 3>();
    focal.push_back(0.5 * (Numbers::Unit(0) + Numbers::Unit(1)));
    u0.push_back(Numbers::Unit(2));
    v0.push_back(Numbers::Unit(3));
    aspect.push_back((Numbers::Unit(0) - k.fx / k.fy * Numbers::Unit(1)) / k.fy);
    skew.push_back((Numbers::Unit(4) - k.skew / k.fy * Numbers::Unit(1)) / k.fy);
  }
  const auto each = [&](double sigma) {
    return sigma > 0 ? Eigen::MatrixXd(sigma * sigma * Eigen::MatrixXd::Identity(n, n)) : Eigen::MatrixXd();
  };
  accept(information, focal, prior.focal_covariance);
  accept(information, u0, prior.principal_covariance);
  accept(information, v0, prior.principal_covariance);
  accept(information, aspect, each(prior.aspect_sigma));
  accept(information, skew, each(prior.skew_sigma));
  const Eigen::VectorXd root = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd inverse = geometry::inverse(root.asDiagonal() * information * root.asDiagonal());
  return (root.asDiagonal() * inverse * root.asDiagonal()).bottomRightCorner<3, 3>();
}

}  // namespace helicarm::study
