// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/priors.h"

#include <cmath>
#include <vector>

#include "helicarm/geometry/rotation.h"

namespace helicarm::calibration {
namespace {

/// Quantities of a view that have priors, and their derivatives by its step.
enum : Eigen::Index { focal, aspect, principal_u, principal_v, skew };
struct Quantities {
  Eigen::Vector<double, 5> values;
  Eigen::Matrix<double, 5, view_parameters> by_step;
};

Quantities quantities_of(const CentredView& view) {
  const geometry::Intrinsics k = uncentred(view).intrinsics;
  const ViewCovariance by_step = parameters_by_step(view);
  const double sign = k.fx < 0 ? -1 : 1;
  Quantities quantities{{(sign * k.fx + k.fy) / 2, sign * k.fx / k.fy, k.u0, k.v0, k.skew / k.fy}, {}};
  quantities.by_step.row(focal) = (sign * by_step.row(0) + by_step.row(1)) / 2;
  quantities.by_step.row(aspect) = sign * (by_step.row(0) - k.fx / k.fy * by_step.row(1)) / k.fy;
  quantities.by_step.middleRows<2>(principal_u) = by_step.middleRows<2>(2);
  quantities.by_step.row(skew) = (by_step.row(10) - k.skew / k.fy * by_step.row(1)) / k.fy;
  return quantities;
}

class Rows {
 public:
  explicit Rows(std::span<const CentredView> views) : columns_(view_parameters * Eigen::Index(views.size())) {
    for (const CentredView& view : views) quantities_.push_back(quantities_of(view));
  }

  void add_own(std::size_t view, Eigen::Index which, const geometry::NormalPrior& normal_prior) {
    residuals_.push_back((quantities_[view].values(which) - normal_prior.value) / normal_prior.sigma);
    rows_.emplace_back(Eigen::RowVectorXd::Zero(columns_))
        .segment<view_parameters>(view_parameters * Eigen::Index(view)) =
        quantities_[view].by_step.row(which) / normal_prior.sigma;
  }

  /// Deviations of a quantity from nominal in several views, of covariance common^2 + of_view^2 [i = j].
  struct Nominal {
    std::size_t view;
    double value;
    double unit;
  };
  void add_common(const std::vector<Nominal>& nominal, Eigen::Index which,
                  const IntrinsicsVariation& variation) {
    const auto count = Eigen::Index(nominal.size());
    Eigen::VectorXd residuals(count);
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(count, columns_);
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto& [view, value, unit] = nominal[std::size_t(i)];
      residuals(i) = (quantities_[view].values(which) - value) / unit;
      rows.row(i).segment<view_parameters>(view_parameters * Eigen::Index(view)) =
          quantities_[view].by_step.row(which) / unit;
    }
    // The covariance has two eigenvalues: one along equal deviations, one across them.
    const double along = 1 / std::hypot(variation.of_view, std::sqrt(double(count)) * variation.common);
    const double across = 1 / variation.of_view;
    Eigen::MatrixXd whitens = Eigen::MatrixXd::Constant(count, count, (along - across) / double(count));
    whitens.diagonal().array() += across;
    residuals = (whitens * residuals).eval();
    rows = (whitens * rows).eval();
    for (Eigen::Index i = 0; i < count; ++i) {
      residuals_.push_back(residuals(i));
      rows_.emplace_back(rows.row(i));
    }
  }

  PriorRows finish() const {
    PriorRows result{Eigen::Map<const Eigen::VectorXd>(residuals_.data(), Eigen::Index(residuals_.size())),
                     Eigen::MatrixXd(Eigen::Index(rows_.size()), columns_)};
    for (std::size_t i = 0; i < rows_.size(); ++i) result.jacobian.row(Eigen::Index(i)) = rows_[i];
    return result;
  }

 private:
  Eigen::Index columns_;
  std::vector<Quantities> quantities_;
  std::vector<double> residuals_;
  std::vector<Eigen::RowVectorXd> rows_;
};

}  // namespace

CentredView shrunk_to_prior(CentredView view, const geometry::IntrinsicsPrior& prior) {
  const double magnification = (std::abs(view.ax) + view.ay) / 2;
  if (prior.aspect) {
    view.ay = 2 * magnification / (1 + prior.aspect->value);
    view.ax = std::copysign(prior.aspect->value * view.ay, view.ax);
  }
  if (prior.skew) view.skew = prior.skew->value * view.ay;
  if (prior.focal_px) view.rho = magnification / *prior.focal_px;
  if (!prior.principal_px) return view;
  const double qy = (view.vc - prior.principal_px->y()) * view.rho / view.ay;
  const double qx = ((view.uc - prior.principal_px->x()) * view.rho - view.skew * qy) / view.ax;
  view.rotation = geometry::rotation_from_vector({view.qy - qy, qx - view.qx, 0}) * view.rotation;
  view.qx = qx;
  view.qy = qy;
  return view;
}

PriorRows prior_rows(std::span<const CentredView> views, std::span<const geometry::IntrinsicsPrior> priors,
                     const CArmPrior& c_arm) {
  Rows rows(views);
  std::vector<Rows::Nominal> focals, principals_u, principals_v;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const geometry::IntrinsicsPrior& prior = priors[i];
    if (prior.aspect) rows.add_own(i, aspect, *prior.aspect);
    if (prior.skew) rows.add_own(i, skew, *prior.skew);
    if (prior.focal_px) focals.push_back({i, *prior.focal_px, prior.unit_px});
    if (!prior.principal_px) continue;
    // A mirrored image reverses the C-arm's deviation along u.
    const double hand = views[i].ax < 0 ? -1 : 1;
    principals_u.push_back({i, prior.principal_px->x(), hand * prior.unit_px});
    principals_v.push_back({i, prior.principal_px->y(), prior.unit_px});
  }
  if (c_arm.focal) rows.add_common(focals, focal, *c_arm.focal);
  if (c_arm.principal) {
    rows.add_common(principals_u, principal_u, *c_arm.principal);
    rows.add_common(principals_v, principal_v, *c_arm.principal);
  }
  return rows.finish();
}

}  // namespace helicarm::calibration
