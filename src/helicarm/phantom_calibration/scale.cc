// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/scale.h"

#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/phantom_calibration/gauge.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector3d;

/// d distance / d points.
Eigen::MatrixXd by_points(const std::vector<Vector3d>& centres,
                          const std::vector<CentreDistance>& distances) {
  Eigen::MatrixXd rows =
      Eigen::MatrixXd::Zero(Eigen::Index(distances.size()), 3 * Eigen::Index(centres.size()));
  for (std::size_t k = 0; k < distances.size(); ++k) {
    const Vector3d along = (centres[distances[k].a] - centres[distances[k].b]).normalized();
    rows.block<1, 3>(Eigen::Index(k), 3 * Eigen::Index(distances[k].a)) = along.transpose();
    rows.block<1, 3>(Eigen::Index(k), 3 * Eigen::Index(distances[k].b)) = -along.transpose();
  }
  return rows;
}

Eigen::VectorXd offsets_of(const std::vector<Vector3d>& centres) {
  return similarity_motions(centres).col(6);
}

double scale_sigma_of(const std::vector<Vector3d>& centres, const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd offsets = offsets_of(centres);
  return std::sqrt(std::max(0.0, offsets.dot(covariance * offsets))) / offsets.squaredNorm();
}

}  // namespace

ScaledPoints scaled_by(const std::vector<Vector3d>& centres, const Eigen::MatrixXd& covariance_mm2,
                       double factor, double sigma) {
  ScaledPoints scaled;
  for (const Vector3d& centre : centres) scaled.centres.push_back(factor * centre);
  const Eigen::VectorXd offsets = offsets_of(scaled.centres);
  scaled.covariance_mm2 = factor * factor * covariance_mm2 + sigma * sigma * offsets * offsets.transpose();
  scaled.scale_sigma = sigma;
  return scaled;
}

Expected<ScaledPoints> scaled_by(const std::vector<Vector3d>& centres, const Eigen::MatrixXd& covariance_mm2,
                                 const std::vector<CentreDistance>& distances,
                                 const std::vector<std::string>& labels) {
  const auto count = Eigen::Index(distances.size());
  const Eigen::MatrixXd rows = by_points(centres, distances);
  Eigen::VectorXd measured(count), reckoned(count);
  double factor = 0;
  for (Eigen::Index k = 0; k < count; ++k) {
    const CentreDistance& d = distances[std::size_t(k)];
    measured[k] = d.mm;
    reckoned[k] = (centres[d.a] - centres[d.b]).norm();
    factor += d.mm / reckoned[k] / double(count);
  }
  Eigen::MatrixXd covariance = factor * factor * rows * covariance_mm2 * rows.transpose();
  for (Eigen::Index k = 0; k < count; ++k)
    covariance(k, k) += distances[std::size_t(k)].sigma_mm * distances[std::size_t(k)].sigma_mm;
  const Eigen::MatrixXd weight = geometry::inverse(covariance);
  factor = reckoned.dot(weight * measured) / reckoned.dot(weight * reckoned);
  const Eigen::VectorXd residual = measured - factor * reckoned;
  const double chi2 = residual.dot(weight * residual);
  const double limit = count > 1 ? chi2_quantile(double(count) - 1, normal_at_999) : 0;
  if (count > 1 && chi2 > limit) {
    Eigen::Index worst = 0;
    (residual.array() / covariance.diagonal().array().sqrt()).abs().maxCoeff(&worst);
    const CentreDistance& d = distances[std::size_t(worst)];
    return fail(
        Reason::distances_disagree,
        fmt::format("the distances are inconsistent: {} to {} is {:.3f} mm as measured by hand, {:.3f} mm as "
                    "computed from the images and the other distances; measure them again",
                    labels[d.a], labels[d.b], d.mm, factor * reckoned[worst]),
        {{"chi2", chi2}, {"limit", limit}, {"difference_mm", residual[worst]}});
  }
  // The scale is not known beforehand: 100 % of a prior error change nothing.
  ScaledPoints scaled = scaled_by(centres, covariance_mm2, factor, 1);
  const Eigen::MatrixXd gain_rows = scaled.covariance_mm2 * rows.transpose();
  Eigen::MatrixXd innovation = rows * gain_rows;
  for (Eigen::Index k = 0; k < count; ++k)
    innovation(k, k) += distances[std::size_t(k)].sigma_mm * distances[std::size_t(k)].sigma_mm;
  // Not by an inverse: of an unknown scale its numbers are large, and cancel.
  const Eigen::MatrixXd gain = geometry::solve_spd(innovation, gain_rows.transpose()).solution.transpose();
  const Eigen::VectorXd change = gain * residual;
  for (std::size_t i = 0; i < centres.size(); ++i)
    scaled.centres[i] += change.segment<3>(3 * Eigen::Index(i));
  scaled.covariance_mm2 -= gain * gain_rows.transpose();
  scaled.covariance_mm2 = (scaled.covariance_mm2 + scaled.covariance_mm2.transpose()).eval() / 2;
  scaled.scale_sigma = scale_sigma_of(scaled.centres, scaled.covariance_mm2);
  scaled.chi2 = chi2;
  return scaled;
}

