// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/diagnosis/displaced_balls.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/detection/find_dots.h"
#include "helicarm/fiducials/candidates.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm::pipeline {
namespace {

using Eigen::Vector3d;

constexpr double displaced_reach_mm = 6;  // search radius around a fiducial's coordinates
constexpr double displaced_gap_mm = 0.4;  // ray gap of a displaced fiducial
constexpr double same_place_mm = 0.5;
constexpr double same_diameter = 0.08;  // of ln diameter: edge model and tolerance

/// Position of a displaced fiducial, from unlabelled candidates near its projections in two views.
struct DisplacedBall {
  Vector3d place;
  double gap_mm;
};

std::optional<DisplacedBall> displaced_ball(const CaseCalibration& calibration,
                                            const std::vector<LabelledView>& images,
                                            const phantom::CalibratorBall& ball) {
  struct Near {
    std::size_t view;
    Eigen::Vector2d uv;
  };
  std::vector<Near> near;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const geometry::View& view = calibration.views[i].view;
    const double per_mm = view.intrinsics.fy / view.depth(ball.centre_in_calibrator);
    const Eigen::Vector2d expected = view.project(ball.centre_in_calibrator);
    for (const detection::Dot& dot : images[i].fiducials.false_blobs) {
      const auto uv = images[i].rectification.map.rectified_from_raw(dot.centre_px);
      if (uv && (*uv - expected).norm() < displaced_reach_mm * per_mm) near.push_back({i, *uv});
    }
  }
  std::optional<DisplacedBall> best;
  for (const Near& a : near)
    for (const Near& b : near) {
      if (a.view >= b.view) continue;
      const std::array<geometry::RayObservation, 2> ray_observations{
          geometry::RayObservation{calibration.views[a.view].view, a.uv},
          geometry::RayObservation{calibration.views[b.view].view, b.uv}};
      const auto met = geometry::intersect(ray_observations, Eigen::MatrixXd::Identity(4, 4));
      if (!met || met->ray_gap_mm > displaced_gap_mm) continue;
      if ((met->point - ball.centre_in_calibrator).norm() > displaced_reach_mm) continue;
      if (!best || met->ray_gap_mm < best->gap_mm) best = DisplacedBall{met->point, met->ray_gap_mm};
    }
  return best;
}

/// Diameter of the unlabelled ball at a fiducial's place, mean of all views; nothing unless two show one.
std::optional<double> diameter_at(const CaseCalibration& calibration, const std::vector<LabelledView>& images,
                                  const phantom::CalibratorBall& ball) {
  double sum_mm = 0;
  int count = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const geometry::View& view = calibration.views[i].view;
    const double per_mm = view.intrinsics.fy / view.depth(ball.centre_in_calibrator);
    const Eigen::Vector2d expected = view.project(ball.centre_in_calibrator);
    const rectification::DistortionMap& map = images[i].rectification.map;
    for (const detection::Dot& dot : images[i].fiducials.false_blobs) {
      const auto uv = map.rectified_from_raw(dot.centre_px);
      if (!uv || (*uv - expected).norm() > same_place_mm * per_mm) continue;
      sum_mm += 2 * dot.radius_px / std::sqrt(std::abs(map.jacobian(*uv).determinant())) / per_mm;
      ++count;
    }
  }
  return count >= 2 ? std::optional(sum_mm / count) : std::nullopt;
}

Warning exchanged(const phantom::CalibratorBall& a, const phantom::CalibratorBall& b, double at_a_mm,
                  double at_b_mm) {
  return {Reason::ball_displaced,
          fmt::format("{} and {} look exchanged in the calibrator's file: at {}'s position lies a ball of "
                      "{:.2g} mm, at {}'s one of {:.2g} mm. They are not used; correct the file",
                      a.label, b.label, a.label, at_a_mm, b.label, at_b_mm),
          {},
          {{"distance_mm", (a.centre_in_calibrator - b.centre_in_calibrator).norm()}}};
}

/// Pairs of unused fiducials at each of whose places lies a ball of the other's diameter; these are removed
/// from `unused`.
std::vector<Warning> exchanged_balls(const CaseCalibration& calibration,
                                     const std::vector<LabelledView>& images,
                                     const phantom::Calibrator& calibrator,
                                     std::vector<std::size_t>& unused) {
  const auto is_about = [](double measured_mm, double stated_mm) {
    return std::abs(std::log(measured_mm / stated_mm)) < same_diameter;
  };
  std::vector<std::optional<double>> at(calibrator.balls.size());
  for (const std::size_t k : unused) at[k] = diameter_at(calibration, images, calibrator.balls[k]);
  std::vector<Warning> warnings;
  for (const std::size_t j : std::vector(unused))
    for (const std::size_t k : std::vector(unused)) {
      const phantom::CalibratorBall &a = calibrator.balls[j], &b = calibrator.balls[k];
      if (j >= k || !at[j] || !at[k] || is_about(a.diameter_mm, b.diameter_mm)) continue;
      if (!is_about(*at[j], b.diameter_mm) || !is_about(*at[k], a.diameter_mm)) continue;
      warnings.push_back(exchanged(a, b, *at[j], *at[k]));
      std::erase_if(unused, [&](std::size_t one) { return one == j || one == k; });
      at[j].reset();
      at[k].reset();
    }
  return warnings;
}

