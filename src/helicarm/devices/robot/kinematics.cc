// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/kinematics.h"

#include <cmath>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::robot {
namespace {

constexpr double pi = std::numbers::pi;

/// +-360 degrees, the elbow +-180: beyond it the forearm collides with the upper arm.
Joints joint_limits() {
  Joints limits = Joints::Constant(2 * pi);
  limits[2] = pi;
  return limits;
}

/// Rotation about z by `angle`, translations along z by `d` and along the new x by `a`, rotation about it by
/// a twist of given cosine and sine.
geometry::RigidTransform link(double angle, double d, double a, double cos_twist, double sin_twist) {
  const double c = std::cos(angle), s = std::sin(angle);
  geometry::RigidTransform step;
  step.rotation << c, -s * cos_twist, s * sin_twist, s, c * cos_twist, -c * sin_twist, 0, sin_twist,
      cos_twist;
  step.translation << a * c, a * s, d;
  return step;
}

double wrapped(double angle) { return std::remainder(angle, 2 * pi); }

/// The equivalent of `angle` within +-limit nearest to `near`.
std::optional<double> nearest_turn(double angle, double near, double limit) {
  double turned = near + wrapped(angle - near);
  if (turned > limit) turned -= 2 * pi;
  if (turned < -limit) turned += 2 * pi;
  if (std::abs(turned) > limit) return std::nullopt;
  return turned;
}

/// The last five joints for a given base joint: two wrist and two elbow configurations.
void append_solutions(const RobotModel& model, const geometry::RigidTransform& base_from_flange, double base,
                      std::vector<Joints>& solutions) {
  const Eigen::Vector3d across(std::sin(base), -std::cos(base), 0);  // axis of joints 2, 3 and 4
  const Eigen::Vector3d across_in_flange = base_from_flange.rotation.transpose() * across;
  const double sine = std::hypot(across_in_flange.x(), across_in_flange.y());
  for (const double way : {1.0, -1.0}) {
    const double wrist2 = std::atan2(way * sine, across_in_flange.z());
    const double wrist3 =
        sine < 1e-12 ? 0 : std::atan2(-way * across_in_flange.y(), way * across_in_flange.x());
    const geometry::RigidTransform frame1_from_frame4 =
        link(base, model.d1, 0, 0, 1).inverse() * base_from_flange *
        (link(wrist2, model.d5, 0, 0, -1) * link(wrist3, model.d6, 0, 1, 0)).inverse();
    const double x = frame1_from_frame4.translation.x(), y = frame1_from_frame4.translation.y();
    const double cos_elbow =
        (x * x + y * y - model.a2 * model.a2 - model.a3 * model.a3) / (2 * model.a2 * model.a3);
    if (!(std::abs(cos_elbow) <= 1)) continue;
    const double together = std::atan2(frame1_from_frame4.rotation(1, 0), frame1_from_frame4.rotation(0, 0));
    for (const double bend : {1.0, -1.0}) {
      const double sin_elbow = bend * std::sqrt((1 - cos_elbow) * (1 + cos_elbow));
      const double elbow = std::atan2(sin_elbow, cos_elbow);
      const double shoulder =
          std::atan2(y, x) - std::atan2(model.a3 * sin_elbow, model.a2 + model.a3 * cos_elbow);
      Joints joints;
      joints << base, shoulder, elbow, together - shoulder - elbow, wrist2, wrist3;
      solutions.push_back(joints.unaryExpr(&wrapped));
    }
  }
}

}  // namespace

// Shoulder offsets: Universal_Robots_ROS2_Description, config/ur5 and config/ur5e, physical_parameters.yaml.

// UR5 user manual (CB3, series 3), appendix B.2.
RobotModel ur5() { return {"UR5", 89.159, -425, -392.25, 109.15, 94.65, 82.3, 135.85, 125, joint_limits()}; }

// Universal Robots, "DH parameters for calculations of kinematics and dynamics".
RobotModel ur5e() { return {"UR5e", 162.5, -425, -392.2, 133.3, 99.7, 99.6, 138, 500, joint_limits()}; }

std::array<geometry::RigidTransform, 6> joint_frames(const RobotModel& model, const Joints& joints) {
  std::array<geometry::RigidTransform, 6> frames;
  frames[0] = link(joints[0], model.d1, 0, 0, 1);
  frames[1] = frames[0] * link(joints[1], 0, model.a2, 1, 0);
  frames[2] = frames[1] * link(joints[2], 0, model.a3, 1, 0);
  frames[3] = frames[2] * link(joints[3], model.d4, 0, 0, 1);
  frames[4] = frames[3] * link(joints[4], model.d5, 0, 0, -1);
  frames[5] = frames[4] * link(joints[5], model.d6, 0, 1, 0);
  return frames;
}

geometry::RigidTransform base_from_flange(const RobotModel& model, const Joints& joints) {
  return joint_frames(model, joints).back();
}

Eigen::Matrix<double, 6, 6> jacobian(const RobotModel& model, const Joints& joints,
                                     const Eigen::Vector3d& point_in_flange) {
  const auto frames = joint_frames(model, joints);
  const Eigen::Vector3d point = frames.back() * point_in_flange;
  Eigen::Matrix<double, 6, 6> columns;
  geometry::RigidTransform before;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Vector3d axis = before.rotation.col(2);
    columns.block<3, 1>(0, i) = axis.cross(point - before.translation);
    columns.block<3, 1>(3, i) = axis;
    before = frames[i];
  }
  return columns;
}

double least_singular_value(const RobotModel& model, const Joints& joints) {
  Eigen::Matrix<double, 6, 6> scaled = jacobian(model, joints);
  scaled.topRows<3>() /= 1000;
  return std::sqrt(std::max(0.0, geometry::symmetric_eigen(scaled * scaled.transpose()).values[0]));
}

std::vector<Joints> inverse(const RobotModel& model, const geometry::RigidTransform& base_from_flange) {
  std::vector<Joints> solutions;
  if (!base_from_flange.translation.allFinite() || !base_from_flange.rotation.allFinite()) return solutions;
  const Eigen::Vector3d wrist = base_from_flange.translation - model.d6 * base_from_flange.rotation.col(2);
  const double sine = model.d4 / std::hypot(wrist.x(), wrist.y());
  if (!(sine <= 1)) return solutions;
  const double towards = std::atan2(wrist.y(), wrist.x());
  for (const double base : {towards + std::asin(sine), towards + pi - std::asin(sine)})
    append_solutions(model, base_from_flange, base, solutions);
  return solutions;
}

Expected<Joints> nearest_inverse(const RobotModel& model, const geometry::RigidTransform& base_from_flange,
                                 const Joints& near) {
  std::optional<Joints> best;
  for (Joints joints : inverse(model, base_from_flange)) {
    bool within = true;
    for (int i = 0; i < 6; ++i) {
      const auto turned = nearest_turn(joints[i], near[i], model.farthest[i]);
      within = within && turned.has_value();
      joints[i] = turned.value_or(0);
    }
    if (within && (!best || (joints - near).cwiseAbs().maxCoeff() < (*best - near).cwiseAbs().maxCoeff()))
      best = joints;
  }
  if (best) return *best;
  const Eigen::Vector3d& position = base_from_flange.translation;
  return fail(
      Reason::out_of_reach,
      fmt::format("the {} cannot reach the flange position {:.1f}, {:.1f}, {:.1f} mm in this orientation",
                  model.name, position.x(), position.y(), position.z()),
      {{"distance_mm", position.norm()}});
}

}  // namespace helicarm::robot
