// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/search.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "helicarm/core/random.h"
#include "helicarm/fiducials/three_point.h"
#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::fiducials {
namespace {

constexpr std::size_t most_kept = 24;        // hypotheses
constexpr std::size_t most_candidates = 16;  // more do not extend the search

Eigen::Matrix3d principal_axes_of(const std::vector<ModelBall>& balls) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const ModelBall& ball : balls) spread += ball.centre * ball.centre.transpose();
  return geometry::symmetric_eigen(spread).vectors;
}

/// Random triples in which all items occur equally often.
class TripleSampler {
 public:
  explicit TripleSampler(std::vector<int> items) : items_(std::move(items)), next_(items_.size()) {}

  std::array<int, 3> next_triple() {
    if (next_ + 3 > items_.size()) {
      for (std::size_t i = items_.size(); i > 1; --i) {
        std::swap(items_[i - 1], items_[random_.index(static_cast<std::uint32_t>(i))]);
      }
      next_ = 0;
    }
    next_ += 3;
    return {items_[next_ - 3], items_[next_ - 2], items_[next_ - 1]};
  }

 private:
  std::vector<int> items_;
  std::size_t next_;
  RandomStream random_{1, 0};
};

}  // namespace

LabelSearch::LabelSearch(const LabellingProblem& scene, std::vector<double> focals_px)
    : scene_(scene),
      focals_px_(std::move(focals_px)),
      flat_px_(0.04 * scene.field_radius_px),
      principal_axes_(principal_axes_of(scene.balls)),
      filter_(scene) {}

bool LabelSearch::try_triple(std::array<int, 3> candidates) {
  std::sort(candidates.begin(), candidates.end());
  if (!triples_.insert(candidates).second) return false;
  const Eigen::Vector2d e1 = scene_.candidates[candidates[1]].uv - scene_.candidates[candidates[0]].uv;
  const Eigen::Vector2d e2 = scene_.candidates[candidates[2]].uv - scene_.candidates[candidates[0]].uv;
  const double longest = std::max({e1.norm(), e2.norm(), (e2 - e1).norm()});
  if (std::abs(e1.x() * e2.y() - e1.y() * e2.x()) < flat_px_ * longest) return false;
  for (const double focal_px : focals_px_) try_scale(candidates, focal_px);
  return true;
}

void LabelSearch::try_scale(const std::array<int, 3>& candidates, double focal_px) {
  const Eigen::Vector2d& centre = scene_.camera.principal_px;
  for (const PoseHypothesis& pose : filter_.filter(candidates, focal_px, required())) {
    if (scene_.mirrored && pose.mirrored != *scene_.mirrored) continue;
    std::array<Eigen::Vector2d, 3> image;
    std::array<Eigen::Vector3d, 3> points;
    for (int i = 0; i < 3; ++i) {
      image[i] = (scene_.candidates[candidates[i]].uv - centre) / focal_px;
      if (pose.mirrored) image[i].x() *= -1;
      points[i] = scene_.balls[pose.balls[i]].centre;
    }
    const auto triangle = model_triangle(pose.balls, points);
    if (!triangle) continue;
    const Eigen::Vector2d e1 = image[1] - image[0];
    const Eigen::Vector2d e2 = image[2] - image[0];
    Orthography start = orthography(*triangle, e1.squaredNorm(), e2.squaredNorm(), e1.dot(e2));
    start.behind1 *= pose.depth_sign;
    start.behind2 *= pose.depth_sign;
    const auto depths = three_point_depths(*triangle, image, start);
    if (!depths) continue;
    const double fx = pose.mirrored ? -focal_px : focal_px;
    try_pose({{fx, focal_px, centre.x(), centre.y()}, three_point_pose(*triangle, image, *depths)},
             pose.depth_sign);
  }
}

void LabelSearch::try_expected() {
  if (scene_.expected) keep(match_and_fit(scene_, scene_.expected->view, required()));
}

int LabelSearch::required() const {
  return std::max(least_balls - 1, (ranking_.empty() ? 0 : ranking_.front().matched) - 3);
}

void LabelSearch::try_pose(const geometry::View& rough, double depth_sign) {
  auto key = match(scene_, rough, rough_gate_px(scene_));
  const auto matched = static_cast<int>(std::count_if(key.begin(), key.end(), [](int i) { return i >= 0; }));
  if (matched < required()) return;
  key.push_back(rough.intrinsics.fx < 0 ? -1 : 1);
  key.push_back(depth_sign < 0 ? -1 : 1);
  if (!tried_.insert(std::move(key)).second) return;
  supported_.push_back({matched, rough});
  keep(match_and_fit(scene_, rough, required()));
}

std::vector<geometry::View> LabelSearch::supported(int required, std::size_t most) const {
  std::vector<Rough> enough;
  std::copy_if(supported_.begin(), supported_.end(), std::back_inserter(enough),
               [&](const Rough& rough) { return rough.matched >= required; });
  std::stable_sort(enough.begin(), enough.end(),
                   [](const Rough& p, const Rough& q) { return p.matched > q.matched; });
  std::vector<geometry::View> views;
  for (std::size_t i = 0; i < std::min(most, enough.size()); ++i) views.push_back(enough[i].view);
  return views;
}

