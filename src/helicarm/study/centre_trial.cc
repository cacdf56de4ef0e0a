// SPDX-License-Identifier: Apache-2.0
#include "helicarm/study/centre_trial.h"

#include <algorithm>
#include <optional>

#include "helicarm/core/random.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/fiducials/centre_offset.h"
#include "helicarm/fiducials/label_fiducials.h"
#include "helicarm/simulation/simulate_case.h"

namespace helicarm {
namespace {

using Eigen::Vector2d;

constexpr std::uint32_t pose_stream = 3001;
constexpr std::uint32_t noise_stream = 4000;  // and the next, for each image
constexpr double pose_px = 0.5;               // per axis: how well a pose tells where a ball is
constexpr int bounds_per_image = 4;
constexpr std::size_t images_with_bounds = 6;
constexpr double grey_of_the_open = 0.75;  // the field's brightest part, as a share of white

simulation::Imaging imaging_of(const CentreSituation& s, const Image<float>& signal) {
  simulation::Imaging imaging;
  imaging.scatter_fraction = s.scatter;
  imaging.quanta_per_pixel = s.quanta;
  imaging.screen_sigma_px = s.screen_sigma_px;
  imaging.focus_sigma_px = s.focus_sigma_px;
  imaging.logarithmic = s.logarithmic;
  if (!s.logarithmic)
    imaging.open_level =
        grey_of_the_open / ((1 + s.scatter) * double(*std::ranges::max_element(signal.pixels())));
  return imaging;
}

/// Makes each square brighter until the given share of the ball's background is clipped.
void clip(XrayImage& xray_image, const BallScene& scene, double share) {
  const double radius = scene.radius_px();
  for (const BallTile& tile : scene.tiles) {
    const Vector2d middle = scene.view.project(tile.ball);
    std::vector<float> background;
    const auto each_pixel = [&](auto&& act) {
      for (int v = tile.top; v < tile.top + BallScene::side_px; ++v)
        for (int u = tile.left; u < tile.left + BallScene::side_px; ++u) act(u, v, xray_image.pixels(u, v));
    };
    each_pixel([&](int u, int v, float grey) {
      const double distance = (Vector2d(u, v) - middle).norm();
      if (distance > radius + 2 && distance < 2 * radius) background.push_back(grey);
    });
    const auto at = background.begin() + std::ptrdiff_t((1 - share) * double(background.size()));
    std::nth_element(background.begin(), at, background.end());
    const float gain = xray_image.highest / *at;
    each_pixel([&](int, int, float& grey) { grey = std::min(xray_image.highest, std::round(gain * grey)); });
  }
}

const Dot* nearest(const std::vector<Dot>& dots, const Vector2d& place, double radius) {
  const Dot* best = nullptr;
  double least = 0.5 * radius;
  for (const Dot& dot : dots)
    if (const double distance = (dot.centre_px - place).norm();
        distance < least && dot.radius_px > 0.7 * radius)
      best = &dot, least = distance;
  return best;
}

XrayImage exposure_of(const Image<std::uint16_t>& grey, const simulation::Imaging& imaging) {
  XrayImage xray_image;
  xray_image.pixels = Image<float>(grey.width(), grey.height());
  std::ranges::copy(grey.pixels(), xray_image.pixels.pixels().begin());
  xray_image.highest = float((1 << imaging.bits) - 1);
  xray_image.acquisition.logarithmic = imaging.logarithmic;
  return xray_image;
}

}  // namespace

void CentreSums::add(const Vector2d& error, double sigma, const Vector2d& towards) {
  constexpr double chi2_95 = 5.991464547107979;  // 2 degrees of freedom
  const double variance = sigma * sigma;
  squares += error.squaredNorm();
  normed += error.squaredNorm() / variance;
  variances += variance;
  bias += error.dot(towards);
  covered += error.squaredNorm() < chi2_95 * variance;
}

CentreSums try_image(const CentreSituation& s, int squares, std::uint64_t seed, std::size_t image) {
  const BallScene scene = ball_scene(s.diameter_mm, s.companion, squares, seed, image);
  const Image<float> signal = scene.signal();
  const simulation::Imaging imaging = imaging_of(s, signal);
  const Image<std::uint16_t> grey =
      simulation::detector_response(signal, imaging, seed, noise_stream + 2 * std::uint32_t(image), 1);
  XrayImage xray_image = exposure_of(grey, imaging);
  if (s.clipped > 0) clip(xray_image, scene, s.clipped);

  const double radius = scene.radius_px();
  const std::vector<Dot> found = find_dots(xray_image, {});
  std::vector<Dot> alone;
  for (std::size_t i = 0; i < scene.tiles.size(); ++i)
    if (is_alone(i))
      if (const Dot* dot = nearest(found, scene.view.project(scene.tiles[i].ball), radius))
        alone.push_back(*dot);
  DotLook look = estimate_look(xray_image, noise_correlation(xray_image), alone);
  look.profile = BallProfile(s.blur_factor * look.profile.blur(), look.profile.absorbance());
  look.options.free_radius = !s.held_radius;

  std::vector<double> contrasts;
  for (const Dot& dot : alone) contrasts.push_back(dot.contrast);
  std::ranges::sort(contrasts);
  const auto fit_ball = [&](const BallTile& tile, RandomStream random) {
    const auto predicted = [&](const simulation::Body& body) {
      Dot dot;
      dot.centre_px = scene.view.project(body.solids.front().world_from_unit.translation()) +
                      pose_px * Vector2d(random.normal(), random.normal());
      dot.radius_px = radius;
      return dot;
    };
    std::vector<Dot> neighbours = found;
    if (s.places_known) {
      neighbours.clear();
      for (const simulation::Body& body : tile.bodies) neighbours.push_back(predicted(body));
    }
    Dot start = predicted(tile.bodies.front());
    const Dot* seen = s.places_known ? nullptr : nearest(found, scene.view.project(tile.ball), radius);
    const Dot expected = start;
    if (seen) start = *seen;
    if (s.held_radius) start.radius_px = *s.held_radius * radius;
    const std::vector<Dot> fitted = refit_dots(xray_image, {start}, look, neighbours);
    const bool assumed = !fitted.empty() &&
                         (seen || (!contrasts.empty() &&
                                   is_plausible(fitted.front(), expected, contrasts[contrasts.size() / 2])));
    return assumed ? std::optional(fitted.front()) : std::nullopt;
  };

  const DistortionMap no_distortion = identity_map(grey.width(), grey.height(), scene.detector.pixel_mm);
  CentreSums sums;
  for (std::size_t i = 0; i < scene.tiles.size(); ++i) {
    if (is_alone(i)) continue;
    const BallTile& tile = scene.tiles[i];
    const Vector2d truth = scene.view.project(tile.ball);
    ++sums.balls;
    const std::optional<Dot> fitted = fit_ball(tile, RandomStream(seed, pose_stream, 100 * image + i));
    if (!fitted) {
      ++sums.refused;
      continue;
    }
    const Dot& dot = *fitted;
    sums.add(
        dot.centre_px - blob_offset(no_distortion, scene.view, truth, tile.ball.z(), s.diameter_mm) - truth,
        dot.error_px(), tile.towards);
    sums.radii += dot.radius_px / radius - 1;
  }
  const bool has_bound =
      s.clipped == 0 && (s.companion == Companion::none || s.companion == Companion::ball ||
                         s.companion == Companion::plate_dot);
  if (has_bound && image < images_with_bounds) {
    const simulation::Light light = simulation::illuminate(signal, imaging);
    const double window = look.options.margin_share * radius + look.options.margin_px;
    for (int k = 0; k < bounds_per_image; ++k) {
      std::size_t tile = (1 + 9 * image + 26 * std::size_t(k)) % scene.tiles.size();
      if (is_alone(tile)) tile = tile > 0 ? tile - 1 : 1;
      const double bound = centre_bound_px(scene, scene.tiles[tile], light, imaging, window);
      sums.bound_squares += bound * bound;
      ++sums.bounds;
    }
  }
  return sums;
}

std::array<CentreSums, 2> try_case(std::uint64_t seed) {
  simulation::SimulationOptions options;
  options.seed = seed;
  options.kind = simulation::CaseKind::flat;
  options.faults = {simulation::Fault::wires};
  options.threads = 1;
  const simulation::SimulatedCase simulated_case = value_or_throw(simulation::simulate_case(options));
  std::array<CentreSums, 2> sums;
  for (const simulation::SimulatedView& view : simulated_case.views) {
    XrayImage xray_image = exposure_of(view.pixels, view.true_view.imaging);
    xray_image.acquisition.pixel_mm = Vector2d::Constant(view.true_view.pixel_mm());
    xray_image.acquisition.source_detector_mm = view.true_view.nominal_f_mm;
    const Rectification plain = value_or_throw(with_map(xray_image, flat_panel_map(xray_image), {}));
    const auto found = label_fiducials(xray_image, plain, detect_candidates(xray_image, plain),
                                       simulated_case.calibrator, {});
    for (std::size_t k = 0; k < view.balls.size(); ++k) {
      const simulation::TruePoint& truth = view.balls[k];
      if (truth.visibility == simulation::Visibility::outside) continue;
      CentreSums& of = sums[truth.visibility == simulation::Visibility::hidden];
      ++of.balls;
      if (found && found->fiducials[k].status == FiducialStatus::used)
        of.add(found->fiducials[k].uv_raw - truth.raw, found->fiducials[k].sigma_px, Vector2d::Zero());
      else
        ++of.refused;
    }
  }
  return sums;
}

}  // namespace helicarm
