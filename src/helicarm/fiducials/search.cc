// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/search.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "helicarm/core/random.h"

namespace helicarm {
namespace {

constexpr double radius_sigmas = 3;    // a true triple lost here is made good by the next
constexpr std::size_t most_kept = 24;  // hypotheses

/// Every item in turn, in random company, so that none is left out for long.
class TripleDealer {
 public:
  explicit TripleDealer(std::vector<int> items) : items_(std::move(items)), next_(items_.size()) {}

  std::array<int, 3> deal() {
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

Neighbourhood::Neighbourhood(const Scene& scene) {
  constexpr int reach = 3;  // cells
  const double cell_px = rough_gate_px(scene) / reach;
  Eigen::Array2d low = scene.candidates.front().uv.array();
  Eigen::Array2d high = low;
  for (const auto& candidate : scene.candidates) {
    low = low.min(candidate.uv.array());
    high = high.max(candidate.uv.array());
  }
  low -= (reach + 1) * cell_px;
  const Eigen::Array2i cells = ((high - low) / cell_px).cast<int>() + reach + 2;
  cell_from_px_ << 1 / cell_px, 0, -low.x() / cell_px, 0, 1 / cell_px, -low.y() / cell_px, 0, 0, 1;
  last_column_ = static_cast<float>(cells.x() - 1);
  last_row_ = static_cast<float>(cells.y() - 1);
  marked_.assign(static_cast<std::size_t>(cells.prod()), 0);
  for (const auto& candidate : scene.candidates) {
    const Eigen::Array2i at = ((candidate.uv.array() - low) / cell_px).cast<int>();
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        if (dx * dx + dy * dy <= reach * reach) marked_[(at.y() + dy) * cells.x() + at.x() + dx] = 1;
      }
    }
  }
  balls_.resize((scene.balls.size() + 7) / 8);
  for (std::size_t k = 0; k < scene.balls.size(); ++k) {
    auto& eight = balls_[k / 8];
    const Eigen::Vector3f centre = scene.balls[k].centre.cast<float>();
    eight.x.tail(8 - k % 8) = centre.x();
    eight.y.tail(8 - k % 8) = centre.y();
    eight.z.tail(8 - k % 8) = centre.z();
    eight.used = static_cast<int>(k % 8) + 1;
  }
}

bool Neighbourhood::holds(const View& view, int wanted) const {
  const Eigen::Matrix<float, 3, 4> p = (cell_from_px_ * view.projection()).cast<float>();
  for (const auto& eight : balls_) {
    const auto row = [&](int i) -> Eight {
      return p(i, 0) * eight.x + p(i, 1) * eight.y + p(i, 2) * eight.z + p(i, 3);
    };
    const Eight depth = row(2);
    const Eight column = (row(0) / depth).max(0).min(last_column_).floor();
    const Eight line = (row(1) / depth).max(0).min(last_row_).floor();
    const Eigen::Array<int, 8, 1> cell = (line * (last_column_ + 1) + column).cast<int>();
    for (int i = 0; i < eight.used; ++i) wanted -= marked_[cell[i]];
    if (wanted <= 0) return true;
  }
  return false;
}

LabelSearch::LabelSearch(const Scene& scene, std::vector<double> focals_px)
    : scene_(scene), focals_px_(std::move(focals_px)), flat_px_(0.04 * scene.field_radius_px), near_(scene) {
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
  const auto count = static_cast<Eigen::Index>(triangles_.size());
  a_.resize(count);
  b_.resize(count);
  c_.resize(count);
  for (Eigen::Index t = 0; t < count; ++t) {
    a_[t] = static_cast<float>(triangles_[t].a);
    b_[t] = static_cast<float>(triangles_[t].b);
    c_[t] = static_cast<float>(triangles_[t].c);
  }
  for (const auto& candidate : scene.candidates) {
    for (const auto& ball : scene.balls)
      scales_.push_back(scale_by_radius(scene, candidate, ball, radius_sigmas));
  }
}

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
  const Eigen::ArrayXf mm_per_px =
      static_cast<float>(1 / focal_px) / inverse_distance2(a_, b_, c_, a, b, c).sqrt();
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    const ModelTriangle& triangle = triangles_[t];
    if (!scales[0][triangle.balls[0]].holds(mm_per_px[t])) continue;
    const Scale& s1 = scales[1][triangle.balls[1]];
    const Scale& s2 = scales[2][triangle.balls[2]];
    const auto away = orthography(triangle, a, b, c);
    for (const double lean : {1.0, -1.0}) {
      const Orthography start{away.inverse_distance2, lean * away.behind1, lean * away.behind2};
      if (!s1.holds(mm_per_px[t] * (1 + start.behind1)) || !s2.holds(mm_per_px[t] * (1 + start.behind2)))
        continue;
      const auto depths = three_point_depths(triangle, upright, start);
      if (!depths) continue;
      const Eigen::Vector2d& centre = scene_.camera.principal_px;
      try_pose({{focal_px, focal_px, centre.x(), centre.y()}, three_point_pose(triangle, upright, *depths)},
               lean);
      try_pose({{-focal_px, focal_px, centre.x(), centre.y()}, three_point_pose(triangle, mirrored, *depths)},
               lean);
    }
  }
}

void LabelSearch::try_pose(const View& rough, double lean) {
  const int best = ranking_.empty() ? 0 : ranking_.front().matched;
  const int wanted = std::max(least_balls - 1, best - 3);
  if (!near_.holds(rough, wanted)) return;
  auto key = match(scene_, rough, rough_gate_px(scene_));
  if (std::count_if(key.begin(), key.end(), [](int i) { return i >= 0; }) < wanted) return;
  key.push_back(rough.intrinsics.fx < 0 ? -1 : 1);
  key.push_back(lean < 0 ? -1 : 1);
  if (tried_.insert(std::move(key)).second) keep(settle(scene_, rough));
}

void LabelSearch::keep(Hypothesis hypothesis) {
  if (!std::isfinite(hypothesis.log_odds)) return;
  const auto same = std::find_if(ranking_.begin(), ranking_.end(), [&](const Hypothesis& other) {
    return other.candidate_of_ball == hypothesis.candidate_of_ball &&
           other.mirrored() == hypothesis.mirrored();
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

void explore(LabelSearch& search, std::size_t triples,
             const std::function<bool(const Hypothesis&, std::size_t)>& will_do) {
  std::vector<int> all(search.scene().candidates.size());
  std::iota(all.begin(), all.end(), 0);
  TripleDealer dealer(all);
  for (std::size_t i = 0; i < triples; ++i) {
    search.try_triple(dealer.deal());
    if (!search.ranking().empty() && will_do(search.ranking().front(), i + 1)) return;
  }
}

void challenge(LabelSearch& search) {
  std::vector<int> best;
  do {
    best = search.ranking().front().candidate_of_ball;
    std::vector<int> seen;
    std::copy_if(best.begin(), best.end(), std::back_inserter(seen), [](int i) { return i >= 0; });
    const int triples = seen.size() < 8 ? 24 : 8;  // of six candidates few are left when one is not shared
    TripleDealer dealer(seen);
    for (int done = 0, dealt = 0; done < triples && dealt < 5 * triples; ++dealt) {
      done += search.try_triple(dealer.deal()) ? 1 : 0;
    }
  } while (search.ranking().front().candidate_of_ball != best);
}

}  // namespace helicarm
