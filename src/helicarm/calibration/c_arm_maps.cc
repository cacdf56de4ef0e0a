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

constexpr std::size_t least_for_share = 4;  // fewer maps do not tell the share of what is new in each
// What is known before any map: an intensifier of 1024 pixels deforms by some tenths of a pixel over the
// positions, mostly in low degrees. It counts as this many maps.
constexpr double usual_weight = 2;
constexpr std::array usual_px{0.05, 0.12, 0.12, 0.12, 0.04, 0.03};  // of a polynomial, by degree
constexpr double usual_rest_px = 0.03, usual_width_px = 1024, usual_repeat_share = 0.03;

/// Of what depends smoothly on the position: among the maps (diagonal 1), and between them and another
/// position.
struct Alike {
  MatrixXd among;
  VectorXd with_wanted;
};

MatrixXd correlations(std::span<const HistoryEntry> maps) {
  std::vector<std::optional<Eigen::Vector3d>> at;
  for (const HistoryEntry& map : maps) at.push_back(c_arm_direction(map.primary_deg, map.secondary_deg));
  const Index n = std::ssize(at);
  MatrixXd among = MatrixXd::Identity(n, n);
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < i; ++j)
      among(i, j) = among(j, i) = position_correlation(at[std::size_t(i)], at[std::size_t(j)]);
  return among;
}

Alike alike(std::span<const HistoryEntry> maps, const std::optional<Eigen::Vector3d>& wanted) {
  Alike positions{correlations(maps), VectorXd(std::ssize(maps))};
  for (std::size_t i = 0; i < maps.size(); ++i)
    positions.with_wanted[Index(i)] =
        position_correlation(c_arm_direction(maps[i].primary_deg, maps[i].secondary_deg), wanted);
  return positions;
}

/// Of a map and the others.
Alike left_out(const MatrixXd& among, Index i) {
  std::vector<Index> others;
  for (Index k = 0; k < among.rows(); ++k)
    if (k != i) others.push_back(k);
  return {among(others, others), among(others, i)};
}

template <class Value>
std::vector<Value> without(std::vector<Value> values, std::size_t i) {
  values.erase(values.begin() + std::ptrdiff_t(i));
  return values;
}

/// Kriging about the mean of the maps (Cressie 1993, 3.4.5): weights of sum 1, and the prediction's variance
/// over the process's. The best estimate of the mean would extrapolate from positions that are close
/// together.
struct Prediction {
  VectorXd weights;
  double variance = 0;
};

Prediction predicted(const Alike& positions, double repeat_share) {
  if (positions.among.size() == 0) return {{}, 1};
  MatrixXd among = (1 - repeat_share) * positions.among;
  among.diagonal().setOnes();
  const VectorXd with_wanted = (1 - repeat_share) * positions.with_wanted;
  Prediction prediction{geometry::solve_spd(among, with_wanted).solution};
  VectorXd& weights = prediction.weights;
  weights.array() += (1 - weights.sum()) / double(weights.size());
  prediction.variance =
      std::max(repeat_share, 1 - 2 * weights.dot(with_wanted) + weights.dot(among * weights));
  return prediction;
}

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

Residuals held_out(const std::vector<MatrixX2d>& values, const MatrixXd& among, double repeat_share) {
  Residuals residuals;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Prediction by_others = predicted(left_out(among, Index(i)), repeat_share);
    VectorXd weights = VectorXd::Zero(among.rows());
    for (Index k = 0, other = 0; k < weights.size(); ++k)
      if (k != Index(i)) weights[k] = by_others.weights[other++];
    residuals.off.push_back(values[i] - weighted(values, weights));
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

/// Share of what is new in each map, and variation, as the model's maps are off their prediction by the
/// others.
void fit_to_maps(CArmMaps& model) {
  const MatrixXd among = correlations(model.entries);
  model.repeat_share = usual_repeat_share;
  Residuals best;
  if (model.entries.size() > 1) best = held_out(model.displacements, among, model.repeat_share);
  if (model.entries.size() >= least_for_share) {
    double least = std::numeric_limits<double>::infinity();
    for (const double share : {0.01, 0.03, 0.1, 0.3, 1.0}) {
      Residuals residuals = held_out(model.displacements, among, share);
      double sum = 0;
      for (const MatrixX2d& off : residuals.off) sum += off.squaredNorm();
      if (sum < least) least = sum, model.repeat_share = share, best = std::move(residuals);
    }
  }
  model.variation = variation_of(best, model.field, model.entries.back().plate->map.width);
}

MapCheck checked(const CArmMaps& model, const MatrixX2d& own, const HistoryEntry& acquired) {
  const Prediction there =
      predicted(alike(model.entries, c_arm_direction(acquired.primary_deg, acquired.secondary_deg)),
                model.repeat_share);
  const VectorXd mean = VectorXd::Constant(there.weights.size(), 1 / double(there.weights.size()));
  return {std::sqrt(mean_square(own - weighted(model.displacements, there.weights))),
          std::sqrt(mean_square(own - weighted(model.displacements, mean))),
          std::sqrt(there.variance * expected_square(model.variation))};
}

}  // namespace

