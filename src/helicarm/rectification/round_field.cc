// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/round_field.h"

#include <algorithm>
#include <array>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::rectification {
namespace {

using RimPoints = std::vector<Eigen::Vector2d>;

constexpr double corner_share = 0.04;  // of a side: the square that must be dark
constexpr double dark_share = 0.1;     // of the grey value in the middle
constexpr double largest_miss =
    0.05;  // of a boundary point, relative to the radius; real fields deviate by 0.04
constexpr double largest_rms = 0.025;  // a square differs from its ellipse by 0.08
constexpr double least_kept = 0.5;     // of the boundary: collimator leaves and annotations take the rest
constexpr std::size_t least_points = 40;

float median_of(const image::Image<float>& image, int left, int top, int width, int height) {
  std::vector<float> values;
  for (int v = top; v < top + height; ++v)
    values.insert(values.end(), image.row(v) + left, image.row(v) + left + width);
  return median(std::move(values));
}

/// Grey value between the dark corners and the field; nothing if fewer than three corners are dark.
std::optional<float> threshold_of(const xray::XrayImage& xray_image) {
  const image::Image<float>& image = xray_image.pixels;
  const int w = image.width(), h = image.height();
  const int cw = std::max(2, int(corner_share * w)), ch = std::max(2, int(corner_share * h));
  std::array corners{median_of(image, 0, 0, cw, ch), median_of(image, w - cw, 0, cw, ch),
                     median_of(image, 0, h - ch, cw, ch), median_of(image, w - cw, h - ch, cw, ch)};
  std::ranges::sort(corners);
  const float middle = median_of(image, w / 4, h / 4, w / 2, h / 2), black = corners.front();
  if (middle - black < 0.02f * (xray_image.highest - xray_image.lowest)) return std::nullopt;
  const float threshold = black + float(dark_share) * (middle - black);
  return corners[2] < threshold ? std::optional(threshold) : std::nullopt;
}

/// First and last pixel of the field in each row and column, unless they lie at the image's border.
RimPoints boundary_of(const image::Image<float>& image, float threshold) {
  constexpr int border = 3;
  RimPoints points;
  const auto scan = [&](int lines, int length, auto grey, auto point) {
    for (int line = 0; line < lines; ++line) {
      int first = 0, last = length - 1;
      while (first < length && grey(line, first) < threshold) ++first;
      while (last > first && grey(line, last) < threshold) --last;
      if (first >= last) continue;
      if (first > border) points.push_back(point(line, first));
      if (last < length - 1 - border) points.push_back(point(line, last));
    }
  };
  scan(
      image.height(), image.width(), [&](int v, int u) { return image(u, v); },
      [](int v, int u) { return Eigen::Vector2d(u, v); });
  scan(
      image.width(), image.height(), [&](int u, int v) { return image(u, v); },
      [](int u, int v) { return Eigen::Vector2d(u, v); });
  return points;
}

/// Least squares of a u^2 + b v^2 + c u + d v = 1 about the weighted mean; nothing unless it is an ellipse.
std::optional<RoundField> ellipse_through(const RimPoints& points, const Eigen::VectorXd& weights) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) mean += weights[Eigen::Index(i)] * points[i];
  mean /= weights.sum();
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  const double unit = (points.front() - mean).norm() + 1;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d p = (points[i] - mean) / unit;
    const Eigen::Vector4d row(p.x() * p.x(), p.y() * p.y(), p.x(), p.y());
    normal += weights[Eigen::Index(i)] * row * row.transpose();
    right += weights[Eigen::Index(i)] * row;
  }
  const Eigen::Vector4d k = geometry::solve_spd(normal, right).solution;
  const Eigen::Array2d a(k[0], k[1]), b(k[2], k[3]);
  if (!(a.minCoeff() > 0)) return std::nullopt;
  const Eigen::Array2d centre = -b / (2 * a);
  const double level = 1 + (a * centre.square()).sum();
  return RoundField{mean + unit * centre.matrix(), unit * (level / a).sqrt().matrix()};
}

/// Distance from the ellipse relative to the radius.
double miss(const RoundField& field, const Eigen::Vector2d& point) {
  return std::abs((point - field.centre_px).cwiseQuotient(field.radius_px).norm() - 1);
}

}  // namespace

std::optional<RoundField> round_field(const xray::XrayImage& xray_image) {
  if (xray_image.pixels.width() < 64 || xray_image.pixels.height() < 64) return std::nullopt;
  const auto threshold = threshold_of(xray_image);
  if (!threshold) return std::nullopt;
  const RimPoints points = boundary_of(xray_image.pixels, *threshold);
  if (points.size() < least_points) return std::nullopt;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(Eigen::Index(points.size()));
  Eigen::ArrayXd misses(weights.size());
  std::optional<RoundField> field;
  for (int iteration = 0; iteration < 30; ++iteration) {  // Cauchy weights
    field = ellipse_through(points, weights);
    if (!field) return std::nullopt;
    for (std::size_t i = 0; i < points.size(); ++i) misses[Eigen::Index(i)] = miss(*field, points[i]);
    weights = 1 / (1 + (misses / largest_rms).square());
  }
  const auto kept = (misses < largest_miss).cast<double>();
  if (kept.sum() < least_kept * double(points.size())) return std::nullopt;
  if (std::sqrt((kept * misses.square()).sum() / kept.sum()) > largest_rms) return std::nullopt;
  return field;
}

}  // namespace helicarm::rectification
