// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/faults.h"

#include "helicarm/core/random_vectors.h"
#include "helicarm/simulation/streams.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector3d;

constexpr double wire_radius_mm = 1;

/// A K-wire across a ball's shadow in this view, 15 mm nearer the source.
Body wire_over(const Vector3d& ball, const TrueView& true_view, RandomStream& random) {
  const Vector3d towards_source = (true_view.view.source_in_world() - ball).normalized();
  const Vector3d middle = ball + 15 * towards_source;
  const Vector3d across = towards_source.unitOrthogonal();
  const Vector3d axis = Eigen::AngleAxisd(random.uniform(0, EIGEN_PI), towards_source) * across;
  return steel("wire", {cylinder(middle - 50 * axis, middle + 100 * axis, wire_radius_mm)});
}

/// A cancellous screw: core of the thread, and head.
Body screw(const Vector3d& tip, const Vector3d& axis, double length) {
  const Vector3d neck = tip + length * axis;
  return steel("screw", {cylinder(tip, neck, 2.2), frustum(neck, neck + 4 * axis, 2.2, 4)});
}

}  // namespace

Scene stray_metal(const SimulationOptions& options, const phantom::Calibrator& calibrator,
                  const std::vector<TrueView>& true_views,
                  const geometry::RigidTransform& calibrator_from_knee) {
  RandomStream random(options.seed, stream::faults);
  Scene scene;
  if (options.has(Fault::decoys))
    for (int i = 0; i < 2; ++i) {
      const Vector3d position = in_box(random, Vector3d(-45, -45, 5), Vector3d(45, 45, 70));
      const Vector3d offset = options.calibrator
                                  ? phantom::middle_of(calibrator) - phantom::middle_of(phantom::udcsc())
                                  : Vector3d(0, 0, 0);
      scene.push_back(steel("decoy", {sphere(position + offset, 2)}));
    }
  if (options.has(Fault::wires))
    for (const TrueView& true_view : true_views) {
      const auto chosen = random.index(static_cast<std::uint32_t>(calibrator.balls.size()));
      scene.push_back(wire_over(calibrator.balls[chosen].centre_in_calibrator, true_view, random));
    }
  if (options.has(Fault::screws)) {
    scene.push_back(
        moved(screw({16, 14, -10}, Vector3d(0.05, -1, 0.1).normalized(), 42), calibrator_from_knee));
    scene.push_back(
        moved(screw({34, 10, -12}, Vector3d(-0.02, -1, 0.3).normalized(), 36), calibrator_from_knee));
  }
  return scene;
}

Scene shutter_leaves(const SimulationOptions& options, const TrueView& true_view) {
  if (!options.has(Fault::shutters)) return {};
  RandomStream random(options.seed, stream::faults, true_view.number + 1);
  const double field_mm = 0.5 * true_view.pixel_mm() * true_view.detector.width;
  constexpr double depth_mm = 100;
  const double scale = depth_mm / true_view.f_mm;
  const geometry::RigidTransform world_from_camera = true_view.view.camera_from_world.inverse();
  const double reach = field_mm * scale * 2;
  Scene leaves;
  for (int side : {-1, 1}) {
    // The leaf's inner edge is at 55 to 70 % of the half field.
    const double edge = side * random.uniform(0.55, 0.7) * field_mm * scale;
    Body leaf{"shutter", {box({edge + side * reach, 0, depth_mm}, {reach, reach, 1})}, {}};
    leaf.attenuation.setConstant(1.8);  // 2 mm transmit 2.7 %
    leaves.push_back(moved(leaf, world_from_camera));
  }
  return leaves;
}

}  // namespace helicarm::simulation
