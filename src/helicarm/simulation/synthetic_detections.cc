// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/synthetic_detections.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "helicarm/core/random_vectors.h"
#include "helicarm/simulation/random_pose.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

const NominalCamera nominal;
constexpr double lattice_px = 110;  // 25 mm at the receiver

geometry::View random_view(const phantom::Calibrator& calibrator, std::optional<bool> mirrored,
                           RandomStream& random) {
  geometry::View view;
  const bool flip = mirrored.value_or(random.uniform() < 0.5);
  const double f = nominal.focal_px * random.uniform(0.99, 1.01);
  const Vector2d principal = nominal.principal_px + in_disc(random, 55);
  view.intrinsics = {flip ? -f : f, f, principal.x(), principal.y()};
  view.camera_from_world.rotation = random_rotation(random);
  Vector3d centre = Vector3d::Zero();
  for (const auto& ball : calibrator.balls)
    centre += ball.centre_in_calibrator / static_cast<double>(calibrator.balls.size());
  const Vector3d place = in_box(random, Vector3d(-20, -20, 550), Vector3d(20, 20, 920));
  view.camera_from_world.translation = place - view.camera_from_world.rotation * centre;
  return view;
}

}  // namespace

SyntheticView synthetic_detections(const phantom::Calibrator& calibrator,
                                   const SyntheticDetectionOptions& options, RandomStream& random) {
  SyntheticView image;
  image.view = random_view(calibrator, options.mirrored, random);
  image.radius_bias = random.uniform(-0.02, 0.02);
  const auto balls = static_cast<int>(calibrator.balls.size());
  std::vector<int> order(calibrator.balls.size());
  std::iota(order.begin(), order.end(), 0);
  for (std::uint32_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random.index(i)]);

  std::vector<Vector2d> exact;
  std::vector<double> radius;
  for (const auto& ball : calibrator.balls) {
    exact.push_back(image.view.project(ball.centre_in_calibrator));
    radius.push_back((1 + image.radius_bias) * image.view.intrinsics.fy * ball.diameter_mm / 2 /
                     image.view.depth(ball.centre_in_calibrator));
  }
  const auto shown = [&](int place) {
    return place >= options.hidden &&
           (exact[order[place]] - nominal.principal_px).norm() < nominal.field_radius_px;
  };
  const auto add = [&](const Vector2d& uv, double r, int ball) {
    image.detections.push_back({uv, options.noise_px, r * (1 + 0.02 * random.normal()), 0.02 * r, ball});
  };
  for (int i = 0; i < balls; ++i) {
    if (!shown(i)) continue;
    const int k = order[i];
    const Vector2d noisy = exact[k] + options.noise_px * normal_2(random);
    int twin = 0;
    while (twin < balls &&
           (twin == i || !shown(twin) || (exact[order[twin]] - exact[k]).norm() > 0.7 * radius[k]))
      ++twin;
    if (twin == balls) {
      add(noisy, radius[k], k);
      ++image.visible;
    } else if (twin > i) {
      add((noisy + exact[order[twin]]) / 2, radius[k], -1);
    }
  }

  const Vector2d origin = in_box(random, Vector2d(0, 0), Vector2d(lattice_px, lattice_px));
  const double turn = random.uniform(0, std::numbers::pi / 2);
  const auto false_place = [&](int i) -> Vector2d {
    if (options.kind == OutlierKind::imitating && i == 0 && options.hidden > 0)
      return exact[order[i]] + 4 * normal_2(random);
    if (options.kind == OutlierKind::lattice) {
      const int down = static_cast<int>(random.index(9)) - 4;
      const int right = static_cast<int>(random.index(9)) - 4;
      const Vector2d steps(right, down);
      return nominal.principal_px + Eigen::Rotation2Dd(turn) * (lattice_px * steps + origin);
    }
    return nominal.principal_px + in_disc(random, i % 2 == 0 ? nominal.field_radius_px : 300);
  };
  for (int i = 0; i < options.outliers; ++i) {
    const Vector2d uv = false_place(i);
    const bool inside = (uv - nominal.principal_px).norm() < nominal.field_radius_px;
    const bool free =
        std::all_of(image.detections.begin(), image.detections.end(),
                    [&](const SyntheticDetection& other) { return (other.uv - uv).norm() > 10; });
    if (inside && free) add(uv, radius[order.front()], -1);
  }
  return image;
}

}  // namespace helicarm::simulation
