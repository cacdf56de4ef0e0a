// SPDX-License-Identifier: Apache-2.0
#include "helicarm/study/centres.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "helicarm/core/parallel.h"
#include "helicarm/core/random.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/fiducials/centre_offset.h"
#include "helicarm/fiducials/find_fiducials.h"
#include "helicarm/simulation/simulate_case.h"
#include "helicarm/study/ball_scene.h"

namespace helicarm {
namespace {

using Eigen::Vector2d;

constexpr std::uint32_t pose_stream = 3001;
constexpr std::uint32_t noise_stream = 4000;         // and the next, for each picture
constexpr double chi2_95_plane = 5.991464547107979;  // 2 degrees of freedom
constexpr const char* whole_view = "cone before a knee";
constexpr double ball_mm = 4;
constexpr double pose_px = 0.5;  // per axis: how well a pose tells where a ball is
constexpr int bounds_per_picture = 4;
constexpr std::size_t pictures_with_bounds = 6;
constexpr double grey_of_the_open = 0.75;  // the field's brightest part, as a share of white

/// What a situation changes in the picture or in what the fit is told.
struct CentreSituation {
  std::string group, name;
  double scatter = 0.3;  ///< over the direct signal
  double quanta = 1000;  ///< per pixel, mean over the field
  double screen_sigma_px = 0.65;
  double focus_sigma_px = 0.6;
  bool logarithmic = false;
  double diameter_mm = ball_mm;
  Companion companion = Companion::none;
  bool places_known = false;               ///< of the balls, roughly: nothing is searched for
  double clipped = 0;                      ///< share of the ball's background
  double blur_factor = 1;                  ///< on the blur that the fit has found
  std::optional<double> held_radius = {};  ///< over the true one; empty: fitted
};

std::vector<CentreSituation> all_situations() {
  std::vector<CentreSituation> all;
  const auto add = [&](const char* group, const char* name, auto change) {
    CentreSituation situation{group, name};
    change(situation);
    all.push_back(situation);
  };
  using S = CentreSituation;
  add("as it is", "as it is", [](S&) {});
  add("fitted blur", "20 % too small", [](S& s) { s.blur_factor = 0.8; });
  add("fitted blur", "20 % too large", [](S& s) { s.blur_factor = 1.2; });
  add("diameter held", "true", [](S& s) { s.held_radius = 1; });
  add("diameter held", "5 % too small", [](S& s) { s.held_radius = 0.95; });
  add("diameter held", "5 % too large", [](S& s) { s.held_radius = 1.05; });
  add("scatter over direct", "0", [](S& s) { s.scatter = 0; });
  add("scatter over direct", "0.6", [](S& s) { s.scatter = 0.6; });
  add("background clipped", "20 %", [](S& s) { s.clipped = 0.2; });
  add("background clipped", "50 %", [](S& s) { s.clipped = 0.5; });
  add("across the ball", "wire over the middle third",
      [](S& s) { s.companion = Companion::wire_in_the_middle; });
  add("across the ball", "wire over a side's third", [](S& s) { s.companion = Companion::wire_beside; });
  add("across the ball", "ball 1.5 radii off", [](S& s) { s.companion = Companion::ball; });
  add("across the ball", "the same with places known",
      [](S& s) { s.companion = Companion::ball, s.places_known = true; });
  add("across the ball", "plate dot on the rim", [](S& s) { s.companion = Companion::plate_dot; });
  add("across the ball", "edge of a bone", [](S& s) { s.companion = Companion::bone; });
  add("quanta per pixel", "50", [](S& s) { s.quanta = 50; });
  add("quanta per pixel", "250", [](S& s) { s.quanta = 250; });
  add("quanta per pixel", "4000", [](S& s) { s.quanta = 4000; });
  add("quanta per pixel", "16000", [](S& s) { s.quanta = 16000; });
  add("screen blur sigma", "0 px", [](S& s) { s.screen_sigma_px = 0; });
  add("screen blur sigma", "1 px", [](S& s) { s.screen_sigma_px = 1; });
  add("screen blur sigma", "2 px", [](S& s) { s.screen_sigma_px = 2; });
  add("focus blur sigma", "1.5 px", [](S& s) { s.focus_sigma_px = 1.5; });
  add("picture", "logarithmic", [](S& s) { s.logarithmic = true; });
  add("ball", "2.5 mm", [](S& s) { s.diameter_mm = 2.5; });
  return all;
}

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
void clip(Exposure& exposure, const BallScene& scene, double share) {
  const double radius = scene.radius_px();
  for (const BallTile& tile : scene.tiles) {
    const Vector2d middle = scene.view.project(tile.ball);
    std::vector<float> background;
    const auto each_pixel = [&](auto&& act) {
      for (int v = tile.top; v < tile.top + BallScene::side_px; ++v)
        for (int u = tile.left; u < tile.left + BallScene::side_px; ++u) act(u, v, exposure.pixels(u, v));
    };
    each_pixel([&](int u, int v, float grey) {
      const double distance = (Vector2d(u, v) - middle).norm();
      if (distance > radius + 2 && distance < 2 * radius) background.push_back(grey);
    });
    const auto at = background.begin() + std::ptrdiff_t((1 - share) * double(background.size()));
    std::nth_element(background.begin(), at, background.end());
    const float gain = exposure.highest / *at;
    each_pixel([&](int, int, float& grey) { grey = std::min(exposure.highest, std::round(gain * grey)); });
  }
}

/// What one picture adds.
struct CentreSums {
  int balls = 0, refused = 0, covered = 0, bounds = 0;
  double squares = 0, normed = 0, variances = 0, bias = 0, radii = 0, bound_squares = 0;

