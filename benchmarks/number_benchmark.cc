// SPDX-License-Identifier: Apache-2.0
// The computation of Fig. 5 for 10,000 groups of 12 balls with two DLTs and 12 intersections each: the
// study's SIMD code and plain Eigen, one group after the other. benchmarks/number.py compares them with
// batched NumPy.
#include <random>
#include <vector>

#include <Eigen/Dense>
#include <benchmark/benchmark.h>

#include "helicarm/phantom/conical_helix.h"
#include "studies/number.h"

namespace helicarm {
namespace {

constexpr std::size_t groups = 10000;
constexpr int balls = 12;

study::NumberOptions yardstick() {
  study::NumberOptions options;
  options.groups = groups;
  options.balls = {balls};
  options.sigmas = {study::SigmaReading::std};
  options.readings = {study::PixelReading::calibration_pixels};
  return options;
}

void run_study(benchmark::State& state, const study::NumberOptions& options) {
  const study::Ranks alone;
  study::EngineOptions engine;
  engine.threads = static_cast<unsigned>(state.range(0));
  for (auto _ : state) {
    const auto rows = study::study_number(options, engine, alone).value();
    state.counters["median_fre_mm"] = rows.front().of_groups.median;
  }
}

/// Back-projection of the calibration's pixels, FRE only, as in the other versions.
void number_simd(benchmark::State& state) { run_study(state, yardstick()); }
BENCHMARK(number_simd)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

/// One sigma, independent noise, FRE and TRE of 43 targets.
void number_with_targets(benchmark::State& state) {
  study::NumberOptions options = yardstick();
  options.readings = {study::PixelReading::fresh_noise};
  run_study(state, options);
}
BENCHMARK(number_with_targets)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

/// All readings of sigma and of the pixels.
void number_of_all_readings(benchmark::State& state) {
  study::NumberOptions options;
  options.groups = groups;
  options.balls = {balls};
  run_study(state, options);
}
BENCHMARK(number_of_all_readings)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

/// Eq. 7 by normal equations, with centred pixels.
geometry::Projection calibrated(const std::vector<Eigen::Vector3d>& world,
                                const std::vector<Eigen::Vector2d>& pixels) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& pixel : pixels) mean += pixel / balls;
  Eigen::Matrix<double, 2 * balls, 11> e = Eigen::Matrix<double, 2 * balls, 11>::Zero();
  Eigen::Matrix<double, 2 * balls, 1> c;
  for (int i = 0; i < balls; ++i) {
    const Eigen::Vector3d x = world[std::size_t(i)] / 64;
    const Eigen::Vector2d u = (pixels[std::size_t(i)] - mean) / 512;
    e.row(i) << x.transpose(), 1, -u.x() * x.transpose(), Eigen::RowVector4d::Zero();
    e.row(balls + i) << Eigen::RowVector4d::Zero(), -u.y() * x.transpose(), x.transpose(), 1;
    c(i) = u.x();
    c(balls + i) = u.y();
  }
  const Eigen::Matrix<double, 11, 11> normal = e.transpose() * e;
  const Eigen::Matrix<double, 11, 1> a = normal.ldlt().solve(e.transpose() * c);
  geometry::Projection p;
  p.row(2) << a.segment<3>(4).transpose() / 64, 1;
  p.row(0) << 8 * a.head<3>().transpose(), 512 * a(3);
  p.row(1) << 8 * a.segment<3>(7).transpose(), 512 * a(10);
  p.topRows<2>() += mean * p.row(2);
  return p;
}

double fre_of_group(std::mt19937_64& engine, const std::array<geometry::View, 2>& views) {
  std::uniform_real_distribution<double> angle(0, phantom::ConicalHelix().t_end);
  std::normal_distribution<double> noise(0, study::printed_fle);
  std::vector<Eigen::Vector3d> world(balls);
  std::vector<Eigen::Vector2d> pixels[2];
  for (auto& ball : world) ball = phantom::ConicalHelix().point(angle(engine));
  geometry::Projection p[2];
  for (std::size_t view = 0; view < 2; ++view) {
    for (const auto& ball : world)
      pixels[view].push_back(views[view].project(ball) + Eigen::Vector2d(noise(engine), noise(engine)));
    p[view] = calibrated(world, pixels[view]);
  }
  double sum = 0;
  for (std::size_t i = 0; i < balls; ++i) {
    Eigen::Matrix<double, 4, 3> left;
    Eigen::Vector4d right;
    for (Eigen::Index row = 0; row < 4; ++row) {
      const auto view = std::size_t(row / 2);
      const Eigen::RowVector4d equation = pixels[view][i](row % 2) * p[view].row(2) - p[view].row(row % 2);
      left.row(row) = equation.head<3>();
      right(row) = -equation(3);
    }
    const Eigen::Matrix3d normal = left.transpose() * left;
    sum += (normal.inverse() * (left.transpose() * right) - world[i]).norm();
  }
  return sum / balls;
}

void number_in_eigen(benchmark::State& state) {
  const auto views = paper_views(study::WorldOrigin::base);
  for (auto _ : state) {
    std::mt19937_64 engine(1);
    std::vector<double> fre(groups);
    for (double& value : fre) value = fre_of_group(engine, views);
    state.counters["median_fre_mm"] = study::column_statistics(fre).median;
  }
}
BENCHMARK(number_in_eigen)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace helicarm
