// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/body_series.h"

#include <algorithm>

namespace helicarm::track {
namespace {

using geometry::RigidTransform;

/// Of the body against the reference, both against their first frames.
TrackedBody relative_of(const TrackedBody& reference, const TrackedBody& body) {
  TrackedBody made;
  made.decision = std::max(reference.decision, body.decision);
  made.reason = reference.decision > body.decision ? reference.reason : body.reason;
  made.markers = std::min(reference.markers, body.markers);
  made.centre = body.centre;
  if (!reference.pose || !body.pose) return made;
  made.centre = reference.pose->pose.inverse() * body.centre;
  made.pose = relative_pose(*reference.pose, reference.centre, *body.pose, body.centre);
  return made;
}

}  // namespace

FramePose relative_pose(const FramePose& reference, const Eigen::Vector3d& reference_centre,
                        const FramePose& body, const Eigen::Vector3d& centre) {
  const RigidTransform back = reference.pose.inverse();
  // A step of the reference about its centre moves the body about its own, in the reference's axes.
  RigidCovariance carried = RigidCovariance::Identity();
  carried.bottomLeftCorner<3, 3>() = point_by_step(centre, reference_centre).leftCols<3>();
  RigidCovariance turned = RigidCovariance::Zero();
  turned.topLeftCorner<3, 3>() = turned.bottomRightCorner<3, 3>() = back.rotation;
  return {
      back * body.pose,
      turned * (body.covariance + carried * reference.covariance * carried.transpose()) * turned.transpose()};
}

void against_first(TrackedBody& frame, const FramePose& pose, const Eigen::Vector3d& centre_in_body,
                   const FramePose& first, bool is_first) {
  FramePose made{pose.pose * first.pose.inverse(), pose.covariance};
  RigidCovariance turned = RigidCovariance::Zero();
  turned.topLeftCorner<3, 3>() = turned.bottomRightCorner<3, 3>() = made.pose.rotation;
  const RigidStep common = pose.common - turned * first.common;
  made.covariance += turned * first.covariance * turned.transpose() + common * common.transpose();
  if (is_first) made = {RigidTransform{}, RigidCovariance::Zero()};
  frame.pose = made;
  frame.centre = pose.pose * centre_in_body;
}

std::optional<FramePose> take_motion(BodySequence& body, const std::vector<std::optional<FramePose>>& poses,
                                     const std::optional<SmoothMotion>& motion,
                                     const Eigen::Vector3d& centre_in_body) {
  // Before the first and behind the last pose nothing bounds the motion.
  const auto has_pose = [](const auto& pose) { return pose.has_value(); };
  const auto begin = std::size_t(std::ranges::find_if(poses, has_pose) - poses.begin());
  const auto behind =
      std::size_t(poses.rend() - std::ranges::find_if(poses.rbegin(), poses.rend(), has_pose));
  if (motion) {
    body.prior = motion->prior;
    body.noise_factor = motion->noise_factor;
    body.turn_noise_factor = motion->turn_noise_factor;
    for (std::size_t f = 0; f < poses.size(); ++f) {
      TrackedBody& frame = body.smoothed[f];
      const TrackedBody& own = body.frames[f];
      if (f > 0 && (f < begin || f >= behind)) {
        frame.decision = PoseDecision::refuse;
        frame.reason = own.reason;
        continue;
      }
      against_first(frame, motion->frames[f], centre_in_body, motion->frames.front(), f == 0);
      frame.markers = own.markers;
      frame.rms_mm = own.rms_mm;
      frame.reason = own.reason;
      frame.decision = poses[f] ? own.decision : PoseDecision::warn;
    }
  }
  // The first frame's smooth pose, which its neighbours' images determine too.
  const auto first = motion ? std::optional(motion->frames.front()) : poses.front();
  for (std::size_t f = 0; f < poses.size(); ++f)
    if (first && poses[f])
      against_first(body.frames[f], *poses[f], centre_in_body, *first, f == 0);
    else
      body.frames[f].decision = PoseDecision::refuse;
  return first;
}

std::vector<std::vector<TrackedBody>> relative_motions(const std::vector<BodySequence>& bodies) {
  std::vector<std::vector<TrackedBody>> motions;
  for (std::size_t b = 1; b < bodies.size(); ++b) {
    auto& motion = motions.emplace_back();
    for (std::size_t f = 0; f < bodies[b].smoothed.size(); ++f)
      motion.push_back(relative_of(bodies[0].smoothed[f], bodies[b].smoothed[f]));
  }
  return motions;
}

}  // namespace helicarm::track
