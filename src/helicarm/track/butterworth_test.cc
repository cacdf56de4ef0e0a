// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/butterworth.h"

#include <cmath>

#include <gtest/gtest.h>

namespace helicarm::track {
namespace butterworth_test {

using Places = std::vector<std::optional<Eigen::Vector3d>>;
constexpr double rate = 100;

Places sine(double hz, std::size_t count = 400) {
  Places places;
  for (std::size_t i = 0; i < count; ++i)
    places.push_back(Eigen::Vector3d(std::sin(2 * EIGEN_PI * hz * double(i) / rate), 0, 5));
  return places;
}

/// About the middle of the sequence, in phase with the input.
double amplitude(const Places& places, double hz) {
  double sum = 0;
  for (std::size_t i = 100; i < 300; ++i)
    sum += places[i]->x() * std::sin(2 * EIGEN_PI * hz * double(i) / rate) / 100;
  return sum;
}

TEST(Butterworth, CutOffLeavesTheRootOfHalfInPhase) {
  for (const int order : {2, 4})
    for (const double hz : {2.0, 6.0, 10.0})
      EXPECT_NEAR(amplitude(butterworth_filtered(sine(hz), rate, {hz, order}), hz), std::sqrt(0.5), 1e-3)
          << order << " " << hz;
}

TEST(Butterworth, HigherOrderIsSteeper) {
  EXPECT_GT(amplitude(butterworth_filtered(sine(2), rate, {6, 4}), 2),
            amplitude(butterworth_filtered(sine(2), rate, {6, 2}), 2));
  EXPECT_LT(amplitude(butterworth_filtered(sine(20), rate, {6, 4}), 20),
            amplitude(butterworth_filtered(sine(20), rate, {6, 2}), 20));
}

TEST(Butterworth, StraightMotionStaysToItsEnds) {
  Places places;
  for (int i = 0; i < 200; ++i) places.push_back(Eigen::Vector3d(0.3 * i, -2, 0.1 * i));
  const Places smooth = butterworth_filtered(places, rate, {6, 4});
  for (std::size_t i = 0; i < places.size(); ++i) EXPECT_LT((*smooth[i] - *places[i]).norm(), 1e-3) << i;
}

TEST(Butterworth, RunsBetweenGapsAreFilteredByThemselves) {
  Places places = sine(3, 60);
  for (std::size_t i = 20; i < 25; ++i) places[i].reset();
  places[26].reset();
  const Places smooth = butterworth_filtered(places, rate, {6, 4}),
               first = butterworth_filtered({places.begin(), places.begin() + 20}, rate, {6, 4});
  EXPECT_FALSE(smooth[22]);
  EXPECT_EQ(*smooth[25], *places[25]);  // alone
  for (std::size_t i = 0; i < 20; ++i) EXPECT_EQ(*smooth[i], *first[i]);
}

}  // namespace butterworth_test
}  // namespace helicarm::track
