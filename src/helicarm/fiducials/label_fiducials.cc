// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/label_fiducials.h"

#include <algorithm>
#include <cmath>
#include <ranges>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/fiducials/candidates.h"
#include "helicarm/fiducials/centre_error.h"
#include "helicarm/fiducials/centre_offset.h"
#include "helicarm/fiducials/label.h"
#include "helicarm/fiducials/paper_circles.h"
#include "helicarm/rectification/intrinsics_prior.h"

namespace helicarm::fiducials {
namespace {

using Eigen::Vector2d;

constexpr std::size_t max_candidates = 30;
constexpr double paper_systematic = 2e-3;  // of the field radius: residual distortion of a quadratic map
constexpr double shared_bias_sigma = 0.008;
constexpr double prediction_reach_px = 4;
constexpr double least_diameter_px = 3;
constexpr double tolerance_sigmas = 3.3;      // as for a labelled fiducial
constexpr double printed_tolerance_mm = 0.3;  // of a printed phantom that has not been measured

/// Dots that may be fiducials, by decreasing ratio of contrast to misfit.
std::vector<detection::Dot> plausible_balls(const std::vector<detection::Dot>& dots,
                                            const rectification::DistortionMap& map,
                                            const phantom::Calibrator& calibrator) {
  const auto& pixel_mm = map.rectified_pixel_mm;
  const Range radii = pixel_mm ? ball_radii_px(calibrator, *pixel_mm) : Range{2, 1e9};
  std::vector<detection::Dot> balls;
  for (const detection::Dot& dot : dots)
    if (radii.low <= dot.radius_px && dot.radius_px <= radii.high && dot.sigma_px < 0.5 &&
        map.rectified_from_raw(dot.centre_px))
      balls.push_back(dot);
  const auto contrast_to_misfit = [](const detection::Dot& dot) {
    return std::abs(dot.contrast) / (0.03 + dot.misfit);
  };
  std::stable_sort(balls.begin(), balls.end(), [&](const detection::Dot& a, const detection::Dot& b) {
    return contrast_to_misfit(a) > contrast_to_misfit(b);
  });
  if (balls.size() > max_candidates) balls.resize(max_candidates);
  return balls;
}

LabellingPrior labelling_prior(const xray::XrayImage& xray_image,
                               const geometry::IntrinsicsPrior& intrinsics) {
  LabellingPrior prior;
  prior.focal_px = intrinsics.focal_px;
  prior.principal_px = *intrinsics.principal_px;
  prior.principal_sigma_px = 0.03 * xray_image.pixels.width();
  prior.field_radius_px = 0.5 * std::hypot(xray_image.pixels.width(), xray_image.pixels.height());
  return prior;
}

/// Standard deviation of a fiducial's image point, rectified, per axis.
double sigma_of(const detection::Dot& dot, const rectification::DistortionMap& map, const Vector2d& uv) {
  const double map_sigma = map.sigma_px(uv);
  return std::sqrt(dot.error_px() * dot.error_px() + map_sigma * map_sigma + sigma_floor_px * sigma_floor_px);
}

double predicted_radius(const geometry::View& view, const phantom::CalibratorBall& ball) {
  return 0.5 * ball.diameter_mm * std::abs(view.intrinsics.fy) / view.depth(ball.centre_in_calibrator);
}

/// Fits fiducials with the profile common to the labelled ones.
class BallFitter {
 public:
  BallFitter(const xray::XrayImage& xray_image, const detection::NoiseCorrelation& noise,
             std::vector<detection::Dot> neighbours, const std::vector<detection::Dot>& labelled_dots)
      : image_(xray_image),
        appearance_(detection::estimate_appearance(xray_image, noise, labelled_dots)),
        neighbours_(std::move(neighbours)) {
    std::vector<double> contrasts;
    for (const detection::Dot& dot : labelled_dots) contrasts.push_back(dot.contrast);
    typical_contrast_ = median(contrasts);
    std::vector<double> middles, steps;
    for (const detection::Dot& dot : labelled_dots) {
      middles.push_back(mean_between(dot.centre_px, 0, 0.5 * dot.radius_px));
      steps.push_back(mean_between(dot.centre_px, 1.5 * dot.radius_px, 2 * dot.radius_px) - middles.back());
    }
    metal_ = median(middles);
    step_to_background_ = median(steps);
  }

