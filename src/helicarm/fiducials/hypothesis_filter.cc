// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/hypothesis_filter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "helicarm/fiducials/three_point.h"

namespace helicarm::fiducials {
namespace {

constexpr double filter_radius_sigmas = 3;  // a true triple lost here is replaced by another
constexpr int reach = 3;                    // of a candidate, in cells

template <class T>
struct LaneVector {
  T x, y, z;

  LaneVector operator+(const LaneVector& q) const { return {x + q.x, y + q.y, z + q.z}; }
  LaneVector operator-(const LaneVector& q) const { return {x - q.x, y - q.y, z - q.z}; }
  LaneVector operator*(const T& s) const { return {x * s, y * s, z * s}; }
  T dot(const LaneVector& q) const { return x * q.x + y * q.y + z * q.z; }
  LaneVector cross(const LaneVector& q) const {
    return {y * q.z - z * q.y, z * q.x - x * q.z, x * q.y - y * q.x};
  }
  LaneVector unit() const { return *this * T(dot(*this).rsqrt()); }
};

/// Columns of the orthonormal frame of two edges.
template <class T>
std::array<LaneVector<T>, 3> frame_of(const LaneVector<T>& e1, const LaneVector<T>& e2) {
  const LaneVector<T> along = e1.unit();
  const LaneVector<T> normal = e1.cross(e2).unit();
  return {along, normal.cross(along), normal};
}

/// A triangle of balls in each lane: squared lengths of two edges, their product, and the corners.
template <class Simd>
struct ModelTriangles {
  Simd a, b, c;
  std::array<LaneVector<Simd>, 3> corners;
};

/// Relative depths of the second and third corner behind the first.
template <class Simd>
struct Depths {
  Simd behind1, behind2;
  Simd inverse_distance2 = Simd::Zero();  ///< of the first corner
  Simd open = Simd::Ones();               ///< 0 where the iteration has settled
};

template <class Simd, class Image>
std::array<LaneVector<Simd>, 2> lifted_edges(const Image& image, const Depths<Simd>& depths) {
  const auto lift = [&](const Eigen::Vector2f& at, const Simd& behind) -> LaneVector<Simd> {
    return {(1 + behind) * at.x() - image.at0.x(), (1 + behind) * at.y() - image.at0.y(), behind};
  };
  return {lift(image.at1, depths.behind1), lift(image.at2, depths.behind2)};
}

/// Perspective depths, iterated from scaled orthography.
template <class Simd, class Image>
void settle(const ModelTriangles<Simd>& model, const Image& image, Depths<Simd>& depths) {
  for (int iteration = 0; iteration < most_depth_iterations && (depths.open > 0).any(); ++iteration) {
    const auto [e1, e2] = lifted_edges(image, depths);
    const Simd a = e1.x * e1.x + e1.y * e1.y;
    const Simd b = e2.x * e2.x + e2.y * e2.y;
    const Simd c = e1.x * e2.x + e1.y * e2.y;
    const Simd w = inverse_distance2(model.a, model.b, model.c, a, b, c);
    const Simd size2 = (w * model.b - b).max(0).sqrt();
    Simd next1 = (w * model.a - a).max(0).sqrt();
    Simd next2 = (w * model.c < c).select(-size2, size2);
    const Simd sign =
        (next1 * depths.behind1 + next2 * depths.behind2 < 0).select(Simd::Constant(-1), Simd::Ones());
    next1 *= sign;
    next2 *= sign;
    const Simd moved = (next1 - depths.behind1).abs().max((next2 - depths.behind2).abs());
    const Simd deepest = next1.abs().max(next2.abs());
    depths = {next1, next2, w,
              (moved >= static_cast<float>(depth_settled) && deepest < static_cast<float>(deepest_corner))
                  .select(Simd::Ones(), Simd::Zero())};
  }
}

/// What the projected balls are compared with.
struct Support {
  const CandidateGrid& near;
  const Eigen::Vector2d& principal_px;
  const std::vector<Eigen::Vector3f>& balls;
  int required;  ///< of balls near a candidate
};

/// Adds for each lane the balls that project near a candidate, in the pose and in its mirror image about the
/// triangle's plane; stops once no lane can reach the number required.
template <class Simd, class Image, class Counts>
void count_near(const ModelTriangles<Simd>& model, const Depths<Simd>& depths, const Image& image,
                const Support& support, Counts& upright, Counts& mirrored) {
  const auto [e1, e2] = lifted_edges(image, depths);
  const auto lifted = frame_of(e1, e2);
  const auto own = frame_of(model.corners[1] - model.corners[0], model.corners[2] - model.corners[0]);
  const Simd distance = depths.inverse_distance2.rsqrt();
  const CandidateGrid& near = support.near;
  const Eigen::Array2f centre =
      ((support.principal_px.array() - near.low_px()) / near.cell_px()).template cast<float>();
  const float focal = image.focal_px * static_cast<float>(1 / near.cell_px());
  // Rows of the pose without the component along the triangle's normal, which changes sign if mirrored.
  const auto in_plane = [&](const Simd& along, const Simd& across, const Simd& origin) {
    const LaneVector<Simd> row = own[0] * along + own[1] * across;
    return std::pair<LaneVector<Simd>, Simd>(row, origin - row.dot(model.corners[0]));
  };
  const auto x = in_plane(lifted[0].x, lifted[1].x, image.at0.x() * distance);
  const auto y = in_plane(lifted[0].y, lifted[1].y, image.at0.y() * distance);
  const auto z = in_plane(lifted[0].z, lifted[1].z, distance);
  const Simd normal_offset = own[2].dot(model.corners[0]);
  constexpr int between_looks = 8;
  int left = static_cast<int>(support.balls.size());
  for (const auto& ball : support.balls) {
    if (left % between_looks == 0 && std::max(*std::max_element(upright.begin(), upright.end()),
                                              *std::max_element(mirrored.begin(), mirrored.end())) +
                                             left <
                                         support.required)
      return;
    --left;
    const auto at = [&](const std::pair<LaneVector<Simd>, Simd>& row) -> Simd {
      return row.first.x * ball.x() + row.first.y * ball.y() + row.first.z * ball.z() + row.second;
    };
    const Simd px = at(x);
    const Simd py = at(y);
    const Simd pz = at(z);
    const Simd out = own[2].x * ball.x() + own[2].y * ball.y() + own[2].z * ball.z() - normal_offset;
    const Simd ox = out * lifted[2].x;
    const Simd oy = out * lifted[2].y;
    const Simd oz = out * lifted[2].z;
    const auto count_marked = [&](const Simd& qx, const Simd& qy, const Simd& qz, Counts& count) {
      const Simd per_depth = focal / qz;
      near.add_marks<Simd::RowsAtCompileTime>(qx * per_depth + centre.x(), qy * per_depth + centre.y(),
                                              count);
    };
    count_marked(px + ox, py + oy, pz + oz, upright);
    count_marked(px - ox, py - oy, pz - oz, mirrored);
  }
}

}  // namespace

CandidateGrid::CandidateGrid(const LabellingProblem& scene) : cell_px_(rough_gate_px(scene) / reach) {
  low_px_ = scene.candidates.front().uv.array();
  Eigen::Array2d high = low_px_;
  for (const auto& candidate : scene.candidates) {
    low_px_ = low_px_.min(candidate.uv.array());
    high = high.max(candidate.uv.array());
  }
  low_px_ -= (reach + 1) * cell_px_;
  const Eigen::Array2i cells = ((high - low_px_) / cell_px_).cast<int>() + reach + 2;
  last_column_ = static_cast<float>(cells.x() - 1);
  last_row_ = static_cast<float>(cells.y() - 1);
  marked_.assign(static_cast<std::size_t>(cells.prod()), 0);
  for (const auto& candidate : scene.candidates) {
    const Eigen::Array2i at = ((candidate.uv.array() - low_px_) / cell_px_).cast<int>();
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        if (dx * dx + dy * dy <= reach * reach) marked_[(at.y() + dy) * cells.x() + at.x() + dx] = 1;
      }
    }
  }
}

