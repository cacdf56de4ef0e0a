// SPDX-License-Identifier: Apache-2.0
#include "studies/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::study {
namespace {

std::vector<double> heavy_tailed(std::size_t count) {
  RandomStream random(1, 1);
  std::vector<double> values;
  while (values.size() < count) values.push_back(std::abs(random.normal() / random.normal()));
  return values;
}

TEST(ColumnStatistics, AgreeWithASortedColumn) {
  for (const std::size_t n : {1u, 2u, 99u, 100u, 1000u, 4321u}) {
    const std::vector<double> values = heavy_tailed(n);
    std::vector<double> sorted = values;
    std::ranges::sort(sorted);
    const auto quantile = [&](double share) {
      const double at = share * double(n - 1);
      const auto below = std::size_t(at);
      return below + 1 < n ? std::lerp(sorted[below], sorted[below + 1], at - double(below)) : sorted[below];
    };
    const std::size_t cut = n / 100;
    const double trimmed =
        std::accumulate(sorted.begin() + std::ptrdiff_t(cut), sorted.end() - std::ptrdiff_t(cut), 0.0) /
        double(n - 2 * cut);
    const ColumnStatistics s = column_statistics(values);
    EXPECT_NEAR(s.mean, std::accumulate(sorted.begin(), sorted.end(), 0.0) / double(n), 1e-12 * s.mean);
    EXPECT_NEAR(s.median, quantile(0.5), 1e-14 * s.median);
    EXPECT_NEAR(s.p99, quantile(0.99), 1e-14 * s.p99);
    EXPECT_NEAR(s.trimmed, trimmed, 1e-12 * trimmed);
    EXPECT_EQ(s.left_out, 0);
  }
}

TEST(ColumnStatistics, StandardErrorsAgreeWithTheNormalDistribution) {
  RandomStream random(2, 1);
  std::vector<double> values(20000);
  for (double& value : values) value = 10 + random.normal();
  const ColumnStatistics s = column_statistics(values);
  EXPECT_NEAR(s.se, 1 / std::sqrt(20000.0), 1e-4);
  EXPECT_NEAR(s.median_se / s.se, std::sqrt(std::acos(-1.0) / 2), 0.15);
}

TEST(ColumnStatistics, RanksValuesOfAnySizeAndTies) {
  EXPECT_EQ(column_statistics(std::vector{0.0, 1e-300, 1.0, 1e300, 1e12}).median, 1.0);
  const ColumnStatistics same = column_statistics(std::vector<double>(300, 0.25));
  EXPECT_EQ(same.median, 0.25);
  EXPECT_EQ(same.trimmed, 0.25);
  EXPECT_EQ(same.se, 0);
  std::vector<double> ties(300, 1.0);
  std::fill(ties.begin(), ties.begin() + 5, 0.0);  // 3 are cut, 2 count
  EXPECT_NEAR(column_statistics(ties).trimmed, 292.0 / 294, 1e-15);
}

TEST(ColumnStatistics, NonFiniteValuesAreCountedAndLeftOut) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(),
                   inf = std::numeric_limits<double>::infinity();
  const ColumnStatistics s = column_statistics(std::vector{1.0, nan, 2.0, inf, 3.0});
  EXPECT_EQ(s.left_out, 2);
  EXPECT_EQ(s.median, 2);
  EXPECT_EQ(s.mean, 2);
  const ColumnStatistics none = column_statistics(std::vector{nan, inf});
  EXPECT_EQ(none.left_out, 2);
  EXPECT_TRUE(std::isnan(none.median));
}

TEST(Correlation, IsOneForALineAndMinusOneForItsMirror) {
  const std::vector a{1.0, 2.0, 3.0, 5.0}, b{2.0, 4.0, 6.0, 10.0}, c{-1.0, -2.0, -3.0, -5.0};
  EXPECT_NEAR(pearson(a, b), 1, 1e-15);
  EXPECT_NEAR(pearson(a, c), -1, 1e-15);
}

TEST(Correlation, SpearmanUsesOnlyTheOrderAndSharesTies) {
  EXPECT_NEAR(spearman(std::vector{1.0, 2.0, 3.0, 4.0}, std::vector{1.0, 10.0, 100.0, 1e6}), 1, 1e-15);
  // Ranks 1 2.5 2.5 4 against 1 2 3 4.
  EXPECT_NEAR(spearman(std::vector{1.0, 2.0, 2.0, 9.0}, std::vector{1.0, 2.0, 3.0, 4.0}),
              4.5 / std::sqrt(4.5 * 5), 1e-15);
}

}  // namespace
}  // namespace helicarm::study
