// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/landmarks.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/small_matrix.h"

namespace helicarm::registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double least_spread_mm = 2;  // rms distance from the line that fits the landmarks best

}  // namespace

Expected<LandmarkRegistration> register_landmarks(const std::vector<Landmark>& landmarks,
                                                  const Eigen::MatrixXd& camera_covariance) {
  const double n = double(landmarks.size());
  if (landmarks.size() < least_landmarks)
    return fail(Reason::bad_value,
                fmt::format("{} landmarks, at least {} are required", landmarks.size(), least_landmarks));
  Vector3d model_mean = Vector3d::Zero(), world_mean = Vector3d::Zero();
  for (const Landmark& landmark : landmarks) {
    model_mean += landmark.in_model / n;
    world_mean += landmark.in_world / n;
  }
  Matrix3d across = Matrix3d::Zero(), spread = Matrix3d::Zero();
  double world_spread = 0;
  for (const Landmark& landmark : landmarks) {
    across += (landmark.in_world - world_mean) * (landmark.in_model - model_mean).transpose();
    spread += (landmark.in_model - model_mean) * (landmark.in_model - model_mean).transpose() / n;
    world_spread += (landmark.in_world - world_mean).squaredNorm() / n;
  }
  const double aside = std::sqrt(std::max(0.0, geometry::symmetric_eigen(spread).values[1]));
  if (aside < least_spread_mm) {
    const double ratio = std::sqrt(world_spread / spread.trace());
    return fail(
        Reason::bad_value,
        fmt::format("the landmarks lie within {:.2g} mm (rms) of a line, at least {:g} mm are required{}",
                    aside, least_spread_mm,
                    ratio > 5 ? fmt::format("; their picks are {:.0f} times as far apart: is the file in {}? "
                                            "It must be in mm",
                                            ratio, ratio > 100 ? "m" : "cm")
                              : ""),
        {{"spread_mm", aside}, {"limit_mm", least_spread_mm}});
  }
  LandmarkRegistration result;
  result.world_from_model.rotation = geometry::nearest_rotation(across);
  result.world_from_model.translation = world_mean - result.world_from_model.rotation * model_mean;
  result.centre = world_mean;
  double stated = 0;
  RigidCovariance information = RigidCovariance::Zero(), by_picks = RigidCovariance::Zero();
  Eigen::MatrixXd by_cameras = Eigen::MatrixXd::Zero(6, camera_covariance.cols());
  for (const Landmark& landmark : landmarks) {
    const Vector3d at = result.world_from_model * landmark.in_model;
    result.places.push_back(at);
    result.residuals_mm.push_back((landmark.in_world - at).norm());
    result.fre_mm += std::pow(result.residuals_mm.back(), 2) / n;
    stated += landmark.covariance_in_world.trace() / n;
    Eigen::Matrix<double, 3, 6> by_step;
    by_step << -geometry::cross_matrix(at - world_mean), Matrix3d::Identity();
    information += by_step.transpose() * by_step;
    by_picks += by_step.transpose() * landmark.covariance_in_world * by_step;
    if (landmark.by_cameras.size() > 0) by_cameras += by_step.transpose() * landmark.by_cameras;
  }
  result.fre_mm = std::sqrt(result.fre_mm);
  // <FRE^2> = (1 - 2/n) <FLE^2>.
  result.fle_mm = std::sqrt(std::max(stated, result.fre_mm * result.fre_mm / (1 - 2 / n)));
  // What the picks do not account for is known by few residuals.
  const double few = std::pow(student_975(3 * n - 6) / normal_at_975, 2);
  const double placing = few * (result.fle_mm * result.fle_mm - stated) / 3;
  const RigidCovariance inverse = geometry::inverse(information);
  const Eigen::MatrixXd gain = inverse * by_cameras;
  result.covariance =
      inverse * (by_picks + placing * information) * inverse + gain * camera_covariance * gain.transpose();
  return result;
}

double predicted_tre_mm(const LandmarkRegistration& registration, const Vector3d& point_in_world) {
  return std::sqrt(point_covariance(registration.covariance, registration.centre, point_in_world).trace());
}

}  // namespace helicarm::registration
