// SPDX-License-Identifier: Apache-2.0
// How near the fitted centres come to the Cramer-Rao bound, and whether their sigmas are true.
#include <cmath>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"
#include "helicarm/detection/find_dots.h"

namespace helicarm::detection {
namespace centre_limit_test {

using Eigen::Vector2d;

constexpr double absorbance = 3;
constexpr double contrast = 0.5;  // reduced by scatter
constexpr double quanta = 400;    // per pixel of open background
constexpr double electronic = 3;  // in quanta
constexpr double grey_per_quantum = 5;
constexpr double focus_px = 0.6;

constexpr int side = 96;  // side of the square around one ball

struct Situation {
  double radius;
  double fwhm_px;  ///< detector blur, which correlates the noise of neighbouring pixels
};

double detector_sigma(const Situation& s) { return s.fwhm_px / 2.3548; }

/// Image parameters, all taken as unknown: six of the background, then each ball's contrast, centre and
/// radius.
using Truth = Eigen::VectorXd;

/// Expected quanta in a square with some balls, before the detector blur.
image::Image<float> expected(const Truth& truth) {
  image::Image<float> image(side, side);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) {
      const double x = (u - 0.5 * side) / side;
      const double y = (v - 0.5 * side) / side;
      image(u, v) = static_cast<float>(truth[0] + truth[1] * x + truth[2] * y + truth[3] * x * x +
                                       truth[4] * x * y + truth[5] * y * y);
    }
  for (Eigen::Index k = 6; k < truth.size(); k += 4) {
    drawn::Shade shade(side, side);
    drawn::add_ball(shade, {truth[k + 1], truth[k + 2]}, truth[k + 3], focus_px, absorbance);
    for (int v = 0; v < side; ++v)
      for (int u = 0; u < side; ++u) image(u, v) *= static_cast<float>(1 - truth[k] * double(shade(u, v)));
  }
  return image;
}

image::Image<float> blurred(image::Image<float> image, const Situation& s) {
  cv::Mat mat = image::as_mat(image);
  if (s.fwhm_px > 0) cv::GaussianBlur(mat, mat, {}, detector_sigma(s), 0, cv::BORDER_REFLECT);
  return image;
}

image::Image<float> exposed(const image::Image<float>& expected_quanta, const Situation& s,
                            RandomStream& random) {
  image::Image<float> image = expected_quanta;
  for (float& quantum : image.pixels())  // large counts: Poisson is approximated by a Gaussian
    quantum = std::max(0.f, quantum + std::sqrt(quantum) * static_cast<float>(random.normal()));
  image = blurred(std::move(image), s);
  for (float& grey : image.pixels())
    grey = static_cast<float>(grey_per_quantum) *
           (grey + static_cast<float>(electronic) * static_cast<float>(random.normal()));
  return image;
}

/// Cramer-Rao bound of the first ball's standard deviation per axis from the pixels of the fit's own window,
/// all parameters unknown.
double bound_px(const Truth& truth, const Situation& s, const DotFitOptions& options) {
  std::vector<std::pair<int, int>> pixels;
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u)
      for (Eigen::Index k = 6; k < truth.size(); k += 4)
        if (std::hypot(u - truth[k + 1], v - truth[k + 2]) <=
            truth[k + 3] * (1 + options.margin_share) + options.margin_px) {
          pixels.push_back({u, v});
          break;
        }
  const auto n = static_cast<Eigen::Index>(pixels.size());
  Eigen::MatrixXd slopes(n, truth.size());
  for (Eigen::Index k = 0; k < truth.size(); ++k) {
    const double step = k < 6 ? 20 : 0.02;
    Truth more = truth;
    Truth less = truth;
    more[k] += step;
    less[k] -= step;
    const image::Image<float> high = blurred(expected(more), s);
    const image::Image<float> low = blurred(expected(less), s);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto [u, v] = pixels[static_cast<std::size_t>(i)];
      slopes(i, k) = double(high(u, v) - low(u, v)) / (2 * step);
    }
  }
  // Neighbouring pixels share quanta through the blur; the quanta's density is nearly constant over it.
  const image::Image<float> mean = blurred(expected(truth), s);
  const double sigma = detector_sigma(s);
  cv::Mat taps(1, 1, CV_64F, cv::Scalar(1));
  if (s.fwhm_px > 0) taps = cv::getGaussianKernel(2 * int(4 * sigma + 2) + 1, sigma, CV_64F);
  const auto overlap = [&](int d) {
    double sum = 0;
    for (int i = 0; i + d < taps.rows; ++i) sum += taps.at<double>(i) * taps.at<double>(i + d);
    return sum;
  };
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) {
      const auto [u, v] = pixels[static_cast<std::size_t>(i)];
      const auto [x, y] = pixels[static_cast<std::size_t>(j)];
      covariance(i, j) = std::sqrt(double(mean(u, v)) * double(mean(x, y))) * overlap(std::abs(u - x)) *
                         overlap(std::abs(v - y));
      if (i == j) covariance(i, j) += electronic * electronic;
    }
  const Eigen::MatrixXd information =
      slopes.transpose() * covariance.selfadjointView<Eigen::Lower>().llt().solve(slopes);
  const Eigen::MatrixXd bound = information.inverse();
  return std::sqrt(0.5 * (bound(7, 7) + bound(8, 8)));
}