HypothesisFilter::HypothesisFilter(const LabellingProblem& scene) : scene_(scene), near_(scene) {
  const auto count = scene.balls.size();
  for (const auto& ball : scene.balls) balls_.push_back(ball.centre.cast<float>());
  std::vector<float> a, b, c;
  for (std::size_t i = 0; i < count; ++i) {
    first_of_ball_.push_back(static_cast<int>(triangles_.size()));
    for (std::size_t j = 0; j < count; ++j) {
      for (std::size_t k = 0; k < count; ++k) {
        if (i == j || j == k || i == k) continue;
        const Eigen::Vector3f e1 = balls_[j] - balls_[i];
        const Eigen::Vector3f e2 = balls_[k] - balls_[i];
        if (is_flat(e1.squaredNorm(), e2.squaredNorm(), e1.dot(e2))) continue;
        triangles_.push_back(
            {{static_cast<std::int16_t>(i), static_cast<std::int16_t>(j), static_cast<std::int16_t>(k)}});
        a.push_back(e1.squaredNorm());
        b.push_back(e2.squaredNorm());
        c.push_back(e1.dot(e2));
      }
    }
  }
  first_of_ball_.push_back(static_cast<int>(triangles_.size()));
  const auto as_array = [](const std::vector<float>& values) {
    return Eigen::Map<const Eigen::ArrayXf>(values.data(), static_cast<Eigen::Index>(values.size()));
  };
  a_ = as_array(a);
  b_ = as_array(b);
  c_ = as_array(c);
  in_scale_.resize(triangles_.size() + 1);
  for (const auto& candidate : scene.candidates) {
    for (const auto& ball : scene.balls) {
      const Scale scale = scale_by_radius(scene, candidate, ball, filter_radius_sigmas);
      scales_.push_back({static_cast<float>(scale.finest), static_cast<float>(scale.coarsest)});
    }
  }
}

