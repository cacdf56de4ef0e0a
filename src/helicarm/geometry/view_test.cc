// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/view.h"

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {
namespace {

/// Points (mm), pose and intrinsics, and the pixels computed by OpenCV 4.6.0: cv2.projectPoints(points, (0.4,
/// -1.1, 0.3), (12, -34.5, 803.25), [[fx, 0, 498.25], [0, 4298.75, 531.5], [0, 0, 1]], None).
struct Projected {
  Eigen::Vector3d point;
  Eigen::Vector2d upright, mirrored;  ///< fx = 4321.5, -4321.5
};
const Projected by_opencv[] = {
    {{51.106, 29.506, 2.083}, {596.7256359495324, 494.9050118593246}, {399.7743640504676, 494.9050118593246}},
    {{17.057, -29.544, 70.836},
     {371.5548161027383, 59.655000117069335},
     {624.9451838972617, 59.655000117069335}},
    {{-12.5, 40.25, 33.125}, {301.617970375994, 456.00127311579035}, {694.882029624006, 456.00127311579035}},
    {{0, 0, 0}, {562.8102240896359, 346.86647992530345}, {433.6897759103641, 346.86647992530345}}};

View view_with(double fx) {
  return {{fx, 4298.75, 498.25, 531.5, 0}, {rotation_from_vector({0.4, -1.1, 0.3}), {12, -34.5, 803.25}}};
}

TEST(View, ProjectionAgreesWithOpenCv) {
  for (const Projected& expected : by_opencv) {
    EXPECT_LT((view_with(4321.5).project(expected.point) - expected.upright).norm(), 1e-10);
    EXPECT_LT((view_with(-4321.5).project(expected.point) - expected.mirrored).norm(), 1e-10);
  }
}

TEST(View, MatrixProjectionAgreesWithOpenCv) {
  const Projection projection = view_with(4321.5).projection();
  for (const Projected& expected : by_opencv) {
    const Eigen::Vector3d p = projection * expected.point.homogeneous();
    EXPECT_LT((p.hnormalized() - expected.upright).norm(), 1e-10);
  }
}

/// cv2.Rodrigues((0.4, -1.1, 0.3)), OpenCV 4.6.0.
TEST(RotationFromVector, AgreesWithOpenCv) {
  Eigen::Matrix3d expected;
  expected << 0.42533334289299746, -0.4266500216635599, -0.7981612032903829,  //
      0.03764489992958889, 0.8894871813255765, -0.455406868379005,            //
      0.9042535092178294, 0.16365302707852672, 0.39438975366415885;
  EXPECT_LT((rotation_from_vector({0.4, -1.1, 0.3}) - expected).norm(), 1e-14);
}

}  // namespace
}  // namespace helicarm::geometry
