// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/diameter_scale.h"

#include <algorithm>

#include "helicarm/core/statistics.h"
#include "helicarm/pipeline/diagnosis/calibrator_checks.h"

namespace helicarm::phantom_calibration {
namespace {}  // namespace

DiameterScale diameter_scale(const AdjustedViews& found) {
  std::vector<double> factors, sigmas;
  for (const auto& view : found.observed)
    for (std::size_t i = 0; i < view.size(); ++i)
      if (view[i]) {
        factors.push_back(found.diameters_mm[i] / view[i]->diameter_mm);
        sigmas.push_back(view[i]->diameter_sigma);
      }
  return {median(std::move(factors)), median(std::move(sigmas))};
}

std::vector<std::optional<double>> seen_diameters(const AdjustedViews& found) {
  std::vector<std::optional<double>> seen;
  for (std::size_t i = 0; i < found.diameters_mm.size(); ++i) {
    std::vector<double> of_views;
    for (const auto& view : found.observed)
      if (view[i]) of_views.push_back(view[i]->diameter_mm);
    seen.push_back(of_views.empty() ? std::nullopt : std::optional(median(std::move(of_views))));
  }
  return seen;
}

DepthLimits depth_limits(const AdjustedViews& found, const std::vector<pipeline::RectifiedView>& detected) {
  DepthLimits limits;
  std::vector<double> factors, sigmas;
  const BundleFit& fit = found.consistent.fit;
  for (std::size_t v = 0; v < fit.views.size(); ++v) {
    const xray::Acquisition& stated = detected[found.view_of_case[v]].xray_image->acquisition;
    double farthest = 0, mean = 0;
    for (const Eigen::Vector3d& centre : fit.centres) {
      farthest = std::max(farthest, fit.views[v].depth(centre));
      mean += fit.views[v].depth(centre) / double(fit.centres.size());
    }
    if (stated.source_detector_mm && farthest > 0)
      limits.largest_factor = std::min(limits.largest_factor, *stated.source_detector_mm / farthest);
    if (stated.source_patient_mm && mean > 0) {
      factors.push_back(*stated.source_patient_mm / mean);
      sigmas.push_back(pipeline::patient_distance_sigma_mm / *stated.source_patient_mm);
    }
  }
  if (!factors.empty()) limits.by_tag = {median(std::move(factors)), median(std::move(sigmas))};
  return limits;
}

}  // namespace helicarm::phantom_calibration