  void add(const Vector2d& error, double sigma, const Vector2d& towards) {
    const double variance = sigma * sigma;
    squares += error.squaredNorm();
    normed += error.squaredNorm() / variance;
    variances += variance;
    bias += error.dot(towards);
    covered += error.squaredNorm() < chi2_95_plane * variance;
  }
};

const Dot* nearest(const std::vector<Dot>& dots, const Vector2d& place, double radius) {
  const Dot* best = nullptr;
  double least = 0.5 * radius;
  for (const Dot& dot : dots)
    if (const double distance = (dot.centre_px - place).norm();
        distance < least && dot.radius_px > 0.7 * radius)
      best = &dot, least = distance;
  return best;
}

Exposure exposure_of(const Image<std::uint16_t>& grey, const simulation::Imaging& imaging) {
  Exposure exposure;
  exposure.pixels = Image<float>(grey.width(), grey.height());
  std::ranges::copy(grey.pixels(), exposure.pixels.pixels().begin());
  exposure.highest = float((1 << imaging.bits) - 1);
  exposure.acquisition.logarithmic = imaging.logarithmic;
  return exposure;
}

CentreSums try_picture(const CentreSituation& s, int squares, std::uint64_t seed, std::size_t picture) {
  const BallScene scene = ball_scene(s.diameter_mm, s.companion, squares, seed, picture);
  const Image<float> signal = scene.signal();
  const simulation::Imaging imaging = imaging_of(s, signal);
  const Image<std::uint16_t> grey =
      simulation::develop(signal, imaging, seed, noise_stream + 2 * std::uint32_t(picture), 1);
  Exposure exposure = exposure_of(grey, imaging);
  if (s.clipped > 0) clip(exposure, scene, s.clipped);

  const double radius = scene.radius_px();
  const std::vector<Dot> found = find_dots(exposure, {});
  std::vector<Dot> alone;
  for (std::size_t i = 0; i < scene.tiles.size(); ++i)
    if (is_alone(i))
      if (const Dot* dot = nearest(found, scene.view.project(scene.tiles[i].ball), radius))
        alone.push_back(*dot);
  DotLook look = estimate_look(exposure, noise_correlation(exposure), alone);
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
    const std::vector<Dot> fitted = refit_dots(exposure, {start}, look, neighbours);
    const bool believed =
        !fitted.empty() && (seen || (!contrasts.empty() && is_believable(fitted.front(), expected,
                                                                         contrasts[contrasts.size() / 2])));
    return believed ? std::optional(fitted.front()) : std::nullopt;
  };

