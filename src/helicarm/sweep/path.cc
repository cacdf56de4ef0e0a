// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/path.h"

#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "helicarm/calibration/centred_view.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::sweep {
namespace {

constexpr double radian = std::numbers::pi / 180;

using Eigen::Vector3d;

/// From the source to the image's centre, in the camera's axes.
Vector3d towards_detector(const geometry::Intrinsics& k, const Detector& detector) {
  const Eigen::Vector2d off = detector.centre_px() - Eigen::Vector2d(k.u0, k.v0);
  return {off.x() * detector.pixel_mm / detector.aspect, off.y() * detector.pixel_mm,
          k.fy * detector.pixel_mm};
}

/// Largest angle by which the cameras' orientations differ from the middle one's, and the common axis.
std::pair<double, Vector3d> turn_of(const std::vector<PlacedCamera>& cameras) {
  const Eigen::Matrix3d& middle = cameras[cameras.size() / 2].rotation;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  double widest = 0;
  for (const PlacedCamera& camera : cameras) {
    const Vector3d turn = geometry::vector_from_rotation(camera.rotation.transpose() * middle);
    spread += turn * turn.transpose();
    widest = std::max(widest, turn.norm());
  }
  return {widest, geometry::symmetric_eigen(spread).vectors.col(2)};
}

Vector3d direction(const PlacedCamera& camera, const Vector3d& centre) {
  return (camera.source - centre).normalized();
}

/// Normal of the plane through the centre that is nearest the sources.
Vector3d normal_of_sources(const std::vector<PlacedCamera>& cameras, const Vector3d& centre) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const PlacedCamera& camera : cameras) {
    const Vector3d ray = direction(camera, centre);
    spread += ray * ray.transpose();
  }
  return geometry::symmetric_eigen(spread).vectors.col(0);
}

/// The mean of the cameras turned back to the angle 0.
PlacedCamera mean_camera(const std::vector<PlacedCamera>& cameras, const std::vector<double>& angles_deg,
                         const Orbit& orbit) {
  PlacedCamera mean{Vector3d::Zero(), Vector3d::Zero(), Eigen::Matrix3d::Zero()};
  const double share = 1 / double(cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Eigen::Matrix3d back =
        orbit.axis ? Eigen::AngleAxisd(-angles_deg[i] * radian, *orbit.axis).toRotationMatrix()
                   : Eigen::Matrix3d::Identity();
    mean.source += share * (orbit.centre + back * (cameras[i].source - orbit.centre));
    mean.detector += share * (orbit.centre + back * (cameras[i].detector - orbit.centre));
    mean.rotation += share * cameras[i].rotation * back.transpose();
  }
  mean.rotation = geometry::nearest_rotation(mean.rotation);
  return mean;
}

}  // namespace

PlacedCamera placed(const geometry::View& view, const Detector& detector) {
  const Eigen::Matrix3d& rotation = view.camera_from_world.rotation;
  const Vector3d source = view.source_in_world();
  return {source, source + rotation.transpose() * towards_detector(view.intrinsics, detector), rotation};
}

geometry::View view_of(const PlacedCamera& camera, const Detector& detector) {
  const Vector3d q = camera.rotation * (camera.detector - camera.source) / detector.pixel_mm;
  const Eigen::Vector2d centre = detector.centre_px();
  return {{detector.aspect * q.z(), q.z(), centre.x() - detector.aspect * q.x(), centre.y() - q.y(), 0},
          {camera.rotation, -(camera.rotation * camera.source)}};
}

PlacedCamera Orbit::at(double angle_deg) const {
  if (!axis) return first;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle_deg * radian, *axis).toRotationMatrix();
  return {centre + turn * (first.source - centre), centre + turn * (first.detector - centre),
          first.rotation * turn.transpose()};
}

OrbitFit fit_orbit(const std::vector<PlacedCamera>& cameras, const Vector3d& centre) {
  constexpr double least_share = 0.5;  // of the sources' arc, by which a turning camera's orientation turns
  OrbitFit fit{{std::nullopt, centre, cameras.front()}, {}};
  const auto [turn, turn_axis] = turn_of(cameras);
  double arc = 0;
  for (const PlacedCamera& camera : cameras)
    arc = std::max(
        arc, std::acos(std::clamp(
                 direction(camera, centre).dot(direction(cameras[cameras.size() / 2], centre)), -1.0, 1.0)));
  const bool turns = turn > least_share * arc;
  const Vector3d axis = turns ? turn_axis : normal_of_sources(cameras, centre);
  const Vector3d across =
      (direction(cameras.front(), centre) - axis * axis.dot(direction(cameras.front(), centre))).normalized();
  const Vector3d along = axis.cross(across);
  double earlier = 0;
  for (const PlacedCamera& camera : cameras) {
    const Vector3d ray = direction(camera, centre);
    double angle = std::atan2(ray.dot(along), ray.dot(across)) / radian;
    angle += 360 * std::round((earlier - angle) / 360);
    fit.angles_deg.push_back(earlier = angle);
  }
  if (turns) fit.orbit.axis = axis;
  fit.orbit.first = mean_camera(cameras, fit.angles_deg, fit.orbit);
  return fit;
}

