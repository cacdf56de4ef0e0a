// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <opencv2/imgproc.hpp>

#include "helicarm/core/random.h"
#include "helicarm/image/image.h"
#include "helicarm/image/opencv.h"
#include "helicarm/xray/xray_image.h"

/// For tests: images rendered by brute force, independent of the models under test.
namespace helicarm::detection::drawn {

using Shade = image::Image<float>;  ///< absorbed fraction of the rays, 0 .. 1

/// Adds `absorbed(x, y)` within `reach` of `middle`: sampled on a fine grid, blurred there and averaged over
/// each pixel.
template <class Absorbed>
void add_shade(Shade& shade, const Eigen::Vector2d& middle, double reach, double blur_px,
               Absorbed&& absorbed) {
  constexpr int fine = 8;
  const double rim = reach + 4 * blur_px + 1;
  const int u0 = static_cast<int>(std::floor(middle.x() - rim));
  const int v0 = static_cast<int>(std::floor(middle.y() - rim));
  const int side = static_cast<int>(std::ceil(2 * rim)) + 2;
  image::Image<float> sharp(side * fine, side * fine);
  for (int j = 0; j < sharp.height(); ++j)
    for (int i = 0; i < sharp.width(); ++i)
      sharp(i, j) = static_cast<float>(absorbed(u0 + (i + 0.5) / fine - 0.5, v0 + (j + 0.5) / fine - 0.5));
  cv::Mat mat = image::as_mat(sharp);
  if (blur_px > 0) cv::GaussianBlur(mat, mat, {}, blur_px * fine, 0, cv::BORDER_REPLICATE);
  cv::Mat small;
  cv::resize(mat, small, {side, side}, 0, 0, cv::INTER_AREA);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u)
      if (shade.contains(u0 + u, v0 + v)) shade(u0 + u, v0 + v) += small.at<float>(v, u);
}

/// A ball of the given absorbance along its diameter, 1 at the centre of the sharp image.
inline void add_ball(Shade& shade, const Eigen::Vector2d& centre, double radius, double blur_px,
                     double absorbance) {
  add_shade(shade, centre, radius, blur_px, [&](double x, double y) {
    const double square = 1 - (Eigen::Vector2d(x, y) - centre).squaredNorm() / (radius * radius);
    return square > 0 ? std::expm1(-absorbance * std::sqrt(square)) / std::expm1(-absorbance) : 0;
  });
}

struct Wire {
  Eigen::Vector2d from, to;
};

/// Round wires with flat ends, 0.9 at their axes; overlapping wires multiply their transmission.
inline void add_wires(Shade& shade, const std::vector<Wire>& wires, double radius, double blur_px) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Wire& wire : wires) middle += 0.5 / double(wires.size()) * (wire.from + wire.to);
  double reach = 0;
  for (const Wire& wire : wires)
    reach = std::max({reach, (wire.from - middle).norm() + radius, (wire.to - middle).norm() + radius});
  add_shade(shade, middle, reach, blur_px, [&](double x, double y) {
    double left = 1;
    for (const Wire& wire : wires) {
      const double length = (wire.to - wire.from).norm();
      const Eigen::Vector2d axis = (wire.to - wire.from) / length;
      const Eigen::Vector2d p = Eigen::Vector2d(x, y) - wire.from;
      const double across = axis.x() * p.y() - axis.y() * p.x();
      if (p.dot(axis) < 0 || p.dot(axis) > length || std::abs(across) >= radius) continue;
      left *= std::exp(-2.3 * std::sqrt(1 - across * across / (radius * radius)));
    }
    return 1 - left;
  });
}

inline void add_noise(image::Image<float>& image, double sigma, RandomStream& random) {
  for (float& grey : image.pixels()) grey += static_cast<float>(sigma * random.normal());
}

/// Grey values on a uniform background of 3000, of which the shade takes `contrast`; negative: brighter.
inline image::Image<float> grey(const Shade& shade, double contrast) {
  image::Image<float> image(shade.width(), shade.height());
  for (int v = 0; v < shade.height(); ++v)
    for (int u = 0; u < shade.width(); ++u)
      image(u, v) = static_cast<float>((contrast > 0 ? 3000 : 1500) - contrast * double(shade(u, v)));
  return image;
}

/// A 12-bit image, rounded and clipped as in a file.
inline xray::XrayImage xray_image(image::Image<float> image) {
  for (float& value : image.pixels()) value = std::clamp(std::round(value), 0.f, 4095.f);
  xray::XrayImage xray_image;
  xray_image.name = "AP";
  xray_image.pixels = std::move(image);
  xray_image.acquisition.logarithmic = true;
  return xray_image;
}

}  // namespace helicarm::detection::drawn
