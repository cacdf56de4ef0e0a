// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_model.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "helicarm/calibration/c_arm_maps.h"
#include "helicarm/calibration/c_arm_position.h"
#include "helicarm/calibration/c_arm_variations.h"
#include "helicarm/core/statistics.h"
#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::calibration {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr std::size_t most_used = 150;
constexpr double largest_sigma_mm = 100;  // of an entry along a direction that it does not determine
constexpr double usual_repeat = 0.1;      // of the sag

Matrix3d noise_of(const HistoryEntry& entry) {
  const auto [values, vectors] = geometry::symmetric_eigen(entry.information);
  const Vector3d variances = values.cwiseMax(1 / (largest_sigma_mm * largest_sigma_mm)).cwiseInverse();
  return vectors * variances.asDiagonal() * vectors.transpose();
}

const CArmVariation& of(const CArmModel& model, int axis) {
  return axis == 0 ? model.focal : model.principal;
}

double common_sigma(const CArmModel& model, int axis) {
  return (axis == 0 ? model.unknown.focal : model.unknown.principal)->common;
}

/// Covariance between the values of two lists of acquisitions, without their own errors. `same`: the lists
/// are one list.
MatrixXd covariance_between(const CArmModel& model, std::span<const HistoryEntry> a,
                            std::span<const HistoryEntry> b, bool same) {
  MatrixXd between = MatrixXd::Zero(3 * Index(a.size()), 3 * Index(b.size()));
  std::vector<std::optional<Vector3d>> in_a, in_b;
  for (const HistoryEntry& entry : a) in_a.push_back(c_arm_direction(entry.primary_deg, entry.secondary_deg));
  for (const HistoryEntry& entry : b) in_b.push_back(c_arm_direction(entry.primary_deg, entry.secondary_deg));
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < b.size(); ++j) {
      const bool itself = same && i == j;
      const double alike = itself ? 1 : position_correlation(in_a[i], in_b[j]);
      for (int axis = 0; axis < 3; ++axis) {
        const CArmVariation& variation = of(model, axis);
        between(3 * Index(i) + axis, 3 * Index(j) + axis) =
            std::pow(common_sigma(model, axis), 2) + alike * variation.smooth * variation.smooth +
            (itself ? variation.repeat * variation.repeat : 0);
      }
    }
  return between;
}

/// Covariance between the errors of two acquisitions by their calibrator.
Matrix3d shared_noise(const HistoryEntry& a, const HistoryEntry& b) {
  if (a.calibrator.empty() || a.calibrator != b.calibrator ||
      a.by_calibrator.cols() != b.by_calibrator.cols())
    return Matrix3d::Zero();
  return a.by_calibrator * b.by_calibrator.transpose();
}

MatrixXd noise_between(std::span<const HistoryEntry> a, std::span<const HistoryEntry> b) {
  MatrixXd between(3 * Index(a.size()), 3 * Index(b.size()));
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < b.size(); ++j)
      between.block<3, 3>(3 * Index(i), 3 * Index(j)) = shared_noise(a[i], b[j]);
  return between;
}

/// Of the acquisitions' own errors.
MatrixXd noise_among(std::span<const HistoryEntry> entries) {
  MatrixXd noise = noise_between(entries, entries);
  for (std::size_t i = 0; i < entries.size(); ++i)
    noise.block<3, 3>(3 * Index(i), 3 * Index(i)) = noise_of(entries[i]);
  return noise;
}

VectorXd deviations(const CArmModel& model, std::span<const HistoryEntry> entries) {
  VectorXd from_nominal(3 * Index(entries.size()));
  for (std::size_t i = 0; i < entries.size(); ++i)
    from_nominal.segment<3>(3 * Index(i)) = entries[i].deviation_from(model.nominal_mm);
  return from_nominal;
}

/// Log-normal about the sag of an unknown C-arm, a factor of 4 per standard deviation.
double log_prior(const CArmVariation& variation, double of_view) {
  const double width = std::log(4.0);
  const double smooth = std::log(variation.smooth / of_view) / width;
  const double repeat = std::log(variation.repeat / (usual_repeat * of_view)) / width;
  return -0.5 * (smooth * smooth + repeat * repeat);
}

}  // namespace

