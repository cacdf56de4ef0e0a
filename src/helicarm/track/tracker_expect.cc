// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/tracker.h"
#include "helicarm/track/view_map.h"

namespace helicarm::track {

double Tracker::Delay::sigma() const { return 1 / std::sqrt(information); }

Eigen::Vector2d Tracker::rectified(std::size_t view, const Eigen::Vector2d& raw) const {
  return rectified_in(given_->views[view], raw).value();
}

bool Tracker::is_in_map(std::size_t view, const MarkerImage& image) const {
  return rectified_in(given_->views[view], image.uv_raw).has_value();
}

double Tracker::radius_px(std::size_t view, const Eigen::Vector3d& place) const {
  return given_->diameter_mm / 2 * std::abs(cameras_[view].intrinsics.fy) /
         std::max(1.0, cameras_[view].depth(place));
}

std::optional<PosePrior> Tracker::predicted_pose(const BodyState& body) const {
  if (body.poses == 0) return std::nullopt;
  PosePrior prior{body.pose, RigidCovariance::Zero(), body.centre};
  if (body.poses > 1) {
    // The turn is that of the frame, the shift that of the centre.
    const RigidStep step = registration::step_about(body.previous, body.pose,
                                                    body.previous * (body.pose.inverse() * body.centre));
    prior.world_from_body = registration::moved_about(body.pose, body.centre, step);
    prior.centre = prior.world_from_body * (body.pose.inverse() * body.centre);
  }
  const double grown = 1 + body.hidden;
  prior.covariance.diagonal().head<3>().setConstant(std::pow(grown * body.turn_rad, 2));
  prior.covariance.diagonal().tail<3>().setConstant(std::pow(grown * body.shift_mm, 2));
  return prior;
}

Eigen::Vector3d Tracker::velocity_of(std::size_t marker) const {
  if (const auto b = body_of_[marker]) {
    const BodyState& body = bodies_[*b];
    const auto& markers = given_->bodies[*b].markers;
    const auto i = std::size_t(std::ranges::find(markers, marker) - markers.begin());
    if (body.poses > 1 && body.seen[i] > 0)
      return predicted_pose(body)->world_from_body * body.in_body[i] - body.pose * body.in_body[i];
  }
  return markers_[marker].velocity;
}

void Tracker::expect_images(ExpectedMarker& marker, std::size_t index,
                            const Eigen::Vector3d& velocity) const {
  for (std::size_t k = 0; k < cameras_.size(); ++k) {
    ExpectedImage image;
    image.radius_px = radius_px(k, marker.place);
    image.contrast = contrast_of(index, k);
    // Discs are fitted with a free radius, which their contrast depends on.
    image.contrast.spread = std::clamp(image.contrast.spread * (1 + 0.1 * markers_[index].age[k]), 0.25, 0.8);
    image.visible = markers_[index].contrast[k] * std::exp(-0.15 * markers_[index].age[k]);
    if (k > 0 && cameras_[k].depth(marker.place) > 1) {
      const Eigen::Vector2d speed = geometry::projection_jacobian(cameras_[k], marker.place) * velocity;
      image.shift_px = delays_[k].mean() * speed;
      image.shift_sigma = delays_[k].sigma() * speed.norm();
    }
    marker.images.push_back(image);
  }
}

ExpectedMarker Tracker::expected(std::size_t marker) const {
  const MarkerState& state = markers_[marker];
  ExpectedMarker made;
  made.place = state.place + state.velocity;
  // One that is picked in one view alone is looked for where its body places it.
  if (!state.known) made.place.setConstant(std::numeric_limits<double>::quiet_NaN());
  const double sigma = std::min(15.0, state.acceleration_mm * (1 + state.hidden));
  made.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  expect_images(made, marker, state.velocity);
  return made;
}

ExpectedMarker Tracker::expected(std::size_t marker, const PosePrior& pose, double wide) const {
  const std::size_t b = *body_of_[marker];
  const BodyState& body = bodies_[b];
  const auto& markers = given_->bodies[b].markers;
  const auto i = std::size_t(std::ranges::find(markers, marker) - markers.begin());
  ExpectedMarker made;
  made.place = pose.world_from_body * body.in_body[i];
  const auto slope = point_by_step(made.place, pose.centre);
  made.covariance = wide * wide * slope * pose.covariance * slope.transpose();
  made.covariance.diagonal().array() += body.loose_mm * body.loose_mm * (1 + 4 / body.seen[i]);
  expect_images(made, marker, velocity_of(marker));
  return made;
}

}  // namespace helicarm::track
