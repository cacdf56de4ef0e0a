// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include "helicarm/volume/drr.h"

namespace helicarm {
namespace {

/// 256 voxels of 1 mm per side, none empty: every ray crosses all slabs.
volume::Volume full_volume() {
  volume::Volume volume;
  volume.size.setConstant(256);
  volume.voxels.resize(std::size_t{256} * 256 * 256);
  for (std::size_t i = 0; i < volume.voxels.size(); ++i) volume.voxels[i] = static_cast<float>(i * 7 % 613);
  volume.patient_from_voxel = Eigen::Translation3d(-127.5, -127.5, -127.5);
  return volume;
}

/// Along an axis, then rotated about an oblique one by this many degrees.
geometry::View view_along(int axis, double turn_deg) {
  geometry::View view;
  view.intrinsics = {4000, 4000, 511.5, 511.5, 0};
  const Eigen::Vector3d ray = Eigen::Vector3d::Unit(axis);
  const Eigen::Vector3d right = Eigen::Vector3d::Unit(axis == 0 ? 1 : 0);
  view.camera_from_world.rotation << right.transpose(), ray.cross(right).transpose(), ray.transpose();
  const Eigen::Vector3d slanted = Eigen::Vector3d(1, 2, -1).normalized();
  view.camera_from_world.rotation *= Eigen::AngleAxisd(turn_deg * EIGEN_PI / 180, slanted).toRotationMatrix();
  view.camera_from_world.translation = {0, 0, 1000};
  return view;
}

/// 1024 x 1024 rays that all (unrotated) meet the volume: axis, rotation, threads.
void drr_of_256(benchmark::State& state) {
  const volume::Absorber absorber(full_volume(), volume::attenuation_from_hu);
  const geometry::View view =
      view_along(static_cast<int>(state.range(0)), static_cast<double>(state.range(1)));
  for (auto _ : state)
    benchmark::DoNotOptimize(volume::drr(absorber, view, 1024, 1024, static_cast<unsigned>(state.range(2))));
}
BENCHMARK(drr_of_256)
    ->ArgsProduct({{0, 1, 2}, {0, 20}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void prepare_256(benchmark::State& state) {
  const volume::Volume volume = full_volume();
  for (auto _ : state)
    benchmark::DoNotOptimize(
        volume::Absorber(volume, volume::attenuation_from_hu, static_cast<unsigned>(state.range(0)))
            .contains(Eigen::Vector3d::Zero()));
}
BENCHMARK(prepare_256)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace helicarm