  std::optional<detection::Dot> fit(const detection::Dot& start) const {
    const auto fitted = detection::refit_dots(image_, {start}, appearance_, neighbours_);
    return fitted.empty() ? std::nullopt : std::optional(fitted.front());
  }

  /// A fiducial at its predicted position; nothing if none is visible there.
  std::optional<detection::Dot> fit_at_prediction(const Vector2d& raw, double radius, double reach_px) const {
    detection::Dot start;
    start.centre_px = raw;
    start.radius_px = radius;
    const auto dot = fit(start);
    return dot && is_plausible(*dot, start, typical_contrast_, reach_px) ? dot : std::nullopt;
  }

  /// Whether the disc is as dark as the middles of the labelled balls: what lies behind such metal is not
  /// seen.
  bool is_metal(const Vector2d& raw, double radius) const {
    const double above_metal = mean_between(raw, 0, radius) - metal_;
    return std::signbit(above_metal) != std::signbit(step_to_background_) ||
           std::abs(above_metal) < 0.1 * std::abs(step_to_background_);
  }

  bool is_black(const Vector2d& raw) const {
    return image_.pixels(static_cast<int>(std::lround(raw.x())), static_cast<int>(std::lround(raw.y()))) <=
           appearance_.options.floor;
  }

 private:
  /// Mean grey value of the pixels at distances from `least` to `most` of a point.
  double mean_between(const Vector2d& middle, double least, double most) const {
    const auto& pixels = image_.pixels;
    const auto from = [](double at) { return std::max(0, int(std::ceil(at))); };
    double sum = 0, count = 0;
    for (int v = from(middle.y() - most); v <= std::min(pixels.height() - 1, int(middle.y() + most)); ++v)
      for (int u = from(middle.x() - most); u <= std::min(pixels.width() - 1, int(middle.x() + most)); ++u) {
        const double distance = (Vector2d(u, v) - middle).norm();
        if (distance < least || distance > most) continue;
        sum += pixels(u, v);
        ++count;
      }
    return count > 0 ? sum / count : 0;
  }

