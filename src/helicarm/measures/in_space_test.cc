// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/in_space.h"

#include <cmath>
#include <numbers>
#include <utility>

#include <gmock/gmock.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/measures/zones.h"

namespace helicarm::measures {
namespace in_space_test {

using Eigen::Vector3d;
using testing::HasSubstr;

const Eigen::Matrix3d half_mm = 0.25 * Eigen::Matrix3d::Identity();

/// A right femur, x lateral, y anterior, z proximal; the quadrants are 50 mm deep and 25 mm high.
std::vector<Landmark> femur() {
  return {{"axis_medial", {-45, -25, -20}, half_mm},
          {"axis_lateral", {5, -25, -20}, half_mm},
          {"blumensaat_posterior", {0, -20, 0}, half_mm},
          {"blumensaat_anterior", {-3, 20, 0}, half_mm},
          {"inferior", {8, 3, -25}, half_mm},
          {"posterior", {6, -25, -10}, half_mm},
          {"anterior", {7, 25, -4}, half_mm},
          {"FS", {-20, -12.5, -7}, half_mm}};
}

std::vector<Landmark> turned(std::vector<Landmark> landmarks, double seed) {
  const geometry::RigidTransform pose{geometry::rotation_from_euler(seed, 0.7 * seed, -seed), {5, 60, -9}};
  for (Landmark& each : landmarks) each.at = pose * each.at;
  return landmarks;
}

TEST(MeasureInSpace, QuadrantsAreThoseAlongTheCondylesAxisInAnyPose) {
  for (const double pose : {0.0, 0.8, 2.5}) {
    const auto measure = measure_in_space(Kind::femoral_quadrants, turned(femur(), pose));
    ASSERT_TRUE(measure) << measure.error().message;
    EXPECT_NEAR(measure->positions.at(0).percent[0], 25, 1e-9);
    EXPECT_NEAR(measure->positions[0].percent[1], 28, 1e-9);
    EXPECT_NEAR(measure->quantities.at(0).value, 50, 1e-9);
    EXPECT_EQ(measure->quantities[0].unit, "mm");
    EXPECT_FALSE(measure->depth_mm);
  }
}

Eigen::MatrixXd scatter_of(Kind kind, const std::vector<Landmark>& landmarks) {
  constexpr int trials = 4000;
  RandomStream random(5, 2);
  const Eigen::Index n = Eigen::Index(info_of(kind).components.size());
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(n);
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < trials; ++i) {
    std::vector<Landmark> drawn = landmarks;
    for (Landmark& each : drawn) {
      each.at += 0.5 * Vector3d(random.normal(), random.normal(), random.normal());
      each.covariance_mm2.setZero();  // the position alone is asked for
    }
    const Eigen::VectorXd percent = measure_in_space(kind, drawn)->positions[0].percent;
    sum += percent;
    squares += percent * percent.transpose();
  }
  return squares / trials - sum * sum.transpose() / trials / trials;
}

/// The point lies far off the width, in no plane of the axes.
const std::vector<Landmark> plateau{
    {"medial", {-35, 3, 1}, half_mm}, {"lateral", {35, 3, 1}, half_mm}, {"TS", {-14, -40, 60}, half_mm}};

TEST(MeasureInSpace, CovarianceIsThatOfDrawnLandmarks) {
  for (const auto& [kind, landmarks] :
       {std::pair(Kind::femoral_quadrants, femur()), std::pair(Kind::tibia_ml, plateau)}) {
    const Eigen::MatrixXd scatter = scatter_of(kind, landmarks);
    const Eigen::MatrixXd told = measure_in_space(kind, landmarks)->positions[0].covariance;
    for (Eigen::Index i = 0; i < scatter.rows(); ++i) EXPECT_NEAR(told(i, i) / scatter(i, i), 1, 0.1) << i;
  }
}

TEST(MeasureInSpace, ErrorsDoNotDependOnTheAxesOfTheCt) {
  for (const auto& [kind, landmarks] :
       {std::pair(Kind::femoral_quadrants, femur()), std::pair(Kind::tibia_ml, plateau)}) {
    const Measure as_given = *measure_in_space(kind, landmarks);
    for (const double seed : {0.4, 1.1, 2.5}) {
      const Measure elsewhere = *measure_in_space(kind, turned(landmarks, seed));
      EXPECT_TRUE(elsewhere.positions[0].covariance.isApprox(as_given.positions[0].covariance, 1e-6));
      EXPECT_NEAR(*elsewhere.quantities[0].sigma, *as_given.quantities[0].sigma, 1e-6);
    }
  }
}

TEST(MeasureInSpace, PositionIsOutsideByItsWholeError) {
  std::vector<Landmark> landmarks = femur();
  landmarks.back().at.z() = 0.6;  // 2.4 % above Blumensaat's line
  for (Landmark& each : landmarks) each.covariance_mm2.setZero();
  const auto exact = measure_in_space(Kind::femoral_quadrants, landmarks);
  EXPECT_EQ(exact->positions[0].warnings.size(), 1U);
  landmarks[1].covariance_mm2 = 9 * Eigen::Matrix3d::Identity();  // turns the image by a tenth of its length
  const Position position = measure_in_space(Kind::femoral_quadrants, landmarks)->positions[0];
  EXPECT_GT(1.96 * std::sqrt(position.covariance(1, 1)), 2.4);
  EXPECT_TRUE(position.warnings.empty());
}

TEST(MeasureInSpace, TheTibialPerCentAreAlongTheSagittalDiameter) {
  const std::vector<Landmark> tibia{{"axis_medial", {-35, 0, 0}, half_mm},
                                    {"axis_lateral", {35, 0, 0}, half_mm},
                                    {"anterior", {4, 20, 0}, half_mm},
                                    {"posterior", {-8, -30, 0}, half_mm},
                                    {"TS", {3, -1.15, 2}, half_mm}};
  EXPECT_NEAR(measure_in_space(Kind::tibia_ap, turned(tibia, 1.1))->positions[0].percent[0], 42.3, 1e-9);
  const std::vector<Landmark> width{
      {"medial", {-35, 3, 1}, half_mm}, {"lateral", {35, 3, 1}, half_mm}, {"TS", {0, -9, 20}, half_mm}};
  EXPECT_NEAR(measure_in_space(Kind::tibia_ml, width)->positions[0].percent[0], 50, 1e-9);
}

TEST(MeasureInSpace, WhatDoesNotDetermineItIsRefused) {
  auto landmarks = femur();
  landmarks.erase(landmarks.begin());
  EXPECT_THAT(measure_in_space(Kind::femoral_quadrants, landmarks).error().message,
              HasSubstr("\"axis_medial\""));
  landmarks = femur();
  landmarks[1].at = landmarks[0].at + Vector3d(3, 0, 0);
  EXPECT_THAT(measure_in_space(Kind::femoral_quadrants, landmarks).error().message, HasSubstr("3 mm apart"));
  EXPECT_THAT(measure_in_space(Kind::circle, femur()).error().message, HasSubstr("one image"));
  landmarks = femur();
  landmarks[3].at = landmarks[2].at + Vector3d(20, 0, 0);
  EXPECT_FALSE(measure_in_space(Kind::femoral_quadrants, landmarks));
}

TEST(Lateral, AngleAndDistanceOfTheCondylesTellAViewFromATrueLateralOne) {
  geometry::View view{{4000, 4000, 500, 500, 0}, {}};
  view.camera_from_world.translation = {0, 0, 900};  // looks along z
  const auto exact = lateral_of(view, {0, 0, -25}, {0, 0, 25});
  ASSERT_TRUE(exact);
  EXPECT_NEAR(exact->off_deg, 0, 1e-9);
  EXPECT_NEAR(exact->apart_mm, 0, 1e-9);
  const double turn = 10 * std::numbers::pi / 180;
  const Vector3d half = 25 * Vector3d(std::sin(turn), 0, std::cos(turn));
  const auto off = lateral_of(view, -half, half);
  EXPECT_NEAR(off->off_deg, 10, 1e-9);
  EXPECT_NEAR(off->apart_mm, 50 * std::sin(turn), 0.1);
}

TEST(Zones, TheUsualOnesHaveSourcesAndTellADistanceFromTheCentre) {
  const auto zones = zones_from(value_or_throw(parse_json(usual_zones_text(), "zones")), "zones");
  ASSERT_TRUE(zones) << zones.error().message;
  for (const Zone& zone : *zones) EXPECT_GT(zone.source.size(), 10U);
  Position position{"FS", Eigen::Vector2d(40, 28.5), Eigen::Matrix2d::Identity(), {}};
  const auto fits = zone_fits(Kind::femoral_quadrants, position, *zones);
  ASSERT_EQ(fits.size(), 2U);
  EXPECT_NEAR(*fits[0].from_centre[0], 15.2, 1e-9);
  EXPECT_NEAR(*fits[0].from_centre[1], 0, 1e-9);
  EXPECT_FALSE(fits[0].is_outside);
  EXPECT_TRUE(fits[1].is_outside);
  position.covariance *= 9;  // 40 % is not beyond 35 % by 1.96 standard deviations of 3 %
  EXPECT_FALSE(zone_fits(Kind::femoral_quadrants, position, *zones)[1].is_outside);
}

TEST(Zones, AFileThatIsNoneIsRefusedWithTheFieldsName) {
  const auto refusal = [](const char* text) {
    return zones_from(value_or_throw(parse_json(text, "z")), "z.json").error().message;
  };
  EXPECT_THAT(refusal(R"({"format": "helicarm-zones/2", "zones": []})"), HasSubstr("helicarm-zones/1"));
  EXPECT_THAT(
      refusal(R"({"format": "helicarm-zones/1", "zones": [{"kind": "circle", "name": "a", "source": "b"}]})"),
      HasSubstr("kind"));
  EXPECT_THAT(
      refusal(R"({"format": "helicarm-zones/1", "zones": [{"kind": "tibia_ap", "name": "a", "source": "b",
                          "from_anterior": {"low": 50, "high": 40}}]})"),
      HasSubstr("high"));
}

}  // namespace in_space_test
}  // namespace helicarm::measures
