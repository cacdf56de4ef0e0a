// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/outcome.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/xray/view_of.h"

namespace helicarm::pipeline {
namespace {

std::size_t index_of(const std::vector<PointResult>& points, const std::string& name) {
  return static_cast<std::size_t>(std::ranges::find(points, name, &PointResult::name) - points.begin());
}

std::optional<guidance::LineError> error_at(const PointResult& point,
                                            const std::vector<geometry::View>& views,
                                            const guidance::ToolLine& line) {
  if (!point.place) return std::nullopt;
  guidance::PlannedPoint planned{point.place->in_calibrator, {}};
  for (const auto& seen : point.seen)
    planned.uv.push_back(seen ? std::optional<Eigen::Vector2d>(seen->uv) : std::nullopt);
  return value_or_throw(guidance::distance_to_line(views, planned, line));
}

/// 95 % error of a point by that of the calibrator's scale, along the line from its middle.
double scale_error_95_mm(const phantom::Calibrator& calibrator, const Eigen::Vector3d& point_in_calibrator) {
  if (calibrator.scale_sigma == 0) return 0;
  return normal_at_975 * calibrator.scale_sigma *
         (point_in_calibrator - phantom::middle_of(calibrator)).norm();
}

}  // namespace

localization::Accuracy measure_accuracy(const phantom::Calibrator& calibrator,
                                        const calibration::CalibrationResult& calibration,
                                        const std::vector<PointResult>& points) {
  localization::Accuracy accuracy{localization::fiducial_localization_error(calibration),
                                  localization::fiducial_registration_error(calibration),
                                  {},
                                  {}};
  std::vector<double> errors;
  for (const phantom::CalibratorTarget& target : calibrator.targets) {
    const PointResult& point = points[index_of(points, target.name)];
    if (!point.place) continue;
    const Eigen::Matrix3d& covariance = point.place->covariance_in_calibrator;
    errors.push_back((point.place->in_calibrator - target.point_in_calibrator).norm());  // Eq. 12
    accuracy.targets.push_back(
        {target.name, errors.back(), std::sqrt(covariance.trace()), localization::length_at_95(covariance)});
  }
  accuracy.tre_mm = localization::statistics_of(errors);
  return accuracy;
}

std::vector<TunnelEnds> tunnel_ends(const std::vector<CaseTunnel>& plans,
                                    const std::vector<PointResult>& points) {
  std::vector<TunnelEnds> ends;
  for (const CaseTunnel& plan : plans)
    ends.push_back({index_of(points, plan.start), index_of(points, plan.end)});
  return ends;
}

Expected<std::vector<guidance::Tunnel>> plan_tunnels(const Case& the_case, const Result& result) {
  const std::vector<CaseTunnel>& plans = the_case.tunnels;
  return guarded([&] {
    std::vector<guidance::Tunnel> tunnels;
    for (std::size_t i = 0; i < plans.size(); ++i) {
      const auto& start = result.points[result.tunnel_ends[i].start].place;
      const auto& end = result.points[result.tunnel_ends[i].end].place;
      tunnels.push_back(start && end
                            ? value_or_throw(guidance::plan_tunnel(
                                  plans[i].name, *start, *end, joint_covariance(result), the_case.tracker))
                            : guidance::Tunnel{plans[i].name, {}, {}, {}, {}});
    }
    return tunnels;
  });
}

Expected<std::vector<guidance::Verification>> verify_tool_lines(const Case& the_case, const Result& result) {
  return guarded([&] {
    std::vector<guidance::Verification> verifications;
    for (const guidance::ToolLine& line : the_case.tool_lines) {
      const auto plan =
          std::ranges::find(the_case.tunnels, line.tunnel, &CaseTunnel::name) - the_case.tunnels.begin();
      const TunnelEnds& ends = result.tunnel_ends[static_cast<std::size_t>(plan)];
      const auto error_of = [&](std::size_t end) {
        const PointResult& point = result.points[end];
        return error_at(point, views_of_bone(result, point.moves_with), line);
      };
      verifications.push_back({line.name, error_of(ends.start), error_of(ends.end)});
    }
    return verifications;
  });
}

std::vector<Warning> lines_off_plan(const std::vector<guidance::Verification>& verifications) {
  std::vector<Warning> warnings;
  for (const guidance::Verification& line : verifications) {
    const auto distance_mm = [](const std::optional<guidance::LineError>& end) {
      return end ? end->distance_mm : 0;
    };
    const double off_mm = std::max(distance_mm(line.start), distance_mm(line.end));
    if (off_mm <= guidance::most_off_plan_mm) continue;
    warnings.push_back(
        {Reason::off_target,
         fmt::format(
             "tool line \"{}\" passes the {} of its tunnel at {:.2f} mm, limit {:g} mm: the tunnel is "
             "not where it was planned",
             line.name, off_mm == distance_mm(line.start) ? "start" : "end", off_mm,
             guidance::most_off_plan_mm),
         {},
         {{"distance_mm", off_mm}, {"limit_mm", guidance::most_off_plan_mm}}});
  }
  return warnings;
}

Expected<void> check_picks_agree(const std::vector<PointResult>& points,
                                 const calibration::CalibrationResult& calibration) {
  constexpr std::size_t least_picks = 2;
  std::vector<double> gaps;
  std::size_t missed = 0;
  for (const PointResult& point : points)
    if (point.place && point.source == localization::PointSource::pick) {
      gaps.push_back(point.ray_gap_mm);
      missed += point.rays_miss;
    }
  if (!calibration.contradicts_calibrator || gaps.size() < least_picks || missed < gaps.size()) return {};
  const auto [least, largest] = std::ranges::minmax(gaps);
  return fail(
      Reason::calibrator_mismatch,
      fmt::format("every picked point contradicts the calibration (ray gaps of {:.3g} to {:.3g} mm), and the "
                  "fiducials deviate from the calibrator's file: the case names another calibrator than the "
                  "one in the images, or its file is wrong",
                  least, largest),
      {{"picks", double(gaps.size())}, {"least_gap_mm", least}, {"largest_gap_mm", largest}});
}

std::optional<double> tunnel_end_error_in_tool(const Result& result, const std::string& tunnel, bool start) {
  const auto found =
      std::ranges::find(result.tunnels, tunnel, &guidance::Tunnel::name) - result.tunnels.begin();
  if (std::size_t(found) >= result.tunnel_ends.size()) return {};
  const TunnelEnds& ends = result.tunnel_ends[std::size_t(found)];
  const auto& located = result.points[start ? ends.start : ends.end].place;
  if (!located || !located->in_tool) return {};
  return localization::length_at_95(located->in_tool->covariance);
}

std::vector<Warning> reused_uids(const std::vector<ViewResult>& views) {
  std::vector<Warning> warnings;
  const auto uid_of = [](const ViewResult& view) {
    return view.xray_image ? view.xray_image->acquisition.uid_key : std::string();
  };
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (const std::string uid = uid_of(views[i]);
          !uid.empty() && uid == uid_of(views[j]) &&
          views[i].xray_image->acquisition.instance_key != views[j].xray_image->acquisition.instance_key)
        warnings.push_back({Reason::uid_reused,
                            fmt::format("{} and {} differ, but have the same SOP Instance UID (0008,0018)",
                                        views[j].name, views[i].name)});
  return warnings;
}

std::vector<Warning> exchanged_views(const std::vector<ViewResult>& views) {
  std::vector<std::string> names;
  for (const ViewResult& view : views) names.push_back(view.name);
  std::vector<Warning> warnings;
  for (const ViewResult& view : views) {
    if (!view.xray_image) continue;
    const std::string other = xray::view_of(view.xray_image->acquisition, view.name, names);
    if (other == view.name) continue;
    const double angle = *view.xray_image->acquisition.primary_angle_deg;
    warnings.push_back(
        {Reason::tag_disagrees,
         fmt::format("the positioner's primary angle (0018,1510) is {:g} degrees, as of a view {}: check "
                     "whether the images of {} and {} are exchanged",
                     angle, other, view.name, other),
         view.name,
         {{"primary_angle_deg", angle}}});
  }
  return warnings;
}

std::vector<Warning> diagnose(const Case& the_case, const Result& result) {
  const phantom::Calibrator& calibrator = the_case.calibrator;
  constexpr double largest_ratio = 3;
  std::vector<Warning> warnings;
  for (const localization::TargetError& target : result.accuracy.targets)
    if (target.error_mm > largest_ratio * target.predicted_95_mm)
      warnings.push_back(
          {Reason::residual_too_large,
           fmt::format(
               "the error of check target \"{}\" is {:.3g} mm, its 95 % bound {:.3g} mm: the calibrator "
               "differs from its file",
               target.name, target.error_mm, target.predicted_95_mm),
           {},
           {{"error_mm", target.error_mm}, {"predicted_95_mm", target.predicted_95_mm}}});
  for (std::size_t k = 0; k < calibrator.balls.size(); ++k) {
    const auto rejected = std::ranges::count_if(result.views, [&](const ViewResult& view) {
      return view.found->fiducials[k].status == fiducials::FiducialStatus::rejected;
    });
    if (rejected > 1)
      warnings.push_back(
          {Reason::residual_too_large,
           fmt::format("fiducial {} is rejected in {} views: check its coordinates in the calibrator's file",
                       calibrator.balls[k].label, rejected),
           {},
           {{"views", double(rejected)}}});
  }
  return warnings;
}

Expected<std::vector<Warning>> check_certain(const std::vector<PointResult>& points,
                                             std::optional<double> max_error_mm,
                                             const phantom::Calibrator& calibrator) {
  constexpr double default_limit_mm = 2;
  const double limit = max_error_mm.value_or(default_limit_mm);
  std::vector<Warning> warnings;
  for (const PointResult& point : points) {
    if (!point.place) continue;
    const auto& in_tool = point.place->in_tool;
    double error = localization::length_at_95(point.place->covariance_in_calibrator);
    const bool worse_in_tool = in_tool && localization::length_at_95(in_tool->covariance) > error;
    if (worse_in_tool) error = localization::length_at_95(in_tool->covariance);
    if (error <= limit) continue;
    std::string message = fmt::format("the 95 % error of \"{}\"{} is {:.3g} mm, over the limit of {:g} mm",
                                      point.name, worse_in_tool ? " in the tool's frame" : "", error, limit);
    std::map<std::string, double> figures{{"error_95_mm", error}, {"limit_mm", limit}};
    const double by_scale_mm = scale_error_95_mm(calibrator, point.place->in_calibrator);
    if (constexpr double most = 0.7; by_scale_mm > most * error) {
      figures["by_scale_sigma_mm"] = by_scale_mm;
      message += fmt::format(
          "; {:.3g} mm of it are the calibrator's scale_sigma of {:.2g} %: measure a distance between two of "
          "its "
          "fiducials, and the calibrator with `helicarm phantom measure --distance`",
          std::min(by_scale_mm, error), 100 * calibrator.scale_sigma);
    }
    if (max_error_mm) return fail(Reason::uncertain, message, figures);
    warnings.push_back({Reason::uncertain, message, {}, figures});
  }
  return warnings;
}

}  // namespace helicarm::pipeline
