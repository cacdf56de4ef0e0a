// SPDX-License-Identifier: Apache-2.0
// From a tracker's message to the tool's line in two views: the display latency without the network.
#include <benchmark/benchmark.h>

#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/operation/tool_line.h"

namespace helicarm {
namespace {

std::string message_at(double time_s) {
  tracker::IgtlTracking tracking;
  for (const char* tool : {"femur", "tibia", "tool"}) {
    geometry::RigidTransform pose{geometry::rotation_from_euler(0.3, 0.2, 0.1),
                                  {100, 50 + 0.01 * time_s, 900}};
    pose.translation.x() += 0.1 * std::sin(1e4 * time_s);
    tracking.tools.push_back({tool, 2, pose.matrix()});
  }
  tracker::IgtlMessage message;
  message.device = "tracker";
  message.stamp = tracker::stamp_from_seconds(1.7e9 + time_s);
  message.content = tracking;
  return encode(message);
}

void message_to_lines_in_xrays(benchmark::State& state) {
  tracker::PoseBoard board;
  guidance::Poses xray_image;
  xray_image.tracker_from_calibrator = geometry::RigidTransform{Eigen::Matrix3d::Identity(), {0, 0, 900}};
  xray_image.tracker_from_bone["femur"] =
      geometry::RigidTransform{Eigen::Matrix3d::Identity(), {100, 50, 900}};
  const geometry::View views[2] = {
      {{4000, 4000, 511, 511, 0}, {Eigen::Matrix3d::Identity(), {0, 0, 700}}},
      {{4000, 4000, 511, 511, 0}, {geometry::rotation_from_euler(1.57, 0, 0), {0, 0, 700}}}};
  const double begin = tracker::monotonic_seconds();
  double time_s = 0;
  for (auto _ : state) {
    state.PauseTiming();
    time_s += 0.01;
    const std::string bytes = message_at(time_s);
    state.ResumeTiming();
    const tracker::IgtlHeader header = tracker::decode_header(bytes).value();
    board.take(tracker::decode(header, std::string_view(bytes).substr(tracker::IgtlHeader::size)).value(),
               begin + time_s);
    guidance::Poses now;
    now.tracker_from_tool = board.latest("tool", begin + time_s).value().tracker_from_tool;
    now.tracker_from_bone["femur"] = board.latest("femur", begin + time_s).value().tracker_from_tool;
    const guidance::ToolLine line = operation::tool_line("femur", "femur", xray_image, now, {}).value();
    for (const geometry::View& view : views) benchmark::DoNotOptimize(guidance::line_in_xray(view, line));
  }
}
BENCHMARK(message_to_lines_in_xrays)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace helicarm
