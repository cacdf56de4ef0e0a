// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/detector_response.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "helicarm/core/parallel.h"
#include "helicarm/core/random.h"
#include "helicarm/image/opencv.h"

namespace helicarm::simulation {
namespace {

void blur(image::Image<float>& image, double sigma_px) {
  if (sigma_px <= 0) return;
  cv::Mat mat = image::as_mat(image);
  cv::GaussianBlur(mat, mat, {}, sigma_px, sigma_px, cv::BORDER_REPLICATE);
}

/// Wide blur on a coarse grid: scatter has no detail.
void add_scatter(image::Image<float>& image, double fraction, double sigma_px) {
  if (fraction <= 0) return;
  constexpr int coarse = 16;
  cv::Mat small;
  cv::resize(image::as_mat(image), small, {image.width() / coarse, image.height() / coarse}, 0, 0,
             cv::INTER_AREA);
  cv::GaussianBlur(small, small, {}, sigma_px / coarse, sigma_px / coarse, cv::BORDER_CONSTANT);
  cv::Mat scatter;
  cv::resize(small, scatter, {image.width(), image.height()}, 0, 0, cv::INTER_CUBIC);
  for (int v = 0; v < image.height(); ++v)
    for (int u = 0; u < image.width(); ++u)
      if (image(u, v) > 0)
        image(u, v) += static_cast<float>(fraction) * std::max(0.0f, scatter.at<float>(v, u));
}

void darken_towards_the_edge(image::Image<float>& image, double vignette, double radius_px) {
  const double u0 = 0.5 * (image.width() - 1);
  const double v0 = 0.5 * (image.height() - 1);
  for (int v = 0; v < image.height(); ++v)
    for (int u = 0; u < image.width(); ++u) {
      const double rho2 = ((u - u0) * (u - u0) + (v - v0) * (v - v0)) / (radius_px * radius_px);
      image(u, v) *= static_cast<float>(1 / (1 + vignette * rho2));
    }
}

double mean_of_the_field(const image::Image<float>& image) {
  double sum = 0;
  std::size_t count = 0;
  for (float pixel : image.pixels())
    if (pixel > 0) {
      sum += pixel;
      ++count;
    }
  return count ? sum / static_cast<double>(count) : 1;
}

double poisson(double mean, RandomStream& random) {
  if (mean > 40) return std::max(0.0, std::round(mean + std::sqrt(mean) * random.normal()));
  // Knuth's Poisson sampler: counts until the product of uniforms falls below exp(-mean).
  const double limit = std::exp(-mean);
  double product = random.uniform();
  int count = 0;
  while (product > limit) {
    product *= random.uniform();
    ++count;
  }
  return count;
}

}  // namespace

Light illuminate(const image::Image<float>& signal, const Imaging& imaging) {
  Light light{signal, 0};
  blur(light.level, imaging.focus_sigma_px);
  add_scatter(light.level, imaging.scatter_fraction, imaging.scatter_sigma_px);
  light.quanta = imaging.quanta_per_pixel / mean_of_the_field(light.level);
  return light;
}

image::Image<std::uint16_t> detector_response(const image::Image<float>& signal, const Imaging& imaging,
                                              std::uint64_t seed, std::uint32_t stream, unsigned threads) {
  auto [light, quanta_of_open_beam] = illuminate(signal, imaging);
  const double quanta = quanta_of_open_beam;  // a structured binding cannot be captured
  const auto rows = static_cast<std::size_t>(light.height());
  parallel_for(rows, threads, [&](std::size_t row) {
    RandomStream random(seed, stream, row);
    float* pixel = light.row(static_cast<int>(row));
    for (int u = 0; u < light.width(); ++u)
      pixel[u] = static_cast<float>(poisson(quanta * pixel[u], random) / quanta);
  });
  blur(light, imaging.screen_sigma_px);
  darken_towards_the_edge(light, imaging.vignette, imaging.field_radius_px);

  const double highest = (1 << imaging.bits) - 1;
  image::Image<std::uint16_t> grey(light.width(), light.height());
  parallel_for(rows, threads, [&](std::size_t row) {
    RandomStream random(seed, stream + 1, row);
    const int v = static_cast<int>(row);
    for (int u = 0; u < light.width(); ++u) {
      const double level = light(u, v) + imaging.electronic_noise / quanta * random.normal();
      const double part =
          imaging.logarithmic ? 1 - std::log(std::max(level, floor_signal)) / std::log(floor_signal) : level;
      grey(u, v) = static_cast<std::uint16_t>(
          std::clamp(std::round(imaging.open_level * part * highest), 0.0, highest));
    }
  });
  return grey;
}

}  // namespace helicarm::simulation
