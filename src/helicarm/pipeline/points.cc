// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/points.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/fiducials/paper_circles.h"
#include "helicarm/pipeline/middle.h"

namespace helicarm::pipeline {
namespace {

constexpr double least_sigma_px = 0.01;  ///< of an exact pick among other rays

double radius_px(double diameter_mm, const geometry::View& camera, const Eigen::Vector3d& position) {
  return 0.5 * diameter_mm * std::abs(camera.intrinsics.fy) / camera.depth(position);
}

Expected<fiducials::ImagePoint> ball_at(const Pick& pick, const xray::XrayImage& image,
                                        const rectification::DistortionMap& map,
                                        const detection::NoiseCorrelation& noise,
                                        const calibration::CalibratedView& calibrated,
                                        const Eigen::Vector3d& centre) {
  const geometry::View& camera = calibrated.view;
  if (!calibrated.by_paper)
    return fiducials::snap_to_ball(image, map, camera, camera.depth(centre), pick.uv_raw, pick.diameter_mm,
                                   noise);
  return fiducials::point_of_click(map, pick.uv_raw, 0).and_then([&](const fiducials::ImagePoint& click) {
    return fiducials::circle_near(image, map, click.uv, radius_px(pick.diameter_mm, camera, centre));
  });
}

}  // namespace

Expected<fiducials::ImagePoint> observe_pick(const Pick& pick, const xray::XrayImage& image,
                                             const rectification::DistortionMap& map,
                                             const detection::NoiseCorrelation& noise,
                                             const calibration::CalibratedView& calibrated,
                                             const Eigen::Vector3d& centre) {
  if (pick.snap == Snap::ball) {
    auto seen = ball_at(pick, image, map, noise, calibrated, centre);
    if (seen && pick.sigma_px) seen->sigma_px = *pick.sigma_px;
    return seen;
  }
  return fiducials::point_of_click(map, pick.uv_raw, pick.sigma_px);
}

namespace {

void check_inside(const Pick& pick, const rectification::DistortionMap& map) {
  if (!map.shows(pick.uv_raw))
    throw BadInput({Reason::bad_value,
                    fmt::format("case.json: pick \"{}\": {:g}, {:g} lies outside the image of {} x {} pixels",
                                pick.name, pick.uv_raw.x(), pick.uv_raw.y(), map.width, map.height),
                    pick.view,
                    {}});
}

/// The images of plate dots and fiducials, to be left out of a target's fit.
std::vector<detection::Disc> detections_of(const LabelledView& image, const geometry::View& camera,
                                           const std::vector<fiducials::Fiducial>& fiducials,
                                           const phantom::Calibrator& calibrator) {
  constexpr double rim_share = 0.1;  // of the radius: the blur of the ball's edge
  constexpr double rim_px = 1.5;     // of a plate's dot
  std::vector<detection::Disc> discs;
  for (const detection::Dot& dot : image.rectification.plate_dots)
    discs.push_back({dot.centre_px, dot.radius_px + rim_px});
  for (std::size_t k = 0; k < fiducials.size(); ++k)
    if (const fiducials::Fiducial& ball = fiducials[k]; ball.status == fiducials::FiducialStatus::used) {
      const double px_per_mm = std::abs(camera.intrinsics.fy) / camera.depth(ball.centre_in_calibrator);
      discs.push_back({ball.uv_raw, (1 + rim_share) * 0.5 * calibrator.balls[k].diameter_mm * px_per_mm});
    }
  return discs;
}

Expected<fiducials::ImagePoint> observe_target(const phantom::CalibratorTarget& target,
                                               const LabelledView& image,
                                               const calibration::CalibratedView& calibrated,
                                               const std::vector<fiducials::Fiducial>& fiducials,
                                               const phantom::Calibrator& calibrator) {
  const rectification::DistortionMap& map = image.rectification.map;
  const geometry::View& camera = calibrated.view;
  const Eigen::Vector3d& position = target.point_in_calibrator;
  if (calibrated.by_paper && target.kind == phantom::TargetKind::ball && camera.depth(position) > 0)
    return fiducials::circle_near(*image.xray_image, map, camera.project(position),
                                  radius_px(target.diameter_mm, camera, position));
  return fiducials::find_target(*image.xray_image, map, camera, target,
                                detections_of(image, camera, fiducials, calibrator), image.dots.noise);
}

/// A pick or a target in one view.
struct Task {
  std::size_t point;
  std::size_t view;
  const Pick* pick;                         ///< either this
  const phantom::CalibratorTarget* target;  ///< or this
};

std::vector<Task> tasks_of(const Case& the_case, std::vector<PointResult>& points) {
  const std::size_t views = the_case.views.size();
  const auto add = [&](const std::string& name, localization::PointSource source,
                       std::optional<guidance::Bone> moves_with) {
    points.push_back(
        {name, source, moves_with, std::vector<std::optional<fiducials::ImagePoint>>(views), {}, 0, {}});
    return points.size() - 1;
  };
  std::vector<Task> tasks;
  std::map<std::string, std::size_t> index;
  for (const Pick& pick : the_case.picks) {
    if (!index.contains(pick.name))
      index[pick.name] = add(pick.name, localization::PointSource::pick, pick.moves_with);
    const auto view = std::ranges::find(the_case.views, pick.view, &CaseView::name) - the_case.views.begin();
    tasks.push_back({index[pick.name], static_cast<std::size_t>(view), &pick, nullptr});
  }
  for (const phantom::CalibratorTarget& target : the_case.calibrator.targets) {
    const std::size_t point = add(target.name, localization::PointSource::target, {});
    for (std::size_t view = 0; view < views; ++view) tasks.push_back({point, view, nullptr, &target});
  }
  return tasks;
}

void add_warning(PointResult& point, std::vector<Warning>& warnings, const Warning& warning) {
  point.warnings.push_back(warning);
  warnings.push_back(warning);
}

struct Located {
  localization::LocatedPoint point;
  std::optional<guidance::Bone> anchor;
  std::vector<guidance::DatedView> views;
};

/// The bone in whose frame the rays intersect; nothing if there is none or a pose is missing.
std::optional<guidance::Bone> anchor_of(const PointResult& point, const Case& the_case) {
  if (!point.moves_with) return std::nullopt;
  for (std::size_t i = 0; i < point.seen.size(); ++i)
    if (point.seen[i] && !guidance::calibrator_from(*point.moves_with, the_case.views[i].poses))
      return std::nullopt;
  return point.moves_with;
}

/// Check targets are fixed to the calibrator; a tracked bone's motion is in its poses.
bool may_move(const PointResult& point, std::optional<guidance::Bone> anchor) {
  return point.source == localization::PointSource::pick && !anchor;
}

Expected<Located> intersect_rays(const PointResult& point, const Case& the_case,
                                 const calibration::Calibration& calibration, double motion_sigma_mm) {
  const auto anchor = anchor_of(point, the_case);
  const double motion = may_move(point, anchor) ? motion_sigma_mm : 0;
  std::vector<localization::PointObservation> observations;
  std::vector<guidance::DatedView> views;
  for (std::size_t i = 0; i < point.seen.size(); ++i) {
    if (!point.seen[i]) continue;
    const guidance::Poses& poses = the_case.views[i].poses;
    const double sigma = point.seen[i]->sigma_px;
    observations.push_back(
        {i, point.seen[i]->uv, sigma * sigma * Eigen::Matrix2d::Identity(),
         anchor ? *guidance::calibrator_from(*anchor, poses) : geometry::RigidTransform{}});
    views.push_back({calibration.views[i].view, poses, std::max(sigma, least_sigma_px)});
  }
  auto located = localization::locate(point.name, point.source, observations, calibration, motion);
  // Independent tracker samples displace each ray independently, shared ones all rays equally.
  if (located && anchor && the_case.tracker.samples == guidance::Samples::independent) {
    for (localization::PointObservation& observation : observations)
      observation.anchor_covariance = guidance::noise_of_poses(
          located->point_in_anchor, *anchor, the_case.views[observation.view].poses, the_case.tracker);
    located = localization::locate(point.name, point.source, observations, calibration);
  }
  return located.map([&](const localization::LocatedPoint& found) { return Located{found, anchor, views}; });
}

}  // namespace

Expected<std::vector<PointResult>> observe_points(const Case& the_case, const CaseCalibration& calibration,
                                                  unsigned threads) {
  std::vector<PointResult> points;
  const std::vector<Task> tasks = tasks_of(the_case, points);
  const Eigen::Vector3d centre = middle_of(the_case.calibrator, calibration);
  std::vector<std::optional<Failure>> failures(tasks.size());
  const auto done = guarded([&] {
    for (const Task& task : tasks)
      if (task.pick) check_inside(*task.pick, calibration.images[task.view].rectification.map);
  });
  if (!done) return tl::unexpected<Failure>(done.error());
  parallel_for(tasks.size(), threads, [&](std::size_t i) {
    const Task& task = tasks[i];
    const LabelledView& image = calibration.images[task.view];
    const calibration::CalibratedView& view = calibration.views[task.view];
    const auto seen = task.pick ? observe_pick(*task.pick, *image.xray_image, image.rectification.map,
                                               image.dots.noise, view, centre)
                                : observe_target(*task.target, image, view, calibration.fiducials[task.view],
                                                 the_case.calibrator);
    if (seen)
      points[task.point].seen[task.view] = *seen;
    else
      failures[i] = seen.error();
  });
  for (std::size_t i = 0; i < tasks.size(); ++i)
    if (failures[i] && !points[tasks[i].point].reason) {
      points[tasks[i].point].reason = failures[i];
      points[tasks[i].point].reason->view = the_case.views[tasks[i].view].name;
    }
  return points;
}

std::vector<Warning> locate_points(const Case& the_case, const calibration::Calibration& calibration,
                                   std::vector<PointResult>& points, double motion_sigma_mm) {
  std::vector<Warning> warnings;
  for (PointResult& point : points) {
    auto located = intersect_rays(point, the_case, calibration, motion_sigma_mm);
    if (!located) {
      if (!point.reason) point.reason = located.error();
      continue;
    }
    point.reason.reset();
    if (located->point.missing_rays) add_warning(point, warnings, *located->point.missing_rays);
    point.rays_miss = located->point.missing_rays.has_value();
    point.ray_gap_mm = located->point.ray_gap_mm;
    point.place = guidance::guide(located->point, located->anchor, located->views, the_case.poses_now,
                                  the_case.tracker);
    if (point.moves_with && !located->anchor)
      add_warning(
          point, warnings,
          {Reason::bone_taken_as_fixed,
           fmt::format("\"{}\" moves with the {}, but poses of it or of the calibrator are missing: it "
                       "is taken as fixed to the calibrator",
                       point.name, *point.moves_with),
           {},
           {}});
  }
  return warnings;
}

std::vector<Warning> note_motion(const Case& the_case, const calibration::Calibration& calibration,
                                 std::vector<PointResult>& points, double motion_sigma_mm) {
  std::vector<Warning> notes;
  for (PointResult& point : points) {
    if (!point.place || !may_move(point, anchor_of(point, the_case))) continue;
    const auto first = std::ranges::find_if(point.seen, [](const auto& seen) { return seen.has_value(); });
    point.notes.push_back(localization::unobservable_motion(
        point.name, point.place->in_calibrator, calibration.views[std::size_t(first - point.seen.begin())],
        motion_sigma_mm));
    notes.push_back(point.notes.back());
  }
  return notes;
}

std::vector<Warning> picks_on_fiducials(const Case& the_case, const calibration::Calibration& calibration,
                                        std::vector<PointResult>& points) {
  std::vector<Warning> warnings;
  for (PointResult& point : points) {
    if (point.source != localization::PointSource::pick || !point.place) continue;
    std::vector<localization::PointObservation> observations;
    for (std::size_t i = 0; i < point.seen.size(); ++i)
      if (point.seen[i]) observations.push_back({i, point.seen[i]->uv, Eigen::Matrix2d::Zero()});
    const auto warning = localization::pick_on_fiducial(point.name, observations, calibration,
                                                        the_case.calibrator.balls, point.rays_miss);
    if (!warning) continue;
    add_warning(point, warnings, *warning);
    point.reason = warning;
    point.place.reset();
  }
  return warnings;
}

}  // namespace helicarm::pipeline
