// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_maps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <ranges>

#include "helicarm/calibration/c_arm_position.h"
#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::calibration {
namespace {

using Eigen::Index;
using Eigen::MatrixX2d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t most_maps = 60;
constexpr std::size_t least_for_share = 4;  // fewer maps do not tell the share of what is new in each
// What is known before any map: an intensifier of 1024 pixels deforms by some tenths of a pixel over the
// positions, mostly in low degrees. It counts as this many maps.
constexpr double usual_weight = 2;
constexpr std::array usual_px{0.05, 0.12, 0.12, 0.12, 0.04, 0.03};  // of a polynomial, by degree
constexpr double usual_rest_px = 0.03, usual_width_px = 1024, usual_repeat_share = 0.03;

std::vector<std::optional<Eigen::Vector3d>> directions_of(std::span<const HistoryEntry> maps) {
  std::vector<std::optional<Eigen::Vector3d>> directions;
  for (const HistoryEntry& map : maps)
    directions.push_back(c_arm_direction(map.primary_deg, map.secondary_deg));
  return directions;
}

/// Kriging about the mean of the maps (Cressie 1993, 3.4.5): weights of sum 1, and the prediction's variance
/// over the process's. The best estimate of the mean would extrapolate from positions that are close
/// together.
struct Prediction {
  VectorXd weights;
  double variance = 0;
};

/// `left_out`: of the maps, does not count.
Prediction predicted(const std::vector<std::optional<Eigen::Vector3d>>& at, double repeat_share,
                     const std::optional<Eigen::Vector3d>& wanted, std::size_t left_out) {
  std::vector<Index> used;
  for (std::size_t i = 0; i < at.size(); ++i)
    if (i != left_out) used.push_back(Index(i));
  const Index n = std::ssize(used);
  if (n == 0) return {VectorXd::Zero(Index(at.size())), 1};
  MatrixXd among(n, n);
  VectorXd with_wanted(n);
  const auto alike = [&](const auto& a, const auto& b) {
    return (1 - repeat_share) * position_correlation(a, b);
  };
  for (Index i = 0; i < n; ++i) {
    const auto& place = at[std::size_t(used[std::size_t(i)])];
    for (Index j = 0; j < n; ++j)
      among(i, j) = i == j ? 1 : alike(place, at[std::size_t(used[std::size_t(j)])]);
    with_wanted[i] = alike(place, wanted);
  }
  VectorXd weights = geometry::solve_spd(among, with_wanted).solution;
  weights.array() += (1 - weights.sum()) / double(n);
  Prediction prediction{
      VectorXd::Zero(Index(at.size())),
      std::max(repeat_share, 1 - 2 * weights.dot(with_wanted) + weights.dot(among * weights))};
  for (Index i = 0; i < n; ++i) prediction.weights[used[std::size_t(i)]] = weights[i];
  return prediction;
}

constexpr std::size_t no_entry = std::numeric_limits<std::size_t>::max();

MatrixX2d weighted(const std::vector<MatrixX2d>& values, const VectorXd& weights) {
  MatrixX2d sum = MatrixX2d::Zero(values.front().rows(), 2);
  for (std::size_t i = 0; i < values.size(); ++i)
    if (weights[Index(i)] != 0) sum += weights[Index(i)] * values[i];
  return sum;
}

struct Residuals {
  std::vector<MatrixX2d> off;    ///< of each map from its prediction by the others
  std::vector<double> variance;  ///< relative, of each prediction
};

Residuals held_out(const std::vector<MatrixX2d>& values,
                   const std::vector<std::optional<Eigen::Vector3d>>& at, double repeat_share) {
  Residuals residuals;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Prediction by_others = predicted(at, repeat_share, at[i], i);
    residuals.off.push_back(values[i] - weighted(values, by_others.weights));
    residuals.variance.push_back(by_others.variance);
  }
  return residuals;
}

double mean_square(const MatrixX2d& off) { return off.squaredNorm() / double(off.size()); }

