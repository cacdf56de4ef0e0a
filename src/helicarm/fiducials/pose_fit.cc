// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/pose_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

namespace helicarm::fiducials {
namespace {

using Vector9 = Eigen::Matrix<double, 9, 1>;

using Four = Eigen::Array4d;

/// Four correspondences for SIMD; the last group is padded with zero weights.
struct FourCorrespondences {
  Four x, y, z, u, v, weight;
};

std::vector<FourCorrespondences> in_fours(const std::vector<WeightedCorrespondence>& correspondences) {
  std::vector<FourCorrespondences> fours((correspondences.size() + 3) / 4);
  for (std::size_t i = 0; i < 4 * fours.size(); ++i) {
    const WeightedCorrespondence& s = correspondences[std::min(i, correspondences.size() - 1)];
    FourCorrespondences& four = fours[i / 4];
    const auto lane = static_cast<Eigen::Index>(i % 4);
    four.x[lane] = s.point.x();
    four.y[lane] = s.point.y();
    four.z[lane] = s.point.z();
    four.u[lane] = s.uv.x();
    four.v[lane] = s.uv.y();
    four.weight[lane] = i < correspondences.size() ? 1 / s.sigma_px : 0;
  }
  return fours;
}

/// d pixel / d (rotation applied from the left, translation, ln f, u0, v0).
Eigen::Matrix<double, 2, 9> jacobian(const geometry::View& view, const Eigen::Vector3d& point) {
  const geometry::Intrinsics& k = view.intrinsics;
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

/// A row of the Jacobian without its zero, followed by the residual.
using Row = std::array<Four, 8>;
using RowSums = std::array<Row, 8>;

void add(RowSums& sums, const Row& row) {
  for (std::size_t i = 0; i < row.size(); ++i)
    for (std::size_t j = 0; j <= i; ++j) sums[i][j] += row[i] * row[j];
}

/// Lower triangle of the normal equations; row 9 is the gradient, (9, 9) is chi2. Two rows pad the columns to
/// whole SIMD vectors.
using PoseNormal = Eigen::Matrix<double, 12, 10>;

PoseNormal normal_equations(const geometry::View& view, const std::vector<FourCorrespondences>& fours,
                            const CameraPrior& prior) {
  constexpr std::array<int, 8> of_u{0, 1, 2, 3, 5, 6, 7, 9};
  constexpr std::array<int, 8> of_v{0, 1, 2, 4, 5, 6, 8, 9};
  RowSums u_sums;
  for (Row& row : u_sums) row.fill(Four::Zero());
  RowSums v_sums = u_sums;
  const Eigen::Matrix3d& r = view.camera_from_world.rotation;
  const Eigen::Vector3d& t = view.camera_from_world.translation;
  const geometry::Intrinsics& k = view.intrinsics;
  bool before_source = true;
  for (const FourCorrespondences& s : fours) {
    const Four x = r(0, 0) * s.x + r(0, 1) * s.y + r(0, 2) * s.z;
    const Four y = r(1, 0) * s.x + r(1, 1) * s.y + r(1, 2) * s.z;
    const Four z = r(2, 0) * s.x + r(2, 1) * s.y + r(2, 2) * s.z;
    const Four depth = z + t.z();
    before_source &= (depth > 0).all();
    const Four px = (x + t.x()) / depth;
    const Four py = (y + t.y()) / depth;
    const Four fu = k.fx * s.weight / depth;
    const Four fv = k.fy * s.weight / depth;
    add(u_sums, {-fu * px * y, fu * (z + px * x), -fu * y, fu, -fu * px, k.fx * px * s.weight, s.weight,
                 (k.fx * px + k.u0 - s.u) * s.weight});
    add(v_sums, {-fv * (py * y + z), fv * py * x, fv * x, fv, -fv * py, k.fy * py * s.weight, s.weight,
                 (k.fy * py + k.v0 - s.v) * s.weight});
  }
  PoseNormal normal = PoseNormal::Zero();
  for (std::size_t i = 0; i < of_u.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      normal(of_u[i], of_u[j]) += u_sums[i][j].sum();
      normal(of_v[i], of_v[j]) += v_sums[i][j].sum();
    }
  }
  const std::array<double, 3> sigma{prior.focal_sigma, prior.principal_sigma_px, prior.principal_sigma_px};
  const std::array<double, 3> variation{std::log(k.fy / prior.focal_px), k.u0 - prior.principal_px.x(),
                                        k.v0 - prior.principal_px.y()};
  for (int i = 0; i < 3; ++i) {
    const double excess = variation[i] / sigma[i];
    normal(6 + i, 6 + i) += 1 / (sigma[i] * sigma[i]);
    normal(9, 6 + i) += excess / sigma[i];
    normal(9, 9) += excess * excess;
  }
  if (!before_source) normal(9, 9) = std::numeric_limits<double>::infinity();
  return normal;
}

/// Cholesky factorisation in place; including the gradient's row in it does the forward substitution.
Vector9 descent(PoseNormal a, double damping) {
  a.diagonal().head<9>() *= 1 + damping;
  for (int j = 0; j < 9; ++j) {
    a.col(j) /= std::sqrt(a(j, j));
    for (int k = j + 1; k < 9; ++k) a.col(k) -= a(k, j) * a.col(j);
  }
  Vector9 step;
  for (int j = 8; j >= 0; --j) {
    double rest = -a(9, j);
    for (int i = j + 1; i < 9; ++i) rest -= a(i, j) * step[i];
    step[j] = rest / a(j, j);
  }
  return step;
}

geometry::View moved(const geometry::View& view, const Vector9& step) {
  geometry::View next = view;
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

PoseFit fit_pose(const geometry::View& start, const std::vector<WeightedCorrespondence>& correspondences,
                 const CameraPrior& prior, int most_steps) {
  const auto fours = in_fours(correspondences);
  PoseFit fit{start};
  PoseNormal normal = normal_equations(fit.view, fours, prior);
  double damping = 1e-6;
  for (int step = 0; step < most_steps && damping < 1e3; ++step) {
    const geometry::View next = moved(fit.view, descent(normal, damping));
    const PoseNormal there = normal_equations(next, fours, prior);
    const double gain = normal(9, 9) - there(9, 9);
    if (!(there(9, 9) <= normal(9, 9))) {
      damping = damping * 30 + 1e-3;
      continue;
    }
    fit.view = next;
    normal = there;
    damping *= 0.1;
    if (gain < 1e-3) break;
  }
  fit.chi2 = normal(9, 9);
  fit.information.compute(normal.topLeftCorner<9, 9>());
  fit.log_volume = -fit.information.matrixLLT().diagonal().array().log().sum();
  return fit;
}

Eigen::Matrix2d prediction_covariance(const PoseFit& fit, const Eigen::Vector3d& point) {
  const Eigen::Matrix<double, 9, 2> j =
      fit.information.matrixL().solve(jacobian(fit.view, point).transpose());
  return j.transpose() * j;
}

}  // namespace helicarm::fiducials
