// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/centred_view.h"

#include <gtest/gtest.h>

#include "helicarm/calibration/priors.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm {
namespace {

using Parameters = Eigen::Matrix<double, 10, 1>;

const View example{{-6000, 6200, 500, 530, 0}, {rotation_from_euler(0.3, -0.8, 2), {30, -20, 820}}};
const Eigen::Vector3d centre(5, 3, 40);

/// Parameters of a view near `example`, the rotation as a step from it.
Parameters parameters_of(const View& view) {
  const Intrinsics& k = view.intrinsics;
  Parameters p;
  p << k.fx, k.fy, k.u0, k.v0,
      vector_from_rotation(view.camera_from_world.rotation * example.camera_from_world.rotation.transpose()),
      view.camera_from_world.translation;
  return p;
}

View view_of(const Parameters& p) {
  return {{p(0), p(1), p(2), p(3), 0},
          {rotation_from_vector(p.segment<3>(4)) * example.camera_from_world.rotation, p.tail<3>()}};
}

const Parameters step_sizes =
    (Parameters() << 1e-4, 1e-4, 1e-2, 1e-2, 1e-5, 1e-5, 1e-5, 1e-7, 1e-5, 1e-5).finished();

TEST(CentredView, IsTheSameCamera) {
  const CentredView view = centred(example, centre);
  EXPECT_LT((uncentred(view).projection() - example.projection()).norm(), 1e-8);
  const Eigen::Vector3d point(-20, 40, 70);
  EXPECT_LT((picture_of(view, point).pixel - example.project(point)).norm(), 1e-10);
}

TEST(CentredView, PictureJacobianAgreesWithDifferences) {
  const CentredView view = centred(example, centre);
  const Eigen::Vector3d point(-20, 40, 70);
  const auto jacobian = picture_of(view, point).by_step;
  for (int i = 0; i < 10; ++i) {
    const ViewStep step = step_sizes(i) * ViewStep::Unit(i);
    const Eigen::Vector2d slope =
        (picture_of(moved(view, step), point).pixel - picture_of(moved(view, -step), point).pixel) /
        (2 * step_sizes(i));
    EXPECT_LT((slope - jacobian.col(i)).norm(), 1e-6 * (1 + jacobian.col(i).norm())) << i;
  }
}

TEST(CentredView, ParameterJacobianAgreesWithDifferences) {
  const CentredView view = centred(example, centre);
  const auto jacobian = parameters_by_step(view);
  for (int i = 0; i < 10; ++i) {
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
  for (int i = 0; i < 10; ++i) {
    const double size = i < 4 || i > 6 ? 1e-3 : 1e-6;
    const Parameters at = parameters_of(example), step = size * Parameters::Unit(i);
    const Eigen::Vector2d slope =
        (view_of(at + step).project(point) - view_of(at - step).project(point)) / (2 * size);
    EXPECT_LT((slope - jacobian.col(i)).norm(), 1e-5 * (1 + jacobian.col(i).norm())) << i;
  }
  const CentredView view = centred(example, centre);
  EXPECT_LT((jacobian * parameters_by_step(view) - picture_of(view, point).by_step).norm(), 1e-4);
}

TEST(PriorRows, JacobianAgreesWithDifferences) {
  View other = example;
  other.intrinsics = {6100, 6150, 515, 505, 0};
  const std::vector<CentredView> views{centred(example, centre), centred(other, centre)};
  const std::vector<IntrinsicsPrior> priors{
      {Belief{6000, 30}, Belief{1, 0.01}, PrincipalBelief{{512, 512}, 20}}, {}};
  const SpreadPrior spread{10, 15};
  const PriorRows rows = prior_rows(views, priors, spread);
  EXPECT_EQ(rows.independent, 4 + 3);
  for (int i = 0; i < 20; ++i) {
    const double size = step_sizes(i % 10);
    auto up = views, down = views;
    up[std::size_t(i / 10)] = moved(views[std::size_t(i / 10)], size * ViewStep::Unit(i % 10));
    down[std::size_t(i / 10)] = moved(views[std::size_t(i / 10)], -size * ViewStep::Unit(i % 10));
    const Eigen::VectorXd slope =
        (prior_rows(up, priors, spread).residuals - prior_rows(down, priors, spread).residuals) / (2 * size);
    EXPECT_LT((slope - rows.jacobian.col(i)).norm(), 1e-5 * (1 + rows.jacobian.col(i).norm())) << i;
  }
}

}  // namespace
}  // namespace helicarm
