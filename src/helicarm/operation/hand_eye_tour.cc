// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/hand_eye_tour.h"

#include <array>
#include <numbers>

#include <Eigen/Geometry>

#include "helicarm/devices/robot/check_order.h"

namespace helicarm::operation {
namespace {

constexpr double turn_rad = 20 * std::numbers::pi / 180;
constexpr double shift_mm = 25;
constexpr double tour_acceleration_mm_s2 = 250;

}  // namespace

std::vector<geometry::RigidTransform> hand_eye_tour(const geometry::RigidTransform& base_from_tcp) {
  constexpr std::array<std::array<double, 3>, 8> corners{{{1, 0, 0.4},
                                                          {-1, 0, -0.4},
                                                          {0, 1, 0.4},
                                                          {0, -1, -0.4},
                                                          {0.7, 0.7, -0.8},
                                                          {-0.7, 0.7, 0.8},
                                                          {-0.7, -0.7, -0.8},
                                                          {0.7, -0.7, 0.8}}};
  std::vector<geometry::RigidTransform> tour;
  for (const auto& [x, y, z] : corners) {
    const Eigen::Vector3d turn(x, y, z);
    const geometry::RigidTransform moved{
        Eigen::AngleAxisd(turn_rad * turn.norm(), turn.normalized()).toRotationMatrix(),
        shift_mm * Eigen::Vector3d(y, z, x)};
    tour.push_back(base_from_tcp * moved);
  }
  tour.push_back(base_from_tcp);
  return tour;
}

robot::RobotOrder tour_order(const RobotPlan& plan, const robot::RobotState& present,
                             const geometry::RigidTransform& base_from_tcp) {
  robot::RobotOrder order;
  order.name = tour_name;
  order.model = plan.model;
  order.tool = plan.tool;
  order.start = present.joints;
  order.waypoints = {{base_from_tcp, plan.approach.travel_mm_s, tour_acceleration_mm_s2}};
  order.keep_outs = plan.approach.keep_outs;
  order.corrections.tolerance_mm = 0.5;
  order.corrections.tolerance_deg = 0.5;
  return robot::slowed_for_joints(std::move(order), plan.approach.limits);
}

}  // namespace helicarm::operation
