// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/diagnosis/causes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/pipeline/diagnosis/calibrator_checks.h"
#include "helicarm/pipeline/prior.h"
#include "helicarm/rectification/round_field.h"

namespace helicarm::pipeline {
namespace {

/// One view of a case, measured again with other tags.
struct Trial {
  const Case& the_case;
  const RunOptions& options;
  std::string name;
  const xray::XrayImage& image;
  detection::ImageDots dots;  ///< of any size

  DetectedView with(std::optional<double> pixel_factor, std::optional<double> distance_factor) const {
    xray::XrayImage changed = image;
    xray::Acquisition& tags = changed.acquisition;
    if (!pixel_factor)
      tags.pixel_mm.reset();
    else if (tags.pixel_mm)
      *tags.pixel_mm *= *pixel_factor;
    if (tags.source_detector_mm) *tags.source_detector_mm *= distance_factor.value_or(1);
    return {{{name}, std::make_shared<const xray::XrayImage>(std::move(changed))}, dots};
  }
};

/// For trials with other tags, which change how large the plate's dots and the fiducials are expected.
detection::ImageDots dots_of_any_size(const xray::XrayImage& xray_image,
                                      const std::optional<phantom::Plate>& plate) {
  auto dots = detection::unsearched(xray_image, detection::DotOptions{}.min_radius_px);
  detection::dots_of(dots, xray_image, detection::Polarity::dark);
  if (plate && plate->kind == phantom::DotKind::holes)
    detection::dots_of(dots, xray_image, detection::Polarity::bright);
  return dots;
}

/// Mean pixel size on the detector that a rectification by the plate implies.
std::optional<double> pixel_by_plate(const Trial& trial) {
  constexpr int least_dots = 20;
  const auto rectified = rectify_views({trial.with({}, 1)}, trial.the_case, trial.options);
  if (!rectified) return std::nullopt;
  const rectification::Rectification& found = rectified->front().rectification;
  if (found.dots_found < least_dots || !found.map.rectified_pixel_mm) return std::nullopt;
  const auto& distance = trial.image.acquisition.source_detector_mm;
  const auto& height = trial.the_case.plate->height_above_receiver_mm;
  const bool in_plate = found.map.rectified_plane != rectification::RectifiedPlane::detector;
  return *found.map.rectified_pixel_mm *
         (in_plate && distance && height ? *distance / (*distance - *height) : 1);
}

/// The focal length (px) estimated from one view's fiducials, and their number.
struct FittedFocal {
  double focal_px;
  double factor;  ///< assumed focal length of the trial over the file's
  std::ptrdiff_t used;
};

std::optional<FittedFocal> focal_of(const LabelledView& view, double factor) {
  constexpr double most_sigma = 0.03;  // relative
  calibration::ViewFiducials fiducials = fiducials_of(view);
  const double wanted = 0.15 * *fiducials.prior.focal_px / fiducials.prior.unit_px;
  calibration::CalibrationOptions options;
  options.common.c_arm = unknown_c_arm();
  options.common.c_arm.focal = calibration::IntrinsicsVariation{wanted, 0.01};
  const auto fit = calibration::calibrate({fiducials}, options);
  if (!fit || fit->variance_scale != 1) return std::nullopt;
  const geometry::Intrinsics& k = fit->views[0].view.intrinsics;
  const double focal = 0.5 * (std::abs(k.fx) + k.fy);
  if (!(std::sqrt(fit->views[0].covariance(1, 1)) < most_sigma * focal)) return std::nullopt;
  return FittedFocal{
      focal, factor,
      std::ranges::count(fit->fiducials[0], fiducials::FiducialStatus::used, &fiducials::Fiducial::status)};
}

/// Labels the view with assumed focal lengths from half to twice the file's and returns the fit with the most
/// fiducials. With a plate the source distance varies, without one the pixel size.
std::optional<FittedFocal> fitted_focal(const Trial& trial, unsigned threads) {
  constexpr int each_way = 8;
  constexpr double ratio = 1.09;  // 8 steps: a factor of 2
  constexpr std::ptrdiff_t least_used = 8;
  std::vector<std::optional<FittedFocal>> found(2 * each_way + 1);
  parallel_for(found.size(), threads, [&](std::size_t i) {
    const double factor = std::pow(ratio, double(i) - each_way);
    const DetectedView view = trial.the_case.plate ? trial.with(1, factor) : trial.with(1 / factor, 1);
    const auto labelled = rectify_views({view}, trial.the_case, trial.options).and_then([&](auto views) {
      return label_views(std::move(views), trial.the_case, trial.options);
    });
    if (labelled) found[i] = focal_of(labelled->front(), factor);
  });
  std::optional<FittedFocal> best;
  for (const auto& one : found)
    if (one && one->used >= least_used && (!best || one->used > best->used)) best = one;
  return best;
}

/// How many times as large as in the calibrator's file the balls are, by labels with other diameters.
std::optional<double> fitted_diameters(const Trial& trial, unsigned threads) {
  constexpr std::array factors{0.5, 0.6, 0.71, 0.84, 1.19, 1.41, 1.68, 2.0};
  constexpr std::ptrdiff_t least_used = 8;
  std::array<std::pair<std::ptrdiff_t, double>, factors.size()> found{};
  parallel_for(found.size(), threads, [&](std::size_t i) {
    Case other = trial.the_case;
    for (phantom::CalibratorBall& ball : other.calibrator.balls) ball.diameter_mm *= factors[i];
    const auto labelled = rectify_views({trial.with(1, 1)}, other, trial.options).and_then([&](auto views) {
      return label_views(std::move(views), other, trial.options);
    });
    if (!labelled) return;
    calibration::CalibrationOptions options;
    options.common = common_prior(other.calibrator);
    const auto fit = calibration::calibrate({fiducials_of(labelled->front())}, options);
    if (!fit || fit->variance_scale != 1) return;
    DiameterEvidence diameters;
    diameters.add(fit->views[0].view, fit->fiducials[0], other.calibrator,
                  trial.image.acquisition.logarithmic);
    found[i] = {
        std::ranges::count(fit->fiducials[0], fiducials::FiducialStatus::used, &fiducials::Fiducial::status),
        factors[i] * std::exp(diameters.scale().excess)};
  });
  const auto best = std::ranges::max_element(found, {}, [](const auto& one) { return one.first; });
  return best->first >= least_used ? std::optional(best->second) : std::nullopt;
}

void add_pixel(Failure& failure, double file_mm, double fitting_mm) {
  failure.message += fmt::format(
      ". A pixel size of {:.4g} mm fits, the file has {:.4g} mm: either it is wrong, or the case names "
      "another plate or calibrator than the one in the image",
      fitting_mm, file_mm);
  failure.figures["file_pixel_mm"] = file_mm;
  failure.figures["fitting_pixel_mm"] = fitting_mm;
}

void add_distance(Failure& failure, double file_mm, double fitting_mm, std::optional<double> file_pixel_mm) {
  failure.message +=
      fmt::format(". A source distance of {:.4g} mm fits, the file has {:.4g} mm", fitting_mm, file_mm);
  failure.figures["file_source_detector_mm"] = file_mm;
  failure.figures["fitting_source_detector_mm"] = fitting_mm;
  if (file_pixel_mm) {
    const double fitting_pixel_mm = *file_pixel_mm * file_mm / fitting_mm;
    failure.message += fmt::format(", or a pixel size of {:.4g} mm, the file has {:.4g} mm", fitting_pixel_mm,
                                   *file_pixel_mm);
    failure.figures["file_pixel_mm"] = *file_pixel_mm;
    failure.figures["fitting_pixel_mm"] = fitting_pixel_mm;
  }
  failure.message += ": either it is wrong, or the case names another calibrator than the one in the image";
}

void add_diameters(Failure& failure, double times) {
  failure.message += fmt::format(
      ". Balls {:.2g} times as large as in the calibrator's file fit: its diameters are wrong (radii in "
      "their place?), or the case names another calibrator than the one in the image",
      times);
  failure.figures["fitting_diameters"] = times;
}

/// The image with its columns resampled, as wide as `factor` times.
image::Image<float> widened(const image::Image<float>& image, double factor) {
  const int width = std::max(1, int(std::lround(image.width() * factor)));
  image::Image<float> wide(width, image.height());
  const double share = double(image.width()) / width;
  for (int u = 0; u < width; ++u) {
    const double at = std::clamp((u + 0.5) * share - 0.5, 0.0, double(image.width() - 1));
    const int left = std::min(int(at), image.width() - 2);
    const auto weight = float(at - left);
    for (int v = 0; v < image.height(); ++v)
      wide(u, v) = (1 - weight) * image(left, v) + weight * image(left + 1, v);
  }
  return wide;
}

/// Whether the view's fiducials are labelled with its columns resampled by a factor and the pixel size
/// unknown.
bool is_labelled(const Trial& trial, double factor) {
  xray::XrayImage resampled = trial.image;
  if (factor != 1) resampled.pixels = widened(trial.image.pixels, factor);
  resampled.acquisition.pixel_mm.reset();
  return detect_in_views({{{trial.name}, std::make_shared<const xray::XrayImage>(std::move(resampled))}},
                         trial.the_case, trial.options)
      .and_then([&](auto views) { return rectify_views(std::move(views), trial.the_case, trial.options); })
      .and_then([&](auto views) { return label_views(std::move(views), trial.the_case, trial.options); })
      .has_value();
}

/// Factor by which the image is too wide: its fiducials are labelled only after its columns are resampled
/// back, not with an unknown pixel size alone. The round field proposes it, else the formats of screens.
std::optional<double> excess_width(const Trial& trial) {
  constexpr double least_excess = 0.03;
  std::vector<double> factors{4.0 / 3, 3.0 / 4, 5.0 / 4, 4.0 / 5};
  if (const auto field = rectification::round_field(trial.image)) factors = {field->aspect()};
  std::erase_if(factors, [&](double factor) { return std::abs(factor - 1) < least_excess; });
  if (factors.empty() || is_labelled(trial, 1)) return std::nullopt;
  for (const double factor : factors)
    if (is_labelled(trial, 1 / factor)) return factor;
  return std::nullopt;
}

Failure unequal_pixels(const Failure& failure, const image::Image<float>& pixels, double factor) {
  Failure named = failure;
  named.reason = Reason::unequal_pixels;
  named.message = fmt::format(
      "the image was resampled with unequal pixels: its fiducials are labelled only after its {} x {} pixels "
      "are made {:.3g} times {} (as it is: {}: {}). Export it as the C-arm stored it",
      pixels.width(), pixels.height(), factor > 1 ? factor : 1 / factor, factor > 1 ? "narrower" : "wider",
      code(failure.reason), failure.message);
  named.figures["aspect"] = factor;
  return named;
}

}  // namespace

Failure with_cause(const Refusal& refusal, const Case& the_case, const RunOptions& options) {
  constexpr double least_change = 0.03;  // relative: below it the tags did not cause the refusal
  Failure failure = refusal.failure;
  const auto at = std::ranges::find(refusal.views, failure.view, &ViewResult::name);
  if (at == refusal.views.end() || !at->xray_image) return failure;
  const xray::Acquisition& tags = at->xray_image->acquisition;
  Case one = the_case;
  one.views = {the_case.views[std::size_t(at - refusal.views.begin())]};
  RunOptions alone = options;
  alone.threads = 1;
  const bool of_plate = failure.reason == Reason::plate_mismatch || failure.reason == Reason::plate_not_found;
  const bool of_labels = failure.reason == Reason::calibrator_mismatch ||
                         failure.reason == Reason::ambiguous_labels ||
                         failure.reason == Reason::too_few_fiducials;
  if (!of_plate && !of_labels) return failure;
  const Trial trial{one, alone, at->name, *at->xray_image, dots_of_any_size(*at->xray_image, the_case.plate)};
  if (of_plate && tags.pixel_mm && the_case.plate) {
    const auto pixel = pixel_by_plate(trial);
    if (pixel && std::abs(*pixel / tags.pixel_mm->mean() - 1) > least_change)
      add_pixel(failure, tags.pixel_mm->mean(), *pixel);
  }
  if (const auto factor = excess_width(trial))
    return unequal_pixels(failure, at->xray_image->pixels, *factor);
  if (of_labels && at->rectification && at->rectification->map.is_identity() &&
      rectification::round_field(*at->xray_image))
    failure.message +=
        ". The field is round as an image intensifier's, and neither plate nor map rectifies it: name the "
        "plate, "
        "plate_image or map, or a C-arm's record that holds maps (--machine)";
  if (!of_labels || !tags.pixel_mm || !tags.source_detector_mm) return failure;
  const auto focal = fitted_focal(trial, options.threads);
  if (!focal) {
    if (const auto times = fitted_diameters(trial, options.threads)) add_diameters(failure, *times);
    return failure;
  }
  const double share = focal->focal_px * tags.pixel_mm->mean() / *tags.source_detector_mm;
  if (std::abs(share - 1) < least_change) return failure;
  add_distance(failure, *tags.source_detector_mm, *tags.source_detector_mm * share,
               the_case.plate ? std::nullopt : std::optional(tags.pixel_mm->mean()));
  return failure;
}

}  // namespace helicarm::pipeline
