// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/propagated_point.h"

#include <numbers>

namespace helicarm::guidance {
namespace {

using Effect = Eigen::Matrix<double, 3, 6>;

/// tau + omega x p
Effect effect_of_motion(const Eigen::Vector3d& p) {
  Effect effect;
  effect << 1, 0, 0, 0, p.z(), -p.y(),  //
      0, 1, 0, -p.z(), 0, p.x(),        //
      0, 0, 1, p.y(), -p.x(), 0;
  return effect;
}

Effect& effect_at(PropagatedPoint& point, Reading reading) {
  return point.by_reading.try_emplace(reading, Effect::Zero()).first->second;
}

PropagatedPoint turned(PropagatedPoint point, const Eigen::Matrix3d& rotation) {
  point.covariance = rotation * point.covariance * rotation.transpose();
  for (auto& [reading, effect] : point.by_reading) effect = rotation * effect;
  point.by_calibration = rotation * point.by_calibration;
  return point;
}

/// Variances of (tau, omega).
Eigen::Vector<double, 6> variances_of(const TrackerNoise& noise) {
  const double sigma_rad = noise.sigma_deg * std::numbers::pi / 180;
  Eigen::Vector<double, 6> variances;
  variances << Eigen::Vector3d::Constant(noise.sigma_mm * noise.sigma_mm),
      Eigen::Vector3d::Constant(sigma_rad * sigma_rad);
  return variances;
}

}  // namespace

Eigen::Matrix3d PropagatedPoint::total_covariance(const TrackerNoise& noise) const {
  Eigen::Matrix3d total = covariance;
  for (const auto& [reading, effect] : by_reading)
    total += effect * variances_of(noise).asDiagonal() * effect.transpose();
  return total;
}

Eigen::Matrix3d covariance_between(const PropagatedPoint& from, const PropagatedPoint& to,
                                   const Eigen::MatrixXd& calibration_covariance, const TrackerNoise& noise) {
  Eigen::Matrix3d covariance = from.covariance + to.covariance;
  const Eigen::Index shared = calibration_covariance.cols();
  if (shared > 0 && from.by_calibration.cols() == shared && to.by_calibration.cols() == shared) {
    const Eigen::Matrix3d both = from.by_calibration * calibration_covariance * to.by_calibration.transpose();
    covariance -= both + both.transpose();
  }
  auto readings = from.by_reading;
  for (auto& [reading, effect] : readings) effect *= -1;
  for (const auto& [reading, effect] : to.by_reading) {
    const auto [at, is_new] = readings.try_emplace(reading, effect);
    if (!is_new) at->second += effect;
  }
  for (const auto& [reading, effect] : readings)
    covariance += effect * variances_of(noise).asDiagonal() * effect.transpose();
  return covariance;
}

PropagatedPoint point_between(const PropagatedPoint& from, const PropagatedPoint& to, double share,
                              const Eigen::MatrixXd& calibration_covariance) {
  const double rest = 1 - share;
  PropagatedPoint between{rest * from.point + share * to.point,
                          rest * rest * from.covariance + share * share * to.covariance,
                          {}};
  if (const Eigen::Index shared = calibration_covariance.cols();
      shared > 0 && from.by_calibration.cols() == shared && to.by_calibration.cols() == shared) {
    const Eigen::Matrix3d both = from.by_calibration * calibration_covariance * to.by_calibration.transpose();
    between.covariance += rest * share * (both + both.transpose());
    between.by_calibration = rest * from.by_calibration + share * to.by_calibration;
  }
  for (const auto& [reading, effect] : from.by_reading) effect_at(between, reading) += rest * effect;
  for (const auto& [reading, effect] : to.by_reading) effect_at(between, reading) += share * effect;
  return between;
}

PropagatedPoint enter_tracker(PropagatedPoint point, const geometry::RigidTransform& tracker_from_marker,
                              Reading reading) {
  effect_at(point, reading) += effect_of_motion(point.point);
  point.point = tracker_from_marker * point.point;
  return turned(std::move(point), tracker_from_marker.rotation);
}

PropagatedPoint leave_tracker(PropagatedPoint point, const geometry::RigidTransform& tracker_from_marker,
                              Reading reading) {
  point.point = tracker_from_marker.inverse() * point.point;
  point = turned(std::move(point), tracker_from_marker.rotation.transpose());
  effect_at(point, reading) -= effect_of_motion(point.point);
  return point;
}

}  // namespace helicarm::guidance
