// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/map_field.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/rectification/fit_map.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;

constexpr int plate_side = 512;

/// Of a plate's dots with a cubic distortion of this strength, px at the edge.
DistortionMap map_of(double pincushion_px, double s_px) {
  std::vector<Correspondence> dots;
  const Vector2d middle = Vector2d::Constant((plate_side - 1) / 2.0);
  for (int i = -11; i <= 11; ++i)
    for (int j = -11; j <= 11; ++j) {
      const Vector2d mm(10.0 * i, 10.0 * j), t = mm / 110;
      const double r2 = t.squaredNorm();
      const Vector2d raw = middle + 2.2 * mm + pincushion_px * r2 * t + s_px * r2 * Vector2d(-t.y(), t.x());
      dots.push_back({mm, raw, 0.02});
    }
  return value_or_throw(fit_map(dots, plate_side, plate_side, {})).map;
}

double farthest(const DistortionMap& a, const DistortionMap& b, const MapField& field) {
  return (displacements(a, field) - displacements(b, field)).rowwise().norm().maxCoeff();
}

TEST(MapField, PassesThroughTheDisplacements) {
  const std::vector maps{map_of(6, 2)};
  const MapField field = field_of(maps, 300);
  const DistortionMap through = map_through(field, displacements(maps[0], field), {}, 1, maps[0]);
  EXPECT_LT(farthest(through, maps[0], field), 5e-3);
  EXPECT_EQ(through.sigma_px(field.normalised.centre), 0);
}

TEST(MapField, ErrorsHaveTheVariationsMeanSquareOverTheField) {
  const std::vector maps{map_of(6, 2)};
  const MapField field = field_of(maps, 200);
  MapVariation variation;
  variation.variance_px2[3] = 0.04;
  variation.rest_px2 = 0.01;
  const DistortionMap through = map_through(field, displacements(maps[0], field), variation, 2, maps[0]);
  const Eigen::MatrixXd covariance = through.covariance_px2(field.places);
  EXPECT_NEAR(covariance.diagonal().mean(), 2 * (4 * 0.04 + 0.01), 1e-6);
}

TEST(MapField, IsReadFromItsMapFile) {
  const std::vector maps{map_of(6, 2)};
  const MapField field = field_of(maps, 300);
  MapVariation variation;
  variation.variance_px2.fill(0.01);
  const DistortionMap through = map_through(field, displacements(maps[0], field), variation, 1, maps[0]);
  const DistortionMap read = value_or_throw(distortion_map_from_json(to_json(through), "map.json"));
  const Vector2d at(400, 120);
  EXPECT_EQ(read.raw_from_rectified(at), through.raw_from_rectified(at));
  EXPECT_EQ(read.sigma_px(at), through.sigma_px(at));
}

TEST(MapField, WithoutCovarianceAMapIsTakenAsExact) {
  const DistortionMap map = map_of(6, 2), exact = without_covariance(map);
  const Vector2d at(400, 120);
  EXPECT_GT(map.sigma_px(at), 0);
  EXPECT_EQ(exact.raw_from_rectified(at), map.raw_from_rectified(at));
  EXPECT_LT(to_json(exact).dump().size(), to_json(map).dump().size() / 2);
}

TEST(MapField, PolynomialsAreOrthonormalOverIt) {
  const std::vector maps{map_of(6, 2)};
  const MapField field = field_of(maps, 200);
  const Eigen::MatrixXd values = field.polynomials();
  const Eigen::MatrixXd products = values.transpose() * values / double(values.rows());
  EXPECT_LT((products - Eigen::MatrixXd::Identity(products.rows(), products.cols())).norm(), 1e-8);
}

}  // namespace
}  // namespace helicarm::rectification
