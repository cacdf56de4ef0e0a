// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/pair_match.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <tuple>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector2d;

constexpr double one_degree = std::numbers::pi / 180;
constexpr double angle_step = 1.5 * one_degree;
constexpr double largest_roll = 39 * one_degree;
constexpr double scale_step = 0.015;
constexpr double largest_log_scale = 0.15;
constexpr double usual_bin_px = 5;         // this and the tolerances: at 1024 px a side
constexpr double largest_parallax = 0.38;  // of the phantom's width: sin(40 degrees) times its half depth
constexpr double tolerances_px[] = {7, 5, 4};
constexpr std::size_t most_refined = 600;

Vector2d along(double angle) { return {std::cos(angle), std::sin(angle)}; }
Vector2d across(double angle) { return {-std::sin(angle), std::cos(angle)}; }

double width_of(const std::vector<PlainCandidate>& candidates) {
  Vector2d low = candidates[0].uv, high = low;
  for (const PlainCandidate& c : candidates) {
    low = low.cwiseMin(c.uv);
    high = high.cwiseMax(c.uv);
  }
  return (high - low).norm();
}

Vector2d mean_of(const std::vector<PlainCandidate>& candidates) {
  Vector2d sum = Vector2d::Zero();
  for (const PlainCandidate& c : candidates) sum += c.uv;
  return sum / double(candidates.size());
}

struct Vote {
  int count;
  double angle_a, angle_b, scale, offset;
};

/// The most frequent offset of each pair of angles and scale.
std::vector<Vote> votes_of(const std::vector<PlainCandidate>& a, const std::vector<PlainCandidate>& b,
                           double reach, double bin_px) {
  std::vector<Vote> votes;
  std::vector<double> p(a.size()), e(a.size()), q(b.size()), g(b.size());
  const int half = int(reach / bin_px) + 60;
  std::vector<int> bins(std::size_t(2 * half + 1));
  const Vector2d mean_a = mean_of(a), mean_b = mean_of(b);
  for (double angle_a = 0; angle_a < std::numbers::pi - 1e-9; angle_a += angle_step) {
    for (std::size_t i = 0; i < a.size(); ++i) {
      p[i] = along(angle_a).dot(a[i].uv - mean_a);
      e[i] = across(angle_a).dot(a[i].uv - mean_a);
    }
    for (double roll = -largest_roll; roll < largest_roll + 1e-9; roll += angle_step) {
      const double angle_b = angle_a + roll;
      for (std::size_t k = 0; k < b.size(); ++k) {
        q[k] = along(angle_b).dot(b[k].uv - mean_b);
        g[k] = across(angle_b).dot(b[k].uv - mean_b);
      }
      for (double log_scale = -largest_log_scale; log_scale <= largest_log_scale; log_scale += scale_step) {
        const double scale = std::exp(log_scale);
        std::ranges::fill(bins, 0);
        for (std::size_t i = 0; i < a.size(); ++i)
          for (std::size_t k = 0; k < b.size(); ++k) {
            if (a[i].kind != b[k].kind || std::abs(g[k] - scale * e[i]) > reach) continue;
            const int bin = int(std::lround((q[k] - scale * p[i]) / bin_px)) + half;
            if (bin >= 0 && bin <= 2 * half) ++bins[std::size_t(bin)];
          }
        int best = 0, at = 0;
        for (std::size_t bin = 0; bin + 1 < bins.size(); ++bin)
          if (bins[bin] + bins[bin + 1] > best) best = bins[bin] + bins[bin + 1], at = int(bin);
        votes.push_back({best, angle_a, angle_b, scale, (at + 0.5 - half) * bin_px});
      }
    }
  }
  return votes;
}

/// Coordinates along and across the axis.
struct Turned {
  Eigen::VectorXd along, across;
};

Turned turned(const std::vector<PlainCandidate>& candidates, double angle) {
  Turned t{Eigen::VectorXd(Eigen::Index(candidates.size())),
           Eigen::VectorXd(Eigen::Index(candidates.size()))};
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    t.along[Eigen::Index(i)] = along(angle).dot(candidates[i].uv);
    t.across[Eigen::Index(i)] = across(angle).dot(candidates[i].uv);
  }
  return t;
}

/// g = c0 + c1 e + c2 p over the matches: what the mean plane of the phantom does across the axis.
Eigen::Vector3d plane_of(const Turned& a, const Turned& b, const std::vector<std::pair<int, int>>& matches,
                         double scale, double limit_scale) {
  Eigen::Matrix3d normal = Eigen::Vector3d(1e-9, 20, 20).asDiagonal();  // towards (0, scale, 0)
  normal *= 1e3 * limit_scale * limit_scale;
  Eigen::Vector3d right = normal * Eigen::Vector3d(0, scale, 0);
  for (const auto& [i, k] : matches) {
    const Eigen::Vector3d row(1, a.across[i], a.along[i]);
    normal += row * row.transpose();
    right += row * b.across[k];
  }
  return geometry::solve_spd(normal, right).solution;
}

