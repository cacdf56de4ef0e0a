// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/observe.h"

#include <algorithm>
#include <cmath>
#include <ranges>

#include "helicarm/core/statistics.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/fiducials/candidates.h"
#include "helicarm/fiducials/centre_offset.h"
#include "helicarm/fiducials/label_fiducials.h"
#include "helicarm/pipeline/diagnosis/calibrator_checks.h"
#include "helicarm/rectification/intrinsics_prior.h"

namespace helicarm::phantom_calibration {
namespace {

constexpr std::size_t most_candidates = 30;
constexpr double largest_sigma_px = 0.5;
constexpr double sigma_floor_px = 0.02;   // as the labelling's
constexpr double principal_share = 0.03;  // of the image's width

fiducials::LabellingPrior labelling_prior(const xray::XrayImage& xray_image,
                                          const rectification::DistortionMap& map) {
  fiducials::LabellingPrior prior;
  const auto& distance = xray_image.acquisition.source_detector_mm;
  if (distance && map.rectified_pixel_mm && map.rectified_plane == rectification::RectifiedPlane::detector)
    prior.focal_px = *distance / *map.rectified_pixel_mm;
  const double width = xray_image.pixels.width(), height = xray_image.pixels.height();
  prior.principal_px = {(width - 1) / 2, (height - 1) / 2};
  prior.principal_sigma_px = principal_share * width;
  prior.field_radius_px = std::hypot(width, height) / 2;
  return prior;
}

phantom::Calibrator balls_of(const std::vector<double>& diameters_mm) {
  phantom::Calibrator calibrator;
  for (const double diameter : diameters_mm)
    calibrator.balls.push_back({"", Eigen::Vector3d::Zero(), diameter});
  return calibrator;
}

double median_contrast(const std::vector<detection::Dot>& dots) {
  std::vector<double> contrasts;
  for (const detection::Dot& dot : dots) contrasts.push_back(dot.contrast);
  return median(std::move(contrasts));
}

/// Whether the image of another fiducial touches that of this one: each would disturb the other's place.
bool is_overlapped(std::size_t ball, const geometry::View& pose, const std::vector<Eigen::Vector3d>& centres,
                   const std::vector<double>& diameters_mm) {
  const auto radius_px = [&](std::size_t i) {
    return diameters_mm[i] / 2 * std::abs(pose.intrinsics.fy) / pose.depth(centres[i]);
  };
  const Eigen::Vector2d uv = pose.project(centres[ball]);
  for (std::size_t i = 0; i < centres.size(); ++i)
    if (i != ball && (pose.project(centres[i]) - uv).norm() < radius_px(i) + radius_px(ball)) return true;
  return false;
}

}  // namespace

PreparedView prepared(const pipeline::RectifiedView& detected, const std::vector<double>& diameters_mm,
                      std::optional<bool> mirrored) {
  const rectification::DistortionMap& map = detected.rectification.map;
  PreparedView result;
  result.view.name = detected.name;
  result.view.labelling = labelling_prior(*detected.xray_image, map);
  result.view.labelling.mirrored = mirrored;
  result.view.prior = rectification::intrinsics_prior(*detected.xray_image, map);
  const Range radii = map.rectified_pixel_mm
                          ? fiducials::ball_radii_px(balls_of(diameters_mm), *map.rectified_pixel_mm)
                          : Range{2, 1e9};
  for (const detection::Dot& dot : fiducials::ball_candidates(detected.dots, detected.rectification))
    if (radii.low <= dot.radius_px && dot.radius_px <= radii.high && dot.sigma_px < largest_sigma_px &&
        map.rectified_from_raw(dot.centre_px))
      result.dots.push_back(dot);
  std::ranges::stable_sort(result.dots, std::greater{}, [](const detection::Dot& dot) {
    return std::abs(dot.contrast) / (0.03 + dot.misfit);
  });
  if (result.dots.size() > most_candidates) result.dots.resize(most_candidates);
  for (const detection::Dot& dot : result.dots)
    result.view.candidates.push_back({*map.rectified_from_raw(dot.centre_px), std::max(0.05, dot.sigma_px),
                                      dot.radius_px, 0.02 * dot.radius_px + 0.1});
  return result;
}

std::vector<std::optional<Observed>> observe(const pipeline::RectifiedView& detected,
                                             const PreparedView& prepared, const geometry::View& pose,
                                             const std::vector<Eigen::Vector3d>& centres,
                                             const std::vector<double>& diameters_mm,
                                             const std::vector<int>& candidate_of) {
  const xray::XrayImage& xray_image = *detected.xray_image;
  const rectification::DistortionMap& map = detected.rectification.map;
  std::vector<std::optional<Observed>> observed(centres.size());
  // Balls of one size share an appearance (blur and absorbance).
  std::vector<double> kinds = diameters_mm;
  std::ranges::sort(kinds);
  kinds.erase(std::unique(kinds.begin(), kinds.end()), kinds.end());
  std::vector<detection::Dot> neighbours = fiducials::ball_candidates(detected.dots, detected.rectification);
  neighbours.insert(neighbours.end(), detected.rectification.plate_dots.begin(),
                    detected.rectification.plate_dots.end());
  std::vector<detection::Dot> all;
  for (const int k : candidate_of)
    if (k >= 0) all.push_back(prepared.dots[std::size_t(k)]);
  if (all.empty()) return observed;
  const double contrast = median_contrast(all);
  for (const double kind : kinds) {
    std::vector<detection::Dot> labelled;
    for (std::size_t ball = 0; ball < centres.size(); ++ball)
      if (diameters_mm[ball] == kind && candidate_of[ball] >= 0)
        labelled.push_back(prepared.dots[std::size_t(candidate_of[ball])]);
    const detection::DotAppearance appearance =
        detection::estimate_appearance(xray_image, detected.dots.noise, labelled.empty() ? all : labelled);
    for (std::size_t ball = 0; ball < centres.size(); ++ball) {
      if (diameters_mm[ball] != kind || is_overlapped(ball, pose, centres, diameters_mm)) continue;
      const Eigen::Vector2d predicted = pose.project(centres[ball]);
      const double depth = pose.depth(centres[ball]);
      const double px_per_mm = std::abs(pose.intrinsics.fy) / depth;
      detection::Dot start;
      start.centre_px = map.raw_from_rectified(predicted);
      const double raw_px_per_mm = px_per_mm * std::sqrt(std::abs(map.jacobian(predicted).determinant()));
      start.radius_px = diameters_mm[ball] / 2 * raw_px_per_mm;
      const detection::Dot expected = start;
      const bool has_candidate = candidate_of[ball] >= 0;
      if (has_candidate) start = prepared.dots[std::size_t(candidate_of[ball])];
      if (!map.shows(start.centre_px)) continue;
      const auto fitted = detection::refit_dots(xray_image, {start}, appearance, neighbours);
      if (fitted.empty() || (!has_candidate && !fiducials::is_plausible(fitted[0], expected, contrast)))
        continue;
      const Eigen::Vector2d raw =
          fitted[0].centre_px - fiducials::blob_offset(map, pose, predicted, depth, diameters_mm[ball]);
      const auto uv = map.rectified_from_raw(raw);
      if (!uv) continue;
      const auto error = pipeline::diameter_error(fitted[0].radius_px, xray_image.acquisition.logarithmic);
      observed[ball] = Observed{raw, *uv, std::hypot(fitted[0].error_px(), sigma_floor_px),
                                2 * fitted[0].radius_px / (1 + error.bias) / raw_px_per_mm, error.sigma};
    }
  }
  return observed;
}

}  // namespace helicarm::phantom_calibration