struct Answer {
  double over_bound;  ///< rms error over the bound
  double z;           ///< rms of error over sigma
};

BallProfile profile_of(const Situation& s) {
  return BallProfile(std::hypot(focus_px, detector_sigma(s), std::sqrt(1.0 / 12)) / s.radius, absorbance);
}

/// Fits the first ball of many images with `fit(exposure, corner)`; `corner` is that of its square.
template <class Fit>
Answer tried(const Situation& s, const std::vector<Vector2d>& further_balls, Fit&& fit) {
  RandomStream random(17, 3);
  double squares = 0;
  double normed = 0;
  double bound = 0;
  int fits = 0;
  constexpr int tiles = 4;
  for (int phase = 0; phase < 4; ++phase) {
    const Vector2d centre =
        Vector2d::Constant(0.5 * side) + Vector2d(random.uniform(-1, 1), random.uniform(-1, 1));
    const auto balls = static_cast<Eigen::Index>(1 + further_balls.size());
    Truth truth(6 + 4 * balls);
    truth.head<6>() << quanta, 60, -40, 30, 20, -50;
    for (Eigen::Index k = 0; k < balls; ++k) {
      const Vector2d place =
          centre + (k > 0 ? further_balls[static_cast<std::size_t>(k) - 1] : Vector2d::Zero().eval());
      truth.segment<4>(6 + 4 * k) << contrast, place, s.radius;
    }
    bound += 0.25 * bound_px(truth, s, {});
    const image::Image<float> one = expected(truth);
    image::Image<float> all(tiles * side, tiles * side);
    for (int v = 0; v < all.height(); ++v)
      for (int u = 0; u < all.width(); ++u) all(u, v) = one(u % side, v % side);
    for (int trial = 0; trial < 4; ++trial) {
      const xray::XrayImage xray_image = drawn::xray_image(exposed(all, s, random));
      for (int tile = 0; tile < tiles * tiles; ++tile) {
        const Vector2d place = side * Vector2d(tile % tiles, tile / tiles) + centre;
        const std::optional<Dot> dot = fit(xray_image, place);
        EXPECT_TRUE(dot);
        if (!dot) continue;
        const double square = (dot->centre_px - place).squaredNorm();
        squares += square;
        normed += square / (dot->sigma_px * dot->sigma_px);
        fits += 2;
      }
    }
  }
  return {std::sqrt(squares / fits) / bound, std::sqrt(normed / fits)};
}

Dot start_at(const Vector2d& place, double radius) {
  Dot start;
  start.centre_px = place + Vector2d(0.1, -0.1);
  start.radius_px = radius;
  return start;
}

/// Properties for --gtest_output=xml.
void record(const Answer& answer) {
  testing::Test::RecordProperty("error_over_bound", std::to_string(answer.over_bound));
  testing::Test::RecordProperty("error_over_sigma", std::to_string(answer.z));
}

class CentreLimit : public testing::TestWithParam<Situation> {};

TEST_P(CentreLimit, CentresReachTheBoundAndSigmasAreCorrect) {
  const Situation s = GetParam();
  const BallProfile profile = profile_of(s);
  std::optional<NoiseCorrelation> noise;
  const Answer answer = tried(s, {}, [&](const xray::XrayImage& xray_image, const Vector2d& place) {
    DotFitOptions options = fit_options_for(xray_image);
    if (!noise) noise = noise_correlation(xray_image, options.floor, options.ceiling);
    options.noise = *noise;
    return fit_dot(xray_image.pixels, start_at(place, s.radius), profile, {}, options);
  });
  record(answer);
  EXPECT_LT(answer.over_bound, 1.2);
  EXPECT_GT(answer.z, 0.9);
  EXPECT_LT(answer.z, 1.1);
}

INSTANTIATE_TEST_SUITE_P(BallsAndDetectors, CentreLimit,
                         testing::Values(Situation{5.5, 0}, Situation{5.5, 1}, Situation{5.5, 2},
                                         Situation{5.5, 3}, Situation{13, 0}, Situation{13, 1},
                                         Situation{13, 2}, Situation{13, 3}));

class OverlapLimit : public testing::TestWithParam<Situation> {};

TEST_P(OverlapLimit, OverlapOfHalfARadiusHasLittleEffect) {
  const Situation s = GetParam();
  const Vector2d beside = 1.5 * s.radius * Vector2d(0.8, 0.6);
  DotAppearance appearance{profile_of(s), {}};
  const Answer answer = tried(s, {beside}, [&](const xray::XrayImage& xray_image, const Vector2d& place) {
    appearance.options = fit_options_for(xray_image);
    const std::vector<Dot> both{start_at(place, s.radius), start_at(place + beside, s.radius)};
    const auto dots = refit_dots(xray_image, {both[0]}, appearance, both);
    return dots.empty() ? std::nullopt : std::optional(dots[0]);
  });
  record(answer);
  EXPECT_LT(answer.over_bound, 1.3);
  EXPECT_GT(answer.z, 0.8);
  EXPECT_LT(answer.z, 1.25);
}

INSTANTIATE_TEST_SUITE_P(Balls, OverlapLimit, testing::Values(Situation{5.5, 0}, Situation{13, 0}));

}  // namespace centre_limit_test
}  // namespace helicarm::detection
