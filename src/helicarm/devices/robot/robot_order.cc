// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/robot_order.h"

#include <limits>
#include <numbers>

#include "helicarm/core/codec.h"
#include "helicarm/geometry/pose_codec.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::robot {
namespace {

constexpr const char* order_format = "helicarm-order/1";
constexpr double in_degrees = 180 / std::numbers::pi;

/// Any finite number: `check_order` applies the limits with a reason.
constexpr Range any{std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max()};

/// Bit-exact: reading must not change what the user confirmed.
geometry::RigidTransform pose_of(JsonReader& reader, const char* key) {
  const Eigen::Matrix4d stated = geometry::matrix_from(reader, key, any);
  const geometry::RigidTransform corrected =
      value_or_throw(geometry::rigid_transform_from(stated, reader.where() + ": " + key));
  if (!((corrected.matrix() - stated).cwiseAbs().maxCoeff() < 1e-9))
    reader.refuse(Reason::bad_value, key, "must be a rotation and a translation to nine digits");
  return geometry::exact_pose(stated);
}

template <class Codec, class Order>
void describe(Codec& codec, Order& order) {
  using geometry::describe_pose;
  codec.custom(
      "format", true, {{"const", order_format}}, "of this file",
      [](JsonReader& reader) { reader.choice("format", {order_format}); },
      [] { return std::optional<Json>(order_format); });
  codec.text("name", order.name, "of the order: the tunnel");
  codec.text("model", order.model, "of the robot");
  codec.required_object("tool", order.tool, "mounted on the flange", [](auto& inner, auto& tool) {
    describe_pose(inner, "flange_from_tcp", tool.flange_from_tcp, pose_of, "origin at the tip, z out of it");
    inner.number("payload_kg", tool.payload_kg, any, "total at the flange");
  });
  codec.custom(
      "start_deg", true, {{"type", "array"}}, "joints at planning",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Order>)
          order.start = Eigen::Map<const Joints>(reader.numbers("start_deg", 6, any).data()) / in_degrees;
      },
      [&] { return std::optional(geometry::json_list(order.start * in_degrees)); });
  codec.list("waypoints", order.waypoints, true, 100, "in order", [](auto& inner, auto& waypoint) {
    describe_pose(inner, "base_from_tcp", waypoint.base_from_tcp, pose_of, "of the tip, mm");
    inner.number("speed_mm_s", waypoint.speed_mm_s, any, "of the tip");
    inner.number("acceleration_mm_s2", waypoint.acceleration_mm_s2, any, "of the tip");
  });
  codec.list("keep_outs", order.keep_outs, false, 100, "forbidden half-spaces",
             [](auto& inner, auto& plane) { describe_keep_out(inner, plane, any); });
  codec.required_object("corrections", order.corrections, "by the tracker, at the last waypoint",
                        [](auto& inner, auto& allowed) {
                          inner.integer("most", allowed.most, 0, 20, "0: none, the robot's own pose decides");
                          inner.number("longest_mm", allowed.longest_mm, any,
                                       "translation of one correction");
                          inner.number("widest_deg", allowed.widest_deg, any, "rotation of one correction");
                          inner.number("tolerance_mm", allowed.tolerance_mm, any, "of the tip");
                          inner.number("tolerance_deg", allowed.tolerance_deg, any, "of the tip");
                        });
}

}  // namespace

Json to_json(const RobotOrder& order) {
  ToJson codec;
  describe(codec, order);
  return std::move(codec.json);
}

Expected<RobotOrder> robot_order_from(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    FromJson codec(reader);
    RobotOrder order;
    describe(codec, order);
    reader.finish();
    return order;
  });
}

}  // namespace helicarm::robot
