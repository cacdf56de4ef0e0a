// SPDX-License-Identifier: Apache-2.0
#include "studies/paper_scene.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "helicarm/geometry/rotation.h"
#include "helicarm/phantom/conical_helix.h"

namespace helicarm::study {
namespace {

// 19 points within sqrt(2) steps: 6 at one step, 12 at sqrt(2). The mean squared radius of a sphere's points
// is 3/5 of its radius squared.
const double ball_lattice_mm = space_radius_mm * std::sqrt(0.6 * 19 / 30);
constexpr double cone_lattice_mm = 30;

/// Lattice points about `middle` for which `inside` holds, up to four steps away.
template <class Inside>
std::vector<Eigen::Vector3d> lattice_points(const Eigen::Vector3d& middle, double step_mm, Inside inside) {
  std::vector<Eigen::Vector3d> points;
  for (int k = -4; k <= 4; ++k)
    for (int j = -4; j <= 4; ++j)
      for (int i = -4; i <= 4; ++i)
        if (const Eigen::Vector3d point = middle + step_mm * Eigen::Vector3d(i, j, k); inside(point))
          points.push_back(point);
  return points;
}

}  // namespace

std::string_view name_of(WorldOrigin origin) { return origin == WorldOrigin::base ? "base" : "centre"; }

std::string_view name_of(SigmaReading reading) {
  constexpr std::array names{"std", "var", "mean_distance", "rms_distance"};
  return names[std::size_t(reading)];
}

double sigma_px(SigmaReading reading, double fle) {
  switch (reading) {
    case SigmaReading::std:
      return fle;
    case SigmaReading::var:
      return std::sqrt(fle);
    case SigmaReading::mean_distance:
      return fle / std::sqrt(std::numbers::pi / 2);  // mean of a Rayleigh distribution
    case SigmaReading::rms_distance:
      return fle / std::numbers::sqrt2;
  }
  throw std::invalid_argument("sigma_px: unknown reading");
}

Eigen::Vector3d origin_in_calibrator(WorldOrigin origin) {
  return origin == WorldOrigin::base ? Eigen::Vector3d::Zero() : middle_of_cone();
}

std::array<geometry::View, 2> paper_views(WorldOrigin origin) {
  constexpr double f_px = 900 / 0.15;
  const auto view = [&](double alpha) {
    const Eigen::Matrix3d rotation = geometry::rotation_from_euler(alpha, 0, 0);
    return geometry::View{{f_px, f_px, 512, 512, 0},
                          {rotation, Eigen::Vector3d(0, 0, 800) - rotation * origin_in_calibrator(origin)}};
  };
  return {view(0), view(std::numbers::pi / 2)};
}

std::vector<Eigen::Vector3d> targets_in_ball(WorldOrigin origin) {
  const Eigen::Vector3d middle = origin_in_calibrator(origin);
  return lattice_points(middle, ball_lattice_mm, [&](const Eigen::Vector3d& point) {
    return (point - middle).norm() <= space_radius_mm;
  });
}

std::vector<Eigen::Vector3d> targets_in_cone() {
  return lattice_points(middle_of_cone(), cone_lattice_mm, [](const Eigen::Vector3d& point) {
    const double share = point.z() / cone_height_mm;
    return share >= 0 && share <= 1 &&
           point.head<2>().norm() <= cone_base_mm + share * (cone_top_mm - cone_base_mm);
  });
}

Eigen::Vector3d middle_of_cone() { return {0, 0, cone_height_mm / 2}; }

SimdViews::SimdViews(const std::array<geometry::View, 2>& views) {
  for (std::size_t i = 0; i < 2; ++i) {
    const geometry::Projection projection = views[i].projection();
    for (Eigen::Index row = 0; row < 3; ++row)
      for (Eigen::Index column = 0; column < 4; ++column) p_[i][row][column] = projection(row, column);
  }
}

SimdPixel SimdViews::project(std::size_t view, const SimdPoint& point) const {
  const auto row = [&](int i) {
    const double(&p)[4] = p_[view][i];
    return p[0] * point.x + p[1] * point.y + p[2] * point.z + p[3];
  };
  const Simd one_over_depth = 1.0 / row(2);
  return {row(0) * one_over_depth, row(1) * one_over_depth};
}

SimdPoint on_spiral(Simd share) {
  constexpr phantom::ConicalHelix spiral;
  const SineCosine direction = sine_cosine_of_turns(share * (spiral.t_end / (2 * std::numbers::pi)));
  const Simd radius = spiral.rr * exponential(share * (-spiral.t_end / spiral.pp));
  return {radius * direction.cosine, radius * direction.sine, share * (spiral.h * spiral.t_end)};
}

std::vector<SimdPoint> balls_on_spiral(const SimdRandom& random, std::size_t count) {
  std::vector<SimdPoint> balls(count);
  for (std::size_t i = 0; i < count; i += 2) {
    const auto [first, second] = random.uniforms(draw::places + std::uint32_t(i / 2));
    balls[i] = on_spiral(first);
    if (i + 1 < count) balls[i + 1] = on_spiral(second);
  }
  return balls;
}

void draw_noise(const SimdRandom& random, std::uint32_t from, std::size_t count, SimdPixels& noise) {
  // In two passes, each short enough for the compiler to vectorise over pixels.
  for (std::uint32_t view = 0; view < 2; ++view) {
    SimdPixel(&pixels)[SimdBalls::most] = noise.of_view[view];
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto [u, v] = random.uniforms(from + view * std::uint32_t(SimdBalls::most) + i);
      pixels[i] = {u, v};
    }
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto [u, v] = SimdRandom::normals_of({pixels[i].u, pixels[i].v});
      pixels[i] = {u, v};
    }
  }
}

