// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/contour.h"

#include <gtest/gtest.h>

#include "helicarm/registration/surface_scene_test.h"
#include "helicarm/registration/thickness.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;

constexpr double drawn_mm = 14;

Surface ball_of(double radius_mm) {
  return *prepare_surface(surface_of_balls({{Vector3d(0, 0, 0), radius_mm}}), "ball");
}

/// The image of a ball at the origin, 0.5 mm pixels; left of column `hidden` nothing is usable.
Raster raster_of_ball(int hidden) {
  const Model ball = *model_from("ball", surface_of_balls({{Vector3d(0, 0, 0), drawn_mm}}));
  Raster raster = attenuation_raster(image_of(filled_volume(ball), {}, view_from(0), "AP", 1));
  for (int v = 0; v < raster.valid.height(); ++v)
    for (int u = 0; u < hidden; ++u) raster.valid(u, v) = 0;
  return raster;
}

ViewObservation compared(const Raster& raster, double radius_mm, double inward_px = 0) {
  return compare_contour(raster, view_from(0), ball_of(radius_mm), {}, Vector3d::Zero(), {5, 1, inward_px});
}

TEST(CompareContour, WhatIsHiddenDoesNotCount) {
  const ViewObservation whole = compared(raster_of_ball(0), drawn_mm),
                        part = compared(raster_of_ball(65), drawn_mm);
  EXPECT_LT(part.comparisons.size(), 0.8 * double(whole.comparisons.size()));
  EXPECT_NEAR(part.score, whole.score, 0.05);
}

TEST(CompareContour, LessThanHalfOfTheContourCountsAsLess) {
  const double whole = compared(raster_of_ball(0), drawn_mm).score;
  EXPECT_LT(compared(raster_of_ball(98), drawn_mm).score, 0.7 * whole);
}

TEST(CompareContour, AgreementIsAboutTheCommonOffset) {
  const Raster raster = raster_of_ball(0);
  constexpr double grown_mm = drawn_mm + 1;
  EXPECT_LT(compared(raster, grown_mm).score, 0.6);
  const ViewObservation about = compared(raster, grown_mm, 4);
  EXPECT_GT(about.score, 0.85);
  double left = 0, information = 0;
  for (const Comparison& each : about.comparisons)
    left += each.gradient[edge_offset], information += each.information(edge_offset, edge_offset);
  EXPECT_NEAR(left / information, 0, 0.1);
}

TEST(CompareContour, ACommonOffsetIsLimitedAndInwards) {
  const Raster raster = raster_of_ball(0);
  EXPECT_LT(compared(raster, drawn_mm + 2, 1).score, 0.6);
  EXPECT_NEAR(compared(raster, drawn_mm - 1, 4).score, compared(raster, drawn_mm - 1).score, 0.02);
}

/// Two balls of 14 mm beside each other along the ray, one 2 mm further left in the image: two lines there.
Surface two_balls() {
  const auto apart = [](const Vector3d& p) {
    return std::min((p - Vector3d(0, -15, 0)).norm(), (p - Vector3d(2, 15, 0)).norm()) - drawn_mm;
  };
  return *prepare_surface(phantom::surface_of(apart, {Vector3d(-18, -33, -18), Vector3d(20, 33, 18)}, 0.8),
                          "balls");
}

TEST(Thickness, IsTheWayThroughABody) {
  const Raster raster = raster_of_ball(0);
  const Surface ball = ball_of(drawn_mm);
  const Thickness thickness(ball, view_from(0), {}, raster);
  const auto through = [&](double x) {
    return thickness.at(raster.raster_at(view_from(0).project(Vector3d(x, 0, 0))));
  };
  EXPECT_NEAR(through(0), 2 * drawn_mm, 0.1);
  EXPECT_NEAR(through(10), 2 * std::sqrt(drawn_mm * drawn_mm - 100), 0.2);
  EXPECT_EQ(through(16), 0);
  EXPECT_EQ(through(1000), 0);
}

TEST(CompareContour, TheEdgeOfARoundBodyIsExpectedInsideItsContour) {
  const Raster raster = raster_of_ball(0);
  const auto common = [&](double inward_px) {
    double left = 0, information = 0;
    for (const Comparison& each : compared(raster, drawn_mm, inward_px).comparisons)
      left += each.gradient[edge_offset], information += each.information(edge_offset, edge_offset);
    return left / information;
  };
  EXPECT_LT(std::abs(common(1)), 0.1);
}

TEST(CompareContour, LinesBesideEachOtherAreExpectedWhereTheBodyThickens) {
  const Surface balls = two_balls();
  const Model drawn = *model_from("balls", balls.mesh);
  const Raster raster = attenuation_raster(image_of(filled_volume(drawn), {}, view_from(0), "AP", 1));
  const auto mean_square = [&](double inward_px) {
    return compare_contour(raster, view_from(0), balls, {}, Vector3d::Zero(), {5, 1, inward_px}).residual_px;
  };
  EXPECT_LT(mean_square(1), 0.7 * mean_square(0));
}

TEST(CompareContour, BesideACutTheContourDoesNotCount) {
  const Raster raster = raster_of_ball(0);
  const Surface ball = ball_of(drawn_mm);
  const std::vector<Vector3d> cuts = {{0, 0, drawn_mm}};
  const auto whole = compare_contour(raster, view_from(0), ball, {}, Vector3d::Zero(), {5, 1, 0});
  const auto part = compare_contour(raster, view_from(0), ball, {}, Vector3d::Zero(), {5, 1, 0}, cuts);
  EXPECT_LT(part.comparisons.size(), whole.comparisons.size());
  EXPECT_NEAR(part.score, whole.score, 0.05);
  const Eigen::Vector2d cut = view_from(0).project(cuts[0]);
  for (const Comparison& each : part.comparisons) EXPECT_GT((each.pixel - cut).norm(), 3.5);
}

}  // namespace
}  // namespace helicarm::registration
