// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/hypothesis.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <math.h>  // lgamma_r is of POSIX

namespace helicarm::fiducials {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double radius_sigmas = 4;
constexpr double match_sigmas = 4.5;         // beyond it a match lowers the odds; loses one in 25,000
constexpr double least_radius_sigma = 0.02;  // relative; limit over bone or metal
constexpr double radius_range = 0.2;         // of ln radius: assumed spread of outliers
constexpr double depth_span = 1.4;           // ln of the ratio of the greatest to the least distance

/// Cauchy weights limit the influence of false matches. Within a third of the gate all count alike, so that
/// the three that gave the pose do not dominate.
void downweight_outliers(std::vector<WeightedCorrespondence>& correspondences, const geometry::View& view,
                         double gate_px) {
  for (auto& s : correspondences)
    s.sigma_px = std::hypot(s.sigma_px, gate_px / 3, (view.project(s.point) - s.uv).norm());
}

struct RadiusEvidence {
  double excess = 0;
  double log_odds = 0;
};

/// Agreement of the radii with the distances, marginalised over the common bias. Imprecise radii do not
/// contribute.
RadiusEvidence radius_evidence(const LabellingProblem& scene, const Hypothesis& h) {
  double weight = 0;
  double first = 0;
  double second = 0;
  double peak = 0;
  for (std::size_t k = 0; k < scene.balls.size(); ++k) {
    if (h.candidate_of_ball[k] < 0) continue;
    const auto& seen = scene.candidates[h.candidate_of_ball[k]];
    const double expected =
        h.fit.view.intrinsics.fy * scene.balls[k].radius_mm / h.fit.view.depth(scene.balls[k].centre);
    const double excess = std::log(seen.radius_px / expected) - std::log1p(scene.radius_bias);
    const double sigma = std::max(seen.radius_sigma_px / seen.radius_px, least_radius_sigma);
    weight += 1 / (sigma * sigma);
    first += excess / (sigma * sigma);
    second += excess * excess / (sigma * sigma);
    peak += std::max(0.0, std::log(radius_range / (sigma * std::sqrt(2 * std::numbers::pi))));
  }
  const double bias_weight = 1 / (scene.radius_bias_sigma * scene.radius_bias_sigma);
  const double chi2 = second - first * first / (weight + bias_weight);
  return {first / weight, std::max(0.0, peak - 0.5 * std::log1p(weight / bias_weight)) - 0.5 * chi2};
}

/// ln n!. std::lgamma writes the global `signgam`, a data race between views.
double log_factorial(double n) {
  int sign = 0;
  return ::lgamma_r(n + 1, &sign);
}

/// Laplace approximation of the evidence. Prior, uniform each: rotation, centroid's image in the field, ln
/// depth over its span, number of visible balls and which of them, mirrored or not.
double log_odds(const LabellingProblem& scene, const std::vector<WeightedCorrespondence>& correspondences,
                const PoseFit& fit) {
  const double n = static_cast<double>(scene.candidates.size());
  const double b = static_cast<double>(scene.balls.size());
  const double m = static_cast<double>(correspondences.size());
  const double log_2pi = std::log(2 * std::numbers::pi);
  const double field_area = std::numbers::pi * scene.field_radius_px * scene.field_radius_px;
  double odds = -0.5 * fit.chi2;
  for (const auto& s : correspondences) odds += std::log(field_area / (s.sigma_px * s.sigma_px)) - log_2pi;
  odds += log_factorial(n - m) - log_factorial(n);  // which candidates, in order
  odds += log_factorial(m) + log_factorial(b - m) - log_factorial(b) - std::log(b + 1);  // which balls
  const double z = fit.view.camera_from_world.translation.z();
  const double per_mm = scene.camera.focal_px / z;
  odds += std::log(per_mm * per_mm / field_area / (z * depth_span));
  odds -= std::log(8 * std::numbers::pi * std::numbers::pi) + std::numbers::ln2;
  odds -= std::log(scene.camera.focal_sigma) + 2 * std::log(scene.camera.principal_sigma_px);
  return odds + fit.log_volume + 3 * log_2pi;
}

/// Pairs balls and candidates one to one by increasing cost; pairs of infinite cost or outside the gate are
/// excluded.
template <class Cost>
std::vector<int> assign(const LabellingProblem& scene, const geometry::View& view, double gate_px,
                        const Cost& cost_of) {
  struct Pair {
    double cost;
    int ball;
    int candidate;
  };
  // By column: those within the gate lie side by side.
  std::vector<std::pair<double, std::size_t>> columns;
  columns.reserve(scene.candidates.size());
  for (std::size_t i = 0; i < scene.candidates.size(); ++i)
    columns.emplace_back(scene.candidates[i].uv.x(), i);
  std::sort(columns.begin(), columns.end());
  std::vector<Pair> pairs;
  pairs.reserve(scene.balls.size() + scene.candidates.size());
  for (std::size_t k = 0; k < scene.balls.size(); ++k) {
    const double depth = view.depth(scene.balls[k].centre);
    if (depth <= 0) continue;
    const Eigen::Vector2d uv = view.project(scene.balls[k].centre);
    auto near = std::lower_bound(columns.begin(), columns.end(), std::pair(uv.x() - gate_px, std::size_t{0}));
    for (; near != columns.end() && near->first < uv.x() + gate_px; ++near) {
      const std::size_t i = near->second;
      const auto& candidate = scene.candidates[i];
      const Eigen::Vector2d off = candidate.uv - uv;
      if (!(off.squaredNorm() < gate_px * gate_px)) continue;
      const double cost = cost_of(k, i, off);
      if (cost < infinity &&
          scale_by_radius(scene, candidate, scene.balls[k], radius_sigmas).holds(depth / view.intrinsics.fy))
        pairs.push_back({cost, static_cast<int>(k), static_cast<int>(i)});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& p, const Pair& q) { return p.cost < q.cost; });
  std::vector<int> candidate_of_ball(scene.balls.size(), -1);
  std::vector<bool> taken(scene.candidates.size(), false);
  for (const auto& pair : pairs) {
    if (candidate_of_ball[pair.ball] >= 0 || taken[pair.candidate]) continue;
    candidate_of_ball[pair.ball] = pair.candidate;
    taken[pair.candidate] = true;
  }
  return candidate_of_ball;
}

/// Matches within the candidate's noise and, for balls that were not fitted, the fit's prediction.
std::vector<int> match_within_noise(const LabellingProblem& scene, const Hypothesis& h) {
  std::vector<Eigen::Matrix2d> prediction(scene.balls.size(), Eigen::Matrix2d::Zero());
  for (std::size_t k = 0; k < scene.balls.size(); ++k)
    if (h.candidate_of_ball[k] < 0) prediction[k] = prediction_covariance(h.fit, scene.balls[k].centre);
  return assign(scene, h.fit.view, rough_gate_px(scene),
                [&](std::size_t k, std::size_t i, const Eigen::Vector2d& off) {
                  const double sigma = match_sigma_px(scene, h.fit.view, k, i);
                  const double cost =
                      off.dot((sigma * sigma * Eigen::Matrix2d::Identity() + prediction[k]).inverse() * off);
                  return cost < match_sigmas * match_sigmas ? cost : infinity;
                });
}

/// Squared studentised residual of a ball: its distance from the others' prediction, in sigmas.
double studentised2(const LabellingProblem& scene, const Hypothesis& h, std::size_t ball) {
  const auto& seen = scene.candidates[h.candidate_of_ball[ball]];
  const Eigen::Vector3d& centre = scene.balls[ball].centre;
  const Eigen::Vector2d off = seen.uv - h.fit.view.project(centre);
  const double sigma = match_sigma_px(scene, h.fit.view, ball, std::size_t(h.candidate_of_ball[ball]));
  const double noise = sigma * sigma;
  constexpr double unchecked = 1e-3;  // finite for a ball that alone determines a parameter
  const Eigen::Matrix2d spread =
      (1 + unchecked) * noise * Eigen::Matrix2d::Identity() - prediction_covariance(h.fit, centre);
  const double off2 = off.dot(spread.inverse() * off);
  return std::isfinite(off2) ? off2 : infinity;
}

/// The balls farther than `sigmas` from the others' prediction, the farthest first.
std::vector<int> beyond(const LabellingProblem& scene, const Hypothesis& h, double sigmas) {
  std::vector<std::pair<double, int>> off2;
  for (std::size_t k = 0; k < scene.balls.size(); ++k)
    if (h.candidate_of_ball[k] >= 0) off2.push_back({studentised2(scene, h, k), static_cast<int>(k)});
  std::sort(off2.rbegin(), off2.rend());
  std::vector<int> balls;
  for (const auto& [distance2, ball] : off2)
    if (distance2 > sigmas * sigmas) balls.push_back(ball);
  return balls;
}

}  // namespace