void add_noise(const SimdPixels& exact, double sigma, const SimdPixels& noise, std::size_t count,
               SimdPixels& pixels) {
  for (std::size_t view = 0; view < 2; ++view)
    for (std::size_t i = 0; i < count; ++i) {
      const SimdPixel& unit = noise.of_view[view][i];
      const SimdPixel& from = exact.of_view[view][i];
      pixels.of_view[view][i] = {from.u + sigma * unit.u, from.v + sigma * unit.v};
    }
}

SimdTargets::SimdTargets(std::span<const Eigen::Vector3d> points,
                         const std::array<geometry::View, 2>& views) {
  if (points.size() > SimdBalls::most) throw std::invalid_argument("SimdTargets: more than 64");
  const SimdViews lane_views(views);
  for (const Eigen::Vector3d& point : points) {
    const SimdPoint target{simd(point.x()), simd(point.y()), simd(point.z())};
    for (std::size_t i = 0; i < 2; ++i) exact_.of_view[i][points_.size()] = lane_views.project(i, target);
    points_.push_back(target);
  }
}

Simd SimdTargets::mean_error(std::size_t begin, std::size_t end, const SimdProjection (&views)[2],
                             double sigma, const SimdPixels* noise) const {
  Simd sum{};
  for (std::size_t i = begin; i < end; ++i) {
    SimdPixel seen[2];
    for (std::size_t view = 0; view < 2; ++view) {
      seen[view] = exact_.of_view[view][i];
      if (!noise) continue;
      seen[view].u += sigma * noise->of_view[view][i].u;
      seen[view].v += sigma * noise->of_view[view][i].v;
    }
    sum += norm(intersect(views[0], seen[0], views[1], seen[1]) - points_[i]);
  }
  return sum / double(end - begin);
}

Simd SimdTargets::mean_square(std::size_t begin, std::size_t end, const SimdProjection (&views)[2]) const {
  Simd sum{};
  for (std::size_t i = begin; i < end; ++i) {
    const SimdPoint off =
        intersect(views[0], exact_.of_view[0][i], views[1], exact_.of_view[1][i]) - points_[i];
    sum += dot(off, off);
  }
  return sum / double(end - begin);
}

}  // namespace helicarm::study
