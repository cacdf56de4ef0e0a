// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/centred_view.h"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "helicarm/calibration/priors.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::calibration {
namespace {

using Parameters = Eigen::Vector<double, view_parameters>;

const geometry::View example{{-6000, 6200, 500, 530, 40},
                             {geometry::rotation_from_euler(0.3, -0.8, 2), {30, -20, 820}}};
const Eigen::Vector3d centre(5, 3, 40);

/// Parameters of a view near `example`, the rotation as a step from it.
Parameters parameters_of(const geometry::View& view) {
  const geometry::Intrinsics& k = view.intrinsics;
  Parameters p;
  p << k.fx, k.fy, k.u0, k.v0,
      geometry::vector_from_rotation(view.camera_from_world.rotation *
                                     example.camera_from_world.rotation.transpose()),
      view.camera_from_world.translation, k.skew;
  return p;
}

geometry::View view_of(const Parameters& p) {
  return {{p(0), p(1), p(2), p(3), p(10)},
          {geometry::rotation_from_vector(p.segment<3>(4)) * example.camera_from_world.rotation,
           p.segment<3>(7)}};
}

const Parameters step_sizes =
    (Parameters() << 1e-4, 1e-4, 1e-2, 1e-2, 1e-5, 1e-5, 1e-5, 1e-7, 1e-5, 1e-5, 1e-4).finished();

TEST(CentredView, ProjectsLikeThePlainView) {
  const CentredView view = centred(example, centre);
  EXPECT_LT((uncentred(view).projection() - example.projection()).norm(), 1e-8);
  const Eigen::Vector3d point(-20, 40, 70);
  EXPECT_LT((image_of(view, point).pixel - example.project(point)).norm(), 1e-10);
}

TEST(CentredView, ImageJacobianAgreesWithDifferences) {
  const CentredView view = centred(example, centre);
  const Eigen::Vector3d point(-20, 40, 70);
  const auto jacobian = image_of(view, point).by_step;
  for (int i = 0; i < view_parameters; ++i) {
    const ViewStep step = step_sizes(i) * ViewStep::Unit(i);
    const Eigen::Vector2d slope =
        (image_of(moved(view, step), point).pixel - image_of(moved(view, -step), point).pixel) /
        (2 * step_sizes(i));
    EXPECT_LT((slope - jacobian.col(i)).norm(), 1e-6 * (1 + jacobian.col(i).norm())) << i;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = 1e-4 * Eigen::Vector3d::Unit(axis);
    const Eigen::Vector2d slope =
        (image_of(view, point + step).pixel - image_of(view, point - step).pixel) / 2e-4;
    EXPECT_LT((slope - image_of(view, point).by_point.col(axis)).norm(), 1e-6) << axis;
  }
}

TEST(CentredView, ParameterJacobianAgreesWithDifferences) {
  const CentredView view = centred(example, centre);
  const auto jacobian = parameters_by_step(view);
  for (int i = 0; i < view_parameters; ++i) {
    const ViewStep step = step_sizes(i) * ViewStep::Unit(i);
    const Parameters slope =
        (parameters_of(uncentred(moved(view, step))) - parameters_of(uncentred(moved(view, -step)))) /
        (2 * step_sizes(i));
    EXPECT_LT((slope - jacobian.col(i)).norm(), 1e-6 * (1 + jacobian.col(i).norm())) << i;
  }
}

TEST(PixelByParameters, AgreesWithDifferencesAndWithTheCentredForm) {
  const Eigen::Vector3d point(-20, 40, 70);
  const auto jacobian = pixel_by_parameters(example, point);
  for (int i = 0; i < view_parameters; ++i) {
    const double size = i < 4 || i > 6 ? 1e-3 : 1e-6;
    const Parameters at = parameters_of(example), step = size * Parameters::Unit(i);
    const Eigen::Vector2d slope =
        (view_of(at + step).project(point) - view_of(at - step).project(point)) / (2 * size);
    EXPECT_LT((slope - jacobian.col(i)).norm(), 1e-5 * (1 + jacobian.col(i).norm())) << i;
  }
  const CentredView view = centred(example, centre);
  EXPECT_LT((jacobian * parameters_by_step(view) - image_of(view, point).by_step).norm(), 1e-4);
}

TEST(ShrunkToPrior, TakesTheKnownIntrinsicsAndKeepsTheImages) {
  const CentredView view = centred(example, centre);
  const geometry::IntrinsicsPrior prior{6300, Eigen::Vector2d(512, 515), 1,
                                        geometry::NormalPrior{0.97, 0.01}};
  const CentredView shrunk = shrunk_to_prior(view, prior);
  const geometry::Intrinsics k = uncentred(shrunk).intrinsics;
  EXPECT_NEAR((k.fy - k.fx) / 2, 6300, 1e-9);
  EXPECT_NEAR(-k.fx / k.fy, 0.97, 1e-12);
  EXPECT_NEAR(k.u0, 512, 1e-9);
  EXPECT_NEAR(k.v0, 515, 1e-9);
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(-20, 40, 70), {30, 30, 10}})
    EXPECT_LT((image_of(shrunk, point).pixel - image_of(view, point).pixel).norm(), 2);
}

