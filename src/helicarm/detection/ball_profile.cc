// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/ball_profile.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace helicarm::detection {
namespace {

/// exp(-x) I0(x), Abramowitz and Stegun 9.8.1 and 9.8.2 (relative error below 2e-7).
double scaled_bessel_i0(double x) {
  if (x < 3.75) {
    const double t = (x / 3.75) * (x / 3.75);
    return std::exp(-x) *
           (1 + t * (3.5156229 +
                     t * (3.0899424 + t * (1.2067492 + t * (0.2659732 + t * (0.0360768 + t * 0.0045813))))));
  }
  const double t = 3.75 / x;
  return (0.39894228 +
          t * (0.01328592 +
               t * (0.00225319 +
                    t * (-0.00157565 +
                         t * (0.00916281 +
                              t * (-0.02057706 + t * (0.02635537 + t * (-0.01647633 + t * 0.00392377)))))))) /
         std::sqrt(x);
}

double sharp(double r, double absorbance) {
  return -std::expm1(-absorbance * std::sqrt(std::max(0.0, 1 - r * r))) / -std::expm1(-absorbance);
}

}  // namespace

BallProfile::BallProfile(double blur, double absorbance) : blur_(blur), absorbance_(absorbance) {
  // Rings no further apart than the blur is wide, and places within it, also in a large ball.
  const double detail = std::max(blur, 0.002);
  const int rings = std::max(48, static_cast<int>(std::ceil(1.6 / detail)));
  const double step = std::min(1.0 / 96, 0.25 * detail);
  const double reach = 1 + 4 * blur;
  const int count = static_cast<int>(std::ceil(reach / step)) + 2;
  per_unit_ = static_cast<float>(1 / step);
  last_ = count - 1;
  values_.resize(static_cast<std::size_t>(count));
  // Rings are denser towards the rim, where the chord length varies like a square root, and towards the
  // centre.
  std::vector<double> radius(static_cast<std::size_t>(rings)), weight(radius.size());
  for (std::size_t k = 0; k < radius.size(); ++k) {
    const double a = double(k) / rings;
    const double b = double(k + 1) / rings;
    const auto place = [](double x) { return 0.5 * (1 - std::cos(std::numbers::pi * x)); };
    radius[k] = place(0.5 * (a + b));
    weight[k] = (place(b) - place(a)) * sharp(radius[k], absorbance) * radius[k];
  }
  for (int i = 0; i < count; ++i) {
    const double d = i * step;
    double sum = 0;
    for (std::size_t k = 0; k < radius.size(); ++k) {
      const double gap = radius[k] - d;
      const double exponent = gap * gap / (2 * blur * blur);
      if (exponent < 30)
        sum += weight[k] * std::exp(-exponent) * scaled_bessel_i0(radius[k] * d / (blur * blur));
    }
    values_[static_cast<std::size_t>(i)] = static_cast<float>(sum / (blur * blur));
  }
  values_.back() = 0;
  values_.push_back(0);  // one extra value for the interpolation at the end
}

}  // namespace helicarm::detection
