// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/blobs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <opencv2/imgproc.hpp>

#include "helicarm/core/statistics.h"
#include "helicarm/image/opencv.h"

namespace helicarm::detection {
namespace {

constexpr int levels_per_octave = 3;
constexpr double first_sigma = 1.1;
constexpr double third_of_octave = 1.2599210498948732;  // 2^(1/3)

/// Detection threshold: a multiple of the robust spread of the filter responses on a coarse grid (zeros
/// excluded: black surround), but at most a quarter of the maximum, for plates full of holes.
float threshold(const cv::Mat& view_image, double sigmas) {
  std::vector<float> values;
  for (int v = 3; v < view_image.rows; v += 5)
    for (int u = 3; u < view_image.cols; u += 5)
      if (const float x = std::abs(view_image.at<float>(v, u)); x > 0) values.push_back(x);
  if (values.empty()) return 0;
  const float typical = 1.4826f * value_of_rank(values, values.size() / 2);
  const float strong = value_of_rank(values, values.size() - 1 - values.size() / 1000);
  return std::min(float(sigmas) * typical, 0.25f * strong);
}

/// In space and scale; of equal values the first counts.
bool is_peak(const std::array<cv::Mat, 3>& answers, int u, int v, float value) {
  for (std::size_t k = 0; k < answers.size(); ++k)
    for (int y = v - 1; y <= v + 1; ++y) {
      const float* row = answers[k].ptr<float>(y);
      for (int x = u - 1; x <= u + 1; ++x)
        if (row[x] > value || (row[x] == value && (k < 1 || (k == 1 && (y < v || (y == v && x < u))))))
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

/// Peaks of the middle one of three neighbouring levels' answers.
void search_level(const std::array<cv::Mat, 3>& answers, double radius, double step,
                  const BlobOptions& options, std::vector<Dot>& blobs) {
  const cv::Mat& answer = answers[1];
  const float limit = threshold(answer, options.threshold_sigma);
  for (int v = 1; v + 1 < answer.rows; ++v) {
    const float* row = answer.ptr<float>(v);
    for (int u = 1; u + 1 < answer.cols; ++u) {
      const float value = row[u];
      if (value <= limit || value < row[u - 1] || value < row[u + 1]) continue;
      if (!is_peak(answers, u, v, value) || !is_round(answer, u, v, options.max_elongation)) continue;
      const double du = offset_of_peak(row[u - 1], value, row[u + 1]);
      const double dv = offset_of_peak(answer.at<float>(v - 1, u), value, answer.at<float>(v + 1, u));
      const double dk = offset_of_peak(answers[0].at<float>(v, u), value, answers[2].at<float>(v, u));
      Dot blob;
      blob.centre_px = {(u + du + 0.5) * step - 0.5, (v + dv + 0.5) * step - 0.5};
      blob.radius_px = radius * std::pow(third_of_octave, dk);
      blob.contrast = double(value);
      blobs.push_back(blob);
    }
  }
}

/// Level by level: of a large image, only the levels in use fit into memory.
void search_octave(const cv::Mat& base, double step, const BlobOptions& options, std::vector<Dot>& blobs) {
  cv::Mat blurred, wider;
  cv::GaussianBlur(base, blurred, {}, step > 1 ? std::sqrt(first_sigma * first_sigma - 0.25) : first_sigma);
  std::array<cv::Mat, 3> answers;
  for (int k = 0; k < levels_per_octave + 2; ++k) {
    const double radius_before =
        std::numbers::sqrt2 * first_sigma * std::pow(third_of_octave, double(k) - 0.5) * step;
    if (radius_before > options.max_radius_px * 1.15) break;
    cv::GaussianBlur(blurred, wider, {},
                     first_sigma * std::pow(third_of_octave, double(k)) *
                         std::sqrt(third_of_octave * third_of_octave - 1));
    std::rotate(answers.begin(), answers.begin() + 1, answers.end());
    const bool dark = options.polarity == Polarity::dark;
    cv::subtract(dark ? wider : blurred, dark ? blurred : wider, answers[2]);
    cv::swap(blurred, wider);
    if (k >= 2 && radius_before >= options.min_radius_px / 1.15)
      search_level(answers, radius_before, step, options, blobs);
  }
}

}  // namespace

std::vector<Dot> find_blobs(image::Image<float> image, const BlobOptions& options) {
  std::vector<Dot> blobs;
  cv::Mat base = image::as_mat(image);
  for (double step = 1; base.cols >= 16 && base.rows >= 16; step *= 2) {
    const auto radius_at = [&](double level) {
      return std::numbers::sqrt2 * first_sigma * step * std::pow(third_of_octave, level + 0.5);
    };
    if (radius_at(1) > 1.15 * options.max_radius_px) break;
    if (1.15 * radius_at(levels_per_octave) > options.min_radius_px)
      search_octave(base, step, options, blobs);
    cv::Mat half;
    cv::resize(base, half, {base.cols / 2, base.rows / 2}, 0, 0, cv::INTER_AREA);
    base = half;
    image = {};  // a quarter is searched from here on
  }
  std::stable_sort(blobs.begin(), blobs.end(),
                   [](const Dot& a, const Dot& b) { return a.contrast > b.contrast; });
  if (blobs.size() > options.max_count) blobs.resize(options.max_count);
  return blobs;
}

}  // namespace helicarm::detection