  const DistortionMap no_distortion = identity_map(grey.width(), grey.height(), scene.detector.pixel_mm);
  CentreSums sums;
  for (std::size_t i = 0; i < scene.tiles.size(); ++i) {
    if (is_alone(i)) continue;
    const BallTile& tile = scene.tiles[i];
    const Vector2d truth = scene.view.project(tile.ball);
    ++sums.balls;
    const std::optional<Dot> fitted = fit_ball(tile, RandomStream(seed, pose_stream, 100 * picture + i));
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
  if (has_bound && picture < pictures_with_bounds) {
    const simulation::Light light = simulation::illuminate(signal, imaging);
    const double window = look.options.margin_share * radius + look.options.margin_px;
    for (int k = 0; k < bounds_per_picture; ++k) {
      std::size_t tile = (1 + 9 * picture + 26 * std::size_t(k)) % scene.tiles.size();
      if (is_alone(tile)) tile = tile > 0 ? tile - 1 : 1;
      const double bound = centre_bound_px(scene, scene.tiles[tile], light, imaging, window);
      sums.bound_squares += bound * bound;
      ++sums.bounds;
    }
  }
  return sums;
}

/// A calibrator before a knee on a flat panel, a wire over a ball in each view: the balls that nothing
/// touches, and those that other metal does.
std::array<CentreSums, 2> try_case(std::uint64_t seed) {
  simulation::SimulationOptions options;
  options.seed = seed;
  options.kind = simulation::CaseKind::flat;
  options.faults = {simulation::Fault::wires};
  options.threads = 1;
  const simulation::SimulatedCase room = value_or_throw(simulation::simulate_case(options));
  std::array<CentreSums, 2> sums;
  for (const simulation::SimulatedView& view : room.views) {
    Exposure exposure = exposure_of(view.pixels, view.shot.imaging);
    exposure.acquisition.pixel_mm = Vector2d::Constant(view.shot.pixel_mm());
    exposure.acquisition.source_detector_mm = view.shot.nominal_f_mm;
    const Range radii = ball_radii_px(room.calibrator, view.shot.pixel_mm());
    const Rectification plain = value_or_throw(without_plate(exposure, 0.5 * radii.low));
    const auto found = find_fiducials(exposure, plain, room.calibrator, Method::best);
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

CentreRow row_of(const CentreSituation& s, const std::vector<CentreSums>& pictures) {
  CentreSums all;
  for (const CentreSums& one : pictures) {
    all.balls += one.balls, all.refused += one.refused, all.covered += one.covered, all.bounds += one.bounds;
    all.squares += one.squares, all.normed += one.normed, all.variances += one.variances;
    all.bias += one.bias, all.radii += one.radii, all.bound_squares += one.bound_squares;
  }
  CentreRow row{s.group, s.name, all.balls, all.refused};
  const double fitted = all.balls - all.refused;
  row.rms_px = std::sqrt(all.squares / (2 * fitted));
  row.bias_px = all.bias / fitted;
  row.sigma_px = std::sqrt(all.variances / fitted);
  row.z = std::sqrt(all.normed / (2 * fitted));
  row.radius_bias = all.radii / fitted;
  row.coverage = all.covered / fitted;
  row.bound_px =
      all.bounds > 0 ? std::sqrt(all.bound_squares / all.bounds) : std::numeric_limits<double>::quiet_NaN();
  return row;
}

}  // namespace

std::vector<CentreRow> study_centres(const CentreOptions& options,
                                     const std::function<void(double share)>& progress) {
  const int squares = options.squares * options.squares;
  const int measured = squares - (squares + 7) / 8;
  const auto pictures = std::size_t((options.balls + measured - 1) / measured);
  const auto wanted = [&](const std::string& group) {
    return options.only.empty() || std::ranges::count(options.only, group) > 0;
  };
  std::vector<CentreSituation> situations = all_situations();
  std::erase_if(situations, [&](const CentreSituation& s) { return !wanted(s.group); });
  std::vector<CentreRow> rows;
  for (const CentreSituation& situation : situations) {
    std::vector<CentreSums> sums(pictures);
    parallel_for(pictures, options.threads,
                 [&](std::size_t i) { sums[i] = try_picture(situation, options.squares, options.seed, i); });
    rows.push_back(row_of(situation, sums));
    progress(double(rows.size()) / double(situations.size() + 2));
  }
  if (!wanted(whole_view)) return rows;
  std::vector<std::array<CentreSums, 2>> cases(pictures);
  parallel_for(pictures, options.threads, [&](std::size_t i) { cases[i] = try_case(options.seed + i); });
  for (const std::size_t touched : {0, 1}) {
    std::vector<CentreSums> sums;
    for (const auto& both : cases) sums.push_back(both[touched]);
    rows.push_back(row_of({whole_view, touched ? "metal touches it" : "alone"}, sums));
    rows.back().bias_px = rows.back().radius_bias = std::numeric_limits<double>::quiet_NaN();
  }
  progress(1);
  return rows;
}

}  // namespace helicarm
