// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/priors.h"

#include <cmath>
#include <vector>

namespace helicarm {
namespace {

/// Numbers of one view that priors speak of, by its step: focal length, aspect, u0, v0.
struct Known {
  Eigen::Vector4d values;
  Eigen::Matrix<double, 4, 10> by_step;
};

enum : Eigen::Index { focal, aspect, principal };

Known known_of(const CentredView& view) {
  const Intrinsics k = uncentred(view).intrinsics;
  const Eigen::Matrix<double, 4, 10> by_step = parameters_by_step(view).topRows<4>();
  const double sign = k.fx < 0 ? -1 : 1;
  Known known{{(sign * k.fx + k.fy) / 2, sign * k.fx / k.fy, k.u0, k.v0}, by_step};
  known.by_step.row(focal) = (sign * by_step.row(0) + by_step.row(1)) / 2;
  known.by_step.row(aspect) = sign * (by_step.row(0) - k.fx / k.fy * by_step.row(1)) / k.fy;
  return known;
}

class Rows {
 public:
  explicit Rows(std::size_t views) : columns_(10 * Eigen::Index(views)) {}

  Eigen::RowVectorXd& add(double residual) {
    residuals_.push_back(residual);
    return rows_.emplace_back(Eigen::RowVectorXd::Zero(columns_));
  }

  PriorRows finish(int independent) const {
    PriorRows result{Eigen::Map<const Eigen::VectorXd>(residuals_.data(), Eigen::Index(residuals_.size())),
                     Eigen::MatrixXd(Eigen::Index(rows_.size()), columns_), independent};
    for (std::size_t i = 0; i < rows_.size(); ++i) result.jacobian.row(Eigen::Index(i)) = rows_[i];
    return result;
  }

  int count() const { return int(rows_.size()); }

 private:
  Eigen::Index columns_;
  std::vector<double> residuals_;
  std::vector<Eigen::RowVectorXd> rows_;
};

/// Deviations from the views' mean: as n - 1 independent differences with the common value unknown.
void add_spread(Rows& rows, const std::vector<Known>& known, Eigen::Index which, double sigma_of_difference) {
  const double n = double(known.size());
  const double sigma = sigma_of_difference / std::sqrt(2.0);
  double mean = 0;
  for (const Known& k : known) mean += k.values(which) / n;
  for (std::size_t i = 0; i < known.size(); ++i) {
    Eigen::RowVectorXd& row = rows.add((known[i].values(which) - mean) / sigma);
    for (std::size_t j = 0; j < known.size(); ++j)
      row.segment<10>(10 * Eigen::Index(j)) =
          ((i == j ? 1 : 0) - 1 / n) / sigma * known[j].by_step.row(which);
  }
}

}  // namespace

PriorRows prior_rows(std::span<const CentredView> views, std::span<const IntrinsicsPrior> priors,
                     const SpreadPrior& spread) {
  std::vector<Known> known;
  for (const CentredView& view : views) known.push_back(known_of(view));
  Rows rows(views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto add = [&](Eigen::Index which, double value, double sigma) {
      rows.add((known[i].values(which) - value) / sigma).segment<10>(10 * Eigen::Index(i)) =
          known[i].by_step.row(which) / sigma;
    };
    if (const auto& f = priors[i].focal_px) add(focal, f->value, f->sigma);
    if (const auto& a = priors[i].aspect) add(aspect, a->value, a->sigma);
    if (const auto& p = priors[i].principal_px)
      for (Eigen::Index axis = 0; axis < 2; ++axis) add(principal + axis, p->value(axis), p->sigma);
  }
  int independent = rows.count();
  const int differences = int(views.size()) - 1;
  if (spread.focal_px && differences > 0) {
    add_spread(rows, known, focal, *spread.focal_px);
    independent += differences;
  }
  if (spread.principal_px && differences > 0) {
    for (Eigen::Index axis = 0; axis < 2; ++axis)
      add_spread(rows, known, principal + axis, *spread.principal_px);
    independent += 2 * differences;
  }
  return rows.finish(independent);
}

}  // namespace helicarm
