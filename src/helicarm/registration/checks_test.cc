// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/checks.h"

#include <cmath>

#include <gmock/gmock.h>

#include "helicarm/core/random.h"

namespace helicarm::registration {
namespace checks_test {

using Eigen::Vector3d;
using testing::HasSubstr, testing::Not;

constexpr double radius_mm = 40;
constexpr EdgeSigma stated{0.08, 0.04};

/// Two views from 900 mm at a right angle about z.
std::vector<RegistrationView> two_views() {
  std::vector<RegistrationView> views(2);
  for (int i = 0; i < 2; ++i) {
    geometry::View& view = views[std::size_t(i)].view;
    view.intrinsics = {4000, 4000, 512, 512};
    const Vector3d z = i == 0 ? Vector3d::UnitX() : Vector3d::UnitY(), y = -Vector3d::UnitZ();
    view.camera_from_world.rotation << y.cross(z).transpose(), y.transpose(), z.transpose();
    view.camera_from_world.translation = {0, 0, 900};
  }
  return views;
}

/// Edges in all directions of a body in the origin that is `growth_mm` larger in the images than its model,
/// with errors of about 0.1 px.
Observation edges_of_body(const std::vector<RegistrationView>& views, double growth_mm) {
  Observation observation;
  RandomStream random(1, 0);
  for (const RegistrationView& view : views) {
    ViewObservation& seen = observation.views.emplace_back();
    for (int i = 0; i < 300; ++i) {
      const double x = random.normal(), y = random.normal(), z = random.normal();
      const Vector3d at = radius_mm * Vector3d(x, y, z).normalized();
      const double angle = EIGEN_PI * random.uniform();
      const Eigen::RowVector2d normal(std::cos(angle), std::sin(angle));
      Eigen::Matrix<double, 2, 3> by_point;
      for (int k = 0; k < 3; ++k)
        by_point.col(k) = (view.view.project(at + 1e-4 * Vector3d::Unit(k)) -
                           view.view.project(at - 1e-4 * Vector3d::Unit(k))) /
                          2e-4;
      const Eigen::RowVector3d along = normal * by_point;
      Gradient jacobian = Gradient::Zero();
      jacobian.head<3>() = along;
      for (int row = 0; row < 3; ++row) jacobian.segment<3>(3 + 3 * row) = along[row] * at;
      jacobian[edge_offset] = 1;
      const double residual = growth_mm / radius_mm * along.dot(at) + 0.1 * random.normal();
      Comparison& comparison = seen.comparisons.emplace_back();
      comparison.pixel = view.view.project(at);
      comparison.information = jacobian * jacobian.transpose();
      comparison.gradient = residual * jacobian;
      comparison.weight = 1;
    }
  }
  return observation;
}

/// Two views' own solutions that are this far apart along z, which both see to 0.01 mm; 0.3 mm across.
std::vector<OwnSolution> solutions_apart(double apart_mm) {
  OwnSolution one{RigidStep::Zero(), RigidCovariance::Zero()};
  one.covariance.diagonal() << 1e-6, 1e-6, 1e-6, 0.09, 0.09, 1e-4;
  one.by_edges(5, 5) = stated.shift_mm * stated.shift_mm;
  one.covariance += one.by_edges;
  OwnSolution other = one;
  one.step[5] = apart_mm / 2, other.step[5] = -apart_mm / 2;
  return {one, other};
}

double ratio_of(double growth_mm, double scale_sigma = 0, double apart_mm = 0) {
  const auto views = two_views();
  const ErrorModel errors{views, radius_mm, Eigen::MatrixXd::Zero(22, 22), {5, 5}, stated, scale_sigma};
  return edge_variance_ratio(edges_of_body(views, growth_mm), errors, Vector3d::Zero(),
                             solutions_apart(apart_mm));
}

TEST(EdgeVariance, IsSmallWhereTheImagesRequireNoStrain) { EXPECT_LT(ratio_of(0), 0.3); }

TEST(EdgeVariance, IsThatOfTheStrainWhichTheImagesRequire) {
  EXPECT_GT(ratio_of(0.04), ratio_of(0));
  EXPECT_GT(ratio_of(0.15), 1);
  EXPECT_LE(ratio_of(4), 16);
}

TEST(EdgeVariance, IsThatOfTheDistanceBetweenTheViewsOwnSolutions) {
  EXPECT_LT(ratio_of(0), 0.1);
  EXPECT_GT(ratio_of(0, 0, 0.1), 2 * ratio_of(0));
  EXPECT_GT(ratio_of(0, 0, 0.4), 1);
  EXPECT_LE(ratio_of(0, 0, 4), 16);
}

TEST(EdgeVariance, ASizeInCommonIsNoDifferenceBetweenTheViews) {
  const auto views = two_views();
  const ErrorModel errors{views, radius_mm, Eigen::MatrixXd::Zero(22, 22), {5, 5}, stated};
  const Observation observation = edges_of_body(views, 0);
  auto own = solutions_apart(0.4);
  const double apart = edge_variance_ratio(observation, errors, Vector3d::Zero(), own);
  // One standard deviation of the size moves the solutions apart by as much.
  own[0].by_scale[5] = 0.2, own[1].by_scale[5] = -0.2;
  EXPECT_LT(edge_variance_ratio(observation, errors, Vector3d::Zero(), own), 0.7 * apart);
}

TEST(EdgeVariance, AStrainThatTheSizeExplainsIsNoneOfTheEdges) {
  EXPECT_LT(ratio_of(0.15, 0.01), ratio_of(0.15));
}

/// Why a model is refused that explains a quarter of the edges, and whose mirror image's cost is this.
std::string refusal_by(double mirrored_ratio) {
  Model model;
  model.name = "bone";
  Registration result;
  result.covariance = 1e-4 * RigidCovariance::Identity();
  result.anywhere = true;
  result.mirrored_ratio = mirrored_ratio;
  result.views = {{"AP", 0.25, 0.5, {}, 100}};
  decide(model, {}, {}, result);
  return result.failure ? result.failure->message : "";
}

TEST(Decide, AMirroredModelThatExplainsLittleIsNamed) {
  EXPECT_THAT(refusal_by(0.6), HasSubstr("explains 0.25 of its edges in AP"));
  EXPECT_THAT(refusal_by(0.6), HasSubstr("its mirror image fits better (cost ratio 0.60)"));
  // By chance the mirror image of another bone fits a little better.
  EXPECT_THAT(refusal_by(0.97), Not(HasSubstr("mirror")));
}

Registration with_strain(const Deformation& deformation, std::size_t views) {
  Registration result;
  result.covariance = 1e-4 * RigidCovariance::Identity();
  result.starts = result.agree = 2;
  result.deformation = deformation;
  result.views.assign(views, {"AP", 0.8, 0.5, {}, 100});
  decide({}, {}, {}, result);
  return result;
}

TEST(Confirmed, IsALoneStartOnlyByClearScores) {
  Registration result;
  result.agree = 1;
  result.views.resize(2);
  result.views[0].score = 0.6;
  result.views[1].score = 0.41;
  EXPECT_FALSE(is_confirmed(Model{}, result));
  result.views[1].score = 0.46;
  EXPECT_TRUE(is_confirmed(Model{}, result));
  result.views[1].score = 0.41;
  result.agree = 2;
  EXPECT_TRUE(is_confirmed(Model{}, result));
  result.starts = 1024;
  EXPECT_FALSE(is_confirmed(Model{}, result)) << "two of so many end together by chance";
  result.agree = 8;
  EXPECT_TRUE(is_confirmed(Model{}, result));
  result.failure = Failure{Reason::wrong_model, "", {}, {}};
  EXPECT_FALSE(is_confirmed(Model{}, result));
}

TEST(Confirmed, IsNoLoneStartOfAContour) {
  Model model;
  model.surface.emplace();
  Registration result;
  result.agree = 1;
  result.views.resize(1);
  result.views[0].score = 0.9;
  EXPECT_FALSE(is_confirmed(model, result));
}

TEST(Decide, AStrainThatIsNotRefusedIsWarnedOf) {
  const Registration warned = with_strain({-0.011, 0.0044}, 2);
  ASSERT_EQ(warned.warnings.size(), 1U);
  EXPECT_EQ(warned.decision, Decision::warn);
  EXPECT_EQ(warned.warnings[0].reason, Reason::scale_disagrees);
  EXPECT_THAT(warned.warnings[0].message, HasSubstr("1.1 % smaller along one direction"));
  EXPECT_EQ(with_strain({-0.011, 0.0058}, 2).decision, Decision::accept);
  EXPECT_EQ(with_strain({-0.0077, 0.003}, 2).decision, Decision::accept);
  EXPECT_EQ(with_strain({-0.011, 0.0044}, 1).decision, Decision::accept);
}

}  // namespace checks_test
}  // namespace helicarm::registration
