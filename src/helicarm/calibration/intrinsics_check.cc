// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/intrinsics_check.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace helicarm::calibration {
namespace {

constexpr double warn_sigmas = 4, least_deviation = 0.01;
constexpr Eigen::Index fy = 1;  // index among view_parameters

/// Focal lengths estimated without their prior, and the relative covariance among them.
struct FocalLengths {
  std::vector<double> px;
  Eigen::MatrixXd covariance;
};

std::optional<FocalLengths> focal_lengths(const std::vector<ViewFiducials>& views, CommonPrior common) {
  CalibrationOptions options;
  options.common = std::move(common);
  options.common.c_arm.focal.reset();
  options.rejection_probability = 0;
  const auto fit = calibrate(views, options);
  if (!fit) return std::nullopt;
  FocalLengths focal{{}, Eigen::MatrixXd(views.size(), views.size())};
  for (const CalibratedView& view : fit->views)
    focal.px.push_back((std::abs(view.view.intrinsics.fx) + view.view.intrinsics.fy) / 2);
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t j = 0; j < views.size(); ++j)
      focal.covariance(Eigen::Index(i), Eigen::Index(j)) =
          fit->joint_covariance(view_parameters * Eigen::Index(i) + fy,
                                view_parameters * Eigen::Index(j) + fy) /
          (focal.px[i] * focal.px[j]);
  return focal;
}

bool contradicts(double deviation, double variance) {
  return std::abs(deviation) > least_deviation && std::abs(deviation) > warn_sigmas * std::sqrt(variance);
}

const char* const advice =
    "its distortion map may be of another C-arm position (plate images exchanged), or its pixel size or "
    "source "
    "distance wrong. The intrinsics absorb this: points among the fiducials stay right, the intrinsics and "
    "points far from the fiducials do not";

std::optional<Warning> against_tag(const ViewFiducials& view, double focal_px, double variance,
                                   const IntrinsicsVariation& tag) {
  const double stated = *view.prior.focal_px;
  const double deviation = std::log(focal_px / stated);
  const double tag_sigma = std::hypot(tag.common, tag.of_view) * view.prior.unit_px / stated;
  if (!contradicts(deviation, variance + tag_sigma * tag_sigma)) return std::nullopt;
  return Warning{
      Reason::intrinsics_inconsistent,
      fmt::format("the fiducials imply a source distance of {:.4g} times that of the file (sigma {:.1g}): {}",
                  focal_px / stated, std::sqrt(variance), advice),
      view.name,
      {{"amount", focal_px / stated - 1},
       {"sigma", std::sqrt(variance)},
       {"focal_px", focal_px},
       {"file_focal_px", stated}}};
}

/// In units of the file's, where both views have one.
std::optional<Warning> against_each_other(const ViewFiducials& a, const ViewFiducials& b, double focal_a,
                                          double focal_b, double variance,
                                          const IntrinsicsVariation& variation) {
  if (a.prior.focal_px.has_value() != b.prior.focal_px.has_value()) return std::nullopt;
  const double unit_a = a.prior.focal_px.value_or(a.prior.unit_px),
               unit_b = b.prior.focal_px.value_or(b.prior.unit_px);
  const double deviation = std::log(focal_b / unit_b) - std::log(focal_a / unit_a);
  const double sag = variation.of_view * a.prior.unit_px / focal_a;
  variance += 2 * sag * sag;
  if (!contradicts(deviation, variance)) return std::nullopt;
  return Warning{
      Reason::intrinsics_inconsistent,
      fmt::format("the fiducials imply a source distance {:.2g} % {} in {} than in {} (sigma {:.1g} "
                  "%), but a C-arm keeps it: for one of them, {}",
                  100 * std::abs(std::expm1(deviation)), deviation > 0 ? "larger" : "smaller", b.name, a.name,
                  100 * std::sqrt(variance), advice),
      b.name,
      {{"amount", std::expm1(deviation)},
       {"sigma", std::sqrt(variance)},
       {"focal_px " + a.name, focal_a},
       {"focal_px " + b.name, focal_b}}};
}

}  // namespace

std::vector<Warning> check_intrinsics(const std::vector<ViewFiducials>& views, const CommonPrior& common) {
  const auto focal = focal_lengths(views, common);
  if (!focal) return {};
  const auto variance = [&](std::size_t i, std::size_t j) {
    return focal->covariance(Eigen::Index(i), Eigen::Index(j));
  };
  const IntrinsicsVariation variation = common.c_arm.focal.value_or(IntrinsicsVariation{0, 0});
  std::vector<Warning> warnings;
  const auto add = [&](std::optional<Warning> warning) {
    if (warning) warnings.push_back(*std::move(warning));
  };
  if (common.c_arm.focal)
    for (std::size_t i = 0; i < views.size(); ++i)
      if (views[i].prior.focal_px) add(against_tag(views[i], focal->px[i], variance(i, i), variation));
  if (!warnings.empty()) return warnings;
  for (std::size_t j = 1; j < views.size(); ++j)
    add(against_each_other(views[0], views[j], focal->px[0], focal->px[j],
                           variance(0, 0) + variance(j, j) - 2 * variance(0, j), variation));
  return warnings;
}

}  // namespace helicarm::calibration
