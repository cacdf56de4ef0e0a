// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/gauge.h"

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/phantom_calibration/synthetic_phantom_test.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;

const Similarity known{1.02, {geometry::rotation_from_vector({0.2, -0.4, 0.7}), {5, -8, 13}}};

std::vector<Vector3d> carried(const std::vector<Vector3d>& points) {
  std::vector<Vector3d> result;
  for (const Vector3d& point : points) result.push_back(known * point);
  return result;
}

/// Normal equations of random distances' differences: seven motions are not observable.
MatrixXd normal_of(const MatrixXd& motions, std::uint64_t seed) {
  RandomStream random(seed, 1, 0);
  MatrixXd rows(motions.rows(), motions.rows());
  for (double& value : rows.reshaped()) value = random.normal();
  const MatrixXd keep = MatrixXd::Identity(motions.rows(), motions.rows()) -
                        motions * (motions.transpose() * motions).ldlt().solve(motions.transpose());
  return keep * rows.transpose() * rows * keep;
}

TEST(Gauge, SimilarityIsRecovered) {
  const auto points = helix_centres();
  const auto fit =
      similarity_between(points, carried(points), Eigen::VectorXd::Ones(Eigen::Index(points.size())), true);
  EXPECT_NEAR(fit.scale, known.scale, 1e-12);
  EXPECT_TRUE(fit.a_from_b.rotation.isApprox(known.a_from_b.rotation, 1e-12));
  EXPECT_TRUE(fit.a_from_b.translation.isApprox(known.a_from_b.translation, 1e-10));
}

TEST(Gauge, RigidFitKeepsTheScale) {
  const auto points = helix_centres();
  const auto fit =
      similarity_between(points, carried(points), Eigen::VectorXd::Ones(Eigen::Index(points.size())), false);
  EXPECT_EQ(fit.scale, 1);
  EXPECT_TRUE(fit.a_from_b.rotation.isApprox(known.a_from_b.rotation, 1e-12));
}

TEST(Gauge, DisplacedPointDoesNotMoveTheRobustFrame) {
  const auto points = helix_centres();
  auto places = carried(points);
  places[3] += Vector3d(3, 0, 0);
  const auto fit = robust_similarity(points, places, true);
  EXPECT_LT((fit.a_from_b * points[7] - places[7]).norm(), 1e-3);
  EXPECT_NEAR((fit.a_from_b * points[3] - places[3]).norm(), 3, 1e-3);
  EXPECT_LT(fit.weights[3], 1e-3);
}

TEST(Gauge, InnerConstraintCovarianceIsThePseudoInverse) {
  const MatrixXd motions = similarity_motions(helix_centres());
  const MatrixXd normal = normal_of(motions, 1);
  const auto covariance = inner_constraint_covariance(normal, motions);
  ASSERT_TRUE(covariance);
  EXPECT_TRUE((normal * *covariance * normal).isApprox(normal, 1e-8));
  EXPECT_LT((motions.transpose() * *covariance).norm(), 1e-9 * motions.norm() * covariance->norm());
}

TEST(Gauge, FurtherUnobservableMotionHasNoCovariance) {
  const MatrixXd motions = similarity_motions(helix_centres());
  Eigen::VectorXd further = Eigen::VectorXd::Unit(motions.rows(), 4);
  further -= motions * (motions.transpose() * motions).ldlt().solve(motions.transpose() * further);
  further.normalize();
  const MatrixXd keep = MatrixXd::Identity(motions.rows(), motions.rows()) - further * further.transpose();
  const MatrixXd normal = keep * normal_of(motions, 2) * keep;
  EXPECT_FALSE(inner_constraint_covariance(normal, motions));
}

TEST(Gauge, FrameOfThreePointsLeavesThemNoCommonMotion) {
  const auto points = helix_centres();
  const MatrixXd motions = similarity_motions(points).leftCols<6>();
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(Eigen::Index(points.size()));
  weights.head<3>().setOnes();
  const MatrixXd in_frame = in_frame_of(MatrixXd::Identity(motions.rows(), motions.rows()), motions, weights);
  const MatrixXd of_three = motions.topRows<9>();
  EXPECT_LT((of_three.transpose() * in_frame.topLeftCorner<9, 9>()).norm(), 1e-9 * of_three.norm());
  EXPECT_GT(in_frame(35, 35), in_frame(0, 0));
}

}  // namespace
}  // namespace helicarm::phantom_calibration
