// SPDX-License-Identifier: Apache-2.0
// Times each stage and the whole of `helicarm run` on a simulated pair of 1024 x 1024 images.
#include <filesystem>
#include <memory>
#include <string>

#include <benchmark/benchmark.h>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/core/failure.h"
#include "helicarm/core/random_vectors.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/fiducials/candidates.h"
#include "helicarm/fiducials/label_fiducials.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/locate_case.h"
#include "helicarm/pipeline/measure.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/simulation/simulate_case.h"
#include "helicarm/simulation/write_case.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm {
namespace {

/// One simulated case on disk, made once.
const pipeline::Case& simulated_case() {
  static const pipeline::Case the_case = [] {
    const auto folder = std::filesystem::temp_directory_path() / "helicarm_benchmark_case";
    simulation::SimulationOptions options;
    const auto simulated = value_or_throw(simulation::simulate_case(options));
    value_or_throw(simulation::write_case(folder, simulated));
    return value_or_throw(pipeline::read_case(folder));
  }();
  return the_case;
}

const xray::XrayImage& xray_image() {
  static const xray::XrayImage read =
      value_or_throw(xray::read_xray_image(simulated_case().views[0].image, "AP", {}));
  return read;
}

detection::ImageDots& dots() {
  static detection::ImageDots detected = [] {
    auto of_image = detection::unsearched(xray_image(), detection::DotOptions{}.min_radius_px);
    detection::dots_of(of_image, xray_image(), detection::Polarity::dark);
    return of_image;
  }();
  return detected;
}

const rectification::Rectification& rectification() {
  static const rectification::Rectification rectified =
      value_or_throw(rectification::rectify(xray_image(), dots(), *simulated_case().plate, {}));
  return rectified;
}

void read_file(benchmark::State& state) {
  const std::filesystem::path& image = simulated_case().views[0].image;
  for (auto _ : state) benchmark::DoNotOptimize(xray::read_xray_image(image, "AP", {}));
}
BENCHMARK(read_file)->Unit(benchmark::kMillisecond);

void search_blobs(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(detection::find_blobs(xray_image().pixels, {}));
}
BENCHMARK(search_blobs)->Unit(benchmark::kMillisecond);

/// The final fit of the balls: from the detected centres, with the image's estimated blur.
void fit_one_ball(benchmark::State& state) {
  const auto found = value_or_throw(
      fiducials::label_fiducials(xray_image(), dots(), rectification(), simulated_case().calibrator, {}));
  std::vector<detection::Dot> balls;
  for (const detection::Dot& dot : fiducials::ball_candidates(dots(), rectification()))
    for (const fiducials::Fiducial& ball : found.fiducials)
      if (ball.status == fiducials::FiducialStatus::used && (ball.uv_raw - dot.centre_px).norm() < 1)
        balls.push_back(dot);
  const detection::DotAppearance appearance =
      detection::estimate_appearance(xray_image(), dots().noise, balls);
  for (auto _ : state)
    benchmark::DoNotOptimize(detection::refit_dots(xray_image(), {balls.front()}, appearance, {}));
}
BENCHMARK(fit_one_ball)->Unit(benchmark::kMicrosecond);

void rectify_view(benchmark::State& state) {
  for (auto _ : state)
    benchmark::DoNotOptimize(rectification::rectify(xray_image(), dots(), *simulated_case().plate, {}));
}
BENCHMARK(rectify_view)->Unit(benchmark::kMillisecond);

void label_candidates(benchmark::State& state) {
  for (auto _ : state)
    benchmark::DoNotOptimize(
        fiducials::label_fiducials(xray_image(), dots(), rectification(), simulated_case().calibrator, {}));
}
BENCHMARK(label_candidates)->Unit(benchmark::kMillisecond);

void resample_image(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(rectification::resample(xray_image(), rectification().map));
}
BENCHMARK(resample_image)->Unit(benchmark::kMillisecond);

void run_whole_case(benchmark::State& state) {
  pipeline::RunOptions options;
  options.threads = static_cast<unsigned>(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(pipeline::measure(simulated_case(), options));
}
BENCHMARK(run_whole_case)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

/// Joint calibration of labelled views about the calibrator, with noise and the priors of a C-arm.
void calibrate_views(benchmark::State& state) {
  const phantom::Calibrator calibrator = phantom::udcsc();
  calibration::CalibrationOptions options;
  options.common.c_arm = {calibration::IntrinsicsVariation{2, 0.5}, calibration::IntrinsicsVariation{2, 0.5}};
  std::vector<calibration::ViewFiducials> views;
  RandomStream random(1, 0);
  const Eigen::Vector3d middle = phantom::middle_of(calibrator);
  for (int i = 0; i < state.range(0); ++i) {
    const Eigen::Matrix3d rotation = geometry::rotation_from_euler(0.06 * i, 0.1, 0);
    const geometry::View view{{6000, 6000, 512, 512, 0},
                              {rotation, Eigen::Vector3d(0, 0, 800) - rotation * middle}};
    calibration::ViewFiducials& of_view = views.emplace_back();
    of_view.name = "V" + std::to_string(i);
    of_view.prior.focal_px = 6000;
    of_view.prior.unit_px = 6.7;
    for (const phantom::CalibratorBall& ball : calibrator.balls) {
      fiducials::Fiducial& fiducial = of_view.fiducials.emplace_back();
      fiducial.label = ball.label;
      fiducial.centre_in_calibrator = ball.centre_in_calibrator;
      fiducial.status = fiducials::FiducialStatus::used;
      fiducial.sigma_px = 0.05;
      fiducial.uv = view.project(ball.centre_in_calibrator) + 0.05 * normal_2(random);
    }
  }
  for (auto _ : state) benchmark::DoNotOptimize(calibration::calibrate(views, options));
}
BENCHMARK(calibrate_views)->Arg(2)->Arg(10)->Arg(50)->Arg(100)->Arg(400)->Unit(benchmark::kMillisecond);

/// Ten picked points against a held calibration: observation, intersection and covariance.
void locate_ten_picks(benchmark::State& state) {
  pipeline::RunOptions options;
  options.threads = 1;
  pipeline::Case the_case = simulated_case();
  const auto calibration =
      std::make_shared<const pipeline::CaseCalibration>(pipeline::calibrate_case(the_case, options).value());
  the_case.calibrator.targets.clear();
  the_case.picks.clear();
  const Eigen::Vector3d centre = phantom::middle_of(the_case.calibrator);
  for (int point = 0; point < 10; ++point)
    for (std::size_t view = 0; view < the_case.views.size(); ++view) {
      const Eigen::Vector2d uv = calibration->views[view].view.project(
          centre + Eigen::Vector3d(2.0 * point - 9, 3.0 * (point % 3), 1.5 * (point % 4)));
      pipeline::Pick pick;
      pick.name = "point " + std::to_string(point);
      pick.view = the_case.views[view].name;
      pick.uv_raw = calibration->images[view].rectification.map.raw_from_rectified(uv);
      the_case.picks.push_back(pick);
    }
  for (auto _ : state) benchmark::DoNotOptimize(pipeline::locate_case(the_case, calibration, options));
}
BENCHMARK(locate_ten_picks)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace helicarm
