// SPDX-License-Identifier: Apache-2.0
// Times a simulated 1024 x 1024 view with knee, calibrator and plate on one and two threads.
#include <benchmark/benchmark.h>

#include "helicarm/simulation/c_arm.h"
#include "helicarm/simulation/calibrator_body.h"
#include "helicarm/simulation/detector_response.h"
#include "helicarm/simulation/knee.h"
#include "helicarm/simulation/render_view.h"
#include "helicarm/simulation/streams.h"

namespace helicarm::simulation {
namespace {

TrueView true_view() { return take_stand({}, *phantom::plate48().height_above_receiver_mm, {}).front(); }

Scene scene_before(const TrueView& true_view) {
  phantom::Calibrator calibrator = phantom::udcsc();
  calibrator.targets = check_targets(calibrator);
  Scene scene = calibrator_body(calibrator);
  for (const Body& body : knee_body())
    scene.push_back(moved(body, {Eigen::Matrix3d::Identity(), {10, 0, 14}}));
  for (const Body& body : plate_body(phantom::plate48(), true_view.camera_from_plate, true_view.view))
    scene.push_back(body);
  return scene;
}

void render_knee(benchmark::State& state) {
  const TrueView taken = true_view();
  const Scene scene = scene_before(taken);
  for (auto _ : state)
    benchmark::DoNotOptimize(
        render_view(scene, taken.detector, taken.view, static_cast<unsigned>(state.range(0))));
}
BENCHMARK(render_knee)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

void knee_image(benchmark::State& state) {
  const TrueView taken = true_view();
  const image::Image<float> signal = render_view(scene_before(taken), taken.detector, taken.view);
  for (auto _ : state)
    benchmark::DoNotOptimize(
        detector_response(signal, taken.imaging, 1, stream::noise, static_cast<unsigned>(state.range(0))));
}
BENCHMARK(knee_image)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace helicarm::simulation
