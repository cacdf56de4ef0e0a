// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/marks.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "helicarm/guidance/image_line.h"

namespace helicarm::report {
namespace {

using Eigen::Vector2d;

std::vector<DotMark> rectified_dots(const rectification::DistortionMap& map,
                                    const std::vector<detection::Dot>& dots) {
  std::vector<DotMark> marks;
  for (const detection::Dot& dot : dots)
    if (const auto at = map.rectified_from_raw(dot.centre_px)) marks.push_back({*at, dot.radius_px});
  return marks;
}

std::vector<BallMark> balls_of(const pipeline::ViewResult& view, bool refused) {
  std::vector<BallMark> marks;
  for (const fiducials::Fiducial& fiducial : view.found->fiducials) {
    const bool used = fiducial.status == fiducials::FiducialStatus::used;
    if (!used && fiducial.status != fiducials::FiducialStatus::rejected) continue;
    BallMark ball{fiducial.label, fiducial.uv, used, fiducial.sigma_px};
    if (view.calibrated)
      ball.residual = fiducial.uv - view.calibrated->view.project(fiducial.centre_in_calibrator);
    else if (refused)
      ball.residual = fiducial.uv - view.found->view.project(fiducial.centre_in_calibrator);
    marks.push_back(std::move(ball));
  }
  return marks;
}

std::vector<PointMark> points_of(const pipeline::Result& result, std::size_t view) {
  std::vector<PointMark> marks;
  for (const pipeline::PointResult& point : result.points)
    if (const auto& seen = point.seen[view]) {
      PointMark mark{point.name, seen->uv, point.source};
      if (point.place) mark.error_95_mm = localization::length_at_95(point.place->covariance_in_calibrator);
      if (point.reason) mark.reason = point.reason->message;
      marks.push_back(std::move(mark));
    }
  return marks;
}

/// That the line's tunnel moves with, if it is known.
std::optional<guidance::Bone> bone_of(const guidance::ToolLine& line, const pipeline::Result& result) {
  const auto tunnel = std::ranges::find(result.tunnels, line.tunnel, &guidance::Tunnel::name);
  if (tunnel == result.tunnels.end()) return std::nullopt;
  return result.points[result.tunnel_ends[std::size_t(tunnel - result.tunnels.begin())].start].moves_with;
}

void add_lines(ViewMarks& marks, const pipeline::Result& result, std::size_t view) {
  for (const auto& [start, end] : result.tunnel_ends) {
    const auto &from = result.points[start].seen[view], &to = result.points[end].seen[view];
    if (from && to) marks.tunnels.push_back({from->uv, to->uv});
  }
  for (const guidance::ToolLine& tool : result.tool_lines)
    if (const auto line =
            guidance::line_in_xray(pipeline::view_of_bone(result, view, bone_of(tool, result)), tool)) {
      const Vector2d beyond = 3 * (line->tip - line->back);
      marks.tool_lines.push_back({line->back - beyond, line->tip + beyond});
    }
}

template <class Mark>
void carry(std::vector<Mark>& marks, const rectification::DistortionMap& map) {
  for (Mark& mark : marks) mark.place = map.raw_from_rectified(mark.place);
}

std::vector<rectification::PixelPath> carried(const std::vector<rectification::PixelPath>& paths,
                                              const rectification::DistortionMap& map) {
  std::vector<rectification::PixelPath> raw;
  for (const rectification::PixelPath& path : paths)
    std::ranges::move(rectification::raw_paths(map, path), std::back_inserter(raw));
  return raw;
}

}  // namespace

ViewMarks marks_of(const pipeline::Result& result, std::size_t index) {
  const pipeline::ViewResult& view = result.views[index];
  ViewMarks marks;
  if (view.rectification)
    marks.plate_dots = rectified_dots(view.rectification->map, view.rectification->plate_dots);
  if (view.rectification && view.found)
    marks.false_blobs = rectified_dots(view.rectification->map, view.found->false_blobs);
  if (view.found) marks.balls = balls_of(view, result.failure.has_value());
  if (view.rectification && !view.found) {
    marks.candidates = rectified_dots(view.rectification->map, pipeline::unlabelled_candidates(view));
    for (const fiducials::GuessedLabel& guess : view.guessed)
      marks.guessed.push_back(
          {fmt::format("{}? {:.1f} px", guess.label, guess.residual_px), guess.uv, false});
  }
  marks.points = points_of(result, index);
  if (view.calibrated) add_lines(marks, result, index);
  return marks;
}

ViewMarks raw_marks(const ViewMarks& rectified, const rectification::DistortionMap& map) {
  ViewMarks raw = rectified;
  for (BallMark& ball : raw.balls)
    if (ball.residual)
      ball.residual =
          map.raw_from_rectified(ball.place) - map.raw_from_rectified(ball.place - *ball.residual);
  carry(raw.balls, map);
  carry(raw.plate_dots, map);
  carry(raw.false_blobs, map);
  carry(raw.candidates, map);
  carry(raw.guessed, map);
  carry(raw.points, map);
  raw.tunnels = carried(rectified.tunnels, map);
  raw.tool_lines = carried(rectified.tool_lines, map);
  return raw;
}

double largest_residual(const ViewMarks& marks) {
  double largest = 0;
  for (const BallMark& ball : marks.balls)
    if (ball.used && ball.residual) largest = std::max(largest, ball.residual->norm());
  return largest;
}

}  // namespace helicarm::report
