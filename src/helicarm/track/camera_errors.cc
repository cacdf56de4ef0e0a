// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/camera_errors.h"

#include <cmath>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/localization/locate.h"

namespace helicarm::track {
namespace {

using Eigen::Index;
using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::Vector3d;
/// Rotation vector and shift about a body's centre, world axes, for each independent error of the cameras.
using PoseErrors = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Columns whose products sum to the covariance.
MatrixXd independent_errors(const MatrixXd& covariance) {
  constexpr double least_share = 1e-10;
  const auto [values, vectors] = geometry::symmetric_eigen(covariance);
  std::vector<Index> kept;
  for (Index i = 0; i < values.size(); ++i)
    if (values[i] > least_share * values.maxCoeff()) kept.push_back(i);
  return vectors(Eigen::all, kept) * values(kept).cwiseSqrt().asDiagonal();
}

/// Of a pose against the first frame, whose markers lay at `first`.
PoseErrors errors_of(const TrackedBody& frame, const std::vector<Vector3d>& first,
                     const std::vector<Matrix3Xd>& in_first, const SequenceData& work,
                     const MatrixXd& errors) {
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  PoseErrors sum = PoseErrors::Zero(6, errors.cols());
  for (std::size_t k = 0; k < first.size(); ++k) {
    const Vector3d now = frame.pose->pose * first[k];
    const Matrix3Xd by_cameras = place_by_cameras(work, now);
    if (by_cameras.cols() == 0 || in_first[k].cols() == 0) continue;
    const Eigen::Matrix<double, 3, 6> by_pose = point_by_step(now, frame.centre);
    information += by_pose.transpose() * by_pose;
    sum += by_pose.transpose() * (by_cameras * errors - frame.pose->pose.rotation * in_first[k]);
  }
  return geometry::solve_spd(information, sum).solution;
}

/// The pose after a step about its body's centre.
TrackedBody moved(TrackedBody body, const Eigen::Matrix<double, 6, 1>& step) {
  const Eigen::Matrix3d turn = geometry::rotation_from_vector(step.head<3>());
  geometry::RigidTransform& pose = body.pose->pose;
  pose = {turn * pose.rotation, body.centre + turn * (pose.translation - body.centre) + step.tail<3>()};
  return body;
}

/// Of a body's motion against the reference, as `relative_pose` states it.
PoseErrors relative_errors(const PoseErrors& of_reference, const TrackedBody& reference,
                           const PoseErrors& of_body, const TrackedBody& body) {
  PoseErrors carried = of_reference;
  carried.bottomRows<3>() = point_by_step(body.centre, reference.centre) * of_reference;
  const Eigen::Matrix3d back = reference.pose->pose.rotation.transpose();
  PoseErrors made(6, of_body.cols());
  made << back * (of_body - carried).topRows<3>(), back * (of_body - carried).bottomRows<3>();
  return made;
}

void add_to_joint(JointAngles& joint, const BodyAxes& reference_axes, const BodyAxes& axes,
                  const TrackedBody& reference, const TrackedBody& body, const PoseErrors& of_reference,
                  const PoseErrors& of_body) {
  for (Index i = 0; i < of_body.cols(); ++i) {
    const auto other = joint_angles(moved(reference, of_reference.col(i)), reference_axes,
                                    moved(body, of_body.col(i)), axes);
    if (!other) continue;
    const Vector3d turn = (other->angles - joint.angles).unaryExpr([](double angle) -> double {
      return std::remainder(angle, 2 * EIGEN_PI);
    });
    joint.covariance += turn * turn.transpose();
    if (!joint.shift || !other->shift) continue;
    const Vector3d shift = *other->shift - *joint.shift;
    joint.shift_covariance += shift * shift.transpose();
  }
}

}  // namespace

Matrix3Xd place_by_cameras(const SequenceData& work, const Vector3d& place) {
  const MatrixXd& covariance = work.the_case.camera_covariance;
  if (covariance.size() == 0) return Matrix3Xd(3, 0);
  calibration::Calibration calibration;
  std::vector<localization::PointObservation> seen;
  for (std::size_t k = 0; k < work.views; ++k) {
    calibration::CalibratedView view;
    view.name = work.the_case.views[k].images.name;
    view.view = work.cameras[k];
    view.covariance = covariance.block<11, 11>(11 * Index(k), 11 * Index(k));
    calibration.views.push_back(view);
    if (work.cameras[k].depth(place) > 1)
      seen.push_back({k, work.cameras[k].project(place), 0.01 * Eigen::Matrix2d::Identity()});
  }
  calibration.joint_covariance = covariance;
  const auto located = localization::locate("", localization::PointSource::pick, seen, calibration);
  return located && located->by_calibration.size() > 0 ? located->by_calibration : Matrix3Xd(3, 0);
}

void add_camera_errors(const SequenceData& work, Sequence& sequence) {
  if (work.the_case.camera_covariance.size() == 0) return;
  const MatrixXd errors = independent_errors(work.the_case.camera_covariance);
  std::vector<std::vector<PoseErrors>> of_smoothed;
  for (BodySequence& body : sequence.bodies) {
    std::vector<Vector3d> first;
    std::vector<Matrix3Xd> in_first;
    for (const PlacedMarker& marker : body.markers) {
      if (!marker.in_body || marker.moved_at) continue;
      first.push_back(marker.in_body->place);
      const Matrix3Xd by_cameras = place_by_cameras(work, first.back());
      in_first.push_back(by_cameras.cols() == 0 ? by_cameras : Matrix3Xd(by_cameras * errors));
    }
    const auto add = [&](TrackedBody& frame) {
      if (!frame.pose) return PoseErrors(PoseErrors::Zero(6, errors.cols()));
      PoseErrors of_pose = errors_of(frame, first, in_first, work, errors);
      frame.pose->covariance += of_pose * of_pose.transpose();
      return of_pose;
    };
    for (TrackedBody& frame : body.frames) add(frame);
    auto& of_body = of_smoothed.emplace_back();
    for (TrackedBody& frame : body.smoothed) of_body.push_back(add(frame));
  }
  for (std::size_t b = 1; b < sequence.bodies.size(); ++b)
    for (std::size_t f = 0; f < sequence.relative[b - 1].size(); ++f) {
      TrackedBody& between = sequence.relative[b - 1][f];
      const TrackedBody &reference = sequence.bodies[0].smoothed[f], &body = sequence.bodies[b].smoothed[f];
      if (!between.pose) continue;
      const PoseErrors of_pose = relative_errors(of_smoothed[0][f], reference, of_smoothed[b][f], body);
      between.pose->covariance += of_pose * of_pose.transpose();
    }
  for (std::size_t j = 0; j < sequence.joints.size(); ++j) {
    Joint& joint = sequence.joints[j];
    const BodyAxes &reference_axes = work.the_case.axes[0], &axes = work.the_case.axes[j + 1];
    for (std::size_t f = 0; f < joint.frames.size(); ++f)
      if (joint.frames[f])
        add_to_joint(*joint.frames[f], reference_axes, axes, sequence.bodies[joint.reference].smoothed[f],
                     sequence.bodies[joint.body].smoothed[f], of_smoothed[joint.reference][f],
                     of_smoothed[joint.body][f]);
  }
}

}  // namespace helicarm::track
