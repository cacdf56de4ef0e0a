// SPDX-License-Identifier: Apache-2.0
#include "studies/centre_trial.h"

#include <algorithm>
#include <optional>

#include "helicarm/core/random_vectors.h"
#include "helicarm/core/statistics.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/fiducials/centre_offset.h"
#include "helicarm/fiducials/label_fiducials.h"
#include "helicarm/simulation/simulate_case.h"

namespace helicarm::study {
namespace {

using Eigen::Vector2d;

constexpr std::uint32_t pose_stream = 3001;
constexpr std::uint32_t noise_stream = 4000;  // and the next one, for each image
constexpr double pose_px = 0.5;               // error of a ball's predicted position, per axis
constexpr int bounds_per_image = 4;
constexpr std::size_t images_with_bounds = 6;
constexpr double grey_of_the_open = 0.75;  // brightest part of the field as a share of white

simulation::Imaging imaging_of(const CentreSituation& s, const image::Image<float>& signal) {
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

/// Brightens each square until the given share of the ball's background is clipped.
void clip(xray::XrayImage& xray_image, const BallScene& scene, double share) {
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
    const float gain =
        xray_image.highest / value_of_rank(background, std::size_t((1 - share) * double(background.size())));
    each_pixel([&](int, int, float& grey) { grey = std::min(xray_image.highest, std::round(gain * grey)); });
  }
}

const detection::Dot* nearest(const std::vector<detection::Dot>& dots, const Vector2d& place, double radius) {
  const detection::Dot* best = nullptr;
  double least = 0.5 * radius;
  for (const detection::Dot& dot : dots)
    if (const double distance = (dot.centre_px - place).norm();
        distance < least && dot.radius_px > 0.7 * radius)
      best = &dot, least = distance;
  return best;
}

xray::XrayImage xray_image_of(const image::Image<std::uint16_t>& grey, const simulation::Imaging& imaging) {
  xray::XrayImage xray_image;
  xray_image.pixels = image::Image<float>(grey.width(), grey.height());
  std::ranges::copy(grey.pixels(), xray_image.pixels.pixels().begin());
  xray_image.highest = float((1 << imaging.bits) - 1);
  xray_image.acquisition.logarithmic = imaging.logarithmic;
  return xray_image;
}

std::vector<detection::Dot> dots_alone(const BallScene& scene, const std::vector<detection::Dot>& found) {
  std::vector<detection::Dot> alone;
  for (std::size_t i = 0; i < scene.tiles.size(); ++i)
    if (is_alone(i))
      if (const detection::Dot* dot =
              nearest(found, scene.view.project(scene.tiles[i].ball), scene.radius_px()))
        alone.push_back(*dot);
  return alone;
}

/// Fits the ball of a tile as the pipeline would: from a detection or from a predicted place, by the image of
/// the balls that stand alone.
class TileFit {
 public:
  TileFit(const CentreSituation& situation, const BallScene& scene, const xray::XrayImage& xray_image)
      : situation_(situation),
        scene_(scene),
        xray_image_(xray_image),
        found_(detection::find_dots(xray_image, {})),
        alone_(dots_alone(scene, found_)),
        appearance_(
            detection::estimate_appearance(xray_image, detection::noise_correlation(xray_image), alone_)) {
    appearance_.profile = detection::BallProfile(situation.blur_factor * appearance_.profile.blur(),
                                                 appearance_.profile.absorbance());
    appearance_.options.free_radius = !situation.held_radius;
    for (const detection::Dot& dot : alone_) contrasts_.push_back(dot.contrast);
    std::ranges::sort(contrasts_);
  }

  double window_px() const {
    return appearance_.options.margin_share * scene_.radius_px() + appearance_.options.margin_px;
  }

  std::optional<detection::Dot> operator()(const BallTile& tile, RandomStream random) const {
    const double radius = scene_.radius_px();
    std::vector<detection::Dot> neighbours = found_;
    if (situation_.places_known) {
      neighbours.clear();
      for (const simulation::Body& body : tile.bodies) neighbours.push_back(predicted(body, random));
    }
    const detection::Dot expected = predicted(tile.bodies.front(), random);
    const detection::Dot* seen =
        situation_.places_known ? nullptr : nearest(found_, scene_.view.project(tile.ball), radius);
    detection::Dot start = seen ? *seen : expected;
    if (situation_.held_radius) start.radius_px = *situation_.held_radius * radius;
    const std::vector<detection::Dot> fitted =
        detection::refit_dots(xray_image_, {start}, appearance_, neighbours);
    if (fitted.empty()) return std::nullopt;
    const bool plausible =
        seen || (!contrasts_.empty() &&
                 fiducials::is_plausible(fitted.front(), expected, contrasts_[contrasts_.size() / 2]));
    return plausible ? std::optional(fitted.front()) : std::nullopt;
  }

