// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace helicarm {
namespace {

constexpr double radius_sigmas = 3;     // a true triple lost here is made good by the next
constexpr std::size_t most_kept = 24;  // hypotheses

/// The fewest supporters (two or three) that chance gives to less than one pose in fifty.
int support_needed(const Scene& scene) {
  const double gate = rough_gate_px(scene) / scene.field_radius_px;
  const double mean = static_cast<double>(scene.balls.size() * scene.candidates.size()) * gate * gate;
  return 1 - std::exp(-mean) * (1 + mean) < 0.02 ? 2 : 3;
}

}  // namespace

LabelSearch::LabelSearch(const Scene& scene, std::vector<double> focals_px)
    : scene_(scene),
      focals_px_(std::move(focals_px)),
      flat_px_(0.04 * scene.field_radius_px),
      support_(support_needed(scene)) {
  const int balls = static_cast<int>(scene.balls.size());
  for (int i = 0; i < balls; ++i) {
    for (int j = 0; j < balls; ++j) {
      for (int k = 0; k < balls; ++k) {
        if (i == j || j == k || i == k) continue;
        const auto triangle =
            model_triangle({i, j, k}, {scene.balls[i].centre, scene.balls[j].centre, scene.balls[k].centre});
        if (triangle) triangles_.push_back(*triangle);
      }
    }
  }
  for (const auto& candidate : scene.candidates) {
    u_.push_back(static_cast<float>(candidate.uv.x()));
    v_.push_back(static_cast<float>(candidate.uv.y()));
    for (const auto& ball : scene.balls) scales_.push_back(scale_by_radius(scene, candidate, ball, radius_sigmas));
  }
}

bool LabelSearch::try_triple(const std::array<int, 3>& candidates) {
  const Eigen::Vector2d e1 = scene_.candidates[candidates[1]].uv - scene_.candidates[candidates[0]].uv;
  const Eigen::Vector2d e2 = scene_.candidates[candidates[2]].uv - scene_.candidates[candidates[0]].uv;
  const double longest = std::max({e1.norm(), e2.norm(), (e2 - e1).norm()});
  if (std::abs(e1.x() * e2.y() - e1.y() * e2.x()) < flat_px_ * longest) return false;
  for (const double focal_px : focals_px_) try_scale(candidates, focal_px);
  return true;
}

void LabelSearch::try_scale(const std::array<int, 3>& candidates, double focal_px) {
  std::array<Eigen::Vector2d, 3> upright;
  std::array<Eigen::Vector2d, 3> mirrored;
  std::array<const Scale*, 3> scales;
  for (int i = 0; i < 3; ++i) {
    upright[i] = (scene_.candidates[candidates[i]].uv - scene_.camera.principal_px) / focal_px;
    mirrored[i] = {-upright[i].x(), upright[i].y()};
    scales[i] = &scales_[candidates[i] * scene_.balls.size()];
  }
  const Eigen::Vector2d e1 = upright[1] - upright[0];
  const Eigen::Vector2d e2 = upright[2] - upright[0];
  const double a = e1.squaredNorm();
  const double b = e2.squaredNorm();
  const double c = e1.dot(e2);
  for (const auto& triangle : triangles_) {
    const Scale& s0 = scales[0][triangle.balls[0]];
    const Scale& s1 = scales[1][triangle.balls[1]];
    const Scale& s2 = scales[2][triangle.balls[2]];
    const auto away = orthography(triangle, a, b, c);
    const double mm_per_px = 1 / (focal_px * std::sqrt(away.inverse_distance2));
    if (!s0.holds(mm_per_px)) continue;
    for (const double lean : {1.0, -1.0}) {
      const Orthography start{away.inverse_distance2, lean * away.behind1, lean * away.behind2};
      if (!s1.holds(mm_per_px * (1 + start.behind1)) || !s2.holds(mm_per_px * (1 + start.behind2))) continue;
      for (const auto* image : {&upright, &mirrored}) {
        const auto pose = three_point_pose(triangle, *image, start);
        if (!pose) continue;
        const Eigen::Vector2d& centre = scene_.camera.principal_px;
        const double fx = image == &mirrored ? -focal_px : focal_px;
        try_pose(View{{fx, focal_px, centre.x(), centre.y()}, *pose}, lean);
      }
    }
  }
}

bool LabelSearch::supported(const View& rough) const {
  const int best = ranking_.empty() ? 0 : ranking_.front().matched;
  int wanted = 3 + std::max(support_, best / 2 - 2);
  int left = static_cast<int>(scene_.balls.size());
  const float gate = static_cast<float>(rough_gate_px(scene_));
  for (const auto& ball : scene_.balls) {
    if (left-- < wanted) return false;
    const Eigen::Vector2f uv = rough.project(ball.centre).cast<float>();
    int near = 0;
    for (std::size_t i = 0; i < u_.size(); ++i) {
      const float du = u_[i] - uv.x();
      const float dv = v_[i] - uv.y();
      near += du * du + dv * dv < gate * gate ? 1 : 0;
    }
    if (near > 0 && --wanted == 0) return true;
  }
  return false;
}

void LabelSearch::try_pose(const View& rough, double lean) {
  if (!supported(rough)) return;
  auto key = match(scene_, rough, rough_gate_px(scene_), std::numeric_limits<double>::infinity());
  key.push_back(rough.intrinsics.fx < 0 ? -1 : 1);
  key.push_back(lean < 0 ? -1 : 1);
  if (tried_.insert(std::move(key)).second) keep(settle(scene_, rough));
}

void LabelSearch::keep(Hypothesis hypothesis) {
  if (!std::isfinite(hypothesis.log_odds)) return;
  const auto same = std::find_if(ranking_.begin(), ranking_.end(), [&](const Hypothesis& other) {
    return other.candidate_of_ball == hypothesis.candidate_of_ball && other.mirrored() == hypothesis.mirrored();
  });
  if (same != ranking_.end()) {
    if (same->log_odds >= hypothesis.log_odds) return;
    ranking_.erase(same);
  }
  const auto place =
      std::upper_bound(ranking_.begin(), ranking_.end(), hypothesis,
                       [](const Hypothesis& p, const Hypothesis& q) { return p.log_odds > q.log_odds; });
  ranking_.insert(place, std::move(hypothesis));
  if (ranking_.size() > most_kept) ranking_.pop_back();
}

}  // namespace helicarm
