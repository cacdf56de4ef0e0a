// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/prominent_points.h"

#include <chrono>

#include <gtest/gtest.h>

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/registration/flat_cut.h"
#include "helicarm/registration/surface_scene_test.h"

namespace helicarm::registration {
namespace prominent_points_test {

using Eigen::Vector3d;
using phantom::TriangleMesh;

TriangleMesh ellipsoid(const Vector3d& radii, double step_mm) {
  const auto distance = [&](const Vector3d& p) {  // zero at the surface, about mm beside it
    const double k = p.cwiseQuotient(radii).norm();
    return (k - 1) * radii.minCoeff();
  };
  const Vector3d corner = radii.array() + 3 * step_mm;
  return phantom::surface_of(distance, {Vector3d(-corner), corner}, step_mm);
}

/// A shaft along x, 100 mm long, of 10 mm radius with round ends, and balls of 7 mm on its side.
const std::vector<Vector3d> knobs{{-30, 14, 0}, {25, 0, 15}, {30, -14, -3}};
TriangleMesh bone_with_knobs(double step_mm) {
  const auto distance = [](const Vector3d& p) {
    const double along = std::clamp(p.x(), -50.0, 50.0);
    double least = (p - Vector3d(along, 0, 0)).norm() - 10;
    for (const Vector3d& knob : knobs) least = std::min(least, (p - knob).norm() - 7);
    return least;
  };
  return phantom::surface_of(distance, {Vector3d(-64, -25, -25), Vector3d(64, 25, 26)}, step_mm);
}

TriangleMesh moved_by(const geometry::RigidTransform& motion, TriangleMesh mesh) {
  for (Vector3d& corner : mesh.corners) corner = motion * corner;
  return mesh;
}

double distance_to(const std::vector<ProminentPoint>& points, const Vector3d& place) {
  double least = 1e9;
  for (const ProminentPoint& point : points) least = std::min(least, (point.place - place).norm());
  return least;
}

TEST(ProminentPoints, TheTipsOfAnEllipsoidAreOnItsLongAxis) {
  for (const Vector3d& radii : {Vector3d(50, 25, 25), Vector3d(22, 48, 28)}) {
    const auto points = prominent_points(ellipsoid(radii, 1.2));
    ASSERT_EQ(points.size(), 2U);
    Eigen::Index axis = 0;
    const double longest = radii.maxCoeff(&axis);
    for (const double side : {-1, 1})
      EXPECT_LT(distance_to(points, side * longest * Vector3d::Unit(axis)), 2.5) << side;
  }
}

TEST(ProminentPoints, OfABallNothingStandsOut) {
  EXPECT_TRUE(prominent_points(ellipsoid({30, 30, 30}, 1.2)).empty());
}

TEST(ProminentPoints, ProminenceFollowsTheMeanCurvature) {
  // Share of a Gaussian of deviation s above a paraboloid of mean curvature H: s H / sqrt(2 pi); s 4 and 8
  // mm.
  const auto points = prominent_points(ellipsoid({150, 90, 90}, 3));
  ASSERT_EQ(points.size(), 2U);
  const double curvature = 150 / (90.0 * 90);
  for (const ProminentPoint& point : points) EXPECT_NEAR(point.prominence, 0.4 * 6 * curvature, 0.005);
}

TEST(ProminentPoints, KnobsOfABoneAreFound) {
  const auto points = prominent_points(bone_with_knobs(0.8));
  ASSERT_GE(points.size(), 3U);
  const std::vector<ProminentPoint> first(points.begin(), points.begin() + 3);
  for (const Vector3d& knob : knobs) {
    const Vector3d tip = knob + 7 * Vector3d(0, knob.y(), knob.z()).normalized();
    EXPECT_LT(distance_to(first, tip), 4) << knob.transpose();
  }
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) EXPECT_GE((points[i].place - points[k].place).norm(), 20 - 1e-9);
}

TEST(ProminentPoints, TheThirdLiesBesideTheLineOfTheFirstTwo) {
  const auto points = prominent_points(bone_with_knobs(0.8));
  ASSERT_GE(points.size(), 3U);
  const Vector3d along = (points[1].place - points[0].place).normalized();
  EXPECT_GT((points[2].place - points[0].place).cross(along).norm(), 5);
}

TEST(ProminentPoints, TheyMoveWithTheBody) {
  const TriangleMesh mesh = bone_with_knobs(0.8);
  const auto begun = std::chrono::steady_clock::now();
  const auto points = prominent_points(mesh);
  RecordProperty("triangles", std::to_string(mesh.triangles.size()));
  RecordProperty(
      "seconds",
      std::to_string(std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count()));
  const geometry::RigidTransform motion{
      Eigen::AngleAxisd(0.7, Vector3d(1, 2, -1).normalized()).toRotationMatrix(), {120, -40, 800}};
  const auto turned = prominent_points(moved_by(motion, mesh));
  ASSERT_GE(points.size(), 3U);
  ASSERT_EQ(turned.size(), points.size());
  for (const ProminentPoint& point : points) EXPECT_LT(distance_to(turned, motion * point.place), 2);
}

TEST(ProminentPoints, ASmallBodyHasTheSameOnesAsALargeOne) {
  TriangleMesh small = bone_with_knobs(0.8);
  for (Vector3d& corner : small.corners) corner *= 0.1;
  const auto points = prominent_points(small);
  ASSERT_GE(points.size(), 3U);
  for (const Vector3d& knob : knobs)
    EXPECT_LT(distance_to(points, 0.1 * (knob + 7 * Vector3d(0, knob.y(), knob.z()).normalized())), 0.4);
}

TEST(ProminentPoints, TheRimOfACutIsNoLandmark) {
  const auto distance = [](const Vector3d& p) {
    const double along = std::clamp(p.x(), -60.0, 30.0);
    return std::max((p - Vector3d(along, 0, 0)).norm() - 8, -20 - p.x());
  };
  const auto shaft = *prepare_surface(
      phantom::surface_of(distance, {Vector3d(-24, -14, -14), Vector3d(42, 14, 14)}, 0.6), "shaft");
  const auto at_rim = [](const ProminentPoint& point) { return point.place.x() < -12; };
  EXPECT_TRUE(std::ranges::any_of(prominent_points(shaft.mesh), at_rim));
  const auto points = prominent_points(shaft.mesh, flat_cut(shaft));
  EXPECT_TRUE(std::ranges::none_of(points, at_rim));
  EXPECT_LT(distance_to(points, {38, 0, 0}), 3);

  TriangleMesh open;  // without the flat end
  open.corners = shaft.mesh.corners;
  for (const auto& triangle : shaft.mesh.triangles)
    if (std::ranges::any_of(triangle, [&](auto corner) { return open.corners[corner].x() > -19.5; }))
      open.triangles.push_back(triangle);
  EXPECT_TRUE(std::ranges::none_of(prominent_points(open), at_rim));
}

TEST(ProminentPoints, CornersWithoutATriangleDoNotCount) {
  TriangleMesh mesh = bone_with_knobs(0.8);
  const auto points = prominent_points(mesh);
  mesh.corners.push_back({500, 0, 0});
  const auto same = prominent_points(mesh);
  ASSERT_EQ(same.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_EQ(same[i].place, points[i].place);
}

TEST(ProminentPoints, NothingHasNone) {
  EXPECT_TRUE(prominent_points({}).empty());
  TriangleMesh flat;
  flat.corners.assign(3, Vector3d::Zero());
  flat.triangles.push_back({0, 1, 2});
  EXPECT_TRUE(prominent_points(flat).empty());
  EXPECT_EQ(prominent_points(bone_with_knobs(1.5), {}, {.most = 2}).size(), 2U);
}

}  // namespace prominent_points_test
}  // namespace helicarm::registration
