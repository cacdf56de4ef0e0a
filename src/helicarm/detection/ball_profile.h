// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

namespace helicarm::detection {

/// Radial profile of a ball's X-ray image: absorption along the chord of a sphere, blurred by a Gaussian and
/// scaled to 1 at the centre of the sharp image. Tabulated over s = distance / radius.
class BallProfile {
 public:
  /// `blur`: standard deviation of the Gaussian over the ball's radius. `absorbance`: attenuation times
  /// diameter; small for a faint ball (profile like the chord length), large for an opaque ball or a hole
  /// (flat disc).
  BallProfile(double blur, double absorbance);

  struct Sample {
    float value;
    float slope;  ///< d value / d s
  };
  /// Passed by value, so that a loop over pixels can vectorise its lookups.
  struct Table {
    const float* values;
    float per_unit;
    float last;
    Sample at(float s) const {
      const float x = std::min(s * per_unit, last);
      const int i = static_cast<int>(x);
      const float t = x - static_cast<float>(i);
      const float rise = values[i + 1] - values[i];
      return {values[i] + t * rise, rise * per_unit};
    }
  };
  Table table() const { return {values_.data(), per_unit_, static_cast<float>(last_)}; }
  Sample at(float s) const { return table().at(s); }
  /// The profile is 0 beyond this s.
  float reach() const { return static_cast<float>(last_) / per_unit_; }
  double blur() const { return blur_; }
  double absorbance() const { return absorbance_; }

 private:
  double blur_;
  double absorbance_;
  float per_unit_;
  int last_;
  std::vector<float> values_;
};

}  // namespace helicarm::detection
