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
  Rows(const CentredView& view, const CArmPrior& c_arm, const CArmDeviation& deviation,
       const Eigen::VectorXd& ball_errors)
      : quantities_(quantities_of(view)), c_arm_(c_arm), deviation_(deviation), ball_errors_(ball_errors) {}

  void add_own(Eigen::Index which, const geometry::NormalPrior& normal_prior) {
    add(which, normal_prior.value, normal_prior.sigma);
  }
  /// `unit`: of the view, per mm on the detector; `share`: the C-arm's deviation of this quantity.
  void add_of_c_arm(Eigen::Index which, double nominal, double unit, const IntrinsicsVariation& variation,
                    Eigen::Index share) {
    add(which, nominal, unit * variation.of_view);
    by_c_arm_.back()[share] = -variation.common / variation.of_view;
    by_ball_errors_.back() = -c_arm_.by_ball_errors.row(share) / variation.of_view;
    residuals_.back() +=
        by_c_arm_.back()[share] * deviation_[share] + by_ball_errors_.back().dot(ball_errors_);
  }

  PriorRows finish() const {
    const auto count = Eigen::Index(residuals_.size());
    PriorRows rows{Eigen::VectorXd(count),
                   {count, view_parameters},
                   {count, 3},
                   Eigen::MatrixXd(count, c_arm_.by_ball_errors.cols())};
    for (Eigen::Index i = 0; i < count; ++i) {
      rows.residuals[i] = residuals_[std::size_t(i)];
      rows.by_step.row(i) = by_step_[std::size_t(i)];
      rows.by_c_arm.row(i) = by_c_arm_[std::size_t(i)];
      rows.by_ball_errors.row(i) = by_ball_errors_[std::size_t(i)];
    }
    return rows;
  }

 private:
  void add(Eigen::Index which, double value, double sigma) {
    residuals_.push_back((quantities_.values[which] - value) / sigma);
    by_step_.emplace_back(quantities_.by_step.row(which) / sigma);
    by_c_arm_.emplace_back(Eigen::RowVector3d::Zero());
    by_ball_errors_.emplace_back(Eigen::RowVectorXd::Zero(c_arm_.by_ball_errors.cols()));
  }

  Quantities quantities_;
  const CArmPrior& c_arm_;
  const CArmDeviation& deviation_;
  const Eigen::VectorXd& ball_errors_;
  std::vector<double> residuals_;
  std::vector<Eigen::RowVector<double, view_parameters>> by_step_;
  std::vector<Eigen::RowVector3d> by_c_arm_;
  std::vector<Eigen::RowVectorXd> by_ball_errors_;
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

PriorRows prior_rows(const CentredView& view, const geometry::IntrinsicsPrior& prior, const CArmPrior& c_arm,
                     const CArmDeviation& deviation, const Eigen::VectorXd& ball_errors) {
  Rows rows(view, c_arm, deviation, ball_errors);
  if (prior.aspect) rows.add_own(aspect, *prior.aspect);
  if (prior.skew) rows.add_own(skew, *prior.skew);
  if (c_arm.focal && prior.focal_px)
    rows.add_of_c_arm(focal, *prior.focal_px, prior.unit_px, *c_arm.focal, 0);
  if (!c_arm.principal || !prior.principal_px) return rows.finish();
  // A mirrored image reverses the C-arm's deviation along u.
  const double hand = view.ax < 0 ? -1 : 1;
  rows.add_of_c_arm(principal_u, prior.principal_px->x(), hand * prior.unit_px, *c_arm.principal, 1);
  rows.add_of_c_arm(principal_v, prior.principal_px->y(), prior.unit_px, *c_arm.principal, 2);
  return rows.finish();
}

}  // namespace helicarm::calibration
