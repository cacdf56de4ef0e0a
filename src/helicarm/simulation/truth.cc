// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/truth.h"

#include <algorithm>
#include <cmath>

namespace helicarm::simulation {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

bool in_image(const TrueView& true_view, const Vector2d& raw) {
  return raw.x() >= 0 && raw.y() >= 0 && raw.x() <= true_view.detector.width - 1 &&
         raw.y() <= true_view.detector.height - 1 && field_weight(true_view.detector, raw) == 1;
}

bool crosses(const Body& body, const Vector3d& source, const Vector3d& direction) {
  constexpr double grazing_mm = 0.1;
  return union_length(body.solids, source, direction) > grazing_mm;
}

Visibility visibility(const std::string& name, const Vector3d& centre, double radius, const Scene& scene,
                      const TrueView& true_view) {
  if (std::none_of(scene.begin(), scene.end(), [&](const Body& body) { return body.name == name; }))
    return Visibility::absent;
  const Vector3d source = true_view.view.source_in_world();
  const Vector3d along = (centre - source).normalized();
  const Vector3d right = along.unitOrthogonal();
  const Vector3d down = along.cross(right);
  Visibility worst = Visibility::clear;
  for (int ring = 0; ring <= 2; ++ring)
    for (int spoke = 0; spoke < (ring ? 16 : 1); ++spoke) {
      const double angle = spoke * EIGEN_PI / 8;
      const Vector3d position =
          centre + 0.5 * ring * radius * (std::cos(angle) * right + std::sin(angle) * down);
      if (!in_image(true_view,
                    true_view.detector.distortion.raw_from_ideal(true_view.view.project(position))))
        return Visibility::outside;
      const Vector3d direction = (position - source).normalized();
      for (const Body& body : scene) {
        if (body.name == name || !(body.metal || body.name == "shutter") || !crosses(body, source, direction))
          continue;
        if (body.name == "shutter") return Visibility::outside;
        worst = Visibility::hidden;
      }
    }
  return worst;
}

}  // namespace

TruePoint true_point(const std::string& name, const Vector3d& in_calibrator, double diameter_mm,
                     const Scene& scene, const TrueView& true_view) {
  return {name, in_calibrator, true_view.ideal_image(in_calibrator), true_view.raw_image(in_calibrator),
          visibility(name, in_calibrator, 0.5 * diameter_mm, scene, true_view)};
}

}  // namespace helicarm::simulation