void LabelSearch::try_near_misses(const Hypothesis& h) {
  for (std::size_t k = 0; k < scene_.balls.size(); ++k) {
    const Eigen::Vector2d uv = h.fit.view.project(scene_.balls[k].centre);
    for (std::size_t i = 0; i < scene_.candidates.size(); ++i) {
      if (h.candidate_of_ball[k] == static_cast<int>(i)) continue;
      if ((scene_.candidates[i].uv - uv).norm() >= rough_gate_px(scene_)) continue;
      for (auto& rival : with_pair(scene_, h, static_cast<int>(k), static_cast<int>(i)))
        keep(std::move(rival));
    }
  }
}

void LabelSearch::try_symmetric_poses(const Hypothesis& h) {
  const Eigen::Vector3d flip(-1, 1, 1);  // of a mirrored image
  for (int which = 1; which < 16; ++which) {
    const auto sign = [&](int bit) { return which >> bit & 1 ? -1.0 : 1.0; };
    const Eigen::Vector3d along_axes(sign(0), sign(1), sign(2)), in_depth(1, 1, sign(3));
    geometry::View symmetric = h.fit.view;
    geometry::RigidTransform& pose = symmetric.camera_from_world;
    pose.rotation = in_depth.asDiagonal() * pose.rotation * principal_axes_ * along_axes.asDiagonal() *
                    principal_axes_.transpose();
    const bool flips = along_axes.prod() * in_depth.z() < 0;
    if (flips) {
      symmetric.intrinsics.fx *= -1;
      pose.rotation = flip.asDiagonal() * pose.rotation;
      pose.translation = flip.asDiagonal() * pose.translation;
    }
    if (scene_.mirrored && *scene_.mirrored != (symmetric.intrinsics.fx < 0)) continue;
    keep(match_and_fit(scene_, symmetric, required()));
    // From the rough gate the matches may differ from those of `h`: a narrower gate is tried, too.
    Hypothesis same;
    same.candidate_of_ball = match(scene_, symmetric, rough_gate_px(scene_) / 4);
    const auto correspondences = correspondences_of(scene_, same.candidate_of_ball, symmetric);
    if (static_cast<int>(correspondences.size()) < required()) continue;
    same.fit = fit_pose(symmetric, correspondences, scene_.camera, fit_steps);
    evaluate_odds(scene_, same);
    keep(std::move(same));
  }
}

void LabelSearch::keep(Hypothesis hypothesis) {
  if (!std::isfinite(hypothesis.log_odds)) return;
  if (scene_.expected && !scene_.expected->allows(hypothesis.fit.view)) return;
  const auto same = std::find_if(ranking_.begin(), ranking_.end(), [&](const Hypothesis& other) {
    return other.candidate_of_ball == hypothesis.candidate_of_ball &&
           other.mirrored() == hypothesis.mirrored();
  });
  if (same != ranking_.end()) {
    if (same->log_odds >= hypothesis.log_odds) return;
    ranking_.erase(same);
  }
  const auto behind_better =
      std::upper_bound(ranking_.begin(), ranking_.end(), hypothesis,
                       [](const Hypothesis& p, const Hypothesis& q) { return p.log_odds > q.log_odds; });
  ranking_.insert(behind_better, std::move(hypothesis));
  if (ranking_.size() > most_kept) ranking_.pop_back();
}

std::size_t triples_required(int balls, std::size_t candidates) {
  const double n = static_cast<double>(std::min(candidates, most_candidates));
  const double b = std::min(static_cast<double>(balls), n);
  return static_cast<std::size_t>(std::ceil(std::log(1e3) * n * (n - 1) * (n - 2) / (b * (b - 1) * (b - 2))));
}

void try_random_triples(LabelSearch& search, std::size_t triples,
                        const std::function<bool(const Hypothesis&, std::size_t)>& is_sufficient) {
  std::vector<int> all(search.scene().candidates.size());
  std::iota(all.begin(), all.end(), 0);
  TripleSampler sampler(all);
  for (std::size_t i = 0; i < triples; ++i) {
    search.try_triple(sampler.next_triple());
    if (!search.ranking().empty() && is_sufficient(search.ranking().front(), i + 1)) return;
  }
}

void search_rivals(LabelSearch& search) {
  std::vector<int> best;
  do {
    best = search.ranking().front().candidate_of_ball;
    std::vector<int> seen;
    std::copy_if(best.begin(), best.end(), std::back_inserter(seen), [](int i) { return i >= 0; });
    const int triples = seen.size() < 8 ? 24 : 8;  // six candidates have few triples without a given one
    TripleSampler sampler(seen);
    for (int done = 0, sampled = 0; done < triples && sampled < 5 * triples; ++sampled) {
      done += search.try_triple(sampler.next_triple()) ? 1 : 0;
    }
    search.try_near_misses(Hypothesis(search.ranking().front()));
    search.try_symmetric_poses(Hypothesis(search.ranking().front()));
  } while (search.ranking().front().candidate_of_ball != best);
}

}  // namespace helicarm::fiducials
