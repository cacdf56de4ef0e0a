// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/run_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

namespace helicarm::sweep {
namespace {

using Frames = std::vector<std::vector<NoiseSample>>;

constexpr double axes = 2;  // a sample is a vector of two residuals
constexpr double normal = std::numeric_limits<double>::infinity();

/// Logarithms of the image's factor and of the variance of the floor, and what is known of them.
using Logs = std::array<double, 2>;
const Logs usual{0, 2 * std::log(0.01)}, usual_spread{1.5, 3};

struct Sample {
  double square, image, other;  ///< px^2

  double of_centre(const Logs& logs) const { return std::exp(logs[0]) * image + std::exp(logs[1]); }
  double variance(const Logs& logs) const { return of_centre(logs) + other; }
};

Sample sample_of(const NoiseSample& sample) {
  return {sample.residual_px.squaredNorm() / sample.free_share, sample.image_variance_px2,
          sample.other_variance_px2};
}

/// Weight of a sample with this squared residual over its variance.
double weight_at(double square, double freedom) {
  return std::isinf(freedom) ? 1 : (freedom + axes) / (freedom + square);
}

double log_posterior(const std::vector<Sample>& samples, double freedom, const Logs& logs) {
  double sum = 0;
  for (const Sample& sample : samples) {
    const double variance = sample.variance(logs), square = sample.square / variance;
    // The normalising factor of two axes is 1 / (2 pi) for all degrees of freedom.
    sum -= std::log(variance) +
           (std::isinf(freedom) ? square / 2 : (freedom + axes) / 2 * std::log1p(square / freedom));
  }
  for (std::size_t k = 0; k < logs.size(); ++k)
    sum -= std::pow((logs[k] - usual[k]) / usual_spread[k], 2) / 2;
  return sum;
}

struct Fit {
  double freedom, log_posterior;
  Logs logs;
};

/// Coordinate search with steps that grow where they gain and shrink where they do not.
Fit fit_of(const std::vector<Sample>& samples, double freedom) {
  constexpr double least_step = 0.02;
  Logs step{1, 1};
  Fit fit{freedom, log_posterior(samples, freedom, usual), usual};
  while (std::ranges::max(step) > least_step)
    for (std::size_t k = 0; k < step.size(); ++k) {
      bool gained = false;
      for (const double sign : {1.0, -1.0}) {
        Logs next = fit.logs;
        next[k] += sign * step[k];
        if (const double value = log_posterior(samples, freedom, next); value > fit.log_posterior) {
          fit = {freedom, value, next};
          gained = true;
          break;
        }
      }
      step[k] *= gained ? 1.3 : 0.4;
    }
  return fit;
}

/// Variance of a location by these weights over that which their sum states: the sandwich of Huber (1981).
double sandwich_of(const std::vector<Sample>& samples, const Fit& fit) {
  double stated = 0, slopes = 0, scatter = 0;
  for (const Sample& sample : samples) {
    const double variance = sample.variance(fit.logs), square = sample.square / variance;
    const double w = weight_at(square, fit.freedom);
    stated += w / variance;
    slopes += (std::isinf(fit.freedom) ? w : w - w * w * square / (fit.freedom + axes)) / variance;
    scatter += w * w * square / axes / variance;
  }
  return stated * scatter / (slopes * slopes);
}

/// 1 + 2 (sum of the correlations of a ball's residuals with those of the next frames), at least 1.
/// `weights`: of each sample, by which its residual counts.
double shared_by_neighbours(const Frames& frames, const std::vector<std::vector<double>>& weights) {
  constexpr std::size_t farthest = 3;  // frames: beyond, the objects over a ball are others
  constexpr std::size_t least_pairs = 100;
  std::vector<std::map<std::size_t, Eigen::Vector2d>> weighted(frames.size());
  double power = 0, count = 0;
  for (std::size_t i = 0; i < frames.size(); ++i)
    for (std::size_t k = 0; k < frames[i].size(); ++k) {
      const Eigen::Vector2d value = weights[i][k] * frames[i][k].residual_px;
      weighted[i][frames[i][k].ball] = value;
      power += value.squaredNorm();
      ++count;
    }
  double factor = 1;
  for (std::size_t lag = 1; lag <= farthest; ++lag) {
    double product = 0;
    std::size_t pairs = 0;
    for (std::size_t i = 0; i + lag < frames.size(); ++i)
      for (const auto& [ball, value] : weighted[i])
        if (const auto next = weighted[i + lag].find(ball); next != weighted[i + lag].end()) {
          product += value.dot(next->second);
          ++pairs;
        }
    if (pairs >= least_pairs && power > 0) factor += 2 * (product / double(pairs)) / (power / count);
  }
  return std::max(1.0, factor);
}

}  // namespace

RunNoise noise_of(const Frames& frames) {
  constexpr std::array candidates{1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0, normal};
  std::vector<Sample> samples;
  for (const auto& frame : frames)
    for (const NoiseSample& sample : frame) samples.push_back(sample_of(sample));
  Fit best{normal, -normal, usual};
  for (const double freedom : candidates)
    if (const Fit fit = fit_of(samples, freedom); fit.log_posterior > best.log_posterior) best = fit;
  std::vector<std::vector<double>> weights(frames.size()), roots(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i)
    for (const NoiseSample& of_frame : frames[i]) {
      const Sample sample = sample_of(of_frame);
      const double variance = sample.variance(best.logs);
      weights[i].push_back(weight_at(sample.square / variance, best.freedom));
      roots[i].push_back(weights[i].back() / std::sqrt(variance));
    }
  RunNoise noise{best.freedom, std::exp(best.logs[0]), std::exp(best.logs[1] / 2), {}, 1};
  noise.shared = shared_by_neighbours(frames, roots);
  const double factor = sandwich_of(samples, best) * noise.shared;
  noise.variance_px2.resize(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i)
    for (std::size_t k = 0; k < frames[i].size(); ++k)
      noise.variance_px2[i].push_back(factor / weights[i][k] * sample_of(frames[i][k]).of_centre(best.logs));
  return noise;
}

}  // namespace helicarm::sweep