/// Whether the ball's place is in the image, and no centre of a plate's dot or of these within `reach` radii.
bool is_free(const phantom::CalibratorBall& ball, const RectifiedView& image, const geometry::View& view,
             const std::vector<detection::Dot>& dots, double reach) {
  const rectification::Rectification& rectification = image.rectification;
  const Eigen::Vector2d raw = rectification.map.raw_from_rectified(view.project(ball.centre_in_calibrator));
  const double radius_px = ball.diameter_mm / 2 * view.intrinsics.fy / view.depth(ball.centre_in_calibrator);
  const auto is_near = [&](const detection::Dot& dot) {
    return (dot.centre_px - raw).norm() < reach * std::max(radius_px, dot.radius_px);
  };
  return rectification.map.shows(raw) && std::ranges::none_of(dots, is_near) &&
         std::ranges::none_of(rectification.plate_dots, is_near);
}

/// Whether nothing known covers the fiducial's place in two views, or in the only one, and in one of them no
/// disc lies there: in another an unlabelled one may, as where a coordinate along its rays is wrong.
bool is_in_no_view(const CaseCalibration& calibration, const std::vector<LabelledView>& images,
                   const phantom::CalibratorBall& ball, std::size_t k) {
  constexpr double reach = 1.5;  // radii: discs that touch look like one, within a radius of each
  std::size_t uncovered = 0, empty = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (calibration.fiducials[i][k].status != fiducials::FiducialStatus::not_found) continue;
    const geometry::View& view = calibration.views[i].view;
    const auto dots = fiducials::ball_candidates(images[i].dots, images[i].rectification);
    uncovered +=
        is_free(ball, images[i], view, detection::dots_except(dots, images[i].fiducials.false_blobs), reach);
    empty += is_free(ball, images[i], view, dots, reach);
  }
  return empty > 0 && uncovered >= std::min<std::size_t>(2, images.size());
}

/// Of a fiducial that the only view shows elsewhere: one view does not tell where along its ray.
std::optional<Warning> rejected_alone(const CaseCalibration& calibration, const phantom::CalibratorBall& ball,
                                      std::size_t k) {
  const fiducials::Fiducial& found = calibration.fiducials.front()[k];
  if (calibration.views.size() != 1 || found.status != fiducials::FiducialStatus::rejected)
    return std::nullopt;
  const geometry::View& view = calibration.views.front().view;
  const double off_mm = found.residual_px * view.depth(ball.centre_in_calibrator) / view.intrinsics.fy;
  if (off_mm < displaced_gap_mm) return std::nullopt;
  return Warning{
      Reason::ball_displaced,
      fmt::format("fiducial {} lies {:.2g} px, {:.2g} mm at its depth, from where the calibrator's file has "
                  "it: wrong coordinates, or something over it. It is not used; a second view, or "
                  "`helicarm phantom measure`, tells which",
                  ball.label, found.residual_px, off_mm),
      calibration.views.front().name,
      {{"residual_px", found.residual_px}, {"distance_mm", off_mm}}};
}

Warning of_absent(const std::vector<std::string>& labels) {
  const bool is_one = labels.size() == 1;
  return {
      Reason::not_seen,
      fmt::format("fiducial{} {} {} found in no view, although nothing covers the place where the "
                  "calibrator's file has {}: lost, or wrong coordinates. Compare the file with the "
                  "calibrator, or measure it with `helicarm phantom measure`",
                  is_one ? "" : "s", fmt::join(labels, ", "), is_one ? "is" : "are", is_one ? "it" : "them"),
      {},
      {{"balls", double(labels.size())}}};
}

}  // namespace

bool is_absent(const phantom::CalibratorBall& ball, const RectifiedView& image, const geometry::View& view) {
  return is_free(ball, image, view, fiducials::ball_candidates(image.dots, image.rectification), 2);
}

std::vector<Warning> displaced_balls(const CaseCalibration& calibration,
                                     const std::vector<LabelledView>& images,
                                     const phantom::Calibrator& calibrator) {
  std::vector<std::size_t> unused;
  for (std::size_t k = 0; k < calibrator.balls.size(); ++k)
    if (std::ranges::none_of(calibration.fiducials, [&](const auto& of_view) {
          return of_view[k].status == fiducials::FiducialStatus::used;
        }))
      unused.push_back(k);
  std::vector<Warning> warnings = exchanged_balls(calibration, images, calibrator, unused);
  std::vector<std::string> absent;
  for (const std::size_t k : unused) {
    const phantom::CalibratorBall& ball = calibrator.balls[k];
    const auto seen = displaced_ball(calibration, images, ball);
    if (!seen) {
      if (auto rejected = rejected_alone(calibration, ball, k)) warnings.push_back(*std::move(rejected));
      if (is_in_no_view(calibration, images, ball, k)) absent.push_back(ball.label);
      continue;
    }
    const double off = (seen->place - ball.centre_in_calibrator).norm();
    warnings.push_back(
        {Reason::ball_displaced,
         fmt::format("fiducial {} is displaced by {:.2g} mm from the calibrator's file, to ({:.2f}, {:.2f}, "
                     "{:.2f}). It is not used; measure the calibrator with `helicarm phantom measure`",
                     ball.label, off, seen->place.x(), seen->place.y(), seen->place.z()),
         {},
         {{"distance_mm", off},
          {"x_mm", seen->place.x()},
          {"y_mm", seen->place.y()},
          {"z_mm", seen->place.z()}}});
  }
  if (!absent.empty()) warnings.push_back(of_absent(absent));
  return warnings;
}

}  // namespace helicarm::pipeline
