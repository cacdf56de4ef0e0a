// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "helicarm/calibration/c_arm_history.h"

namespace helicarm::calibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double prior_weight = 4;
constexpr int rounds = 50;

Vector3d squares(const CArmPrior& prior, double IntrinsicsVariation::*sigma) {
  const double focal = (*prior.focal).*sigma, principal = (*prior.principal).*sigma;
  return {focal * focal, principal * principal, principal * principal};
}

double variance(double first, double observed, double n) {
  return (prior_weight * first * first + observed) / (prior_weight + n);
}

/// What an entry's images say, without its calibrator's errors.
struct Sample {
  Vector3d deviation;
  Matrix3d information;
  Matrix3Xd by_errors;

  Sample(const HistoryEntry& entry, const Vector3d& nominal_mm)
      : deviation(entry.deviation_from(nominal_mm)), by_errors(entry.by_calibrator) {
    const Matrix3d of_calibrator = by_errors * by_errors.transpose();
    information = entry.information * (Matrix3d::Identity() - of_calibrator * entry.information).inverse();
  }
};

/// Entries whose calibrator has the same errors, and the normal equations of the mean and these errors.
class Group {
 public:
  Matrix3d information;
  Matrix3Xd with_errors;
  Vector3d pull;

  void add(Sample sample) { samples_.push_back(std::move(sample)); }

  void sum(const Vector3d& sag) {
    const Eigen::Index errors = samples_.front().by_errors.cols();
    of_sag_ = sag.cwiseInverse().asDiagonal();
    information.setZero();
    with_errors = Matrix3Xd::Zero(3, errors);
    pull.setZero();
    MatrixXd information_of_errors = MatrixXd::Identity(errors, errors);
    pull_of_errors_ = VectorXd::Zero(errors);
    for (const Sample& sample : samples_) {
      // The inverse of information^-1 + sag; the information itself may be too small to be inverted.
      const Matrix3d of_mean = sample.information * posterior_of(sample) * of_sag_;
      const Matrix3Xd by_errors = of_mean * sample.by_errors;
      information += of_mean;
      with_errors += by_errors;
      pull += of_mean * sample.deviation;
      information_of_errors.noalias() += sample.by_errors.transpose() * by_errors;
      pull_of_errors_ += by_errors.transpose() * sample.deviation;
    }
    of_errors_.compute(information_of_errors);
    response_ = -of_errors_.solve(with_errors.transpose());
  }

  Matrix3d marginal_information() const { return information + with_errors * response_; }
  Vector3d marginal_pull() const { return pull + response_.transpose() * pull_of_errors_; }

  /// Expected squares of the samples' own deviations from the mean.
  Vector3d variations(const Vector3d& mean, const Matrix3d& covariance) const {
    const VectorXd errors = of_errors_.solve(pull_of_errors_) + response_ * mean;
    Vector3d sum = Vector3d::Zero();
    for (const Sample& sample : samples_) {
      const Matrix3d posterior = posterior_of(sample);
      const Matrix3d gain = posterior * sample.information;
      const Matrix3d by_mean = Matrix3d::Identity() + sample.by_errors * response_;
      const Matrix3d expected = by_mean * covariance * by_mean.transpose() +
                                sample.by_errors * of_errors_.solve(sample.by_errors.transpose());
      const Vector3d variation = gain * (sample.deviation - mean - sample.by_errors * errors);
      sum += (posterior + gain * expected * gain.transpose()).diagonal() + variation.cwiseAbs2();
    }
    return sum;
  }

 private:
  Matrix3d posterior_of(const Sample& sample) const { return (sample.information + of_sag_).inverse(); }

  std::vector<Sample> samples_;
  Matrix3d of_sag_;
  Eigen::LLT<MatrixXd> of_errors_;
  MatrixXd response_;  ///< of the errors to the mean
  VectorXd pull_of_errors_;
};

/// By calibrator and number of its errors.
using Groups = std::map<std::pair<std::string, Eigen::Index>, Group>;

Groups groups_of(std::span<const HistoryEntry> entries, const Vector3d& nominal_mm) {
  Groups groups;
  for (const HistoryEntry& entry : entries)
    groups[{entry.calibrator, entry.by_calibrator.cols()}].add({entry, nominal_mm});
  return groups;
}

/// That of the next views, if it holds an error of each coordinate.
const Group* of_next(const Groups& groups, const std::string& calibrator) {
  for (const auto& [key, group] : groups)
    if (!calibrator.empty() && key.first == calibrator && key.second > 3) return &group;
  return nullptr;
}

void set_common(CArmPrior& prior, const Matrix3d& covariance) {
  prior.focal->common = std::sqrt(covariance(0, 0));
  prior.principal->common = std::sqrt((covariance(1, 1) + covariance(2, 2)) / 2);
}

}  // namespace

LearnedIntrinsics learn_intrinsics(std::span<const HistoryEntry> entries, const Vector3d& nominal_mm,
                                   const CArmPrior& unknown, const std::string& calibrator) {
  LearnedIntrinsics known{nominal_mm, {Vector3d::Zero(), unknown}, {Vector3d::Zero(), unknown}};
  if (entries.empty()) return known;
  Groups groups = groups_of(entries, nominal_mm);
  auto& [mean, prior] = known.deviation;
  const Matrix3d assumed = squares(unknown, &IntrinsicsVariation::common).cwiseInverse().asDiagonal();
  Matrix3d information;
  Vector3d pull;
  for (int round = 0; round < rounds; ++round) {
    const Vector3d sag = squares(prior, &IntrinsicsVariation::of_view);
    information = assumed;
    pull.setZero();
    for (auto& [key, group] : groups) {
      group.sum(sag);
      information += group.marginal_information();
      pull += group.marginal_pull();
    }
    const Matrix3d covariance = information.inverse();
    mean = covariance * pull;
    Vector3d observed = Vector3d::Zero();
    for (const auto& [key, group] : groups) observed += group.variations(mean, covariance);
    const double n = double(entries.size());
    prior.focal->of_view = std::sqrt(variance(unknown.focal->of_view, observed(0), n));
    prior.principal->of_view =
        std::sqrt(variance(unknown.principal->of_view, (observed(1) + observed(2)) / 2, n));
    set_common(prior, covariance);
  }
  known.of_calibrator = known.deviation;
  if (const Group* own = of_next(groups, calibrator)) {
    const Matrix3d covariance = (information - own->marginal_information() + own->information).inverse();
    known.of_calibrator.mm = covariance * (pull - own->marginal_pull() + own->pull);
    known.of_calibrator.prior.by_ball_errors = -covariance * own->with_errors;
    set_common(known.of_calibrator.prior, covariance);
  }
  return known;
}

}  // namespace helicarm::calibration
