// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/contrast_model.h"

#include <Eigen/LU>

namespace helicarm::track {
namespace {

constexpr double usual_share = 0.4, share_sigma = 0.4;  // of a marker of unknown absorbance
constexpr double usual_spread = 0.35, usual_count = 4;  // before anything is learnt
constexpr double least_spread = 0.1;

}  // namespace

ContrastModel ContrastLearner::model() const {
  ContrastModel made;
  if (!(normal_(0, 0) > 0)) return made;
  Eigen::Matrix2d normal = normal_;
  Eigen::Vector2d right = right_;
  // Where the background hardly varies the line's slope stays the usual one.
  const double pull = 1 / (share_sigma * share_sigma);
  normal(1, 1) += pull;
  right[1] += pull * usual_share;
  const Eigen::Vector2d line = normal.inverse() * right;
  made.at_zero = line[0];
  made.share = line[1];
  made.spread = std::max(least_spread, std::sqrt((squares_ + usual_count * usual_spread * usual_spread) /
                                                 (count_ + usual_count)));
  made.is_known = true;
  return made;
}

void ContrastLearner::forget() {
  constexpr double kept = 0.97;  // a frame
  normal_ *= kept;
  right_ *= kept;
  squares_ *= kept;
  count_ *= kept;
}

void ContrastLearner::add(const MarkerImage& image, double ratio) {
  constexpr double vague = 0.4;
  const double contrast = std::abs(image.contrast) / ratio, relative = contrast_sigma(image);
  if (relative > vague) return;
  double usual = contrast;
  if (const ContrastModel now = model(); now.is_known) {
    const double expected = now.at(image.background);
    usual = expected;
    const double off = std::clamp((contrast - expected) / expected, -1.0, 1.0);
    squares_ += std::max(0.0, off * off - relative * relative);
    ++count_;
  }
  const double sigma = usual * std::hypot(relative, least_spread);
  const Eigen::Vector2d row(1, image.background);
  normal_ += row * row.transpose() / (sigma * sigma);
  right_ += row * contrast / (sigma * sigma);
}

}  // namespace helicarm::track