bool ExpectedView::allows(const geometry::View& other) const {
  const Eigen::AngleAxisd turned(other.camera_from_world.rotation *
                                 view.camera_from_world.rotation.transpose());
  return (other.intrinsics.fx < 0) == (view.intrinsics.fx < 0) &&
         std::abs(turned.angle()) <= within_deg * EIGEN_PI / 180;
}

double match_sigma_px(const LabellingProblem& scene, const geometry::View& view, std::size_t ball,
                      std::size_t candidate) {
  const double own = scene.candidates[candidate].sigma_px;
  const double of_ball = scene.balls[ball].sigma_mm;
  if (of_ball == 0) return own;
  return std::hypot(own, of_ball * view.intrinsics.fy / view.camera_from_world.translation.z());
}

std::vector<WeightedCorrespondence> correspondences_of(const LabellingProblem& scene,
                                                       const std::vector<int>& candidate_of_ball,
                                                       const geometry::View& view) {
  std::vector<WeightedCorrespondence> correspondences;
  for (std::size_t k = 0; k < scene.balls.size(); ++k) {
    if (candidate_of_ball[k] < 0) continue;
    const auto& seen = scene.candidates[candidate_of_ball[k]];
    correspondences.push_back(
        {scene.balls[k].centre, seen.uv, match_sigma_px(scene, view, k, std::size_t(candidate_of_ball[k]))});
  }
  return correspondences;
}

