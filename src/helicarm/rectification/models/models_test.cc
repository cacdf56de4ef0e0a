// SPDX-License-Identifier: Apache-2.0
// What every distortion model does: these tests run for each line of `model_kinds`.
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/rectification/fit_map.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;

constexpr int side = 512;

/// n x n dots, 400 px wide, displaced by up to 6 px of pincushion and 2 px of S distortion about the image
/// centre.
std::vector<Correspondence> bent_plate(int n, double noise_px, std::uint64_t seed = 1) {
  RandomStream random(seed, 4);
  std::vector<Correspondence> dots;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const Vector2d t = Vector2d(2.0 * i, 2.0 * j) / (n - 1) - Vector2d::Ones();
      const Vector2d bend = t.squaredNorm() * (3 * t + Vector2d(-t.y(), t.x()));
      const Vector2d noise(random.normal(), random.normal());
      dots.push_back({100 * t, Vector2d(255.5, 255.5) + 200 * t + bend + noise_px * noise, 0.05});
    }
  return dots;
}

MapOptions of_model(std::string_view name) {
  MapOptions options;
  options.model = name;
  return options;
}

class EveryModel : public testing::TestWithParam<ModelKind> {
 protected:
  MapFit fitted() const {
    return fit_map(bent_plate(7, 0.05), side, side, of_model(GetParam().name)).value();
  }
};

TEST_P(EveryModel, JacobianAgreesWithDifferences) {
  const DistortionMap map = fitted().map;
  const double h = 1e-3;
  for (const Vector2d& at : {Vector2d(255, 260), Vector2d(80, 411.5), Vector2d(402.25, 99)})
    for (const int axis : {0, 1}) {
      const Vector2d step = h * Vector2d::Unit(axis);
      const Vector2d numeric =
          (map.raw_from_rectified(at + step) - map.raw_from_rectified(at - step)) / (2 * h);
      EXPECT_LT((map.jacobian(at).col(axis) - numeric).norm(), 1e-7);
    }
}

TEST_P(EveryModel, RoundTripIsExact) {
  const DistortionMap map = fitted().map;
  for (int v = 60; v < side - 40; v += 36)
    for (int u = 60; u < side - 40; u += 36) {
      const auto rectified = map.rectified_from_raw({u, v});
      ASSERT_TRUE(rectified);
      EXPECT_LT((map.raw_from_rectified(*rectified) - Vector2d(u, v)).norm(), 1e-9);
    }
  EXPECT_FALSE(map.rectified_from_raw({1e5, -3e5}));
}

TEST_P(EveryModel, PredictsPlacesBetweenTheDots) {
  const MapFit fit = fitted();
  double squares = 0;
  const auto exact = bent_plate(12, 0);
  for (const Correspondence& dot : exact)
    squares +=
        (fit.map.raw_from_rectified(fit.rectified_from_plate * dot.place_mm) - dot.raw_px).squaredNorm();
  EXPECT_LT(std::sqrt(squares / double(exact.size())), 0.06);
}

TEST_P(EveryModel, CovarianceIsSymmetricAndNotNegative) {
  const std::vector<Vector2d> places{{100, 120}, {110, 120}, {400, 300}};
  const DistortionMap map = fitted().map;
  const Eigen::MatrixXd covariance = map.covariance_px2(places);
  EXPECT_TRUE(covariance.isApprox(covariance.transpose(), 1e-9));
  for (int i = 0; i < 3; ++i) {
    EXPECT_GT(covariance(i, i), 0);
    EXPECT_NEAR(std::sqrt(covariance(i, i)), map.sigma_px(places[std::size_t(i)]), 1e-12);
  }
}

TEST_P(EveryModel, JsonKeepsEveryBit) {
  const DistortionMap map = fitted().map;
  const auto back = distortion_map_from_json(Json::parse(to_json(map).dump()), "map.json");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(to_json(*back), to_json(map));
  EXPECT_EQ(back->raw_from_rectified({77, 99}), map.raw_from_rectified({77, 99}));
  EXPECT_EQ(back->sigma_px({77, 99}), map.sigma_px({77, 99}));
}

TEST_P(EveryModel, InconsistentJsonIsRefused) {
  const Json sound = to_json(fitted().map);
  for (const char* key : {"coefficients", "covariance"}) {
    Json json = sound;
    json[key].erase(0);
    const auto map = distortion_map_from_json(json, "map.json");
    EXPECT_FALSE(map) << key;
  }
}

TEST_P(EveryModel, DotsOnOneLineAreRefused) {
  std::vector<Correspondence> line = bent_plate(12, 0);
  line.resize(12);
  EXPECT_EQ(fit_map(line, side, side, of_model(GetParam().name)).error().reason, Reason::plate_not_found);
}

INSTANTIATE_TEST_SUITE_P(, EveryModel, testing::ValuesIn(model_kinds().begin(), model_kinds().end()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(FitMap, UnknownModelIsRefused) {
  EXPECT_EQ(fit_map(bent_plate(7, 0), side, side, of_model("spline")).error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::rectification