rectification::MapVariation variation_of(const Residuals& residuals, const rectification::MapField& field,
                                         double width) {
  const MatrixXd polynomials = field.polynomials();
  const std::vector<int> degrees = rectification::polynomial_degrees();
  const double scale = std::pow(width / usual_width_px, 2);
  rectification::MapVariation sums;
  std::array<double, rectification::field_order + 1> counts{};
  for (std::size_t d = 0; d < counts.size(); ++d) {
    counts[d] = usual_weight * 2 * double(d + 1);
    sums.variance_px2[d] = counts[d] * usual_px[d] * usual_px[d] * scale;
  }
  sums.rest_px2 = usual_weight * usual_rest_px * usual_rest_px * scale;
  for (std::size_t i = 0; i < residuals.off.size(); ++i) {
    const MatrixX2d& off = residuals.off[i];
    const MatrixX2d shares = polynomials.transpose() * off / double(off.rows());
    for (std::size_t k = 0; k < degrees.size(); ++k) {
      const auto d = std::size_t(degrees[k]);
      sums.variance_px2[d] += shares.row(Index(k)).squaredNorm() / residuals.variance[i];
      counts[d] += 2;
    }
    sums.rest_px2 += mean_square(off - polynomials * shares) / residuals.variance[i];
  }
  for (std::size_t d = 0; d < counts.size(); ++d) sums.variance_px2[d] /= counts[d];
  sums.rest_px2 /= usual_weight + double(residuals.off.size());
  return sums;
}

/// Mean square over the field of an error with this variation.
double expected_square(const rectification::MapVariation& variation) {
  double sum = variation.rest_px2;
  for (std::size_t d = 0; d < variation.variance_px2.size(); ++d)
    sum += double(d + 1) * variation.variance_px2[d];
  return sum;
}

/// Of one image size and one field of the intensifier.
bool are_alike(const rectification::DistortionMap& a, const rectification::DistortionMap& b) {
  constexpr double tolerance = 0.02;
  const double pixel_a = a.rectified_pixel_mm.value_or(0), pixel_b = b.rectified_pixel_mm.value_or(0);
  return a.width == b.width && a.height == b.height && std::abs(pixel_a - pixel_b) <= tolerance * pixel_b;
}

/// The latest few of each position, so that daily images of two positions do not push out the others.
void keep_latest(std::vector<HistoryEntry>& entries) {
  constexpr double alike = 0.99;  // correlation: within 6 degrees
  constexpr int most_alike = 4;
  const auto at = directions_of(entries);
  std::vector<HistoryEntry> kept;
  std::vector<std::size_t> chosen;
  for (std::size_t i = entries.size(); i-- > 0 && chosen.size() < most_maps;)
    if (std::ranges::count_if(
            chosen, [&](std::size_t k) { return position_correlation(at[i], at[k]) > alike; }) < most_alike)
      chosen.push_back(i);
  for (const std::size_t i : chosen | std::views::reverse) kept.push_back(std::move(entries[i]));
  entries = std::move(kept);
}

std::vector<rectification::DistortionMap> maps_of(const CArmMaps& model) {
  std::vector<rectification::DistortionMap> maps;
  for (const HistoryEntry& entry : model.entries) maps.push_back(*entry.map);
  return maps;
}

}  // namespace

void keep_map(HistoryEntry& entry, const rectification::Rectification& rectification) {
  using rectification::MapSource;
  const rectification::DistortionMap& map = rectification.map;
  if (rectification.source != MapSource::plate && rectification.source != MapSource::plate_image) return;
  const Eigen::Vector2d middle = 0.5 * (map.hull_low + map.hull_high), half = map.hull_high - middle;
  entry.field_radius_px = 0;
  for (const detection::Dot& dot : rectification.plate_dots)
    if (const auto at = map.rectified_from_raw(dot.centre_px))
      entry.field_radius_px = std::max(entry.field_radius_px, (*at - middle).norm());
  // Of a plate image only the box of its dots is known: nearly square, it is that of a round field.
  constexpr double round = 0.95;
  if (entry.field_radius_px == 0)
    entry.field_radius_px = half.minCoeff() > round * half.maxCoeff() ? half.maxCoeff() : half.norm();
  entry.map = rectification::without_covariance(map);
}