double log_likelihood(const CArmModel& model) {
  const MatrixXd covariance =
      covariance_between(model, model.entries, model.entries, true) + noise_among(model.entries);
  const VectorXd residual = deviations(model, model.entries);
  const Eigen::LLT<MatrixXd> factor(covariance);
  if (factor.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
  const VectorXd whitened = factor.matrixL().solve(residual);
  return -0.5 * whitened.squaredNorm() - factor.matrixLLT().diagonal().array().log().sum();
}

namespace {

double log_posterior(const CArmModel& model) {
  return log_likelihood(model) + log_prior(model.focal, model.unknown.focal->of_view) +
         log_prior(model.principal, model.unknown.principal->of_view);
}

/// One kind's variation of greatest posterior density, on a grid.
void fit_variation(CArmModel& model, CArmVariation CArmModel::*kind, double of_view) {
  constexpr std::array smooth{0.06, 0.12, 0.25, 0.5, 1., 2., 4., 8., 16.};
  constexpr std::array repeat{0.012, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8};
  CArmVariation best = model.*kind;
  double highest = -std::numeric_limits<double>::infinity();
  for (const double s : smooth)
    for (const double r : repeat) {
      model.*kind = {s * of_view, r * of_view};
      if (const double density = log_posterior(model); density > highest)
        highest = density, best = model.*kind;
    }
  model.*kind = best;
}

AcquisitionCheck compared(const HistoryEntry& entry, const Vector3d& predicted, const Matrix3d& covariance) {
  const Vector3d difference = entry.estimate_mm - predicted;
  return {entry, predicted, covariance.diagonal().cwiseSqrt(),
          difference.dot(covariance.llt().solve(difference)), false};
}

bool is_beyond(const AcquisitionCheck& check, const CArmTolerances& tolerances) {
  const Vector3d difference = check.entry.estimate_mm - check.predicted_mm;
  return std::abs(difference.x()) > tolerances.focal_mm ||
         difference.tail<2>().norm() > tolerances.principal_mm;
}

}  // namespace

CArmModel c_arm_model(std::span<const HistoryEntry> entries, const Vector3d& nominal_mm,
                      const CArmPrior& unknown) {
  CArmModel model{nominal_mm, unknown, {}, {}, {}};
  const std::span<const HistoryEntry> latest = entries.last(std::min(most_used, entries.size()));
  model.entries.assign(latest.begin(), latest.end());
  model.focal = {unknown.focal->of_view, usual_repeat * unknown.focal->of_view};
  model.principal = {unknown.principal->of_view, usual_repeat * unknown.principal->of_view};
  if (model.entries.empty()) return model;
  for (int round = 0; round < 2; ++round) {
    fit_variation(model, &CArmModel::focal, unknown.focal->of_view);
    fit_variation(model, &CArmModel::principal, unknown.principal->of_view);
  }
  return model;
}

std::optional<CArmDrift> c_arm_drift(const CArmModel& model) {
  constexpr double days_a_year = 365.25;
  std::vector<HistoryEntry> dated;
  std::vector<std::chrono::sys_days> days;
  for (const HistoryEntry& entry : model.entries)
    if (const auto day = day_of(entry.date)) {
      dated.push_back(entry);
      days.push_back(*day);
    }
  if (days.empty()) return {};
  const auto [first, last] = std::ranges::minmax(days);
  if (first == last) return {};
  const MatrixXd covariance = covariance_between(model, dated, dated, true) + noise_among(dated);
  MatrixXd by_year(covariance.rows(), 3);
  for (std::size_t i = 0; i < days.size(); ++i)
    by_year.middleRows<3>(3 * Index(i)) =
        double((days[i] - first).count()) / days_a_year * Matrix3d::Identity();
  const Eigen::LLT<MatrixXd> factor(covariance);
  const MatrixXd weighted = factor.solve(by_year);
  const Matrix3d of_drift = (by_year.transpose() * weighted).inverse();
  return CArmDrift{of_drift * (weighted.transpose() * deviations(model, dated)),
                   of_drift.diagonal().cwiseSqrt()};
}

namespace {

enum class Wanted { intrinsics, estimates };  // estimates: with the errors of the acquisitions

IntrinsicsPrediction predicted_by(const CArmModel& model, std::span<const HistoryEntry> at, Wanted wanted) {
  IntrinsicsPrediction predicted;
  predicted.mean_mm.resize(3 * Index(at.size()));
  for (std::size_t i = 0; i < at.size(); ++i)
    predicted.mean_mm.segment<3>(3 * Index(i)) = at[i].stated_or(model.nominal_mm);
  predicted.covariance_mm2 = covariance_between(model, at, at, true);
  if (wanted == Wanted::estimates) predicted.covariance_mm2 += noise_among(at);
  if (model.entries.empty()) return predicted;
  const Eigen::LLT<MatrixXd> factor(covariance_between(model, model.entries, model.entries, true) +
                                    noise_among(model.entries));
  MatrixXd between = covariance_between(model, at, model.entries, false);
  if (wanted == Wanted::estimates) between += noise_between(at, model.entries);
  const MatrixXd gain = factor.solve(between.transpose()).transpose();
  predicted.mean_mm += gain * deviations(model, model.entries);
  predicted.covariance_mm2 -= gain * between.transpose();
  return predicted;
}

}  // namespace

IntrinsicsPrediction predict_intrinsics(const CArmModel& model, std::span<const HistoryEntry> at) {
  return predicted_by(model, at, Wanted::intrinsics);
}

namespace {

/// Of a change, the acquisitions that are significant alone; none is: the one that says most.
void mark_those_that_tell(CArmCheck& check) {
  if (!check.changed) return;
  const auto worst = std::ranges::max_element(
      check.acquisitions, {}, [](const AcquisitionCheck& one) { return one.is_changed ? one.chi2 : -1; });
  const double limit = std::min(worst->chi2, chi2_quantile(3, normal_at_999));
  for (AcquisitionCheck& one : check.acquisitions) one.is_changed &= one.chi2 >= limit;
}

}  // namespace

namespace {

void check_maps(CArmCheck& check, const CArmModel& model, std::span<const HistoryEntry> acquired) {
  constexpr double significant = 3, noticeable_px = 0.2;
  const auto maps = c_arm_maps(model.entries);
  check.recorded_maps = maps ? maps->entries.size() : 0;
  for (const HistoryEntry& entry : acquired) {
    if (!entry.plate) continue;
    if (check.recorded_maps < least_compared_maps || !is_of_their_field(*maps, *entry.plate)) {
      check.uncompared_maps.push_back(entry.view);
      continue;
    }
    const MapCheck of_map = check_map(*maps, entry);
    check.maps.push_back({entry.view, of_map.error_px, of_map.predicted_px,
                          of_map.error_px > std::max(noticeable_px, significant * of_map.predicted_px)});
  }
}

}  // namespace

CArmCheck check_c_arm(const CArmModel& model, std::span<const HistoryEntry> acquired,
                      const CArmTolerances& tolerances) {
  CArmCheck check;
  if (acquired.empty()) return check;
  check_maps(check, model, acquired);
  const auto [predicted, covariance] = predicted_by(model, acquired, Wanted::estimates);
  VectorXd difference = -predicted;
  for (std::size_t i = 0; i < acquired.size(); ++i)
    difference.segment<3>(3 * Index(i)) += acquired[i].estimate_mm;
  check.chi2 = difference.dot(Eigen::LLT<MatrixXd>(covariance).solve(difference));
  check.limit = chi2_quantile(3 * double(acquired.size()), normal_at_999);
  for (std::size_t i = 0; i < acquired.size(); ++i) {
    const Index first = 3 * Index(i);
    check.acquisitions.push_back(
        compared(acquired[i], predicted.segment<3>(first), covariance.block<3, 3>(first, first)));
    AcquisitionCheck& one = check.acquisitions.back();
    one.is_changed = check.chi2 > check.limit && is_beyond(one, tolerances);
    check.changed |= one.is_changed;
  }
  mark_those_that_tell(check);
  return check;
}

std::vector<AcquisitionCheck> leave_one_out(const CArmModel& model) {
  std::vector<AcquisitionCheck> checks;
  for (std::size_t i = 0; i < model.entries.size(); ++i) {
    CArmModel others = model;
    others.entries.erase(others.entries.begin() + std::ptrdiff_t(i));
    const HistoryEntry& left_out = model.entries[i];
    const auto [predicted, covariance] = predicted_by(others, {&left_out, 1}, Wanted::estimates);
    checks.push_back(compared(left_out, predicted, covariance));
  }
  return checks;
}

}  // namespace helicarm::calibration
