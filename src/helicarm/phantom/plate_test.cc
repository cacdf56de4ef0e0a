// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/plate.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace helicarm::phantom {
namespace {

std::vector<Eigen::Vector2d> turned(const Plate& plate, double angle, const Eigen::Vector2d& shift) {
  std::vector<Eigen::Vector2d> dots;
  for (const auto& dot : plate.dots_mm) dots.push_back(Eigen::Rotation2Dd(angle) * dot + shift);
  return dots;
}

std::vector<Eigen::Vector2d> hexagonal_dots(double pitch, int reach) {
  std::vector<Eigen::Vector2d> dots;
  for (int i = -reach; i <= reach; ++i)
    for (int j = -reach; j <= reach; ++j)
      dots.push_back(pitch * lattice_steps(Lattice::hexagonal) * Eigen::Vector2d(i, j));
  return dots;
}

Reason plate_refusal(const Json& json) {
  const auto plate = plate_from_json(json, "p.json");
  EXPECT_FALSE(plate.has_value());
  return plate ? Reason::usage : plate.error().reason;
}

TEST(Plate48, HasSevenBySevenDotsWithoutTheCentre) {
  const Plate plate = plate48();
  EXPECT_EQ(plate.dots_mm.size(), 48u);
  for (const auto& dot : plate.dots_mm) EXPECT_GE(dot.norm(), 25.0);
  EXPECT_EQ(plate_named("plate48", "/nowhere")->dots_mm.size(), 48u);
}

TEST(ReadPlate, RoundTripKeepsThePlate) {
  const Json json = to_json(plate48());
  EXPECT_EQ(to_json(*plate_from_json(json, "p.json")), json);
}

TEST(ReadPlate, PitchHeightAndDotsMayBeNull) {
  Json json = to_json(plate48());
  json["pitch_mm"] = json["height_above_receiver_mm"] = json["dots_xy_mm"] = nullptr;
  const auto plate = plate_from_json(json, "p.json");
  ASSERT_TRUE(plate.has_value());
  EXPECT_FALSE(plate->pitch_mm || plate->height_above_receiver_mm);
  EXPECT_TRUE(plate->dots_mm.empty());
}

TEST(ReadPlate, BadFieldsAreRefused) {
  const auto with = [](const char* key, const Json& value) {
    Json json = to_json(plate48());
    json[key] = value;
    return json;
  };
  EXPECT_EQ(plate_refusal(with("sise", 1)), Reason::unknown_key);
  EXPECT_EQ(plate_refusal(with("kind", "cubes")), Reason::bad_value);
  EXPECT_EQ(plate_refusal(with("pitch_mm", 0.025)), Reason::bad_value);
  EXPECT_EQ(plate_refusal(with("pitch_mm", 24)), Reason::bad_value);
  EXPECT_EQ(plate_refusal(with("diameter_mm", 26)), Reason::bad_value);
  EXPECT_EQ(plate_refusal(with("lattice", "hexagonal")), Reason::bad_value);
  EXPECT_EQ(plate_refusal(with("dots_xy_mm", {{0, 0, 0}})), Reason::bad_value);
  EXPECT_EQ(plate_refusal(with("dots_xy_mm", {{0, 0}, {25, 0}, {0, 0}})), Reason::bad_value);
  EXPECT_EQ(plate_refusal(with("dots_xy_mm", {{0, 0}, {25, 0.3}, {50, 0}})), Reason::bad_value);
  EXPECT_EQ(plate_refusal(with("dots_xy_mm", Json::array())), Reason::bad_value);
}

TEST(LatticeMisfit, RotationAndShiftAreFree) {
  EXPECT_LT(*lattice_misfit(turned(plate48(), 0.37, {7.1, -3.3}), Lattice::square, 25, 0.1), 1e-9);
  EXPECT_LT(*lattice_misfit(hexagonal_dots(10, 8), Lattice::hexagonal, 10, 0.1), 1e-9);
}

TEST(LatticeMisfit, DisplacedDotIsDetected) {
  auto dots = turned(plate48(), -0.2, {1, 2});
  dots[11].x() += 0.5;
  EXPECT_FALSE(lattice_misfit(dots, Lattice::square, 25, 0.1));
  EXPECT_NEAR(*lattice_misfit(dots, Lattice::square, 25, 1), 0.5, 0.05);
}

TEST(LatticeMisfit, SparseDotsOfTheLatticeFit) {
  EXPECT_LT(*lattice_misfit({{0, 0}, {25, 50}, {-75, 25}, {100, -125}}, Lattice::square, 25, 0.1), 1e-9);
}

TEST(LatticeMisfit, TwentyThousandDotsFit) {
  EXPECT_LT(*lattice_misfit(hexagonal_dots(2, 70), Lattice::hexagonal, 2, 0.1), 1e-9);
}

}  // namespace
}  // namespace helicarm::phantom