/// Scaled orthography, both depth signs.
void HypothesisFilter::gather_starts(const std::array<int, 3>& candidates, const Image& image) {
  mm_per_px_ = inverse_distance2(a_, b_, c_, image.a, image.b, image.c).rsqrt() / image.focal_px;
  std::array<const std::array<float, 2>*, 3> scales{};
  for (int i = 0; i < 3; ++i)
    scales[i] = scales_.data() + static_cast<std::size_t>(candidates[i]) * balls_.size();
  const auto holds = [](const std::array<float, 2>& scale, float mm_per_px) {
    return static_cast<int>(scale[0] <= mm_per_px) & static_cast<int>(mm_per_px <= scale[1]);
  };
  std::size_t kept = 0;
  for (std::size_t ball = 0; ball < balls_.size(); ++ball) {
    const std::array<float, 2> scale = scales[0][ball];
    for (int t = first_of_ball_[ball]; t < first_of_ball_[ball + 1]; ++t) {
      in_scale_[kept] = t;
      kept += holds(scale, mm_per_px_[t]) ? 1 : 0;
    }
  }
  starts_.resize(2 * kept + width);
  std::size_t filled = 0;
  for (std::size_t i = 0; i < kept; ++i) {
    const int t = in_scale_[i];
    const float per_px = mm_per_px_[t];
    const float w = 1 / (per_px * per_px * image.focal_px * image.focal_px);
    const float h1 = std::sqrt(std::max(0.0f, w * a_[t] - image.a));
    const float h2 = std::copysign(std::sqrt(std::max(0.0f, w * b_[t] - image.b)), w * c_[t] - image.c);
    const auto& s1 = scales[1][static_cast<std::size_t>(triangles_[t].balls[1])];
    const auto& s2 = scales[2][static_cast<std::size_t>(triangles_[t].balls[2])];
    for (const float depth_sign : {1.0f, -1.0f}) {
      starts_[filled] = {t, depth_sign, depth_sign * h1, depth_sign * h2};
      filled += holds(s1, per_px * (1 + depth_sign * h1)) & holds(s2, per_px * (1 + depth_sign * h2)) ? 1 : 0;
    }
  }
  starts_.resize(filled);
}

void HypothesisFilter::test(const Start* starts, int used, const Image& image, int required) {
  ModelTriangles<Simd> model;
  Depths<Simd> depths;
  for (int lane = 0; lane < width; ++lane) {
    const Start& start = starts[std::min(lane, used - 1)];
    model.a[lane] = a_[start.triangle];
    model.b[lane] = b_[start.triangle];
    model.c[lane] = c_[start.triangle];
    depths.behind1[lane] = start.behind1;
    depths.behind2[lane] = start.behind2;
    for (int corner = 0; corner < 3; ++corner) {
      const auto& ball = balls_[static_cast<std::size_t>(triangles_[start.triangle].balls[corner])];
      model.corners[corner].x[lane] = ball.x();
      model.corners[corner].y[lane] = ball.y();
      model.corners[corner].z[lane] = ball.z();
    }
  }
  settle(model, image, depths);
  std::array<int, width> upright{};
  std::array<int, width> mirrored{};
  count_near(model, depths, image, {near_, scene_.camera.principal_px, balls_, required}, upright, mirrored);
  for (int lane = 0; lane < used; ++lane) {
    if (depths.open[lane] > 0 ||
        std::max(std::abs(depths.behind1[lane]), std::abs(depths.behind2[lane])) >= deepest_corner)
      continue;
    const auto& balls = triangles_[starts[lane].triangle].balls;
    for (const bool flip : {false, true}) {
      if ((flip ? mirrored : upright)[lane] >= required)
        passed_.push_back({{balls[0], balls[1], balls[2]}, starts[lane].depth_sign, flip});
    }
  }
}

const std::vector<PoseHypothesis>& HypothesisFilter::filter(const std::array<int, 3>& candidates,
                                                            double focal_px, int required) {
  const auto at = [&](int i) -> Eigen::Vector2f {
    return ((scene_.candidates[candidates[i]].uv - scene_.camera.principal_px) / focal_px).cast<float>();
  };
  Image image{at(0), at(1), at(2), 0, 0, 0, static_cast<float>(focal_px)};
  const Eigen::Vector2f e1 = image.at1 - image.at0;
  const Eigen::Vector2f e2 = image.at2 - image.at0;
  image.a = e1.squaredNorm();
  image.b = e2.squaredNorm();
  image.c = e1.dot(e2);
  gather_starts(candidates, image);
  passed_.clear();
  for (std::size_t i = 0; i < starts_.size(); i += width)
    test(starts_.data() + i, static_cast<int>(std::min<std::size_t>(width, starts_.size() - i)), image,
         required);
  return passed_;
}

}  // namespace helicarm::fiducials