std::optional<CArmMaps> c_arm_maps(std::span<const HistoryEntry> entries) {
  CArmMaps model;
  for (const HistoryEntry& entry : entries)
    if (entry.map) model.entries.push_back(entry);
  if (model.entries.empty()) return {};
  const rectification::DistortionMap latest = *model.entries.back().map;
  std::erase_if(model.entries, [&](const HistoryEntry& entry) { return !are_alike(*entry.map, latest); });
  keep_latest(model.entries);
  double radius_px = 0;
  for (const HistoryEntry& entry : model.entries) radius_px = std::max(radius_px, entry.field_radius_px);
  const auto maps = maps_of(model);
  model.field = rectification::field_of(maps, radius_px);
  std::vector<MatrixX2d>& values = model.displacements;
  for (const auto& map : maps) values.push_back(rectification::displacements(map, model.field));
  const auto at = directions_of(model.entries);
  model.repeat_share = usual_repeat_share;
  Residuals best;
  if (maps.size() > 1) best = held_out(values, at, model.repeat_share);
  if (maps.size() >= least_for_share) {
    double least = std::numeric_limits<double>::infinity();
    for (const double share : {0.01, 0.03, 0.1, 0.3, 1.0}) {
      Residuals residuals = held_out(values, at, share);
      double sum = 0;
      for (const MatrixX2d& off : residuals.off) sum += off.squaredNorm();
      if (sum < least) least = sum, model.repeat_share = share, best = std::move(residuals);
    }
  }
  model.variation = variation_of(best, model.field, latest.width);
  const Residuals one_map = held_out(values, std::vector<std::optional<Eigen::Vector3d>>(at.size()), 1);
  for (std::size_t i = 0; i < best.off.size(); ++i)
    model.checks.push_back({i, std::sqrt(mean_square(best.off[i])), std::sqrt(mean_square(one_map.off[i])),
                            std::sqrt(best.variance[i] * expected_square(model.variation))});
  return model;
}

std::optional<MapCheck> check_map(const CArmMaps& model, const HistoryEntry& acquired) {
  if (!acquired.map || !are_alike(*acquired.map, *model.entries.back().map)) return {};
  const MatrixX2d own = rectification::displacements(*acquired.map, model.field);
  const Prediction there = predicted(directions_of(model.entries), model.repeat_share,
                                     c_arm_direction(acquired.primary_deg, acquired.secondary_deg), no_entry);
  const VectorXd mean = VectorXd::Constant(there.weights.size(), 1 / double(there.weights.size()));
  return MapCheck{0, std::sqrt(mean_square(own - weighted(model.displacements, there.weights))),
                  std::sqrt(mean_square(own - weighted(model.displacements, mean))),
                  std::sqrt(there.variance * expected_square(model.variation))};
}

bool is_far_from_maps(const CArmMaps& model, std::optional<double> primary_deg,
                      std::optional<double> secondary_deg) {
  constexpr double little = 0.75;  // of the variance
  return predicted(directions_of(model.entries), model.repeat_share,
                   c_arm_direction(primary_deg, secondary_deg), no_entry)
             .variance > little;
}

rectification::DistortionMap map_at(const CArmMaps& model, std::optional<double> primary_deg,
                                    std::optional<double> secondary_deg) {
  const Prediction there = predicted(directions_of(model.entries), model.repeat_share,
                                     c_arm_direction(primary_deg, secondary_deg), no_entry);
  rectification::DistortionMap like = *model.entries.back().map;
  double pixel_mm = 0;
  for (std::size_t i = 0; i < model.entries.size(); ++i) {
    const rectification::DistortionMap& map = *model.entries[i].map;
    like.hull_low = like.hull_low.cwiseMin(map.hull_low);
    like.hull_high = like.hull_high.cwiseMax(map.hull_high);
    pixel_mm +=
        there.weights[Index(i)] * map.rectified_pixel_mm.value_or(like.rectified_pixel_mm.value_or(0));
  }
  if (like.rectified_pixel_mm) like.rectified_pixel_mm = pixel_mm;
  like.residual_rms_px = like.residual_max_px = 0;
  like.held_out_rms_px = std::sqrt(2 * there.variance * expected_square(model.variation));
  return rectification::map_through(model.field, weighted(model.displacements, there.weights),
                                    model.variation, there.variance, like);
}

}  // namespace helicarm::calibration
