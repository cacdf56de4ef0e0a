// SPDX-License-Identifier: Apache-2.0
#include "studies/location.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <fmt/format.h>

#include "studies/records.h"

namespace helicarm::study {
namespace {

constexpr std::size_t draws_of_block = 128;
constexpr std::uint32_t location_balls = 12;
constexpr std::uint32_t of_point = 2;  // blocks of words, one per view

struct LocationTrials {
  const LocationOptions& options;
  const LocationMap& map;
  std::array<geometry::View, 2> views = paper_views(options.origin);
  SimdViews lane_views{views};

  struct Sums {
    double fresh, fresh_squares, exact, exact_squares;
  };
  static constexpr std::size_t sums_of_point = numbers_in<Sums>;

  /// Sums over the draws of a block; the last one may have fewer.
  void run(std::size_t block, std::span<double> values) const {
    const std::size_t count = map.balls.size();
    const double sigma = sigma_px(options.sigma, options.fle);
    std::vector<SimdPoint> balls;
    SimdPixels exact, noise, pixels;
    for (const Eigen::Vector3d& ball : map.balls) {
      balls.push_back({simd(ball.x()), simd(ball.y()), simd(ball.z())});
      for (std::size_t view = 0; view < 2; ++view)
        exact.of_view[view][balls.size() - 1] = lane_views.project(view, balls.back());
    }
    const SimdBalls model(balls);
    const std::size_t end = std::min(options.groups, (block + 1) * draws_of_block);
    for (std::size_t first = block * draws_of_block; first < end; first += simd_width) {
      const SimdRandom random(options.seed, location_stream, first);
      draw_noise(random, draw::calibration, count, noise);
      add_noise(exact, sigma, noise, count, pixels);
      const SimdProjection calibrated[2] = {model.calibrate({pixels.of_view[0], count}),
                                            model.calibrate({pixels.of_view[1], count})};
      const auto drawn = std::min<std::size_t>(simd_width, end - first);
      for (std::size_t i = 0; i < map.points.size(); ++i) {
        const Eigen::Vector3d& position = map.points[i].place;
        const SimdPoint target{simd(position.x()), simd(position.y()), simd(position.z())};
        SimdPixel bare[2], noisy[2];
        for (std::size_t view = 0; view < 2; ++view) {
          const auto [u, v] =
              random.normals(draw::repetition + of_point * std::uint32_t(i) + std::uint32_t(view));
          bare[view] = lane_views.project(view, target);
          noisy[view] = {bare[view].u + sigma * u, bare[view].v + sigma * v};
        }
        const Simd fresh = norm(intersect(calibrated[0], noisy[0], calibrated[1], noisy[1]) - target);
        const Simd still = norm(intersect(calibrated[0], bare[0], calibrated[1], bare[1]) - target);
        double* sums = values.data() + i * sums_of_point;
        for (std::size_t lane = 0; lane < drawn; ++lane) {
          sums[0] += fresh[lane];
          sums[1] += fresh[lane] * fresh[lane];
          sums[2] += still[lane];
          sums[3] += still[lane] * still[lane];
        }
      }
    }
  }
};

std::vector<Eigen::Vector3d> balls_of(const LocationOptions& options) {
  if (!options.balls.empty()) return options.balls;
  const auto drawn = balls_on_spiral(SimdRandom(options.seed, location_stream + 1, 0), location_balls);
  std::vector<Eigen::Vector3d> balls;
  for (const SimdPoint& ball : drawn) balls.emplace_back(ball.x[0], ball.y[0], ball.z[0]);
  return balls;
}

SeenIn seen_in(const std::array<geometry::View, 2>& views, const Eigen::Vector3d& position) {
  const auto holds = [&](const geometry::View& view) {
    const Eigen::Array2d pixel = view.project(position);
    return view.depth(position) > 0 && (pixel >= -0.5).all() && (pixel < image_px - 0.5).all();
  };
  return SeenIn((holds(views[0]) ? 1 : 0) + (holds(views[1]) ? 2 : 0));
}

LocationMap empty_map(const LocationOptions& options) {
  const std::array<geometry::View, 2> views = paper_views(options.origin);
  LocationMap map;
  map.balls = balls_of(options);
  map.centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& ball : map.balls) map.centre += ball / double(map.balls.size());
  const int reach = int(options.half_mm / options.step_mm + 1e-9);
  map.side = 2 * reach + 1;
  for (const TargetPlane plane : {TargetPlane::xoy, TargetPlane::xoz})
    for (int row = -reach; row <= reach; ++row)
      for (int column = -reach; column <= reach; ++column) {
        const Eigen::Vector3d out =
            plane == TargetPlane::xoy ? Eigen::Vector3d(column, row, 0) : Eigen::Vector3d(column, 0, row);
        const Eigen::Vector3d position = map.centre + options.step_mm * out;
        map.points.push_back({plane, position, seen_in(views, position), 0, 0, 0, 0});
      }
  return map;
}

}  // namespace

Expected<LocationMap> study_location(const LocationOptions& options, const EngineOptions& engine,
                                     const Ranks& ranks) {
  LocationMap map = empty_map(options);
  if (map.balls.size() < 6 || map.balls.size() > SimdBalls::most)
    return fail(Reason::bad_value,
                fmt::format("balls: {}, limits 6 and {}", map.balls.size(), SimdBalls::most));
  if (options.groups < 2)
    return fail(Reason::bad_value, fmt::format("groups: {}, at least 2 are required", options.groups));
  const LocationTrials trials{options, map};
  constexpr std::size_t stride = LocationTrials::sums_of_point;
  StudySetting setting;
  setting.blocks = (options.groups + draws_of_block - 1) / draws_of_block;
  setting.values_per_block = map.points.size() * stride;
  setting.work = [&](std::size_t block, std::span<double> values) { trials.run(block, values); };
  setting.settle = [&](std::span<const double> values) {
    std::vector<double> sums(setting.values_per_block);
    for (std::size_t i = 0; i < values.size(); ++i) sums[i % sums.size()] += values[i];
    return sums;
  };
  std::string identity =
      fmt::format("location {} groups {} seed {} sigma {} fle {} origin {} half {} step {}", HELICARM_VERSION,
                  options.groups, options.seed, name_of(options.sigma), options.fle, name_of(options.origin),
                  options.half_mm, options.step_mm);
  for (const Eigen::Vector3d& ball : map.balls)
    identity += fmt::format(" {} {} {}", ball.x(), ball.y(), ball.z());
  const auto n = double(options.groups);
  const auto mean_and_se = [&](double sum, double squares) {
    const double mean = sum / n;
    return std::pair{mean, std::sqrt(std::max(0.0, squares / n - mean * mean) / (n - 1))};
  };
  return run_study({setting}, identity, engine, ranks).map([&](const auto& kept) {
    if (kept.empty()) map.points.clear();
    for (std::size_t i = 0; i < map.points.size(); ++i) {
      const double* sums = kept.front().data() + i * stride;
      LocationPoint& point = map.points[i];
      std::tie(point.tre_fresh, point.se_fresh) = mean_and_se(sums[0], sums[1]);
      std::tie(point.tre_exact, point.se_exact) = mean_and_se(sums[2], sums[3]);
    }
    return map;
  });
}

}  // namespace helicarm::study