void assign_pairs(PairHypothesis& h, const std::vector<PlainCandidate>& a,
                  const std::vector<PlainCandidate>& b, const Eigen::Vector3d& plane, double tolerance_px,
                  double reach) {
  const Turned in_a = turned(a, h.angle_a), in_b = turned(b, h.angle_b);
  std::vector<std::tuple<double, int, int>> pairs;
  for (int i = 0; i < int(a.size()); ++i)
    for (int k = 0; k < int(b.size()); ++k) {
      const double off = (in_b.along[k] - h.scale * in_a.along[i] - h.offset) / tolerance_px;
      const double parallax = in_b.across[k] - plane.dot(Eigen::Vector3d(1, in_a.across[i], in_a.along[i]));
      if (a[std::size_t(i)].kind != b[std::size_t(k)].kind || std::abs(off) > 1 || std::abs(parallax) > reach)
        continue;
      pairs.emplace_back(off * off + 2 * std::pow(parallax / reach, 2), i, k);
    }
  std::ranges::sort(pairs);
  std::vector<bool> taken_a(a.size()), taken_b(b.size());
  h.matches.clear();
  for (const auto& [cost, i, k] : pairs) {
    if (taken_a[std::size_t(i)] || taken_b[std::size_t(k)]) continue;
    taken_a[std::size_t(i)] = taken_b[std::size_t(k)] = true;
    h.matches.emplace_back(i, k);
  }
}

/// Affine epipolar geometry of the matches: the direction of least spread of (a, b) (Shapiro 1995).
bool refit(PairHypothesis& h, const std::vector<PlainCandidate>& a, const std::vector<PlainCandidate>& b) {
  if (h.matches.size() < 5) return false;
  Eigen::Vector4d mean = Eigen::Vector4d::Zero();
  Eigen::Matrix4d spread = Eigen::Matrix4d::Zero();
  const auto row = [&](const std::pair<int, int>& m) {
    Eigen::Vector4d r;
    r << a[std::size_t(m.first)].uv, b[std::size_t(m.second)].uv;
    return r;
  };
  for (const auto& m : h.matches) mean += row(m) / double(h.matches.size());
  for (const auto& m : h.matches) spread += (row(m) - mean) * (row(m) - mean).transpose();
  const auto eigen = geometry::symmetric_eigen(Eigen::MatrixXd(spread));
  Eigen::Vector4d n = eigen.vectors.col(0);  // n_a . a - n_b . b = constant
  Vector2d n_a = n.head<2>(), n_b = -n.tail<2>();
  if (n_a.dot(along(h.angle_a)) < 0) n_a = -n_a, n_b = -n_b;
  if (n_a.norm() < 0.2 || n_b.norm() < 0.2 || n_b.dot(along(h.angle_b)) < 0) return false;
  h.angle_a = std::atan2(n_a.y(), n_a.x());
  h.angle_b = std::atan2(n_b.y(), n_b.x());
  h.scale = n_a.norm() / n_b.norm();
  h.offset = (n_b.dot(mean.tail<2>()) - n_a.dot(mean.head<2>())) / n_b.norm();
  h.rms_px = std::sqrt(std::max(0.0, eigen.values[0]) / double(h.matches.size()));
  return std::abs(std::log(h.scale)) < 2 * largest_log_scale;
}

bool refine_pair(PairHypothesis& h, const std::vector<PlainCandidate>& a,
                 const std::vector<PlainCandidate>& b, double reach, double limit_scale) {
  const Vector2d mean_a = mean_of(a), mean_b = mean_of(b);
  Eigen::Vector3d plane(across(h.angle_b).dot(mean_b) - h.scale * across(h.angle_a).dot(mean_a), h.scale, 0);
  for (const double tolerance : tolerances_px) {
    assign_pairs(h, a, b, plane, limit_scale * tolerance, reach);
    if (!refit(h, a, b)) return false;
    plane = plane_of(turned(a, h.angle_a), turned(b, h.angle_b), h.matches, h.scale, limit_scale);
  }
  assign_pairs(h, a, b, plane, limit_scale * tolerances_px[2], reach);
  return refit(h, a, b);
}

}  // namespace

std::vector<PairHypothesis> match_pair(const std::vector<PlainCandidate>& a,
                                       const std::vector<PlainCandidate>& b, std::size_t most,
                                       double limit_scale) {
  if (a.size() < 5 || b.size() < 5) return {};
  const double reach = largest_parallax * std::max(width_of(a), width_of(b));
  std::vector<Vote> votes = votes_of(a, b, reach, limit_scale * usual_bin_px);
  const auto kept = votes.begin() + std::ptrdiff_t(std::min(votes.size(), most_refined));
  std::ranges::partial_sort(votes, kept, std::greater{}, &Vote::count);
  votes.erase(kept, votes.end());
  std::vector<PairHypothesis> found;
  std::set<std::vector<std::pair<int, int>>> known;
  for (const Vote& vote : votes) {
    const Vector2d mean_a = mean_of(a), mean_b = mean_of(b);
    PairHypothesis h{
        vote.angle_a,
        vote.angle_b,
        vote.scale,
        vote.offset + along(vote.angle_b).dot(mean_b) - vote.scale * along(vote.angle_a).dot(mean_a),
        {},
        0};
    if (!refine_pair(h, a, b, reach, limit_scale)) continue;
    std::ranges::sort(h.matches);
    if (known.insert(h.matches).second) found.push_back(std::move(h));
  }
  std::ranges::sort(found, {},
                    [](const PairHypothesis& h) { return std::tuple(-double(h.matches.size()), h.rms_px); });
  if (found.size() > most) found.resize(most);
  return found;
}

}  // namespace helicarm::phantom_calibration
