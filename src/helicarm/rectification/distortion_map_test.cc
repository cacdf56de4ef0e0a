// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/distortion_map.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/rectification/models/kriging.h"
#include "helicarm/rectification/models/monomials.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;

/// About 15 px of pincushion at the edge of a 512 px image, a quadratic part and three kernels.
Trend curved_trend() {
  Trend trend;
  trend.order = 3;
  trend.terms.normalised = {{250, 260}, 250};
  Eigen::MatrixX2d& coefficients = trend.terms.coefficients;
  coefficients = Eigen::MatrixX2d::Zero(13, 2);
  coefficients.topRows(4) << 251, 258, 249, 3, -3, 249, 1, -0.5;
  coefficients.middleRows(6, 4) << 7, 0, 0, 7, 7, 0, 0, 7;
  coefficients.bottomRows(3) << 0.8, -0.3, 0.2, 0.9, -0.7, 0.4;
  trend.terms.covariance = 1e-4 * Eigen::MatrixXd::Identity(13, 13);
  trend.knots.resize(3, 2);
  trend.knots << 0.1, 0.2, -0.6, 0.3, 0.5, -0.5;
  trend.length = 0.3;
  return trend;
}

DistortionMap map_of(const Trend& trend) {
  DistortionMap map;
  map.model = std::make_shared<KrigingModel>(trend);
  map.residual_rms_px = 0.03;
  map.residual_max_px = 0.1;
  map.held_out_rms_px = 0.05;
  map.hull_low = {10, 12};
  map.hull_high = {500, 505};
  map.rectified_pixel_mm = 0.459;
  map.rectified_plane = RectifiedPlane::detector;
  map.width = 512;
  map.height = 512;
  return map;
}

DistortionMap curved_map() { return map_of(curved_trend()); }

TEST(Monomials, AreOrderedByDegreeInFallingPowersOfX) {
  const Eigen::VectorXd terms = monomials({2, 3}, 3);
  const Eigen::VectorXd expected = (Eigen::VectorXd(10) << 1, 2, 3, 4, 6, 9, 8, 12, 18, 27).finished();
  EXPECT_TRUE(terms.isApprox(expected, 1e-15)) << terms.transpose();
}

TEST(Monomials, SlopesAgreeWithDifferences) {
  const Vector2d t(0.37, -0.61);
  const double h = 1e-5;
  for (int order = 1; order <= 7; ++order)
    for (int axis = 0; axis < 2; ++axis) {
      const Vector2d step = h * Vector2d::Unit(axis);
      const Eigen::VectorXd numeric = (monomials(t + step, order) - monomials(t - step, order)) / (2 * h);
      EXPECT_LT((monomial_slopes(t, order).col(axis) - numeric).norm(), 1e-8) << order;
    }
}

TEST(DistortionMap, RawToRectifiedRoundTripIsExact) {
  const DistortionMap map = curved_map();
  RandomStream random(1, 1);
  for (int k = 0; k < 500; ++k) {
    const Vector2d raw(random.uniform(0, 511), random.uniform(0, 511));
    const auto rectified = map.rectified_from_raw(raw);
    ASSERT_TRUE(rectified) << raw.transpose();
    EXPECT_LT((map.raw_from_rectified(*rectified) - raw).norm(), 1e-9);
  }
}

TEST(DistortionMap, JacobianAgreesWithDifferences) {
  const DistortionMap map = curved_map();
  const double h = 1e-3;
  for (const Vector2d& place : {Vector2d(250, 260), Vector2d(30, 470), Vector2d(411.5, 77.25)})
    for (int axis = 0; axis < 2; ++axis) {
      const Vector2d step = h * Vector2d::Unit(axis);
      const Vector2d numeric =
          (map.raw_from_rectified(place + step) - map.raw_from_rectified(place - step)) / (2 * h);
      EXPECT_LT((map.jacobian(place).col(axis) - numeric).norm(), 1e-8);
    }
}

TEST(DistortionMap, PointFarOutsideThePlateHasNoRectifiedPosition) {
  EXPECT_FALSE(curved_map().rectified_from_raw({1e4, -3e4}));
}

