// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/detector_response.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace helicarm::simulation {
namespace {

/// Quantum noise only: no blur, scatter, vignetting or electronic noise.
Imaging plain() {
  Imaging imaging;
  imaging.electronic_noise = 0;
  imaging.scatter_fraction = 0;
  imaging.focus_sigma_px = 0;
  imaging.screen_sigma_px = 0;
  imaging.vignette = 0;
  imaging.bits = 16;
  imaging.open_level = 0.5;
  return imaging;
}

bool same_pixels(const image::Image<std::uint16_t>& a, const image::Image<std::uint16_t>& b) {
  return std::equal(a.pixels().begin(), a.pixels().end(), b.pixels().begin(), b.pixels().end());
}

class QuantumNoise : public testing::TestWithParam<double> {};

TEST_P(QuantumNoise, VarianceAndMeanFollowPoisson) {
  Imaging imaging = plain();
  imaging.quanta_per_pixel = GetParam();
  imaging.open_level = 0.1;  // headroom for the largest count
  const image::Image<std::uint16_t> grey =
      detector_response(image::Image<float>(256, 256, 1.0f), imaging, 3, 0);
  const double unit = 0.1 * 65535 / GetParam();  // grey levels per quantum
  double sum = 0;
  double squares = 0;
  for (std::uint16_t pixel : grey.pixels()) {
    sum += pixel / unit;
    squares += (pixel / unit) * (pixel / unit);
  }
  const double n = 256.0 * 256.0;
  const double mean = sum / n;
  const double variance = squares / n - mean * mean;
  EXPECT_NEAR(mean, GetParam(), 5 * std::sqrt(GetParam() / n));
  EXPECT_NEAR(variance / GetParam(), 1, 5 * std::sqrt((2 + 1 / GetParam()) / n) + 0.1 / GetParam());
}

INSTANTIATE_TEST_SUITE_P(FewAndMany, QuantumNoise, testing::Values(4.0, 30.0, 50.0, 1000.0));

TEST(DetectorResponse, ReproducibleFromTheSeedForAnyNumberOfThreads) {
  const image::Image<float> signal(64, 48, 0.5f);
  const Imaging imaging;
  const auto one = detector_response(signal, imaging, 7, 0, 1);
  EXPECT_TRUE(same_pixels(one, detector_response(signal, imaging, 7, 0, 2)));
  EXPECT_FALSE(same_pixels(one, detector_response(signal, imaging, 8, 0, 1)));
  EXPECT_FALSE(same_pixels(one, detector_response(signal, imaging, 7, 2, 1)));
}

TEST(DetectorResponse, OverexposureIsWhiteAtEveryBitDepth) {
  for (int bits : {8, 12, 16}) {
    Imaging imaging = plain();
    imaging.bits = bits;
    imaging.open_level = 1.5;
    const image::Image<std::uint16_t> grey =
        detector_response(image::Image<float>(16, 16, 1.0f), imaging, 1, 0);
    for (std::uint16_t pixel : grey.pixels()) EXPECT_EQ(pixel, (1 << bits) - 1);
  }
}

TEST(DetectorResponse, LogarithmMapsEqualFactorsToEqualSteps) {
  Imaging imaging = plain();
  imaging.logarithmic = true;
  imaging.quanta_per_pixel = 1e9;
  image::Image<float> steps(48, 16, 1.0f);
  for (int v = 0; v < 16; ++v)
    for (int u = 16; u < 48; ++u) steps(u, v) = u < 32 ? 0.2f : 0.04f;
  const auto grey = detector_response(steps, imaging, 1, 0);
  EXPECT_NEAR(grey(8, 8) - grey(24, 8), grey(24, 8) - grey(40, 8), 20);
  EXPECT_GT(grey(24, 8), grey(40, 8) + 1000);
}

TEST(DetectorResponse, ScatterAddsTheFractionOfTheSurroundings) {
  Imaging imaging = plain();
  imaging.quanta_per_pixel = 1e9;
  imaging.scatter_fraction = 0.1;
  imaging.scatter_sigma_px = 40;
  image::Image<float> signal(512, 512, 0.5f);
  for (int v = 252; v < 260; ++v)
    for (int u = 252; u < 260; ++u) signal(u, v) = 0.01f;
  const auto grey = detector_response(signal, imaging, 1, 0);
  EXPECT_NEAR(grey(256, 256), 0.5 * 65535 * (0.01 + 0.1 * 0.5), 0.5 * 65535 * 0.002);
}

TEST(Mirrored, TwiceIsTheIdentityAndOnceSwapsTheColumns) {
  image::Image<std::uint16_t> image(5, 2);
  for (std::size_t i = 0; i < 10; ++i) image.pixels()[i] = static_cast<std::uint16_t>(i);
  const auto mirror = mirrored(image);
  EXPECT_EQ(mirror(0, 1), image(4, 1));
  EXPECT_EQ(mirror(2, 0), image(2, 0));
  EXPECT_TRUE(same_pixels(mirrored(mirror), image));
}

}  // namespace
}  // namespace helicarm::simulation
