// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/blobs.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <opencv2/imgproc.hpp>

#include "helicarm/image/opencv.h"

namespace helicarm::detection {
namespace {

constexpr int levels_per_octave = 3;
constexpr double first_sigma = 1.1;
constexpr double ratio = 1.2599210498948732;  // 2^(1/3)

/// Detection threshold: a multiple of the robust spread of the filter responses on a coarse grid (zeros
/// excluded: black surround), but at most a quarter of the maximum, for plates full of holes.
float threshold(const cv::Mat& view_image, double sigmas) {
  std::vector<float> values;
  for (int v = 3; v < view_image.rows; v += 5)
    for (int u = 3; u < view_image.cols; u += 5)
      if (const float x = std::abs(view_image.at<float>(v, u)); x > 0) values.push_back(x);
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  const auto strong = values.begin() + static_cast<std::ptrdiff_t>(values.size() - 1 - values.size() / 1000);
  std::nth_element(values.begin(), middle, values.end());
  const float typical = 1.4826f * *middle;
  std::nth_element(values.begin(), strong, values.end());
  return std::min(float(sigmas) * typical, 0.25f * *strong);
}

bool is_peak(const std::vector<cv::Mat>& answers, std::size_t level, int u, int v, float value) {
  for (std::size_t k = level - 1; k <= level + 1; ++k)
    for (int y = v - 1; y <= v + 1; ++y) {
      const float* row = answers[k].ptr<float>(y);
      for (int x = u - 1; x <= u + 1; ++x)
        if (row[x] > value ||
            (row[x] == value && (k < level || (k == level && (y < v || (y == v && x < u))))))
          return false;
    }
  return true;
}

bool is_round(const cv::Mat& answer, int u, int v, double max_elongation) {
  const auto at = [&](int x, int y) { return double(answer.at<float>(y, x)); };
  const double xx = at(u - 1, v) + at(u + 1, v) - 2 * at(u, v);
  const double yy = at(u, v - 1) + at(u, v + 1) - 2 * at(u, v);
  const double xy = 0.25 * (at(u + 1, v + 1) - at(u - 1, v + 1) - at(u + 1, v - 1) + at(u - 1, v - 1));
  const double determinant = xx * yy - xy * xy;
  const double trace = xx + yy;
  return determinant > 0 &&
         trace * trace * max_elongation < (1 + max_elongation) * (1 + max_elongation) * determinant;
}

double offset_of_peak(float before, float here, float after) {
  const double bend = double(before) + double(after) - 2 * double(here);
  return bend < 0 ? std::clamp(0.5 * (double(before) - double(after)) / bend, -0.6, 0.6) : 0;
}

void search_octave(const cv::Mat& base, double step, const BlobOptions& options, std::vector<Dot>& blobs) {
  std::vector<cv::Mat> blurred(levels_per_octave + 3);
  cv::GaussianBlur(base, blurred[0], {},
                   step > 1 ? std::sqrt(first_sigma * first_sigma - 0.25) : first_sigma);
  for (std::size_t k = 1; k < blurred.size(); ++k) {
    const double sigma = first_sigma * std::pow(ratio, double(k - 1));
    cv::GaussianBlur(blurred[k - 1], blurred[k], {}, sigma * std::sqrt(ratio * ratio - 1));
  }
  std::vector<cv::Mat> answers(blurred.size() - 1);
  for (std::size_t k = 0; k < answers.size(); ++k)
    answers[k] =
        options.polarity == Polarity::dark ? blurred[k + 1] - blurred[k] : blurred[k] - blurred[k + 1];
  for (std::size_t k = 1; k + 1 < answers.size(); ++k) {
    const float limit = threshold(answers[k], options.threshold_sigma);
    const double sigma = first_sigma * std::pow(ratio, double(k) + 0.5);
    const double radius = std::numbers::sqrt2 * sigma * step;
    if (radius < options.min_radius_px / 1.15 || radius > options.max_radius_px * 1.15) continue;
    for (int v = 1; v + 1 < base.rows; ++v) {
      const float* row = answers[k].ptr<float>(v);
      for (int u = 1; u + 1 < base.cols; ++u) {
        const float value = row[u];
        if (value <= limit || value < row[u - 1] || value < row[u + 1]) continue;
        if (!is_peak(answers, k, u, v, value) || !is_round(answers[k], u, v, options.max_elongation))
          continue;
        const double du = offset_of_peak(row[u - 1], value, row[u + 1]);
        const double dv =
            offset_of_peak(answers[k].at<float>(v - 1, u), value, answers[k].at<float>(v + 1, u));
        const double dk =
            offset_of_peak(answers[k - 1].at<float>(v, u), value, answers[k + 1].at<float>(v, u));
        Dot blob;
        blob.centre_px = {(u + du + 0.5) * step - 0.5, (v + dv + 0.5) * step - 0.5};
        blob.radius_px = radius * std::pow(ratio, dk);
        blob.contrast = double(value);
        blobs.push_back(blob);
      }
    }
  }
}

}  // namespace

std::vector<Dot> find_blobs(const image::Image<float>& image, const BlobOptions& options) {
  std::vector<Dot> blobs;
  cv::Mat base = image::as_mat(image);
  for (double step = 1; base.cols >= 16 && base.rows >= 16; step *= 2) {
    const auto radius_at = [&](double level) {
      return std::numbers::sqrt2 * first_sigma * step * std::pow(ratio, level + 0.5);
    };
    if (radius_at(1) > 1.15 * options.max_radius_px) break;
    if (1.15 * radius_at(levels_per_octave) > options.min_radius_px)
      search_octave(base, step, options, blobs);
    cv::Mat half;
    cv::resize(base, half, {base.cols / 2, base.rows / 2}, 0, 0, cv::INTER_AREA);
    base = half;
  }
  std::stable_sort(blobs.begin(), blobs.end(),
                   [](const Dot& a, const Dot& b) { return a.contrast > b.contrast; });
  if (blobs.size() > options.max_count) blobs.resize(options.max_count);
  return blobs;
}

}  // namespace helicarm::detection
