// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/virtual_arm.h"

#include <fmt/format.h>

namespace helicarm::robot {

void VirtualArm::follow(Path path, double length, double speed, double acceleration) {
  path_ = std::move(path);
  length_ = length;
  speed_ = speed;
  acceleration_ = acceleration;
  covered_ = present_speed_ = 0;
  braking_rad_s2_.reset();
}

Expected<void> VirtualArm::move_linear(const geometry::RigidTransform& base_from_tcp,
                                       const geometry::RigidTransform& flange_from_tcp, double speed_mm_s,
                                       double acceleration_mm_s2) {
  const StraightPath path(base_from_flange(model_, joints_) * flange_from_tcp, base_from_tcp);
  const geometry::RigidTransform tcp_from_flange = flange_from_tcp.inverse();
  if (const auto end = nearest_inverse(model_, base_from_tcp * tcp_from_flange, joints_); !end)
    return tl::unexpected<Failure>(end.error());
  follow(
      [path, tcp_from_flange, model = model_](double part, const Joints& near) {
        return nearest_inverse(model, path.at(part) * tcp_from_flange, near);
      },
      path.length_mm(), speed_mm_s, acceleration_mm_s2);
  return {};
}

void VirtualArm::move_joints(const Joints& target, double speed_rad_s, double acceleration_rad_s2) {
  follow(
      [from = joints_, target](double part, const Joints&) -> Expected<Joints> {
        return Joints(from + part * (target - from));
      },
      (target - joints_).cwiseAbs().maxCoeff(), speed_rad_s, acceleration_rad_s2);
}

void VirtualArm::brake(double deceleration_rad_s2) {
  path_ = nullptr;
  braking_rad_s2_ = deceleration_rad_s2;
}

Expected<void> VirtualArm::step(double period_s, double scaling) {
  if (braking_rad_s2_) {
    const double fastest = speeds_.cwiseAbs().maxCoeff();
    const double slower = fastest - *braking_rad_s2_ * period_s;
    if (slower <= 0) {
      speeds_.setZero();
      braking_rad_s2_.reset();
    } else {
      speeds_ *= slower / fastest;
    }
    joints_ += speeds_ * period_s;
    return {};
  }
  if (!path_) return {};
  const double rest = length_ - covered_;
  const double change = acceleration_ * period_s;
  const double wanted = std::min(speed_ * scaling, std::sqrt(2 * acceleration_ * rest));
  present_speed_ = std::clamp(wanted, present_speed_ - 2 * change, present_speed_ + change);
  covered_ += std::max(0.0, present_speed_) * period_s;
  const bool arrived = covered_ >= length_ - 1e-9;
  const auto next = path_(arrived ? 1 : covered_ / length_, joints_);
  const Joints speeds = next ? Joints((*next - joints_) / period_s) : speeds_;
  const double fastest = speeds.cwiseAbs().maxCoeff();
  if (!next || fastest > model_.fastest) {
    path_ = nullptr;
    return next ? fail(Reason::robot_stopped, fmt::format("a joint would turn at {:.2f} rad/s", fastest))
                : tl::unexpected<Failure>(next.error());
  }
  speeds_ = speeds;
  joints_ = *next;
  if (arrived) {
    path_ = nullptr;
    speeds_.setZero();
  }
  return {};
}

}  // namespace helicarm::robot
