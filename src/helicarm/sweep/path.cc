// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/path.h"

#include <cmath>
#include <numbers>

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

/// Where the axis of the turn passes: cameras that turn about it, as their orientations say, fit sources and
/// detectors best. Across the rays both are known well, along them hardly. `near`: on the axis, roughly.
Vector3d centre_of_turn(const std::vector<PlacedCamera>& cameras, const Vector3d& axis,
                        const Vector3d& near) {
  constexpr double across_mm = 0.1, along_mm = 2, near_mm = 300;
  const Vector3d weights(1 / across_mm, 1 / across_mm, 1 / along_mm);
  // Unknown: the centre's shift, and source and detector at the first angle, from `near`.
  Eigen::Matrix<double, 9, 9> information = Eigen::Matrix<double, 9, 9>::Zero();
  Eigen::Matrix<double, 9, 1> gradient = Eigen::Matrix<double, 9, 1>::Zero();
  information.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / (near_mm * near_mm);
  for (const PlacedCamera& camera : cameras) {
    const double angle =
        axis.dot(geometry::vector_from_rotation(camera.rotation.transpose() * cameras.front().rotation));
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    const Eigen::Matrix3d weighted = weights.asDiagonal() * camera.rotation;
    for (const bool is_source : {true, false}) {
      Eigen::Matrix<double, 3, 9> by = Eigen::Matrix<double, 3, 9>::Zero();
      by.leftCols<3>() = weighted * (Eigen::Matrix3d::Identity() - turn);
      by.middleCols<3>(is_source ? 3 : 6) = weighted * turn;
      information += by.transpose() * by;
      gradient += by.transpose() * (weighted * ((is_source ? camera.source : camera.detector) - near));
    }
  }
  const Vector3d shift = geometry::solve_spd(information, gradient).solution.topRows<3>();
  return near + shift - axis * axis.dot(shift);
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

/// All u, then all v, of 2-vectors of the points, along axes of unit variance. `of_point`: 2 x m of point i.
template <class OfPoint>
Eigen::MatrixXd whitened(const FramePoints& frame, Eigen::Index columns, const OfPoint& of_point) {
  const auto n = Eigen::Index(frame.points.size());
  Eigen::MatrixXd u(n, columns), v(n, columns), both(2 * n, columns);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Matrix2Xd of = of_point(std::size_t(i));
    u.row(i) = of.row(0);
    v.row(i) = of.row(1);
  }
  both << frame.whitening * u, frame.whitening * v;
  return both;
}

/// How the whitened pixels follow the camera's deviation.
Eigen::MatrixXd pixels_by_deviation(const FramePoints& frame, const PlacedCamera& at,
                                    const PlacedCamera& reference, const Detector& detector) {
  const geometry::View view = view_of(at, detector);
  const auto by_deviation = parameters_by_deviation(at, reference, detector);
  return whitened(frame, camera_size, [&](std::size_t i) -> Eigen::Matrix2Xd {
    return calibration::pixel_by_parameters(view, frame.points[i]) * by_deviation;
  });
}

/// information^-1 right, scaled to a unit diagonal first: mm and radian differ by orders of magnitude.
Eigen::MatrixXd solved(const CameraMatrix& information, const Eigen::MatrixXd& right) {
  const CameraVector root = information.diagonal().cwiseSqrt().cwiseInverse();
  const CameraMatrix unit = root.asDiagonal() * information * root.asDiagonal();
  return root.asDiagonal() * geometry::solve_spd(unit, root.asDiagonal() * right).solution;
}