TEST(PriorRows, JacobianAgreesWithDifferences) {
  const CentredView view = centred(example, centre);
  const geometry::IntrinsicsPrior prior{6000, Eigen::Vector2d(512, 512), 5, geometry::NormalPrior{1, 0.01},
                                        geometry::NormalPrior{0, 0.01}};
  const CArmPrior c_arm{IntrinsicsVariation{10, 2}, IntrinsicsVariation{7, 4}};
  const CArmDeviation deviation(0.5, -1, 2);
  const PriorRows rows = prior_rows(view, prior, c_arm, deviation);
  EXPECT_EQ(rows.residuals.size(), 2 + 1 + 2);
  const auto expect_slope = [](const PriorRows& up, const PriorRows& down, double size, const auto& column) {
    const Eigen::VectorXd slope = (up.residuals - down.residuals) / (2 * size);
    EXPECT_LT((slope - column).norm(), 1e-5 * (1 + column.norm()));
  };
  for (int i = 0; i < view_parameters; ++i) {
    const double size = step_sizes(i);
    expect_slope(prior_rows(moved(view, size * ViewStep::Unit(i)), prior, c_arm, deviation),
                 prior_rows(moved(view, -size * ViewStep::Unit(i)), prior, c_arm, deviation), size,
                 rows.by_step.col(i));
  }
  for (int i = 0; i < 3; ++i)
    expect_slope(prior_rows(view, prior, c_arm, deviation + 0.1 * CArmDeviation::Unit(i)),
                 prior_rows(view, prior, c_arm, deviation - 0.1 * CArmDeviation::Unit(i)), 0.1,
                 rows.by_c_arm.col(i));
}

/// Least sum of squares over the C-arm's deviation, its own prior included.
double least_squares_of(const std::vector<PriorRows>& views) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double chi2 = 0;
  for (const PriorRows& rows : views) {
    information += rows.by_c_arm.transpose() * rows.by_c_arm;
    gradient += rows.by_c_arm.transpose() * rows.residuals;
    chi2 += rows.residuals.squaredNorm();
  }
  return chi2 - gradient.dot(information.inverse() * gradient);
}

TEST(PriorRows, CommonVariationOfTwoViewsCountsOnce) {
  geometry::IntrinsicsPrior prior{6200, std::nullopt, 4};
  prior.skew.reset();
  const double first = (6100 - 6200) / 4.0;
  const PriorRows rows = prior_rows(centred(example, centre), prior,
                                    {IntrinsicsVariation{10, 2}, std::nullopt}, CArmDeviation::Zero());
  // Both deviate by the same amount: one common cause.
  EXPECT_NEAR(least_squares_of({rows, rows}), first * first / (100 + 4.0 / 2), 1e-9);
}

TEST(PriorRows, MirroredViewReversesTheVariation) {
  geometry::View plain = example, mirrored = example;
  plain.intrinsics.fx = 6000;
  plain.intrinsics.u0 = 512 + 30;
  mirrored.intrinsics.u0 = 512 - 30;
  plain.intrinsics.v0 = mirrored.intrinsics.v0 = 512;
  geometry::IntrinsicsPrior prior{std::nullopt, Eigen::Vector2d(512, 512), 4};
  prior.skew.reset();
  const CArmPrior c_arm{std::nullopt, IntrinsicsVariation{7, 4}};
  const auto rows_of = [&](const geometry::View& view) {
    return prior_rows(centred(view, centre), prior, c_arm, CArmDeviation::Zero());
  };
  EXPECT_NEAR(least_squares_of({rows_of(plain), rows_of(mirrored)}), 7.5 * 7.5 / (49 + 16.0 / 2), 1e-9);
}

}  // namespace
}  // namespace helicarm::calibration
