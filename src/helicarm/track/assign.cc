// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/assign.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/small_matrix.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/contrast_model.h"

namespace helicarm::track {
namespace {

constexpr double log_density = -6.9;     // of discs that are no marker's: one in 1000 px^2
constexpr double detected = 0.95;        // chance that a marker is found in a view
constexpr double least_sigma_px = 0.15;  // texture behind a marker displaces its fit
constexpr double sigma_factor = 2;
constexpr double vaguest_disc = 0.15;     // standard deviation of a disc over its radius: texture beyond
constexpr double contrast_spread = 0.35;  // of a contrast's logarithm, between frames
constexpr double gate = 25;               // chi2 of one disc
constexpr std::size_t most_per_view = 6, beam = 100;
constexpr double hopeless = 30;  // beyond what later markers could win back

/// Discs for one marker, one entry a view, and the negative logarithm of their likelihood.
struct Hypothesis {
  std::vector<int> discs;
  double cost;
};

struct Option {
  int disc;
  double cost;  // alone
};

double appearance_cost(const MarkerImage& image, const ExpectedImage& expected) {
  const double size = std::log(image.radius_px / expected.radius_px) / 0.3;
  double cost = 0.5 * size * size;
  if (expected.contrast.is_known) {
    const double spread = std::hypot(expected.contrast.spread, contrast_sigma(image));
    const double off = std::log(std::abs(image.contrast) / expected.contrast.at(image.background)) / spread;
    cost += 0.5 * off * off + std::log(spread / contrast_spread);
  }
  return cost;
}

double variance_of(const MarkerImage& image, const ExpectedImage& expected) {
  const double sigma = sigma_factor * image.sigma_px;
  return sigma * sigma + least_sigma_px * least_sigma_px + expected.shift_sigma * expected.shift_sigma;
}

std::vector<Hypothesis> hypotheses_of(std::span<const geometry::View> views, const ExpectedMarker& marker,
                                      std::span<const std::vector<Candidate>> discs) {
  const std::size_t n = views.size();
  std::vector<Eigen::Matrix<double, 2, 3>> slopes(n);
  std::vector<Eigen::Vector2d> places(n);
  std::vector<std::vector<Option>> options(n);
  for (std::size_t k = 0; k < n; ++k) {
    options[k] = {{not_seen, 0}};
    if (!(views[k].depth(marker.place) > 1)) continue;
    slopes[k] = geometry::projection_jacobian(views[k], marker.place);
    places[k] = views[k].project(marker.place) + marker.images[k].shift_px;
    const Eigen::Matrix2d spread = slopes[k] * marker.covariance * slopes[k].transpose();
    for (std::size_t c = 0; c < discs[k].size(); ++c) {
      const Candidate& disc = discs[k][c];
      if (!has_marker_size(disc.image, marker.images[k].radius_px) ||
          disc.image.sigma_px > vaguest_disc * marker.images[k].radius_px)
        continue;
      Eigen::Matrix2d covariance = spread;
      covariance.diagonal().array() += variance_of(disc.image, marker.images[k]);
      const Eigen::Vector2d off = disc.uv - places[k];
      const double chi2 = geometry::squared_distance(off, covariance);
      const double appearance = appearance_cost(disc.image, marker.images[k]);
      if (chi2 < gate && appearance < 6) options[k].push_back({int(c), 0.5 * chi2 + appearance});
    }
    std::sort(options[k].begin() + 1, options[k].end(),
              [](const Option& a, const Option& b) { return a.cost < b.cost; });
    if (options[k].size() > most_per_view + 1) options[k].resize(most_per_view + 1);
  }
  std::vector<Hypothesis> made;
  std::vector<std::size_t> at(n, 0);
  for (bool more = true; more;) {
    Hypothesis hypothesis{std::vector<int>(n, not_seen), 0};
    std::vector<std::size_t> seen;
    for (std::size_t k = 0; k < n; ++k) {
      hypothesis.discs[k] = options[k][at[k]].disc;
      if (hypothesis.discs[k] == not_seen)
        hypothesis.cost -= std::log(1 - detected);
      else
        seen.push_back(k);
    }
    const auto m = Eigen::Index(seen.size());
    if (m > 0) {
      Eigen::VectorXd off(2 * m);
      Eigen::MatrixXd slope(2 * m, 3);
      Eigen::VectorXd noise(2 * m);
      for (Eigen::Index i = 0; i < m; ++i) {
        const std::size_t k = seen[std::size_t(i)];
        const Candidate& disc = discs[k][std::size_t(hypothesis.discs[k])];
        off.segment<2>(2 * i) = disc.uv - places[k];
        slope.middleRows<2>(2 * i) = slopes[k];
        noise.segment<2>(2 * i).setConstant(variance_of(disc.image, marker.images[k]));
        hypothesis.cost += log_density - std::log(detected) + appearance_cost(disc.image, marker.images[k]);
      }
      Eigen::MatrixXd covariance = slope * marker.covariance * slope.transpose();
      covariance.diagonal() += noise;
      const auto white = geometry::whitening(covariance);
      hypothesis.cost += white ? 0.5 * (*white * off).squaredNorm() - white->diagonal().array().log().sum() +
                                     double(m) * std::log(2 * std::numbers::pi)
                               : std::numeric_limits<double>::infinity();
    }
    made.push_back(std::move(hypothesis));
    more = false;
    for (std::size_t k = 0; k < n && !more; ++k) {
      more = ++at[k] < options[k].size();
      if (!more) at[k] = 0;
    }
  }
  std::ranges::stable_sort(made, std::less<>(), &Hypothesis::cost);
  constexpr std::size_t most = 16;
  // That nothing is seen remains possible.
  const auto hidden = std::ranges::find_if(made, [](const Hypothesis& each) {
    return std::ranges::all_of(each.discs, [](int disc) { return disc == not_seen; });
  });
  const Hypothesis nothing = *hidden;
  made.erase(hidden);
  while (!made.empty() && (made.size() >= most || made.back().cost > made.front().cost + hopeless))
    made.pop_back();
  made.push_back(nothing);
  std::ranges::stable_sort(made, std::less<>(), &Hypothesis::cost);
  return made;
}

/// A partial assignment.
struct Branch {
  double cost = 0;
  std::vector<std::size_t> chosen;
  std::vector<std::vector<char>> taken;
};

}  // namespace

std::vector<std::vector<int>> assign(std::span<const geometry::View> views,
                                     std::span<const ExpectedMarker> markers,
                                     std::span<const std::vector<Candidate>> discs) {
  std::vector<std::vector<Hypothesis>> hypotheses;
  for (const ExpectedMarker& marker : markers) hypotheses.push_back(hypotheses_of(views, marker, discs));
  std::vector<std::size_t> order(markers.size());
  std::iota(order.begin(), order.end(), 0);
  const auto margin = [&](std::size_t i) {
    return hypotheses[i].size() > 1 ? hypotheses[i][1].cost - hypotheses[i][0].cost : 1e9;
  };
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return margin(a) > margin(b); });
  Branch root;
  for (const auto& of_view : discs) root.taken.emplace_back(of_view.size(), 0);
  std::vector<Branch> branches{std::move(root)};
  for (const std::size_t marker : order) {
    struct Child {
      double cost;
      std::size_t branch, hypothesis;
    };
    std::vector<Child> children;
    for (std::size_t b = 0; b < branches.size(); ++b)
      for (std::size_t h = 0; h < hypotheses[marker].size(); ++h) {
        const Hypothesis& hypothesis = hypotheses[marker][h];
        bool is_free = true;
        for (std::size_t k = 0; k < views.size() && is_free; ++k)
          is_free =
              hypothesis.discs[k] == not_seen || !branches[b].taken[k][std::size_t(hypothesis.discs[k])];
        if (is_free) children.push_back({branches[b].cost + hypothesis.cost, b, h});
      }
    std::ranges::stable_sort(children, std::less<>(), &Child::cost);
    while (children.size() > 1 &&
           (children.size() > beam || children.back().cost > children.front().cost + hopeless))
      children.pop_back();
    std::vector<Branch> next;
    for (const Child& child : children) {
      Branch& grown = next.emplace_back(branches[child.branch]);
      grown.cost = child.cost;
      grown.chosen.push_back(child.hypothesis);
      const Hypothesis& hypothesis = hypotheses[marker][child.hypothesis];
      for (std::size_t k = 0; k < views.size(); ++k)
        if (hypothesis.discs[k] != not_seen) grown.taken[k][std::size_t(hypothesis.discs[k])] = 1;
    }
    branches = std::move(next);
  }
  std::vector<std::vector<int>> assigned(markers.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    assigned[order[i]] = hypotheses[order[i]][branches.front().chosen[i]].discs;
  return assigned;
}

}  // namespace helicarm::track
