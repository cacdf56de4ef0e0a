// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/carry_plan.h"

#include <algorithm>

#include "helicarm/geometry/rotation.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;

/// Pose (rotation, translation) and size, in units of its standard deviation.
constexpr Eigen::Index shared_errors = 7;

/// d point / d shared errors, in the world.
Eigen::Matrix3Xd by_shared_errors(const registration::Registration& pose, const Vector3d& in_world) {
  const Vector3d arm = in_world - pose.centre;
  const auto& step = pose.by_scale;
  Eigen::Matrix3Xd by(3, shared_errors);
  by << -geometry::cross_matrix(arm), Eigen::Matrix3d::Identity(),
      step.tail<3>() + step.head<3>().cross(arm) - pose.scale_sigma * arm;
  return by;
}

}  // namespace

bool tracked(const pipeline::Case& the_case, const guidance::Bone& bone) {
  return std::ranges::all_of(the_case.views, [&](const pipeline::CaseView& view) {
    return guidance::calibrator_from(bone, view.poses).has_value();
  });
}

std::vector<registration::RegistrationView> following(std::vector<registration::RegistrationView> views,
                                                      const pipeline::Case& the_case,
                                                      const guidance::Bone& bone) {
  const RigidTransform first = *guidance::calibrator_from(bone, the_case.views.front().poses);
  for (std::size_t i = 0; i < views.size(); ++i)
    views[i].view.camera_from_world = views[i].view.camera_from_world *
                                      *guidance::calibrator_from(bone, the_case.views[i].poses) *
                                      first.inverse();
  return views;
}

Eigen::MatrixXd shared_covariance(const registration::Registration& registration) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(shared_errors, shared_errors);
  covariance.topLeftCorner<6, 6>() =
      registration.covariance - registration.by_scale * registration.by_scale.transpose();
  return covariance;
}

void carry_plan(const MarkupPlan& plan, const pipeline::Case& the_case, RegisteredModel& model) {
  model.points.clear();
  model.tunnels.clear();
  model.tunnel_ends.clear();
  const auto& pose = model.registration;
  const std::optional<guidance::Bone> anchor =
      model.moves_with && tracked(the_case, *model.moves_with) ? model.moves_with : std::nullopt;
  std::vector<guidance::DatedView> dated;
  for (std::size_t i = 0; i < the_case.views.size(); ++i)
    dated.push_back({model.views[i], the_case.views[i].poses, 1});
  const RigidTransform anchor_from_world =
      anchor ? guidance::calibrator_from(*anchor, the_case.views.front().poses)->inverse() : RigidTransform{};
  for (const PlanPoint& point : plan.points) {
    const Vector3d in_world = pose.world_from_model * point.in_model;
    localization::LocatedPoint located;
    located.name = point.name;
    located.point_in_anchor = anchor_from_world * in_world;
    located.covariance_in_anchor = anchor_from_world.rotation *
                                   registration::point_covariance(pose, in_world) *
                                   anchor_from_world.rotation.transpose();
    located.by_calibration = anchor_from_world.rotation * by_shared_errors(pose, in_world);
    model.points.push_back(
        {point.name, guidance::guide(located, anchor, dated, the_case.poses_now, the_case.tracker)});
  }
  const Eigen::MatrixXd shared = shared_covariance(pose);
  for (const MarkupLine& tunnel : plan.tunnels) {
    model.tunnels.push_back(
        value_or_throw(guidance::plan_tunnel(tunnel.name, model.points[tunnel.start].place,
                                             model.points[tunnel.end].place, shared, the_case.tracker)));
    model.tunnel_ends.push_back({tunnel.start, tunnel.end});
  }
}

}  // namespace helicarm::case_registration
