// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/find_crosses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Dense>

#include "helicarm/core/statistics.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/detection/robust.h"

namespace helicarm::detection {
namespace {

using Eigen::Vector2d;

constexpr int ring_steps = 90;  // over 180 degrees

/// Background b0 bx by bxx bxy byy; per wire depth, angle, offset; one common width.
constexpr int n_background = 6;
constexpr int n_parameters = n_background + 7;
using CrossVector = Eigen::Matrix<double, n_parameters, 1>;
using CrossNormal = Eigen::Matrix<double, n_parameters, n_parameters>;

float bilinear(const image::Image<float>& image, double u, double v) {
  const int i = std::clamp(static_cast<int>(std::floor(u)), 0, image.width() - 2);
  const int j = std::clamp(static_cast<int>(std::floor(v)), 0, image.height() - 2);
  const float s = std::clamp(float(u - i), 0.f, 1.f);
  const float t = std::clamp(float(v - j), 0.f, 1.f);
  return (1 - t) * ((1 - s) * image(i, j) + s * image(i + 1, j)) +
         t * ((1 - s) * image(i, j + 1) + s * image(i + 1, j + 1));
}

struct Arms {
  double first;  ///< angles of the wires, rad
  double second;
  double depth;  ///< of the fainter
};

/// Directions in which the image is dark on both sides of a position, at two distances.
std::optional<Arms> arms_at(const image::Image<float>& image, const Vector2d& position, double radius,
                            double sign, const CrossOptions& options) {
  std::array<double, ring_steps> dark{};
  const double reach = 1.6 * radius;
  if (position.x() < reach || position.y() < reach || position.x() > image.width() - 1 - reach ||
      position.y() > image.height() - 1 - reach)
    return std::nullopt;
  for (int k = 0; k < ring_steps; ++k) {
    const double angle = std::numbers::pi * k / ring_steps;
    const Vector2d along(std::cos(angle), std::sin(angle));
    double brightest = -1e30;
    for (const double r : {radius, -radius, 1.5 * radius, -1.5 * radius}) {
      const Vector2d p = position + r * along;
      brightest = std::max(brightest, sign * double(bilinear(image, p.x(), p.y())));
    }
    dark[static_cast<std::size_t>(k)] = -brightest;
  }
  auto sorted = dark;
  const double background = value_of_rank(sorted, ring_steps / 3);
  const auto strongest_outside = [&](int forbidden, int gap) {
    int best = -1;
    for (int k = 0; k < ring_steps; ++k) {
      const int apart = std::abs(k - forbidden);
      if (forbidden >= 0 && std::min(apart, ring_steps - apart) < gap) continue;
      if (best < 0 || dark[static_cast<std::size_t>(k)] > dark[static_cast<std::size_t>(best)]) best = k;
    }
    return best;
  };
  const int gap = static_cast<int>(options.least_angle_deg / 180 * ring_steps);
  const int first = strongest_outside(-1, gap);
  const int second = strongest_outside(first, gap);
  if (second < 0) return std::nullopt;
  const double d1 = dark[static_cast<std::size_t>(first)] - background;
  const double d2 = dark[static_cast<std::size_t>(second)] - background;
  if (d2 < 0.4 * d1 || d2 <= 0) return std::nullopt;
  return Arms{std::numbers::pi * first / ring_steps, std::numbers::pi * second / ring_steps, d2};
}

struct Wire {
  double depth, angle, offset;
};

/// One wire's profile (a Gaussian across) at a pixel, and its derivatives with respect to angle, offset and
/// width.
struct Across {
  double value, by_angle, by_offset, by_width;
};

Across across(const Wire& wire, double width, double x, double y) {
  const double c = std::cos(wire.angle);
  const double s = std::sin(wire.angle);
  const double distance = -s * x + c * y - wire.offset;
  const double value = std::exp(-0.5 * distance * distance / (width * width));
  const double slope = -value * distance / (width * width);
  return {value, slope * (-c * x - s * y), -slope, value * distance * distance / (width * width * width)};
}

std::optional<Vector2d> meeting(const Wire& a, const Wire& b) {
  Eigen::Matrix2d normals;
  normals << -std::sin(a.angle), std::cos(a.angle), -std::sin(b.angle), std::cos(b.angle);
  if (std::abs(normals.determinant()) < 0.3) return std::nullopt;
  return normals.inverse() * Vector2d(a.offset, b.offset);
}

struct Pixel {
  double x, y, grey, weight;
};

constexpr int rim_px = 3;  // screen blur and the ramp at the field's edge

/// Whether black pixels, outside the field, lie within `reach` px of a pixel along u and v.
bool near_black(const xray::XrayImage& xray_image, int u, int v, int reach) {
  const float black =
      xray_image.lowest + 0.002f * (xray_image.highest - xray_image.lowest);  // as in usable.cc
  const image::Image<float>& image = xray_image.pixels;
  for (int y = -reach; y <= reach; ++y)
    for (int x = -reach; x <= reach; ++x)
      if (image.contains(u + x, v + y) && image(u + x, v + y) <= black) return true;
  return false;
}

/// Whether the shadow where the wires cross (1.5 half widths with its blur) reaches the field's rim. Its
/// slope moves such a crossing by up to 9 px on simulated images.
bool reaches_rim(const xray::XrayImage& xray_image, const Dot& cross) {
  const Eigen::Vector2i at = cross.centre_px.array().round().matrix().cast<int>();
  return near_black(xray_image, at.x(), at.y(), rim_px + int(std::lround(1.5 * cross.radius_px)));
}

std::optional<Dot> fit_wires(const xray::XrayImage& xray_image, const Vector2d& start, double half_width,
                             const Arms& arms, std::span<const Disc> discs) {
  const image::Image<float>& image = xray_image.pixels;
  const int u0 = static_cast<int>(std::lround(start.x()));
  const int v0 = static_cast<int>(std::lround(start.y()));
  const double window = 4 * half_width + 4;
  const int half = static_cast<int>(window);
  std::vector<Pixel> pixels;
  double mean = 0;
  for (int y = -half; y <= half; ++y)
    for (int x = -half; x <= half; ++x)
      if (x * x + y * y <= window * window && image.contains(u0 + x, v0 + y)) {
        const bool hidden = std::any_of(discs.begin(), discs.end(), [&](const Disc& disc) {
          return (disc.centre - Vector2d(u0 + x, v0 + y)).squaredNorm() < disc.radius * disc.radius;
        });
        if (hidden || near_black(xray_image, u0 + x, v0 + y, rim_px)) continue;
        pixels.push_back({double(x), double(y), double(image(u0 + x, v0 + y)), 1});
        mean += pixels.back().grey;
      }
  if (pixels.size() < 60) return std::nullopt;
  mean /= double(pixels.size());

  CrossVector p = CrossVector::Zero();
  p[0] = mean;
  const Vector2d shift = start - Vector2d(u0, v0);
  const auto offset = [&](double angle) {
    return -std::sin(angle) * shift.x() + std::cos(angle) * shift.y();
  };
  p.segment<3>(6) << arms.depth, arms.first, offset(arms.first);
  p.segment<3>(9) << arms.depth, arms.second, offset(arms.second);
  p[12] = 0.7 * half_width;
  CrossNormal normal;
  double variance = 0;
  double move = 0;
  std::vector<double> residuals(pixels.size());
  std::optional<Vector2d> before;
  for (int i = 0; i < 20; ++i) {
    const Wire a{p[6], p[7], p[8]};
    const Wire b{p[9], p[10], p[11]};
    for (int pass = 0; pass < 2; ++pass) {
      normal.setZero();
      CrossVector right = CrossVector::Zero();
      double squares = 0;
      double weight = 0;
      for (std::size_t k = 0; k < pixels.size(); ++k) {
        const Pixel& pixel = pixels[k];
        const double x = pixel.x / window;
        const double y = pixel.y / window;
        const Across wa = across(a, p[12], pixel.x, pixel.y);
        const Across wb = across(b, p[12], pixel.x, pixel.y);
        // At the crossing the second wire attenuates what the first transmits.
        const double left_b = 1 - std::clamp(a.depth / std::max(1e-9, std::abs(p[0])), 0.0, 0.9) * wa.value;
        CrossVector row;
        row << 1, x, y, x * x, x * y, y * y, -wa.value, -a.depth * wa.by_angle, -a.depth * wa.by_offset,
            -wb.value * left_b, -b.depth * wb.by_angle * left_b, -b.depth * wb.by_offset * left_b,
            -a.depth * wa.by_width - b.depth * wb.by_width * left_b;
        residuals[k] = pixel.grey - (row.head<n_background>().dot(p.head<n_background>()) -
                                     a.depth * wa.value - b.depth * wb.value * left_b);
        normal.selfadjointView<Eigen::Lower>().rankUpdate(row, pixel.weight);
        right += pixel.weight * residuals[k] * row;
        squares += pixel.weight * residuals[k] * residuals[k];
        weight += pixel.weight;
      }
      variance = squares / std::max(1.0, weight - n_parameters);
      if (pass == 0) {
        const double least = std::max(0.05, 0.4 * std::pow(0.6, i)) * std::abs(arms.depth);
        const double cut = tukey_cut<double>(residuals, least);
        for (std::size_t k = 0; k < pixels.size(); ++k) pixels[k].weight = tukey_weight(residuals[k], cut);
        continue;
      }
      CrossNormal damped = normal;
      damped.diagonal() *= 1 + 0.1 * std::pow(0.3, i);
      CrossVector step = damped.selfadjointView<Eigen::Lower>().ldlt().solve(right);
      if (!step.allFinite()) return std::nullopt;
      const double turn = std::max(std::abs(step[7]), std::abs(step[10]));
      if (turn > 0.2) step *= 0.2 / turn;
      p += step;
    }
    if (!(p[12] > 0.25 * half_width && p[12] < 3 * half_width)) return std::nullopt;
    const auto now = meeting({p[6], p[7], p[8]}, {p[9], p[10], p[11]});
    if (!now || now->norm() > window) return std::nullopt;
    move = before ? (*now - *before).norm() : 1;
    before = now;
    if (i >= 5 && move < 1e-3) break;
  }
  if (move > 0.05 || p[6] * arms.depth <= 0 || p[9] * arms.depth <= 0) return std::nullopt;
  const double fainter = std::min(std::abs(p[6]), std::abs(p[9]));
  if (fainter < 0.3 * std::max(std::abs(p[6]), std::abs(p[9])) || fainter < 3 * std::sqrt(variance))
    return std::nullopt;
  const CrossNormal inverse = normal.selfadjointView<Eigen::Lower>().ldlt().solve(CrossNormal::Identity());
  Dot cross;
  cross.centre_px = Vector2d(u0, v0) + *before;
  cross.sigma_px = std::sqrt(std::max(0.0, 0.5 * variance * (inverse(8, 8) + inverse(11, 11)))) /
                   std::abs(std::sin(p[7] - p[10]));
  cross.radius_px = 1.25 * p[12];
  cross.contrast = 0.5 * (p[6] + p[9]);
  cross.misfit = std::sqrt(variance) / fainter;
  if (reaches_rim(xray_image, cross)) return std::nullopt;
  return cross;
}

}  // namespace

std::optional<Dot> fit_cross(const xray::XrayImage& xray_image, const Dot& start, double first_angle,
                             double second_angle, std::span<const Disc> discs) {
  return fit_wires(xray_image, start.centre_px, start.radius_px, {first_angle, second_angle, start.contrast},
                   discs);
}

std::vector<Dot> find_crosses(const xray::XrayImage& xray_image, const CrossOptions& options) {
  BlobOptions blob_options;
  blob_options.polarity = options.polarity;
  blob_options.min_radius_px = 0.5 * options.min_width_px;
  blob_options.max_radius_px = 0.9 * options.max_width_px;
  blob_options.max_elongation = 12;  // wires that cross obliquely
  const double sign = options.polarity == Polarity::dark ? 1 : -1;
  std::vector<Dot> crosses;
  for (const Dot& blob : find_blobs(xray_image.pixels, blob_options)) {
    const double half_width =
        std::clamp(0.75 * blob.radius_px, 0.5 * options.min_width_px, 0.5 * options.max_width_px);
    const auto arms = arms_at(xray_image.pixels, blob.centre_px, 3 * half_width + 3, sign, options);
    if (!arms) continue;
    Arms signed_arms = *arms;
    signed_arms.depth *= sign;
    const auto cross = fit_wires(xray_image, blob.centre_px, half_width, signed_arms, {});
    if (!cross || cross->sigma_px > options.max_sigma_px) continue;
    const auto twin = std::find_if(crosses.begin(), crosses.end(), [&](const Dot& other) {
      return (other.centre_px - cross->centre_px).norm() <
             2 * std::max(other.radius_px, cross->radius_px) + 1;
    });
    if (twin == crosses.end())
      crosses.push_back(*cross);
    else if (cross->misfit < twin->misfit)
      *twin = *cross;
  }
  return crosses;
}

}  // namespace helicarm::detection