/// Change of the frame's value by errors of its pixels, 2 x `columns` of each.
template <class Errors>
Eigen::MatrixXd value_by_errors(const FramePoints& frame, const PlacedCamera& at,
                                const PathObservation& observation, const PlacedCamera& reference,
                                const Detector& detector, Eigen::Index columns, const Errors& errors) {
  const geometry::View view = view_of(at, detector);
  const Eigen::MatrixXd by = pixels_by_deviation(frame, at, reference, detector);
  const Eigen::MatrixXd gradient =
      by.transpose() * whitened(frame, columns, [&](std::size_t i) { return errors(view, i); });
  return solved(observation.information, gradient);
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
  fit.orbit.centre = turns ? centre_of_turn(cameras, axis, centre) : centre;
  const Vector3d across = (direction(cameras.front(), fit.orbit.centre) -
                           axis * axis.dot(direction(cameras.front(), fit.orbit.centre)))
                              .normalized();
  const Vector3d along = axis.cross(across);
  double earlier = 0;
  for (const PlacedCamera& camera : cameras) {
    const Vector3d ray = direction(camera, fit.orbit.centre);
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
  PathObservation observation;
  observation.angle_deg = angle_deg;
  const Eigen::MatrixXd by = pixels_by_deviation(frame, at, reference, detector);
  const Eigen::VectorXd off = whitened(frame, 1, [&](std::size_t i) -> Eigen::Matrix2Xd {
    return frame.pixels[i] - view.project(frame.points[i]);
  });
  observation.information = by.transpose() * by;
  const CameraVector gradient = by.transpose() * off;
  observation.value = deviation_of(at, reference) + solved(observation.information, gradient);
  // A rigid motion (w, t) of the phantom about the centre moves the camera, as the phantom sees it, back.
  const Eigen::Matrix3d& r = reference.rotation;
  observation.motion << r * geometry::cross_matrix(at.source - orbit.centre), -r,
      r * geometry::cross_matrix(at.detector - orbit.centre), -r, at.rotation, Eigen::Matrix3d::Zero();
  observation.turn.setZero();
  if (orbit.axis) {
    const Vector3d& axis = *orbit.axis;
    observation.turn.head<3>().noalias() = r * axis.cross(at.source - orbit.centre);
    observation.turn.segment<3>(3).noalias() = r * axis.cross(at.detector - orbit.centre);
    observation.turn.tail<3>().noalias() = -at.rotation * axis;
  }
  return observation;
}

std::vector<double> free_shares(const FramePoints& frame, const PlacedCamera& at,
                                const CameraMatrix& covariance, const PlacedCamera& reference,
                                const Detector& detector) {
  constexpr double least = 0.1;
  const Eigen::MatrixXd by = pixels_by_deviation(frame, at, reference, detector);
  const auto n = Eigen::Index(frame.points.size());
  const auto taken = [&](Eigen::Index row) { return by.row(row).dot(by.row(row) * covariance); };
  std::vector<double> shares;
  for (Eigen::Index i = 0; i < n; ++i) shares.push_back(std::max(least, 1 - (taken(i) + taken(n + i)) / 2));
  return shares;
}

Eigen::MatrixXd value_by_pixels(const FramePoints& frame, const PlacedCamera& at,
                                const PathObservation& observation, const PlacedCamera& reference,
                                const Detector& detector, const Eigen::MatrixXd& roots) {
  return value_by_errors(frame, at, observation, reference, detector, 2 * roots.cols(),
                         [&](const auto&, std::size_t i) {
                           Eigen::Matrix2Xd errors = Eigen::Matrix2Xd::Zero(2, 2 * roots.cols());
                           errors.row(0).head(roots.cols()) = roots.row(Eigen::Index(i));
                           errors.row(1).tail(roots.cols()) = roots.row(Eigen::Index(i));
                           return errors;
                         });
}

Eigen::MatrixXd value_by_phantom(const FramePoints& frame, const PlacedCamera& at,
                                 const PathObservation& observation, const PlacedCamera& reference,
                                 const Detector& detector, const std::vector<Eigen::Matrix3Xd>& roots) {
  return value_by_errors(frame, at, observation, reference, detector, roots.front().cols(),
                         [&](const geometry::View& view, std::size_t i) -> Eigen::Matrix2Xd {
                           // A shift of the point acts as the opposite shift of its pixel.
                           return -(calibration::pixel_by_parameters(view, frame.points[i]).middleCols<3>(7) *
                                    view.camera_from_world.rotation * roots[frame.balls[i]]);
                         });
}

}  // namespace helicarm::sweep
