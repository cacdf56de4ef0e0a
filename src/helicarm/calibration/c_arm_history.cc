// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_history.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "helicarm/calibration/c_arm_position.h"
#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::calibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double least_information = 1e-9;  // 1 / mm^2
constexpr std::size_t most_maps = 60;       // of one field

Vector3d squares(double focal, double principal) {
  return {focal * focal, principal * principal, principal * principal};
}

/// Symmetric.
Matrix3d root_of(const Matrix3d& covariance) {
  const auto [values, vectors] = geometry::symmetric_eigen(covariance);
  return vectors * values.cwiseMax(0).cwiseSqrt().asDiagonal() * vectors.transpose();
}

}  // namespace

std::optional<HistoryEntry> history_entry_of(const ViewFiducials& view, const std::string& image,
                                             const CommonPrior& unknown) {
  if (!view.prior.focal_px || !view.prior.principal_px) return std::nullopt;
  CalibrationOptions options;
  options.common = unknown;
  options.rejection_probability = 0;  // outliers have been removed already
  const auto alone = calibrate({view}, options);
  if (!alone) return std::nullopt;
  const CalibratedView& calibrated = alone->views[0];
  const geometry::Intrinsics& k = calibrated.view.intrinsics;
  const double hand = k.fx < 0 ? -1 : 1;
  Eigen::Matrix<double, 3, 4> in_mm;
  in_mm << 0.5 * hand, 0.5, 0, 0, 0, 0, hand, 0, 0, 0, 0, 1;
  in_mm /= view.prior.unit_px;
  const double nominal_focal_mm = *view.prior.focal_px / view.prior.unit_px;
  const Vector3d nominal(nominal_focal_mm, 0, 0);
  const Vector3d posterior = in_mm * Eigen::Vector4d(k.fx, k.fy, k.u0 - view.prior.principal_px->x(),
                                                     k.v0 - view.prior.principal_px->y());
  const Matrix3d information =
      (in_mm * calibrated.covariance.topLeftCorner<4, 4>() * in_mm.transpose()).inverse();
  const auto variance_of = [](const IntrinsicsVariation& d) { return std::hypot(d.common, d.of_view); };
  const Matrix3d assumed = squares(variance_of(*unknown.c_arm.focal), variance_of(*unknown.c_arm.principal))
                               .cwiseInverse()
                               .asDiagonal();
  const auto [values, vectors] = geometry::symmetric_eigen(information - assumed);
  const Matrix3d own = vectors * values.cwiseMax(least_information).asDiagonal() * vectors.transpose();
  // Along a direction that the image does not determine, the posterior is as good as any estimate.
  constexpr double least_determined = 1e-4;  // of 100 mm
  const Vector3d variances = (values.array() < least_determined).select(0, values.array().inverse());
  // The posterior is the mean of estimate and nominal values, weighted by `own` and `assumed`.
  const Matrix3d freed =
      Matrix3d::Identity() + vectors * variances.asDiagonal() * vectors.transpose() * assumed;
  HistoryEntry entry{image, view.name, nominal + freed * (posterior - nominal), own};
  entry.nominal_focal_mm = nominal_focal_mm;
  if (alone->by_ball_errors.isZero(0)) return entry;
  entry.calibrator = unknown.calibrator;
  entry.by_calibrator = freed * in_mm * alone->by_ball_errors.topRows<4>();
  if (entry.by_calibrator.cols() > Eigen::Index(most_ball_errors))
    entry.by_calibrator = root_of(entry.by_calibrator * entry.by_calibrator.transpose());
  return entry;
}

geometry::IntrinsicsPrior learned_prior(geometry::IntrinsicsPrior prior, const Vector3d& deviation_mm,
                                        bool mirrored) {
  *prior.focal_px += deviation_mm.x() * prior.unit_px;
  *prior.principal_px +=
      prior.unit_px * Eigen::Vector2d((mirrored ? -1 : 1) * deviation_mm.y(), deviation_mm.z());
  return prior;
}

bool are_of_one_field(const rectification::DistortionMap& a, const rectification::DistortionMap& b) {
  constexpr double tolerance = 0.02;
  const double pixel_a = a.rectified_pixel_mm.value_or(0), pixel_b = b.rectified_pixel_mm.value_or(0);
  return a.width == b.width && a.height == b.height && std::abs(pixel_a - pixel_b) <= tolerance * pixel_b;
}

std::vector<std::size_t> entries_with_latest_maps(std::span<const HistoryEntry> entries) {
  constexpr double alike = 0.99;  // correlation: within 6 degrees
  constexpr int most_alike = 4;
  std::vector<std::size_t> chosen;
  const auto direction_of = [&](std::size_t i) {
    return c_arm_direction(entries[i].primary_deg, entries[i].secondary_deg);
  };
  for (std::size_t i = entries.size(); i-- > 0 && chosen.size() < most_maps;) {
    if (!entries[i].plate) continue;
    if (!chosen.empty() && !are_of_one_field(entries[i].plate->map, entries[chosen.front()].plate->map))
      continue;
    const auto near_it = [&](std::size_t k) {
      return position_correlation(direction_of(i), direction_of(k)) > alike;
    };
    if (std::ranges::count_if(chosen, near_it) < most_alike) chosen.push_back(i);
  }
  std::ranges::reverse(chosen);
  return chosen;
}

void forget_old_maps(CArmHistory& history) {
  std::vector<HistoryEntry> unseen = history.entries;  // of the fields that were not looked at yet
  for (auto kept = entries_with_latest_maps(unseen); !kept.empty(); kept = entries_with_latest_maps(unseen)) {
    const rectification::DistortionMap latest = unseen[kept.back()].plate->map;
    for (std::size_t i = 0; i < unseen.size(); ++i)
      if (unseen[i].plate && are_of_one_field(unseen[i].plate->map, latest)) {
        unseen[i].plate.reset();
        if (!std::ranges::binary_search(kept, i)) history.entries[i].plate.reset();
      }
  }
}

namespace {

/// Takes what an entry of an earlier version does not know from another one of its image.
void complete(HistoryEntry& held, const HistoryEntry& same) {
  if (!held.plate) held.plate = same.plate;
  if (held.nominal_focal_mm || held.estimate_mm != same.estimate_mm) return;
  held.nominal_focal_mm = same.nominal_focal_mm;
  held.calibrator = same.calibrator;
  held.by_calibrator = same.by_calibrator;
}

}  // namespace

std::size_t add_entries(CArmHistory& history, std::span<const HistoryEntry> entries) {
  const std::size_t earlier = history.entries.size();
  for (const HistoryEntry& entry : entries) {
    const auto held = std::ranges::find(history.entries, entry.image, &HistoryEntry::image);
    if (held == history.entries.end())
      history.entries.push_back(entry);
    else
      complete(*held, entry);
  }
  return history.entries.size() - earlier;
}

}  // namespace helicarm::calibration