ScaledPoints with_scale_error(ScaledPoints points, double sigma) {
  const Eigen::VectorXd offsets = offsets_of(points.centres);
  points.covariance_mm2 += sigma * sigma * offsets * offsets.transpose();
  points.scale_sigma = std::hypot(points.scale_sigma, sigma);
  return points;
}

bool is_contradiction(const ScaleComparison& c) {
  constexpr double contradiction = 3, doubtful = 2, clearly_better_chi2 = 4;
  const double off = std::abs(c.ratio - 1) / c.sigma;
  if (off > contradiction) return true;
  if (!c.corrected_ratio || off < doubtful) return false;
  const double corrected_off = std::abs(*c.corrected_ratio - 1) / c.sigma;
  return corrected_off < doubtful && off * off - corrected_off * corrected_off > clearly_better_chi2;
}

Expected<void> check_scale(const ScaleComparison& c, std::vector<Warning>& warnings) {
  constexpr double refused_sigmas = 10;
  if (!is_contradiction(c)) return {};
  Failure failure{Reason::scale_disagrees,
                  fmt::format("{} make the phantom {:.4g} times as large as {} (sigma {:.2g} %)", c.scale,
                              c.ratio, c.other, 100 * c.sigma),
                  {},
                  {{"ratio", c.ratio}, {"relative_sigma", c.sigma}}};
  const bool explained = c.corrected_ratio && std::abs(*c.corrected_ratio - 1) < std::abs(c.ratio - 1) / 2;
  if (explained) {
    failure.message += fmt::format("; {}: {:.4g} times", c.correction, *c.corrected_ratio);
    failure.figures["corrected_ratio"] = *c.corrected_ratio;
  }
  failure.message +=
      ": check the distances' unit and kind (outer distances are over both balls), and the "
      "diameters and coordinates that the case states";
  if (std::abs(c.ratio - 1) > refused_sigmas * c.sigma) return tl::unexpected<Failure>(failure);
  warnings.push_back(std::move(failure));
  return {};
}

PairToMeasure best_pair(const std::vector<Vector3d>& centres, const Eigen::MatrixXd& covariance_mm2,
                        double sigma_mm) {
  PairToMeasure best;
  for (std::size_t a = 0; a < centres.size(); ++a)
    for (std::size_t b = a + 1; b < centres.size(); ++b) {
      const double distance = (centres[a] - centres[b]).norm();
      const Eigen::RowVectorXd row = by_points(centres, {{a, b, distance, sigma_mm}}).row(0);
      const double sigma =
          std::sqrt(row.dot(covariance_mm2 * row.transpose()) + sigma_mm * sigma_mm) / distance;
      if (best.distance_mm == 0 || sigma < best.relative_sigma) best = {a, b, distance, sigma};
    }
  return best;
}

}  // namespace helicarm::phantom_calibration