CameraVector deviation_of(const PlacedCamera& camera, const PlacedCamera& reference) {
  CameraVector deviation;
  deviation.head<3>().noalias() = reference.rotation * (camera.source - reference.source);
  deviation.segment<3>(3).noalias() = reference.rotation * (camera.detector - reference.detector);
  deviation.tail<3>() = geometry::vector_from_rotation(camera.rotation * reference.rotation.transpose());
  return deviation;
}

PlacedCamera deviated(const PlacedCamera& reference, const CameraVector& deviation) {
  const Eigen::Matrix3d back = reference.rotation.transpose();
  return {reference.source + back * deviation.head<3>(), reference.detector + back * deviation.segment<3>(3),
          geometry::rotation_from_vector(deviation.tail<3>()) * reference.rotation};
}

Eigen::Matrix<double, calibration::view_parameters, camera_size> parameters_by_deviation(
    const PlacedCamera& camera, const PlacedCamera& reference, const Detector& detector) {
  const Eigen::Matrix3d turned = camera.rotation * reference.rotation.transpose();
  const Vector3d t = -(camera.rotation * camera.source);
  const Vector3d q = camera.rotation * (camera.detector - camera.source);
  Eigen::Matrix<double, 3, camera_size> dq, dt;
  dq << -turned, turned, -geometry::cross_matrix(q);
  dt << -turned, Eigen::Matrix3d::Zero(), -geometry::cross_matrix(t);
  Eigen::Matrix<double, calibration::view_parameters, camera_size> by;
  by.setZero();
  by.row(0) = detector.aspect / detector.pixel_mm * dq.row(2);
  by.row(1) = dq.row(2) / detector.pixel_mm;
  by.row(2) = -detector.aspect / detector.pixel_mm * dq.row(0);
  by.row(3) = -dq.row(1) / detector.pixel_mm;
  by.block<3, 3>(4, 6).setIdentity();
  by.middleRows<3>(7) = dt;
  return by;
}

PathObservation observation_of(const FramePoints& frame, const PlacedCamera& at, double angle_deg,
                               const Orbit& orbit, const Detector& detector) {
  const PlacedCamera reference = orbit.at(angle_deg);
  const geometry::View view = view_of(at, detector);
  const auto by_deviation = parameters_by_deviation(at, reference, detector);
  PathObservation made;
  made.angle_deg = angle_deg;
  made.information.setZero();
  CameraVector gradient = CameraVector::Zero();
  for (std::size_t i = 0; i < frame.points.size(); ++i) {
    const Eigen::Matrix<double, 2, camera_size> by =
        calibration::pixel_by_parameters(view, frame.points[i]) * by_deviation / frame.sigma_px[i];
    made.information += by.transpose() * by;
    gradient += by.transpose() * (frame.pixels[i] - view.project(frame.points[i])) / frame.sigma_px[i];
  }
  const CameraVector root = made.information.diagonal().cwiseSqrt().cwiseInverse();
  const CameraMatrix unit = root.asDiagonal() * made.information * root.asDiagonal();
  made.value =
      deviation_of(at, reference) + root.cwiseProduct(unit.ldlt().solve(root.cwiseProduct(gradient)));
  // A rigid motion (w, t) of the phantom about the centre moves the camera, as the phantom sees it, back.
  const Eigen::Matrix3d& r = reference.rotation;
  made.motion << r * geometry::cross_matrix(at.source - orbit.centre), -r,
      r * geometry::cross_matrix(at.detector - orbit.centre), -r, at.rotation, Eigen::Matrix3d::Zero();
  made.turn.setZero();
  if (orbit.axis) {
    const Vector3d& axis = *orbit.axis;
    made.turn.head<3>().noalias() = r * axis.cross(at.source - orbit.centre);
    made.turn.segment<3>(3).noalias() = r * axis.cross(at.detector - orbit.centre);
    made.turn.tail<3>().noalias() = -at.rotation * axis;
  }
  return made;
}

Eigen::MatrixXd value_by_phantom(const FramePoints& frame, const PlacedCamera& at,
                                 const PathObservation& observation, const PlacedCamera& reference,
                                 const Detector& detector, const std::vector<Eigen::Matrix3Xd>& roots) {
  const geometry::View view = view_of(at, detector);
  const auto by_deviation = parameters_by_deviation(at, reference, detector);
  Eigen::MatrixXd gradient = Eigen::MatrixXd::Zero(camera_size, roots.front().cols());
  for (std::size_t i = 0; i < frame.points.size(); ++i) {
    const Eigen::Matrix<double, 2, calibration::view_parameters> by_parameters =
        calibration::pixel_by_parameters(view, frame.points[i]);
    // A shift of the point acts as the opposite shift of the translation, turned into the camera.
    const Eigen::Matrix<double, 2, 3> by_point =
        by_parameters.middleCols<3>(7) * view.camera_from_world.rotation;
    gradient -= (by_parameters * by_deviation).transpose() * by_point * roots[frame.balls[i]] /
                (frame.sigma_px[i] * frame.sigma_px[i]);
  }
  const CameraVector root = observation.information.diagonal().cwiseSqrt().cwiseInverse();
  const CameraMatrix unit = root.asDiagonal() * observation.information * root.asDiagonal();
  return root.asDiagonal() * unit.ldlt().solve(root.asDiagonal() * gradient);
}

}  // namespace helicarm::sweep
