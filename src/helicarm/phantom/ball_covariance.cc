// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/ball_covariance.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::phantom {
namespace {

constexpr Range variance_range{-100, 100};  // mm^2: a 10 mm error of a ball
constexpr double rounding = 1e-6;

Eigen::Index place_of(const JointCovariance& joint, const std::string& label) {
  const auto found = std::ranges::find(joint.labels, label);
  return found == joint.labels.end() ? -1 : 3 * Eigen::Index(found - joint.labels.begin());
}

}  // namespace

Expected<Eigen::MatrixXd> checked_covariance(const Eigen::MatrixXd& covariance_mm2) {
  if (covariance_mm2.size() == 0) return covariance_mm2;
  const double largest = covariance_mm2.cwiseAbs().maxCoeff();
  const double asymmetry = (covariance_mm2 - covariance_mm2.transpose()).cwiseAbs().maxCoeff();
  if (asymmetry > rounding * largest)
    return fail(Reason::bad_value, fmt::format("is not symmetric: elements differ by {:g}", asymmetry),
                {{"value", asymmetry}, {"limit", rounding * largest}});
  const Eigen::MatrixXd symmetric = (covariance_mm2 + covariance_mm2.transpose()) / 2;
  const double least = geometry::symmetric_eigen(symmetric).values[0];
  if (least < -rounding * largest)
    return fail(Reason::bad_value, fmt::format("has the negative eigenvalue {:g}", least),
                {{"value", least}, {"limit", 0}});
  return symmetric;
}

Eigen::MatrixXd covariance_from(JsonReader& reader, const char* key, std::size_t size) {
  const auto n = Eigen::Index(size);
  const auto checked = checked_covariance(
      Eigen::Map<const Eigen::MatrixXd>(reader.matrix(key, size, size, variance_range).data(), n, n));
  if (!checked) reader.refuse(checked.error().reason, key, checked.error().message);
  return *checked;
}

JointCovariance joint_covariance_from(JsonReader reader, const std::vector<CalibratorBall>& balls) {
  JointCovariance joint;
  const Json& labels = reader.raw("balls");
  if (!labels.is_array() || labels.empty() || labels.size() > most_correlated_balls ||
      !std::ranges::all_of(labels, [](const Json& label) { return label.is_string(); }))
    reader.refuse(Reason::bad_value, "balls",
                  fmt::format("is not a list of 1 to {} labels", most_correlated_balls));
  for (const Json& label : labels) joint.labels.push_back(label.get<std::string>());
  joint.mm2 = covariance_from(reader, "mm2", 3 * joint.labels.size());
  reader.finish();
  for (const CalibratorBall& ball : balls) {
    const Eigen::Index at = place_of(joint, ball.label);
    if (at < 0 || std::ranges::count(joint.labels, ball.label) != 1)
      reader.refuse(Reason::bad_value, "balls", fmt::format("must hold {} once", ball.label));
    const Eigen::Matrix3d own = joint.mm2.block<3, 3>(at, at);
    if (ball.covariance_mm2 && !own.isApprox(*ball.covariance_mm2, 1e-3))
      reader.refuse(Reason::bad_value, "mm2", fmt::format("differs from the covariance of {}", ball.label));
  }
  return joint;
}

Json to_json(const JointCovariance& joint) {
  Json json{{"balls", joint.labels}, {"mm2", Json::array()}};
  for (const auto& row : joint.mm2.rowwise()) {
    Json numbers = Json::array();
    for (const double number : row) numbers.push_back(number);
    json["mm2"].push_back(std::move(numbers));
  }
  return json;
}

Eigen::MatrixXd joint_ball_covariance(const Calibrator& calibrator) {
  if (!calibrator.joint_covariance) return {};
  const auto n = Eigen::Index(calibrator.balls.size());
  const Eigen::Vector3d middle = middle_of(calibrator);
  Eigen::MatrixXd covariance(3 * n, 3 * n);
  Eigen::VectorXd growth(3 * n);
  std::vector<Eigen::Index> places;
  for (const CalibratorBall& ball : calibrator.balls) {
    growth.segment<3>(3 * Eigen::Index(places.size())) = ball.centre_in_calibrator - middle;
    places.push_back(place_of(*calibrator.joint_covariance, ball.label));
  }
  for (Eigen::Index row = 0; row < n; ++row)
    for (Eigen::Index column = 0; column < n; ++column)
      covariance.block<3, 3>(3 * row, 3 * column) =
          calibrator.joint_covariance->mm2.block<3, 3>(places[std::size_t(row)], places[std::size_t(column)]);
  if (calibrator.scale_sigma > 0) {
    growth.normalize();
    const Eigen::MatrixXd rest = Eigen::MatrixXd::Identity(3 * n, 3 * n) - growth * growth.transpose();
    covariance = rest * covariance * rest;
  }
  covariance.diagonal().array() += calibrator.tolerance_mm * calibrator.tolerance_mm;
  return (covariance + covariance.transpose()) / 2;
}

std::vector<Eigen::Matrix3d> ball_covariances(const Calibrator& calibrator) {
  const Eigen::MatrixXd joint = joint_ball_covariance(calibrator);
  const Eigen::Vector3d middle = middle_of(calibrator);
  std::vector<Eigen::Matrix3d> covariances;
  bool exact = true;
  for (const CalibratorBall& ball : calibrator.balls) {
    Eigen::Matrix3d covariance =
        calibrator.tolerance_mm * calibrator.tolerance_mm * Eigen::Matrix3d::Identity();
    if (const auto at = 3 * Eigen::Index(covariances.size()); joint.size() > 0) {
      covariance = joint.block<3, 3>(at, at);
    } else if (ball.covariance_mm2) {
      const Eigen::Vector3d by_scale = calibrator.scale_sigma * (ball.centre_in_calibrator - middle);
      const Eigen::Matrix3d own = *ball.covariance_mm2 - by_scale * by_scale.transpose();
      const auto [values, vectors] = geometry::symmetric_eigen(own);
      covariance += vectors * values.cwiseMax(0).asDiagonal() * vectors.transpose();
    }
    exact &= covariance.isZero(0);
    covariances.push_back(covariance);
  }
  if (exact) covariances.clear();
  return covariances;
}

}  // namespace helicarm::phantom
