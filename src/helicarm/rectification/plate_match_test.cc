// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/plate_match.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::rectification {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr double px_per_mm = 2;
const Vector2d middle(255.5, 255.5);

/// Pixels of all the plate's dots, the plate rotated or mirrored by `way`.
std::vector<detection::Dot> image(const phantom::Plate& plate, const Matrix2d& way = Matrix2d::Identity()) {
  std::vector<detection::Dot> dots;
  for (const Vector2d& place : plate.dots_mm) {
    detection::Dot dot;
    dot.centre_px = middle + px_per_mm * (way * place);
    dots.push_back(dot);
  }
  return dots;
}

Expected<std::vector<PlateDot>> match(const std::vector<detection::Dot>& dots, const phantom::Plate& plate) {
  return match_plate(index_lattice(dots, plate.lattice, {}), dots, plate, middle);
}

/// Largest distance (px) of a dot from its plate position without rotation and mirroring.
double worst(const std::vector<PlateDot>& matched, const std::vector<detection::Dot>& dots) {
  double most = 0;
  for (const PlateDot& d : matched)
    most = std::max(most, (dots[d.dot].centre_px - middle - px_per_mm * d.place_mm).norm());
  return most;
}

/// Without any symmetry: the corner and a few other dots are missing.
phantom::Plate lopsided() {
  phantom::Plate plate = phantom::plate48();
  plate.name = "lopsided";
  std::erase_if(plate.dots_mm, [](const Vector2d& p) { return p.x() > 60 && p.y() < -20; });
  std::erase_if(plate.dots_mm, [](const Vector2d& p) { return p == Vector2d(-75, 75); });
  return plate;
}

phantom::Plate hexagonal() {
  phantom::Plate plate = phantom::plate48();
  plate.name = "hexagonal";
  plate.lattice = phantom::Lattice::hexagonal;
  plate.dots_mm.clear();
  for (int j = -4; j <= 4; ++j)
    for (int i = -6; i <= 6; ++i)
      if (const Vector2d p = 20 * lattice_point({i, j}, phantom::Lattice::hexagonal);
          p.norm() < 85 && p.norm() > 1)
        plate.dots_mm.push_back(p);
  plate.pitch_mm = 20;
  return plate;
}

TEST(MatchPlate, SymmetricPlateTakesThePlacementNearestToRaw) {
  for (const double mirror : {1.0, -1.0})
    for (int quarter = 0; quarter < 4; ++quarter) {
      Matrix2d way = Eigen::Rotation2Dd(quarter * M_PI / 2).toRotationMatrix();
      way.col(0) *= mirror;
      const auto dots = image(phantom::plate48(), way);
      const auto matched = match(dots, phantom::plate48());
      ASSERT_TRUE(matched);
      EXPECT_EQ(matched->size(), 48u);
      EXPECT_LT(worst(*matched, dots), 1e-6) << quarter << " " << mirror;
    }
}

TEST(MatchPlate, AsymmetricPlateDeterminesItsPlacement) {
  const phantom::Plate plate = lopsided();
  for (const double mirror : {1.0, -1.0})
    for (int quarter = 0; quarter < 4; ++quarter) {
      Matrix2d way = Eigen::Rotation2Dd(quarter * M_PI / 2).toRotationMatrix();
      way.col(0) *= mirror;
      const auto dots = image(plate, way);
      const auto matched = match(dots, plate);
      ASSERT_TRUE(matched);
      EXPECT_EQ(matched->size(), plate.dots_mm.size());
      for (const PlateDot& d : *matched) EXPECT_LT((d.place_mm - plate.dots_mm[d.dot]).norm(), 1e-9);
    }
}

TEST(MatchPlate, ExtraDotAtTheMissingCentreShiftsNothing) {
  auto dots = image(phantom::plate48());
  detection::Dot stray;
  stray.centre_px = middle;
  dots.push_back(stray);
  const auto matched = match(dots, phantom::plate48());
  ASSERT_TRUE(matched);
  EXPECT_EQ(matched->size(), 48u);
  EXPECT_LT(worst(*matched, dots), 1e-6);
}

TEST(MatchPlate, MissingDotsShiftNothing) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    RandomStream random(seed, 1);
    auto dots = image(phantom::plate48());
    std::erase_if(dots, [&](const detection::Dot&) { return random.uniform() < 0.3; });
    const auto matched = match(dots, phantom::plate48());
    ASSERT_TRUE(matched) << seed;
    EXPECT_GE(matched->size(), dots.size() - 2) << seed;
    EXPECT_LT(worst(*matched, dots), 1e-6) << seed;
  }
}

TEST(MatchPlate, PartlyVisiblePlateIsPlacedByItsMissingCentre) {
  // The three columns on the right are outside the image, the missing centre is inside.
  auto dots = image(phantom::plate48());
  std::erase_if(dots, [](const detection::Dot& dot) { return dot.centre_px.x() > middle.x() + 60; });
  const auto matched = match(dots, phantom::plate48());
  ASSERT_TRUE(matched);
  EXPECT_LT(worst(*matched, dots), 1e-6);
}

TEST(MatchPlate, HexagonalPlate) {
  const phantom::Plate plate = hexagonal();
  for (int sixth = 0; sixth < 6; ++sixth) {
    const auto dots = image(plate, Eigen::Rotation2Dd(sixth * M_PI / 3).toRotationMatrix());
    const auto matched = match(dots, plate);
    ASSERT_TRUE(matched);
    EXPECT_EQ(matched->size(), plate.dots_mm.size());
    EXPECT_LT(worst(*matched, dots), 1e-6) << sixth;
  }
}

TEST(MatchPlate, RotatedCoordinatesInTheFileGiveTheSamePlacement) {
  phantom::Plate turned = lopsided();
  for (Vector2d& place : turned.dots_mm) place = Eigen::Rotation2Dd(0.2) * place + Vector2d(40, -10);
  const auto dots = image(turned);
  const auto matched = match(dots, turned);
  ASSERT_TRUE(matched);
  EXPECT_EQ(matched->size(), turned.dots_mm.size());
  for (const PlateDot& d : *matched) EXPECT_EQ(d.place_mm, turned.dots_mm[d.dot]);
}

TEST(MatchPlate, UnboundedLatticeKeepsTheIndices) {
  phantom::Plate endless = phantom::plate48();
  const auto dots = image(endless);
  endless.dots_mm.clear();
  const auto matched = match(dots, endless);
  ASSERT_TRUE(matched);
  ASSERT_EQ(matched->size(), 48u);
  const Vector2d gap = (*matched)[0].place_mm - (*matched)[47].place_mm;
  const Vector2d seen = (dots[(*matched)[0].dot].centre_px - dots[(*matched)[47].dot].centre_px) / px_per_mm;
  EXPECT_LT((gap - seen).norm(), 1e-6);
}

TEST(MatchPlate, DotsAtPositionsWithoutPlateDotAreRefused) {
  phantom::Plate small = phantom::plate48();
  std::erase_if(small.dots_mm, [](const Vector2d& p) { return p.cwiseAbs().maxCoeff() > 30; });
  const auto matched = match(image(phantom::plate48()), small);
  ASSERT_FALSE(matched);
  EXPECT_EQ(matched.error().reason, Reason::plate_mismatch);
  EXPECT_EQ(matched.error().figures.at("indexed"), 48);
}

}  // namespace
}  // namespace helicarm::rectification