TEST(DistortionMap, SigmaIsTheQuadraticFormOfTheTerms) {
  Trend trend = curved_trend();
  const Vector2d t = trend.terms.normalised({100, 300});
  double squares = monomials(t, 3).squaredNorm();
  for (int k = 0; k < 3; ++k)
    squares += std::pow(kernel((t - trend.knots.row(k).transpose()).squaredNorm(), 0.3), 2);
  EXPECT_NEAR(map_of(trend).sigma_px({100, 300}), 1e-2 * std::sqrt(squares), 1e-12);
  trend.terms.covariance.resize(0, 0);
  EXPECT_EQ(map_of(trend).sigma_px({100, 300}), 0);
}

TEST(DistortionMap, PointsOutsideTheImageAreNotMapped) {
  const DistortionMap map = curved_map();
  for (const Vector2d& raw : {Vector2d(-0.4, 100), Vector2d(511.4, 511.4), Vector2d(300, 200)}) {
    const auto there = rectified_in_image(map, raw);
    ASSERT_TRUE(there);
    const auto back = raw_in_image(map, *there);
    ASSERT_TRUE(back);
    EXPECT_LT((*back - raw).norm(), 1e-9);
  }
  for (const Vector2d& off : {Vector2d(-0.6, 100), Vector2d(100, 511.6), Vector2d(-300, 5000)})
    EXPECT_FALSE(rectified_in_image(map, off));
  EXPECT_FALSE(raw_in_image(map, {530, 530}));
  EXPECT_FALSE(raw_in_image(map, {1e6, -1e6}));
  Trend trend = curved_trend();  // x beyond its fold maps back into the image
  trend.terms.coefficients(3, 0) = -100;
  const DistortionMap folded = map_of(trend);
  const Vector2d beyond = Vector2d(250, 260) + 250 * Vector2d(2, 0);
  ASSERT_TRUE(folded.shows(folded.raw_from_rectified(beyond)));
  EXPECT_FALSE(raw_in_image(folded, beyond));
}

TEST(IdentityMap, LeavesPointsUnchanged) {
  const DistortionMap map = identity_map(640, 480, 0.2);
  EXPECT_TRUE(map.is_identity());
  EXPECT_EQ(map.raw_from_rectified({3.5, 7}), Vector2d(3.5, 7));
  EXPECT_EQ(*map.rectified_from_raw({-900, 7}), Vector2d(-900, 7));
  EXPECT_EQ(map.jacobian({1, 2}), Eigen::Matrix2d::Identity());
  EXPECT_EQ(map.sigma_px({1, 2}), 0);
  EXPECT_EQ(map.hull_high, Vector2d(639, 479));
  EXPECT_EQ(map.rectified_plane, RectifiedPlane::detector);
  EXPECT_FALSE(identity_map(640, 480, {}).rectified_plane);
}

TEST(DistortionMapJson, RoundTripKeepsEveryBit) {
  for (const DistortionMap& map : {curved_map(), identity_map(640, 480, 0.2), identity_map(640, 480, {})}) {
    const Json json = to_json(map);
    const auto back = distortion_map_from_json(Json::parse(json.dump()), "map.json");
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(to_json(*back), json);
    EXPECT_EQ(back->raw_from_rectified({77, 99}), map.raw_from_rectified({77, 99}));
  }
}

TEST(DistortionMapJson, InconsistentFieldsAreRefused) {
  const Json sound = to_json(curved_map());
  const auto refused = [&](const char* key, Json value) {
    Json json = sound;
    json[key] = std::move(value);
    const auto map = distortion_map_from_json(json, "map.json");
    return map ? "accepted" : std::string(code(map.error().reason));
  };
  EXPECT_EQ(refused("order", 4), "bad_value");
  EXPECT_EQ(refused("order", 12), "bad_value");
  EXPECT_EQ(refused("weights", Json::array({{1, 2}})), "bad_value");
  EXPECT_EQ(refused("kernel_length", 0), "bad_value");
  EXPECT_EQ(refused("scale", 0), "bad_value");
  EXPECT_EQ(refused("image_size", {0, 512}), "bad_value");
  EXPECT_EQ(refused("format", "helicarm-map/2"), "bad_value");
  EXPECT_EQ(refused("rectified_plane", "wall"), "bad_value");
  EXPECT_EQ(refused("surplus", 1), "unknown_key");
  EXPECT_EQ(refused("kind", "no such model"), "bad_value");
  EXPECT_NE(refused("covariance", Json::array({Json::array({1.0})})), "accepted");
  EXPECT_NE(refused("coefficients", "none"), "accepted");
}

}  // namespace
}  // namespace helicarm::rectification
