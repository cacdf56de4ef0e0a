// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/wire_grid.h"

#include <fmt/format.h>

#include "helicarm/core/random.h"
#include "helicarm/simulation/streams.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector3d;

/// Common to all wires, so that wires do not count as hiding a cross.
constexpr const char* wire_name = "grid wire";

}  // namespace

Scene wire_grid_body(const WireGrid& grid) {
  const int half = grid.wires / 2;
  const double reach = (half + 0.5) * grid.pitch_mm;
  Scene wires;
  for (int k = -half; k <= half; ++k) {
    const double at = k * grid.pitch_mm;
    const double radius = 0.5 * grid.thickness_mm;
    wires.push_back(steel(wire_name, {cylinder({-reach, at, 0}, {reach, at, 0}, radius)}));
    wires.push_back(steel(wire_name, {cylinder({at, -reach, 0}, {at, reach, 0}, radius)}));
  }
  return wires;
}

std::vector<TruePoint> grid_crosses(const WireGrid& grid, const Scene& scene, const TrueView& true_view) {
  std::vector<TruePoint> crosses;
  const int half = grid.wires / 2;
  for (int j = -half; j <= half; ++j)
    for (int i = -half; i <= half; ++i) {
      const Vector3d position = grid.pitch_mm * Vector3d(i, j, 0);
      crosses.push_back(true_point(wire_name, position, grid.thickness_mm, scene, true_view));
      crosses.back().name = fmt::format("{},{}", i, j);
    }
  return crosses;
}

std::vector<TrueView> take_grid_stand(const SimulationOptions& options, double plate_height_mm) {
  TrueView arm = take_stand(options, plate_height_mm, {}).front();
  arm.mirrored = false;
  RandomStream random(options.seed, stream::grid);
  const double turn = random.uniform(-2, 2) * EIGEN_PI / 180;
  const double right = random.uniform(-3, 3);
  const double down = random.uniform(-3, 3);
  const Eigen::Vector2d middle = Eigen::Vector2d::Constant(0.5 * (options.size - 1));
  const Vector3d through_middle =
      arm.view.intrinsics.matrix().inverse() * Vector3d(middle.x(), middle.y(), 1);
  const auto camera_from_grid = [&](double distance_mm) {
    const Vector3d position = (arm.f_mm - distance_mm) * through_middle;
    return geometry::RigidTransform{Eigen::AngleAxisd(turn, Vector3d::UnitZ()).toRotationMatrix(),
                                    position + Vector3d(right, down, 0)};
  };
  std::vector<TrueView> true_views;
  const auto take = [&](std::string name, double distance_mm) {
    true_views.push_back(arm);
    true_views.back().name = std::move(name);
    true_views.back().view.camera_from_world = camera_from_grid(distance_mm);
  };
  const std::vector<double>& distances = options.grid_distances_mm;
  take("PLATE", distances.front());
  for (const double distance : distances)
    take(distances.size() == 1 ? "GRID" : fmt::format("GRID-{:g}", distance), distance);
  return true_views;
}

}  // namespace helicarm::simulation