std::optional<PlateMap> plate_map_of(const rectification::Rectification& rectification) {
  using rectification::MapSource;
  const rectification::DistortionMap& map = rectification.map;
  if (rectification.source != MapSource::plate && rectification.source != MapSource::plate_image) return {};
  const Eigen::Vector2d middle = 0.5 * (map.hull_low + map.hull_high), half = map.hull_high - middle;
  PlateMap plate{rectification::without_covariance(map)};
  for (const detection::Dot& dot : rectification.plate_dots)
    if (const auto at = map.rectified_from_raw(dot.centre_px))
      plate.field_radius_px = std::max(plate.field_radius_px, (*at - middle).norm());
  // Of a plate image only the box of its dots is known: nearly square, it is that of a round field.
  constexpr double round = 0.95;
  if (plate.field_radius_px == 0)
    plate.field_radius_px = half.minCoeff() > round * half.maxCoeff() ? half.maxCoeff() : half.norm();
  return plate;
}

std::optional<CArmMaps> c_arm_maps(std::span<const HistoryEntry> entries) {
  CArmMaps model;
  std::vector<rectification::DistortionMap> maps;
  double radius_px = 0;
  for (const std::size_t i : entries_with_latest_maps(entries)) {
    const PlateMap& plate = *entries[i].plate;
    model.entries.push_back(entries[i]);
    maps.push_back(plate.map);
    radius_px = std::max(radius_px, plate.field_radius_px);
  }
  if (maps.empty()) return {};
  model.field = rectification::field_of(maps, radius_px);
  for (const auto& map : maps) model.displacements.push_back(rectification::displacements(map, model.field));
  fit_to_maps(model);
  return model;
}

std::vector<MapCheck> leave_one_out(const CArmMaps& model) {
  std::vector<MapCheck> checks;
  for (std::size_t i = 0; model.entries.size() > 1 && i < model.entries.size(); ++i) {
    CArmMaps others;
    others.entries = without(model.entries, i);
    others.field = model.field;
    others.displacements = without(model.displacements, i);
    fit_to_maps(others);
    checks.push_back(checked(others, model.displacements[i], model.entries[i]));
  }
  return checks;
}

bool is_of_their_field(const CArmMaps& model, const PlateMap& plate) {
  return are_of_one_field(plate.map, model.entries.back().plate->map);
}

MapCheck check_map(const CArmMaps& model, const HistoryEntry& acquired) {
  return checked(model, rectification::displacements(acquired.plate->map, model.field), acquired);
}

bool is_far_from_maps(const CArmMaps& model, std::optional<double> primary_deg,
                      std::optional<double> secondary_deg) {
  constexpr double little = 0.75;  // of the variance
  return predicted(alike(model.entries, c_arm_direction(primary_deg, secondary_deg)), model.repeat_share)
             .variance > little;
}

rectification::DistortionMap map_at(const CArmMaps& model, std::optional<double> primary_deg,
                                    std::optional<double> secondary_deg) {
  const Prediction there =
      predicted(alike(model.entries, c_arm_direction(primary_deg, secondary_deg)), model.repeat_share);
  rectification::DistortionMap like = model.entries.back().plate->map;
  double pixel_mm = 0;
  for (std::size_t i = 0; i < model.entries.size(); ++i) {
    const rectification::DistortionMap& map = model.entries[i].plate->map;
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