Scale scale_by_radius(const LabellingProblem& scene, const BallCandidate& candidate, const ModelBall& ball,
                      double sigmas) {
  const double radius = candidate.radius_px / (1 + scene.radius_bias);
  const double spread = sigmas * std::hypot(candidate.radius_sigma_px, radius * scene.radius_bias_sigma);
  return {ball.radius_mm / (radius + spread),
          radius > spread ? ball.radius_mm / (radius - spread) : infinity};
}

std::vector<int> match(const LabellingProblem& scene, const geometry::View& view, double gate_px) {
  return assign(scene, view, gate_px, [&](std::size_t k, std::size_t i, const Eigen::Vector2d& off) {
    const double sigma = match_sigma_px(scene, view, k, i);
    return off.squaredNorm() / (sigma * sigma);
  });
}

Hypothesis match_and_fit(const LabellingProblem& scene, const geometry::View& rough, int least) {
  Hypothesis h;
  h.fit.view = rough;
  h.log_odds = -infinity;
  constexpr int narrowing = 4;
  constexpr int most_iterations = 10;
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    const bool narrow = iteration >= narrowing;
    const double gate_px = rough_gate_px(scene) / (1 + iteration);
    auto matches = narrow ? match_within_noise(scene, h) : match(scene, h.fit.view, gate_px);
    if (iteration > narrowing && matches == h.candidate_of_ball) break;
    h.candidate_of_ball = std::move(matches);
    auto correspondences = correspondences_of(scene, h.candidate_of_ball, h.fit.view);
    h.matched = static_cast<int>(correspondences.size());
    if (h.matched < least) return h;
    if (!narrow) downweight_outliers(correspondences, h.fit.view, gate_px);
    h.fit = fit_pose(h.fit.view, correspondences, scene.camera, narrow ? fit_steps : 5);
  }
  while (h.fit.chi2 > match_sigmas * match_sigmas) {  // an upper limit of what one ball's removal gains
    const auto off = beyond(scene, h, match_sigmas);
    if (off.empty()) break;
    h = without(scene, std::move(h), off.front());
  }
  evaluate_odds(scene, h);
  if (h.matched < least) h.log_odds = -infinity;
  return h;
}

void evaluate_odds(const LabellingProblem& scene, Hypothesis& h) {
  const auto correspondences = correspondences_of(scene, h.candidate_of_ball, h.fit.view);
  h.matched = static_cast<int>(correspondences.size());
  h.residual2_px2 = 0;
  for (const auto& s : correspondences) h.residual2_px2 += (h.fit.view.project(s.point) - s.uv).squaredNorm();
  const auto radii = radius_evidence(scene, h);
  h.radius_excess = radii.excess;
  h.log_odds = log_odds(scene, correspondences, h.fit) + radii.log_odds;
}

std::vector<int> outlying(const LabellingProblem& scene, const Hypothesis& h) {
  return beyond(scene, h, 3.3);
}

Hypothesis without(const LabellingProblem& scene, Hypothesis h, int ball) {
  h.candidate_of_ball[ball] = -1;
  h.fit = fit_pose(h.fit.view, correspondences_of(scene, h.candidate_of_ball, h.fit.view), scene.camera,
                   fit_steps);
  return h;
}

std::vector<Hypothesis> with_pair(const LabellingProblem& scene, const Hypothesis& h, int ball,
                                  int candidate) {
  Hypothesis all = h;
  for (int& assigned : all.candidate_of_ball)
    if (assigned == candidate) assigned = -1;
  all.candidate_of_ball[ball] = candidate;
  all.fit = fit_pose(h.fit.view, correspondences_of(scene, all.candidate_of_ball, h.fit.view), scene.camera,
                     fit_steps);
  std::vector<Hypothesis> rivals{all};
  for (const int other : outlying(scene, all)) {
    if (other == ball) continue;
    Hypothesis rival = without(scene, all, other);
    rivals.push_back(rival);
    for (auto off = outlying(scene, rival); !off.empty() && off.front() != ball;
         off = outlying(scene, rival)) {
      rival = without(scene, std::move(rival), off.front());
      rivals.push_back(rival);
    }
  }
  for (auto& rival : rivals) evaluate_odds(scene, rival);
  return rivals;
}

}  // namespace helicarm::fiducials
