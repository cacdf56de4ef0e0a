// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/diagnosis/residuals.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/calibration/distortion_check.h"
#include "helicarm/calibration/intrinsics_check.h"
#include "helicarm/core/statistics.h"
#include "helicarm/rectification/round_field.h"

namespace helicarm::pipeline {
namespace {

using Kind = ImageChange::Kind;

/// An image point with the change removed.
Eigen::Vector2d without(const Eigen::Vector2d& uv, Kind kind, double amount, const Eigen::Vector2d& size_px) {
  const Eigen::Vector2d centre = (size_px - Eigen::Vector2d::Ones()) / 2, from = uv - centre;
  switch (kind) {
    case Kind::radial:
      return centre + from * (1 + amount * from.squaredNorm() / std::pow(size_px.x() / 2, 2));
    case Kind::scale:
      return centre + from / (1 + amount);
    case Kind::aspect:
      return centre + Eigen::Vector2d(from.x(), from.y() / (1 + amount));
  }
  return uv;
}

std::vector<calibration::ViewFiducials> without(std::vector<calibration::ViewFiducials> views,
                                                const ImageChange& change,
                                                const std::vector<Eigen::Vector2d>& size_px) {
  for (std::size_t i = 0; i < views.size(); ++i)
    if (!change.view || *change.view == i)
      for (fiducials::Fiducial& ball : views[i].fiducials)
        if (ball.status == fiducials::FiducialStatus::used)
          ball.uv = without(ball.uv, change.kind, change.amount, size_px[i]);
  return views;
}

struct Fit {
  double chi2;
  int dof;
};

std::optional<Fit> fit_of(const std::vector<calibration::ViewFiducials>& views,
                          const calibration::CommonPrior& common) {
  calibration::CalibrationOptions options;
  options.common = common;
  options.rejection_probability = 0;
  const auto fit = calibration::calibrate(views, options);
  return fit ? std::optional(Fit{fit->chi2, fit->dof}) : std::nullopt;
}

/// Whether chi2 exceeds its degrees of freedom by three standard deviations.
bool is_excessive(double chi2, int dof) {
  constexpr double most = 3;
  return dof < 1 || chi2_excess(chi2, dof) > most;
}

/// The amount of least chi2, by iterated parabolic interpolation.
std::optional<ImageChange> fitted(ImageChange change, const std::vector<calibration::ViewFiducials>& views,
                                  const std::vector<Eigen::Vector2d>& size_px,
                                  const calibration::CommonPrior& common) {
  constexpr double step = 1e-3;
  constexpr double most = 0.2;
  const auto chi2_at = [&](double amount) {
    ImageChange tried = change;
    tried.amount = amount;
    return fit_of(without(views, tried, size_px), common);
  };
  for (int round = 0; round < 3; ++round) {
    const auto below = chi2_at(change.amount - step), at = chi2_at(change.amount),
               above = chi2_at(change.amount + step);
    if (!below || !at || !above) return std::nullopt;
    const double slope = (above->chi2 - below->chi2) / (2 * step);
    const double bend = (above->chi2 - 2 * at->chi2 + below->chi2) / (step * step);
    if (!(bend > 0)) return std::nullopt;
    change.amount -= slope / bend;
    change.sigma = std::sqrt(2 / bend);
    if (!(std::abs(change.amount) < most)) return std::nullopt;
  }
  const auto at = chi2_at(change.amount);
  if (!at) return std::nullopt;
  change.chi2_after = at->chi2;
  change.dof = at->dof - 1;
  return change;
}

/// All images are magnified alike: the source distance or pixel size of all views is wrong.
Warning wrong_distance(const ImageChange& change, const std::vector<LabelledView>& views,
                       std::map<std::string, double> figures) {
  const auto& stated_mm = views.front().xray_image->acquisition.source_detector_mm;
  std::string distance;
  if (stated_mm) {
    const double fitting_mm = *stated_mm * (1 + change.amount);
    figures["file_source_detector_mm"] = *stated_mm;
    figures["fitting_source_detector_mm"] = fitting_mm;
    distance =
        fmt::format(" (a source distance of {:.0f} mm fits, the file has {:.0f} mm)", fitting_mm, *stated_mm);
  }
  return {Reason::intrinsics_inconsistent,
          fmt::format("the fiducials imply that all images are magnified by {:.4g} (sigma {:.1g}) against "
                      "their source distance and pixel size{}: correct them",
                      1 + change.amount, change.sigma, distance),
          {},
          std::move(figures)};
}

Warning warning_of(const ImageChange& change, const std::vector<LabelledView>& views) {
  const std::string view = change.view ? views[*change.view].name : std::string();
  const std::map<std::string, double> figures{{"amount", change.amount},
                                              {"sigma", change.sigma},
                                              {"chi2_before", change.chi2_before},
                                              {"chi2_after", change.chi2_after},
                                              {"dof", double(change.dof)}};
  const double percent = 100 * change.amount, sigma = 100 * change.sigma;
  if (change.kind == Kind::radial)
    return {Reason::residual_distortion,
            fmt::format(
                "the fiducials' residuals imply a radial distortion of {:.2g} % (sigma {:.1g}) at half the "
                "image's width: rectify by a plate or a map",
                -percent, sigma),
            view, figures};
  if (change.kind == Kind::aspect)
    return {
        Reason::residual_distortion,
        fmt::format(
            "the fiducials' residuals imply a row spacing {:.2g} % (sigma {:.1g}) larger than the file's: "
            "check the pixel spacing",
            percent, sigma),
        view, figures};
  if (!change.view) return wrong_distance(change, views, figures);
  return {
      Reason::intrinsics_inconsistent,
      fmt::format("the fiducials imply an image magnified by {:.4g} (sigma {:.1g}) against the other views: "
                  "its pixel size or source distance is wrong, or it was resampled",
                  1 + change.amount, change.sigma),
      view, figures};
}

/// The view's fiducials without those that the calibration rejected.
calibration::ViewFiducials accepted_of(const LabelledView& view,
                                       const std::vector<fiducials::Fiducial>& fiducials) {
  calibration::ViewFiducials accepted = fiducials_of(view);
  accepted.fiducials = fiducials;
  std::vector<Eigen::Vector2d> used;
  for (const fiducials::Fiducial& ball : fiducials)
    if (ball.status == fiducials::FiducialStatus::used) used.push_back(ball.uv);
  accepted.map_covariance_px2 = view.rectification.map.covariance_px2(used);
  return accepted;
}

Eigen::Vector2d size_of(const LabelledView& view) {
  return {view.xray_image->pixels.width(), view.xray_image->pixels.height()};
}

Warning unrectified(const LabelledView& view, const std::optional<ImageChange>& radial) {
  const std::string estimate =
      radial ? fmt::format(
                   "the fiducials give a radial distortion of {:.2g} % (sigma {:.1g}) at half the image's "
                   "width",
                   -100 * radial->amount, 100 * radial->sigma)
             : std::string("the fiducials do not determine its distortion");
  std::map<std::string, double> figures;
  if (radial) figures = {{"amount", radial->amount}, {"sigma", radial->sigma}};
  return {
      Reason::residual_distortion,
      fmt::format("the field is round as an image intensifier's, and neither a plate nor a map rectifies it; "
                  "{}. The intrinsics may be several per cent off while the residuals are small: name the "
                  "plate, plate_image or map",
                  estimate),
      view.name, std::move(figures)};
}

}  // namespace

std::optional<ImageChange> best_image_change(const std::vector<calibration::ViewFiducials>& views,
                                             const std::vector<Eigen::Vector2d>& size_px,
                                             const calibration::CommonPrior& common) {
  constexpr double least_fall = 25;
  const auto plain = fit_of(views, common);
  if (!plain || !is_excessive(plain->chi2, plain->dof)) return std::nullopt;
  std::vector<ImageChange> changes{{Kind::radial, {}}, {Kind::aspect, {}}, {Kind::scale, {}}};
  for (std::size_t i = 0; i < views.size(); ++i) changes.push_back({Kind::scale, i});
  std::optional<ImageChange> best;
  for (const ImageChange& change : changes) {
    auto found = fitted(change, views, size_px, common);
    if (!found || plain->chi2 - found->chi2_after < least_fall ||
        is_excessive(found->chi2_after, found->dof) || (best && best->chi2_after <= found->chi2_after))
      continue;
    found->chi2_before = plain->chi2;
    best = found;
  }
  return best;
}

std::vector<Warning> explain_residuals(const std::vector<LabelledView>& views,
                                       const calibration::CalibrationResult& calibration,
                                       const calibration::CommonPrior& common) {
  const bool rejected = std::ranges::any_of(calibration.fiducials, [](const auto& fiducials) {
    return std::ranges::count(fiducials, fiducials::FiducialStatus::rejected, &fiducials::Fiducial::status) >
           0;
  });
  if (calibration.variance_scale == 1 && !rejected) return {};
  std::vector<calibration::ViewFiducials> fiducials;
  std::vector<Eigen::Vector2d> size_px;
  for (const LabelledView& view : views) {
    fiducials.push_back(fiducials_of(view));
    size_px.push_back(size_of(view));
  }
  const auto change = best_image_change(fiducials, size_px, common);
  return change ? std::vector<Warning>{warning_of(*change, views)} : std::vector<Warning>{};
}

std::vector<Warning> doubtful_intrinsics(const std::vector<LabelledView>& views,
                                         const calibration::CalibrationResult& calibration,
                                         const calibration::CommonPrior& common) {
  constexpr double least_distortion = 0.01;  // intensifiers: 3 to 10 % at half the image's width
  std::vector<calibration::ViewFiducials> fiducials;
  std::vector<Eigen::Vector2d> size_px;
  for (std::size_t i = 0; i < views.size(); ++i) {
    fiducials.push_back(accepted_of(views[i], calibration.fiducials[i]));
    size_px.push_back(size_of(views[i]));
  }
  std::vector<Warning> warnings;
  const auto warned_of = [&](Reason reason) {
    return std::ranges::count(calibration.warnings, reason, &Warning::reason) > 0;
  };
  if (!warned_of(Reason::intrinsics_inconsistent))
    warnings = calibration::check_intrinsics(fiducials, common);
  if (!warned_of(Reason::residual_distortion) && !warned_of(Reason::calibrator_strained))
    if (auto distorted = calibration::check_distortion(fiducials, common))
      warnings.push_back(*std::move(distorted));
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (!views[i].rectification.map.is_identity() || !rectification::round_field(*views[i].xray_image))
      continue;
    const auto radial = fitted({Kind::radial, i}, fiducials, size_px, common);
    if (radial && std::abs(radial->amount) + 2 * radial->sigma < least_distortion) continue;
    warnings.push_back(unrectified(views[i], radial));
  }
  return warnings;
}

}  // namespace helicarm::pipeline