  const xray::XrayImage& image_;
  detection::DotAppearance appearance_;
  std::vector<detection::Dot> neighbours_;
  double typical_contrast_ = 0;
  double metal_ = 0, step_to_background_ = 0;  // grey values
};

bool inside(const xray::XrayImage& xray_image, const Vector2d& raw, double margin) {
  return raw.x() >= margin && raw.y() >= margin && raw.x() <= xray_image.pixels.width() - 1 - margin &&
         raw.y() <= xray_image.pixels.height() - 1 - margin;
}

/// Why a fiducial predicted at `raw` was not measured.
FiducialStatus status_if_absent(const xray::XrayImage& xray_image, const BallFitter& fitter,
                                const Vector2d& raw, double radius,
                                const std::vector<detection::Dot>& labelled_dots) {
  if (!inside(xray_image, raw, 0.5 * radius) || fitter.is_black(raw)) return FiducialStatus::outside;
  const bool behind = std::any_of(
      labelled_dots.begin(), labelled_dots.end(),
      [&](const detection::Dot& other) { return (other.centre_px - raw).norm() < 1.2 * other.radius_px; });
  return behind || fitter.is_metal(raw, radius) ? FiducialStatus::occluded : FiducialStatus::not_found;
}

void set_pixels(Fiducial& fiducial, const detection::Dot& dot, const rectification::DistortionMap& map,
                const geometry::View& view, double diameter_mm) {
  const Eigen::Vector3d& centre = fiducial.centre_in_calibrator;
  const Vector2d raw =
      dot.centre_px - blob_offset(map, view, view.project(centre), view.depth(centre), diameter_mm);
  const auto uv = map.rectified_from_raw(raw);
  if (!uv) return;
  fiducial.status = FiducialStatus::used;
  fiducial.uv_raw = raw;
  fiducial.uv = *uv;
  fiducial.sigma_px = sigma_of(dot, map, *uv);
  fiducial.radius_px = dot.radius_px / std::sqrt(std::abs(map.jacobian(*uv).determinant()));
}

/// Whether displaced fiducials may be the reason that labelling failed.
bool may_be_displaced(const Expected<Labelling>& labelling, const phantom::Calibrator& calibrator) {
  return !labelling && calibrator.tolerance_mm < printed_tolerance_mm &&
         (labelling.error().reason == Reason::calibrator_mismatch ||
          labelling.error().reason == Reason::ambiguous_labels);
}

/// A tolerance resolves ambiguous labels only if it explains more fiducials.
bool explains_more(const Labelling& loose, const Failure& without) {
  const auto matched = without.figures.find("matched");
  return without.reason != Reason::ambiguous_labels ||
         (matched != without.figures.end() && loose.matched > matched->second);
}

/// The refusal with how many discs may be the calibrator's balls and how large these are, where most are
/// missing, or where there are many more: then this is why the labels cannot be told.
Failure with_found(Failure failure, std::size_t found, const phantom::Calibrator& calibrator,
                   const std::optional<double>& pixel_mm) {
  constexpr double most_found = 0.6;  // of the balls: with more, a labelling is usually certain
  const bool of_labels = failure.reason == Reason::ambiguous_labels ||
                         failure.reason == Reason::calibrator_mismatch ||
                         failure.reason == Reason::too_few_fiducials;
  const std::size_t balls = calibrator.balls.size();
  const bool are_many = found >= 2 * balls;
  if (!of_labels || (double(found) > most_found * double(balls) && !are_many)) return failure;
  failure.figures["found"] = double(found);
  failure.figures["balls"] = double(balls);
  if (are_many) {
    failure.message = fmt::format(
        "{} discs of the size of balls were found, and the calibrator's file states {} balls: if it has "
        "more, "
        "state them all (`helicarm phantom measure` measures them); {}",
        found, balls, failure.message);
    return failure;
  }
  std::string size;
  if (pixel_mm) {
    const auto [least, most] =
        std::ranges::minmax(calibrator.balls | std::views::transform(&phantom::CalibratorBall::diameter_mm));
    // On the detector; nearer to the source they are larger.
    failure.figures["ball_px"] = least / *pixel_mm;
    size = fmt::format(", which are from {:.1f} ({:g} mm) to {:.1f} px ({:g} mm) wide, or more",
                       least / *pixel_mm, least, most / *pixel_mm, most);
    if (least / *pixel_mm < least_diameter_px)
      size += fmt::format(": below {:g} px they are hardly found", least_diameter_px);
  }
  failure.message = fmt::format("only {} discs were found that may be the calibrator's {} balls{}; {}", found,
                                balls, size, failure.message);
  return failure;
}

/// Circles of `--method paper`, as large as the labelled dots.
std::vector<detection::Dot> circles_like(const std::vector<detection::Dot>& labelled_dots,
                                         const xray::XrayImage& xray_image,
                                         const rectification::DistortionMap& map) {
  const auto [least, most] =
      std::ranges::minmax(labelled_dots | std::views::transform(&detection::Dot::radius_px));
  return find_circles_paper(xray_image, map, {0.8 * least, 1.2 * most});
}

/// Sets the fiducial's pixels to the circle at its dot, if there is one.
void set_circle(Fiducial& fiducial, const std::vector<detection::Dot>& circles, const detection::Dot& dot,
                const rectification::DistortionMap& map) {
  const auto uv = map.rectified_from_raw(dot.centre_px);
  if (!uv) return;
  for (const detection::Dot& circle : circles)
    if ((circle.centre_px - *uv).norm() < 0.3 * dot.radius_px) {
      const ImagePoint point = point_of_circle(circle, map);
      fiducial.status = FiducialStatus::used;
      fiducial.uv_raw = point.uv_raw;
      fiducial.uv = point.uv;
      fiducial.sigma_px = point.sigma_px;
      fiducial.radius_px = circle.radius_px;
      return;
    }
}

/// What the labelling works on.
struct LabellingInput {
  std::vector<detection::Dot> balls;
  std::vector<BallCandidate> rectified;  ///< of each
  LabellingPrior prior;
  LabellingOptions options;
};

LabellingInput labelling_input(const xray::XrayImage& xray_image, const rectification::DistortionMap& map,
                               const std::vector<detection::Dot>& candidates,
                               const phantom::Calibrator& calibrator, const FiducialOptions& options) {
  LabellingInput input{plausible_balls(candidates, map, calibrator), {}, {}, {}};
  for (const detection::Dot& ball : input.balls) {
    const Vector2d uv = *map.rectified_from_raw(ball.centre_px);
    input.rectified.push_back({uv, std::max(0.05, ball.sigma_px), ball.radius_px, 0.02 * ball.radius_px + 0.1,
                               sigma_of(ball, map, uv)});
  }
  if (options.method == rectification::Method::paper) input.options.systematic_sigma = paper_systematic;
  input.prior = labelling_prior(xray_image, rectification::intrinsics_prior(xray_image, map));
  input.prior.mirrored = options.mirrored;
  input.prior.expected = options.expected;
  if (options.radius_bias) {
    input.prior.radius_bias = *options.radius_bias;
    input.prior.radius_bias_sigma = shared_bias_sigma;
  }
  return input;
}

}  // namespace

std::vector<GuessedLabel> guess_labels(const xray::XrayImage& xray_image, const detection::ImageDots& dots,
                                       const rectification::Rectification& rectification,
                                       const phantom::Calibrator& calibrator,
                                       const FiducialOptions& options) {
  auto [balls, rectified, prior, labelling_options] = labelling_input(
      xray_image, rectification.map, ball_candidates(dots, rectification), calibrator, options);
  labelling_options.tolerance_mm = printed_tolerance_mm;
  const LabellingAttempt attempt = attempt_labels(calibrator, rectified, prior, labelling_options);
  std::vector<GuessedLabel> guessed;
  if (!attempt.best) return guessed;
  for (std::size_t k = 0; k < calibrator.balls.size(); ++k) {
    const int candidate = attempt.best->candidate_of_ball[k];
    if (candidate < 0) continue;
    const phantom::CalibratorBall& ball = calibrator.balls[k];
    const Vector2d& uv = rectified[std::size_t(candidate)].uv;
    guessed.push_back({ball.label, balls[std::size_t(candidate)].centre_px, uv,
                       (attempt.best->view.project(ball.centre_in_calibrator) - uv).norm()});
  }
  return guessed;
}

Range ball_radii_px(const phantom::Calibrator& calibrator, double pixel_mm) {
  const auto [least, most] =
      std::ranges::minmax(calibrator.balls | std::views::transform(&phantom::CalibratorBall::diameter_mm));
  return {1.03 * 0.5 * least / pixel_mm, 2.7 * 0.5 * most / pixel_mm};
}

bool is_plausible(const detection::Dot& fitted, const detection::Dot& predicted, double typical_contrast,
                  double reach_px) {
  return (fitted.centre_px - predicted.centre_px).norm() <= reach_px && fitted.sigma_px <= 0.4 &&
         std::abs(fitted.radius_px / predicted.radius_px - 1) <= 0.12 && fitted.misfit <= 0.35 &&
         fitted.contrast * typical_contrast >= 0 &&
         std::abs(fitted.contrast) >= 0.25 * std::abs(typical_contrast);
}

Expected<LabelledFiducials> label_fiducials(const xray::XrayImage& xray_image,
                                            const detection::ImageDots& dots,
                                            const rectification::Rectification& rectification,
                                            const phantom::Calibrator& calibrator,
                                            const FiducialOptions& options) {
  const rectification::DistortionMap& map = rectification.map;
  std::vector<detection::Dot> seen = ball_candidates(dots, rectification);
  const auto [balls, rectified, prior, given_options] =
      labelling_input(xray_image, map, seen, calibrator, options);
  LabellingOptions labelling_options = given_options;
  auto labelling = label_balls(calibrator, rectified, prior, labelling_options);
  if (may_be_displaced(labelling, calibrator)) {
    labelling_options.tolerance_mm = printed_tolerance_mm;
    auto loose = label_balls(calibrator, rectified, prior, labelling_options);
    if (loose && explains_more(*loose, labelling.error()))
      labelling = std::move(loose);
    else
      labelling_options.tolerance_mm = 0;
  }
  if (!labelling)
    return tl::unexpected<Failure>(
        with_found(std::move(labelling.error()), balls.size(), calibrator, map.rectified_pixel_mm));

  LabelledFiducials found;
  found.view = labelling->view;
  found.mirrored = labelling->mirrored;
  found.margin = labelling->margin;
  found.runner_up_matched = labelling->runner_up_matched;
  found.runner_up_rms_px = labelling->runner_up_rms_px;
  found.radius_bias = labelling->radius_bias;
  found.assumed_tolerance_mm = labelling_options.tolerance_mm;
  std::vector<detection::Dot> labelled_dots;
  for (const int candidate : labelling->candidate_of_ball)
    if (candidate >= 0) labelled_dots.push_back(balls[static_cast<std::size_t>(candidate)]);
  seen.insert(seen.end(), rectification.plate_dots.begin(), rectification.plate_dots.end());
  const BallFitter fitter(xray_image, dots.noise, std::move(seen), labelled_dots);
  const double tolerance_mm = std::hypot(calibrator.tolerance_mm, labelling_options.tolerance_mm);
  const bool by_circles = options.method == rectification::Method::paper;
  const std::vector<detection::Dot> circles =
      by_circles ? circles_like(labelled_dots, xray_image, map) : std::vector<detection::Dot>{};

  for (std::size_t k = 0; k < calibrator.balls.size(); ++k) {
    const phantom::CalibratorBall& ball = calibrator.balls[k];
    Fiducial fiducial;
    fiducial.label = ball.label;
    fiducial.centre_in_calibrator = ball.centre_in_calibrator;
    const double radius = predicted_radius(found.view, ball);
    const Vector2d raw = map.raw_from_rectified(found.view.project(ball.centre_in_calibrator));
    const int candidate = labelling->candidate_of_ball[k];
    std::optional<detection::Dot> dot;
    if (candidate >= 0)
      dot = fitter.fit(balls[static_cast<std::size_t>(candidate)]);
    else if (inside(xray_image, raw, 2))
      dot = fitter.fit_at_prediction(
          raw, radius, prediction_reach_px + tolerance_sigmas * tolerance_mm * 2 * radius / ball.diameter_mm);
    if (dot && by_circles)
      set_circle(fiducial, circles, *dot, map);
    else if (dot)
      set_pixels(fiducial, *dot, map, found.view, ball.diameter_mm);
    if (fiducial.status != FiducialStatus::used)
      fiducial.status = status_if_absent(xray_image, fitter, raw, radius, labelled_dots);
    found.fiducials.push_back(fiducial);
  }
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const auto& taken = labelling->candidate_of_ball;
    if (std::find(taken.begin(), taken.end(), static_cast<int>(i)) == taken.end())
      found.false_blobs.push_back(balls[i]);
  }
  return found;
}

}  // namespace helicarm::fiducials