 private:
  detection::Dot predicted(const simulation::Body& body, RandomStream& random) const {
    detection::Dot dot;
    dot.centre_px =
        scene_.view.project(body.solids.front().world_from_unit.translation()) + pose_px * normal_2(random);
    dot.radius_px = scene_.radius_px();
    return dot;
  }

  const CentreSituation& situation_;
  const BallScene& scene_;
  const xray::XrayImage& xray_image_;
  std::vector<detection::Dot> found_;
  std::vector<detection::Dot> alone_;
  detection::DotAppearance appearance_;
  std::vector<double> contrasts_;
};

void add_bounds(CentreSums& sums, const BallScene& scene, const simulation::Light& light,
                const simulation::Imaging& imaging, double window_px, std::size_t image) {
  for (int k = 0; k < bounds_per_image; ++k) {
    std::size_t tile = (1 + 9 * image + 26 * std::size_t(k)) % scene.tiles.size();
    if (is_alone(tile)) tile = tile > 0 ? tile - 1 : 1;
    const double bound = centre_bound_px(scene, scene.tiles[tile], light, imaging, window_px);
    sums.bound_squares += bound * bound;
    ++sums.bounds;
  }
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
  const image::Image<float> signal = scene.signal();
  const simulation::Imaging imaging = imaging_of(s, signal);
  const image::Image<std::uint16_t> grey =
      simulation::detector_response(signal, imaging, seed, noise_stream + 2 * std::uint32_t(image), 1);
  xray::XrayImage xray_image = xray_image_of(grey, imaging);
  if (s.clipped > 0) clip(xray_image, scene, s.clipped);
  const TileFit tile_fit(s, scene, xray_image);

  const rectification::DistortionMap no_distortion =
      rectification::identity_map(grey.width(), grey.height(), scene.detector.pixel_mm);
  CentreSums sums;
  for (std::size_t i = 0; i < scene.tiles.size(); ++i) {
    if (is_alone(i)) continue;
    const BallTile& tile = scene.tiles[i];
    const Vector2d truth = scene.view.project(tile.ball);
    ++sums.balls;
    const std::optional<detection::Dot> fitted =
        tile_fit(tile, RandomStream(seed, pose_stream, 100 * image + i));
    if (!fitted) {
      ++sums.refused;
      continue;
    }
    const detection::Dot& dot = *fitted;
    sums.add(dot.centre_px -
                 fiducials::blob_offset(no_distortion, scene.view, truth, tile.ball.z(), s.diameter_mm) -
                 truth,
             dot.error_px(), tile.towards);
    sums.radii += dot.radius_px / scene.radius_px() - 1;
  }
  const bool has_bound =
      s.clipped == 0 && (s.companion == Companion::none || s.companion == Companion::ball ||
                         s.companion == Companion::plate_dot);
  if (has_bound && image < images_with_bounds)
    add_bounds(sums, scene, simulation::illuminate(signal, imaging), imaging, tile_fit.window_px(), image);
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
    xray::XrayImage xray_image = xray_image_of(view.pixels, view.true_view.imaging);
    xray_image.acquisition.pixel_mm = Vector2d::Constant(view.true_view.pixel_mm());
    xray_image.acquisition.source_detector_mm = view.true_view.nominal_f_mm;
    auto dots = detection::unsearched(xray_image, detection::DotOptions{}.min_radius_px);
    const rectification::Rectification plain = value_or_throw(
        rectification::with_map(xray_image, dots, rectification::flat_panel_map(xray_image), {}));
    const auto found = fiducials::label_fiducials(xray_image, dots, plain, simulated_case.calibrator, {});
    for (std::size_t k = 0; k < view.balls.size(); ++k) {
      const simulation::TruePoint& truth = view.balls[k];
      if (truth.visibility == simulation::Visibility::outside) continue;
      CentreSums& of = sums[truth.visibility == simulation::Visibility::hidden];
      ++of.balls;
      if (found && found->fiducials[k].status == fiducials::FiducialStatus::used)
        of.add(found->fiducials[k].uv_raw - truth.raw, found->fiducials[k].sigma_px, Vector2d::Zero());
      else
        ++of.refused;
    }
  }
  return sums;
}

}  // namespace helicarm::study
