// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/pose_fit.h"

#include <cmath>
#include <limits>

#include <Eigen/Geometry>

namespace helicarm {
namespace {

using Vector9 = Eigen::Matrix<double, 9, 1>;
using Matrix9 = Eigen::Matrix<double, 9, 9>;

Eigen::Vector3d camera_departure(const Intrinsics& k, const CameraPrior& prior) {
  return {std::log(k.fy / prior.focal_px) / prior.focal_sigma,
          (k.u0 - prior.principal_px.x()) / prior.principal_sigma_px,
          (k.v0 - prior.principal_px.y()) / prior.principal_sigma_px};
}

double chi2_of(const View& view, const std::vector<Sighting>& sightings, const CameraPrior& prior) {
  double sum = camera_departure(view.intrinsics, prior).squaredNorm();
  for (const auto& s : sightings) {
    if (view.depth(s.point) <= 0) return std::numeric_limits<double>::infinity();
    sum += (view.project(s.point) - s.uv).squaredNorm() / (s.sigma_px * s.sigma_px);
  }
  return sum;
}

struct Normal {
  Matrix9 information = Matrix9::Zero();
  Vector9 gradient = Vector9::Zero();
};

/// Of a point's image. Unknowns: rotation (applied from the left), translation, ln f, u0, v0.
Eigen::Matrix<double, 2, 9> jacobian(const View& view, const Eigen::Vector3d& point) {
  const Intrinsics& k = view.intrinsics;
  const Eigen::Vector3d turned = view.camera_from_world.rotation * point;
  const Eigen::Vector3d p = turned + view.camera_from_world.translation;
  const double x = p.x() / p.z();
  const double y = p.y() / p.z();
  Eigen::Matrix<double, 2, 3> by_point;
  by_point << k.fx, 0, -k.fx * x, 0, k.fy, -k.fy * y;
  by_point /= p.z();
  Eigen::Matrix<double, 2, 9> j;
  j.col(0) = by_point.col(2) * turned.y() - by_point.col(1) * turned.z();
  j.col(1) = by_point.col(0) * turned.z() - by_point.col(2) * turned.x();
  j.col(2) = by_point.col(1) * turned.x() - by_point.col(0) * turned.y();
  j.middleCols<3>(3) = by_point;
  j.rightCols<3>() << k.fx * x, 1, 0, k.fy * y, 0, 1;
  return j;
}

Normal normal_equations(const View& view, const std::vector<Sighting>& sightings, const CameraPrior& prior) {
  Normal normal;
  const Intrinsics& k = view.intrinsics;
  for (const auto& s : sightings) {
    const Eigen::Matrix<double, 2, 9> j = jacobian(view, s.point) / s.sigma_px;
    const Eigen::Vector2d residual = (view.project(s.point) - s.uv) / s.sigma_px;
    normal.information += j.transpose().lazyProduct(j);
    normal.gradient += j.transpose().lazyProduct(residual);
  }
  const Eigen::Vector3d sigma(prior.focal_sigma, prior.principal_sigma_px, prior.principal_sigma_px);
  normal.information.diagonal().tail<3>().array() += sigma.array().inverse().square();
  normal.gradient.tail<3>().array() += camera_departure(k, prior).array() / sigma.array();
  return normal;
}

View moved(const View& view, const Vector9& step) {
  View next = view;
  const double angle = step.head<3>().norm();
  if (angle > 0) {
    next.camera_from_world.rotation =
        Eigen::AngleAxisd(angle, step.head<3>() / angle).toRotationMatrix() * view.camera_from_world.rotation;
  }
  next.camera_from_world.translation += step.segment<3>(3);
  next.intrinsics.fx *= std::exp(step[6]);
  next.intrinsics.fy *= std::exp(step[6]);
  next.intrinsics.u0 += step[7];
  next.intrinsics.v0 += step[8];
  return next;
}

}  // namespace

PoseFit fit_pose(const View& start, const std::vector<Sighting>& sightings, const CameraPrior& prior,
                 int most_steps) {
  PoseFit fit{start, chi2_of(start, sightings, prior)};
  Normal normal = normal_equations(fit.view, sightings, prior);
  double damping = 1e-6;
  for (int step = 0; step < most_steps && damping < 1e3; ++step) {
    Matrix9 damped = normal.information;
    damped.diagonal() *= 1 + damping;
    const View next = moved(fit.view, -damped.llt().solve(normal.gradient));
    const double chi2 = chi2_of(next, sightings, prior);
    if (!(chi2 <= fit.chi2)) {
      damping = damping * 30 + 1e-3;
      continue;
    }
    const double gain = fit.chi2 - chi2;
    fit.view = next;
    fit.chi2 = chi2;
    damping *= 0.1;
    normal = normal_equations(fit.view, sightings, prior);
    if (gain < 1e-3) break;
  }
  fit.information.compute(normal.information);
  fit.log_volume = -fit.information.matrixLLT().diagonal().array().log().sum();
  return fit;
}

Eigen::Matrix2d prediction_covariance(const PoseFit& fit, const Eigen::Vector3d& point) {
  const Eigen::Matrix<double, 9, 2> j =
      fit.information.matrixL().solve(jacobian(fit.view, point).transpose());
  return j.transpose() * j;
}

}  // namespace helicarm
