// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/camera_case.h"

#include <algorithm>
#include <limits>

#include <fmt/ranges.h>

#include "helicarm/case_registration/load.h"
#include "helicarm/pipeline/outcome.h"
#include "helicarm/pipeline/points.h"
#include "helicarm/registration/register_model.h"

namespace helicarm::case_registration {
namespace {

using pipeline::CaseCalibration;
using pipeline::PointResult;
using pipeline::Result;
using pipeline::Stage;

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

void append(std::vector<pipeline::Finding>& findings, const std::vector<Warning>& more, Stage stage) {
  for (const Warning& warning : more) findings.push_back({warning, stage});
}

Result with_views(const pipeline::Case& the_case, std::shared_ptr<const CaseCalibration> cameras,
                  const pipeline::RunOptions& options) {
  Result result;
  result.options = options;
  result.bones = the_case.bones;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < cameras->views.size(); ++i) {
    pipeline::ViewResult& view = result.views.emplace_back(pipeline::reported(cameras->images[i]));
    view.found.reset();  // no fiducials are looked for
    view.calibrated = cameras->views[i];
    names.push_back(cameras->views[i].name);
  }
  append(result.warnings, the_case.warnings, Stage::read);
  append(result.warnings, cameras->warnings, Stage::read);
  append(result.warnings,
         {registration::cameras_without_covariance(fmt::format("{}", fmt::join(names, ", ")))},
         Stage::calibrate);
  result.calibration = std::move(cameras);
  return result;
}

void forget_errors(guidance::PointInFrames& place) {
  const auto forget = [](guidance::Place& in_frame) {
    in_frame.covariance.setConstant(unknown);
    in_frame.propagated.covariance.setConstant(unknown);
  };
  place.covariance_in_calibrator.setConstant(unknown);
  for (auto& [bone, in_bone] : place.in_bones) forget(in_bone);
  if (place.in_tool) forget(*place.in_tool);
}

Warning errors_unknown(const PointResult& point, const CaseCalibration& cameras) {
  localization::LocatedPoint located;
  located.name = point.name;
  located.ray_gap_mm = point.ray_gap_mm;
  std::vector<localization::PointObservation> seen;
  for (std::size_t i = 0; i < point.seen.size(); ++i)
    if (point.seen[i]) seen.push_back({i, point.seen[i]->uv, Eigen::Matrix2d::Zero()});
  return *localization::covariance_missing(located, seen, cameras);
}

/// Points whose rays meet do not vouch for cameras by which most others' miss, as
/// `localization::inflate_if_views_contradict`.
void warn_if_views_contradict(Result& result) {
  const auto located =
      std::ranges::count_if(result.points, [](const PointResult& point) { return point.place.has_value(); });
  const auto missing = std::ranges::count_if(result.points, &PointResult::rays_miss);
  if (2 * missing <= located) return;
  for (PointResult& point : result.points) {
    if (!point.place || point.rays_miss) continue;
    point.warnings.push_back(
        {Reason::residual_too_large,
         fmt::format("\"{}\": the rays of {} of {} points miss each other by more than their errors explain: "
                     "the cameras contradict each other, or the picks are wrong",
                     point.name, missing, located),
         {},
         {{"ray_gap_mm", point.ray_gap_mm}, {"missing", double(missing)}}});
    append(result.warnings, {point.warnings.back()}, Stage::locate);
  }
}

void add_points(const pipeline::Case& the_case, const pipeline::RunOptions& options, Result& result) {
  const CaseCalibration& cameras = *result.calibration;
  result.points = value_or_throw(pipeline::observe_points(the_case, cameras, options.threads));
  append(result.warnings, pipeline::locate_points(the_case, cameras, result.points, options.motion_sigma_mm),
         Stage::locate);
  append(result.notes, pipeline::note_motion(the_case, cameras, result.points, options.motion_sigma_mm),
         Stage::locate);
  for (PointResult& point : result.points) {
    if (!point.place) continue;
    forget_errors(*point.place);
    point.warnings.push_back(errors_unknown(point, cameras));
    append(result.warnings, {point.warnings.back()}, Stage::locate);
  }
  warn_if_views_contradict(result);
}

void add_tunnels(const pipeline::Case& the_case, Result& result) {
  result.tunnel_ends = pipeline::tunnel_ends(the_case.tunnels, result.points);
  auto tunnels = pipeline::plan_tunnels(the_case, result);
  if (!tunnels) {  // which does not keep models from being registered
    append(result.warnings, {tunnels.error()}, Stage::locate);
    return;
  }
  result.tunnels = *std::move(tunnels);
  for (guidance::Tunnel& tunnel : result.tunnels) {
    if (tunnel.axis_covariance) tunnel.axis_covariance->setConstant(unknown);
    if (tunnel.length_sigma_mm) tunnel.length_sigma_mm = unknown;
  }
}

}  // namespace

Expected<Result> measure_with_cameras(const std::optional<Result>& earlier, const pipeline::Case& the_case,
                                      const pipeline::RunOptions& options) {
  return guarded([&] {
    auto cameras =
        earlier ? earlier->calibration
                : std::make_shared<const CaseCalibration>(value_or_throw(calibration_of_cameras(the_case)));
    Result result = with_views(the_case, std::move(cameras), options);
    add_points(the_case, options, result);
    add_tunnels(the_case, result);
    if (!the_case.tool_lines.empty())
      append(result.notes,
             {{Reason::unsupported, "tool_lines: are compared in cases with a calibrator alone", {}, {}}},
             Stage::locate);
    return result;
  });
}

}  // namespace helicarm::case_registration
