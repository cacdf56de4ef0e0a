// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace helicarm {

/// The radial profile of a ball's X-ray image: absorption along the chord of a sphere, blurred by a Gaussian
/// and scaled to 1 at the centre of the sharp picture. Tabulated over s = distance / radius.
class BallProfile {
 public:
  /// `blur`: standard deviation of the Gaussian over the ball's radius. `absorbance`: attenuation times
  /// diameter; small for a faint ball (profile like the chord length), large for an opaque one or a hole
  /// (flat disc).
  BallProfile(double blur, double absorbance);

  struct Sample {
    float value;
    float slope;  ///< d value / d s
  };
  Sample at(float s) const {
    const float x = s * per_unit_;
    const int i = static_cast<int>(x);
    if (i >= last_) return {0, 0};
    const float t = x - static_cast<float>(i);
    const float a = values_[static_cast<std::size_t>(i)];
    const float b = values_[static_cast<std::size_t>(i) + 1];
    const float da = slopes_[static_cast<std::size_t>(i)];
    const float db = slopes_[static_cast<std::size_t>(i) + 1];
    return {a + t * (b - a), da + t * (db - da)};
  }
  /// Beyond this s the profile is nought.
  float reach() const { return static_cast<float>(last_) / per_unit_; }
  double blur() const { return blur_; }
  double absorbance() const { return absorbance_; }

 private:
  double blur_;
  double absorbance_;
  float per_unit_;
  int last_;
  std::vector<float> values_;
  std::vector<float> slopes_;
};

}  // namespace helicarm
