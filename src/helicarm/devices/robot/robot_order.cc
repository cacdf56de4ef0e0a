// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/robot_order.h"

#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"

namespace helicarm::robot {
namespace {

constexpr const char* order_format = "helicarm-order/1";
constexpr double in_degrees = 180 / std::numbers::pi;

/// Any finite number: `check_order` applies the limits with a reason.
constexpr Range any{std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max()};

/// Bit-exact: reading must not change what the user confirmed.
geometry::RigidTransform pose_of(JsonReader& reader, const char* key) {
  const Eigen::Matrix4d given = geometry::matrix_from(reader, key, any);
  const geometry::RigidTransform corrected =
      value_or_throw(geometry::rigid_transform_from(given, reader.where() + ": " + key));
  if (!((corrected.matrix() - given).cwiseAbs().maxCoeff() < 1e-9))
    reader.refuse(Reason::bad_value, key, "must be a rotation and a translation to nine digits");
  return geometry::exact_pose(given);
}

RobotTool tool_of(JsonReader reader) {
  RobotTool tool{pose_of(reader, "flange_from_tcp"), reader.number("payload_kg", any)};
  reader.finish();
  return tool;
}

Waypoint waypoint_of(JsonReader& reader) {
  Waypoint waypoint{pose_of(reader, "base_from_tcp"), reader.number("speed_mm_s", any),
                    reader.number("acceleration_mm_s2", any)};
  reader.finish();
  return waypoint;
}

Corrections corrections_of(JsonReader reader) {
  Corrections corrections{reader.integer("most", 0, 20), reader.number("longest_mm", any),
                          reader.number("widest_deg", any), reader.number("tolerance_mm", any),
                          reader.number("tolerance_deg", any)};
  reader.finish();
  return corrections;
}

}  // namespace

Json to_json(const KeepOut& keep_out) {
  return {{"point_in_base", geometry::json_list(keep_out.point_in_base)},
          {"normal", geometry::json_list(keep_out.normal)}};
}

KeepOut keep_out_from(JsonReader& reader, Range range) {
  const KeepOut keep_out{Eigen::Vector3d(reader.numbers("point_in_base", 3, range).data()),
                         Eigen::Vector3d(reader.numbers("normal", 3, {-1, 1}).data())};
  if (!(std::abs(keep_out.normal.norm() - 1) < 1e-6))
    reader.refuse(Reason::bad_value, "normal", "must be of unit length");
  reader.finish();
  return keep_out;
}

Json to_json(const RobotOrder& order) {
  Json waypoints = Json::array(), keep_outs = Json::array();
  for (const Waypoint& waypoint : order.waypoints)
    waypoints.push_back({{"base_from_tcp", geometry::json_rows(waypoint.base_from_tcp.matrix())},
                         {"speed_mm_s", waypoint.speed_mm_s},
                         {"acceleration_mm_s2", waypoint.acceleration_mm_s2}});
  for (const KeepOut& keep_out : order.keep_outs) keep_outs.push_back(to_json(keep_out));
  const Corrections& corrections = order.corrections;
  return {{"format", order_format},
          {"name", order.name},
          {"model", order.model},
          {"tool",
           {{"flange_from_tcp", geometry::json_rows(order.tool.flange_from_tcp.matrix())},
            {"payload_kg", order.tool.payload_kg}}},
          {"start_deg", geometry::json_list(order.start * in_degrees)},
          {"waypoints", waypoints},
          {"keep_outs", keep_outs},
          {"corrections",
           {{"most", corrections.most},
            {"longest_mm", corrections.longest_mm},
            {"widest_deg", corrections.widest_deg},
            {"tolerance_mm", corrections.tolerance_mm},
            {"tolerance_deg", corrections.tolerance_deg}}}};
}

Expected<RobotOrder> robot_order_from(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    reader.choice("format", {order_format});
    RobotOrder order;
    order.name = reader.text("name");
    order.model = reader.text("model");
    order.tool = tool_of(reader.object("tool"));
    order.start = Eigen::Map<const Joints>(reader.numbers("start_deg", 6, any).data()) / in_degrees;
    for (JsonReader& waypoint : reader.objects("waypoints", true, 100))
      order.waypoints.push_back(waypoint_of(waypoint));
    for (JsonReader& keep_out : reader.objects("keep_outs", false, 100))
      order.keep_outs.push_back(keep_out_from(keep_out, any));
    order.corrections = corrections_of(reader.object("corrections"));
    reader.finish();
    return order;
  });
}

}  // namespace helicarm::robot
