// SPDX-License-Identifier: Apache-2.0
#include "studies/limit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"
#include "studies/cramer_rao.h"

namespace helicarm::study {
namespace {

using Eigen::Vector3d;

const std::vector<geometry::View> views{
    {{6000, 6000, 512, 512, 0}, {geometry::rotation_from_euler(0, 0, 0), {0, 0, 800}}},
    {{6000, 6000, 512, 512, 0}, {geometry::rotation_from_euler(std::numbers::pi / 2, 0, 0), {0, 0, 800}}}};

std::vector<Vector3d> balls() {
  std::vector<Vector3d> places;
  for (int k = 0; k < 12; ++k) {
    const double t = k * std::numbers::pi / 2;
    places.push_back({(50 - t) * std::cos(t), (50 - t) * std::sin(t), 4 * t - 35});
  }
  return places;
}

PriorInformation known() {
  return {1e-6 * Eigen::Matrix2d::Identity(), 1e-6 * Eigen::Matrix2d::Identity(), 1e-6, 1e-6};
}

double bound(double ball_sigma, double point_sigma, const PriorInformation& prior) {
  return std::sqrt(least_covariance(views, balls(), {5, 10, -3}, ball_sigma, point_sigma, prior).trace());
}

TEST(LeastCovariance, ExactViewsLeaveOnlyThePixelError) {
  // Two views share one axis; each other axis is observed in one view only.
  const auto covariance = least_covariance(views, balls(), {0, 0, 0}, 1e-4, 0.5, known());
  EXPECT_NEAR(std::sqrt(covariance.trace()), 0.5 * 800 / 6000 * std::sqrt(2.5), 1e-3 * 0.1);
}

TEST(LeastCovariance, GrowsWithTheNoise) { EXPECT_NEAR(bound(1, 1, {}), 2 * bound(0.5, 0.5, {}), 1e-6); }

TEST(LeastCovariance, PriorsNeverIncreaseTheBound) {
  PriorInformation wide{100 * Eigen::Matrix2d::Identity(), 100 * Eigen::Matrix2d::Identity(), 1e-3, 1e-3};
  EXPECT_LT(bound(0.5, 1e-3, wide), bound(0.5, 1e-3, {}));
  EXPECT_LT(bound(0.5, 1e-3, known()), bound(0.5, 1e-3, wide));
}

StudyFiles few_trials(std::size_t trials, std::uint64_t seed, unsigned threads) {
  const LimitOptions options{trials, seed, {8}};
  EngineOptions engine;
  engine.threads = threads;
  return files_of(study_limit(options, engine, Ranks()).value(), options);
}

TEST(StudyLimit, BytesDoNotDependOnThreads) {
  const StudyFiles one = few_trials(52, 7, 1);
  const StudyFiles three = few_trials(52, 7, 3);
  EXPECT_EQ(one.csv, three.csv);
  EXPECT_EQ(one.svg, three.svg);
  EXPECT_EQ(one.summary, three.summary);
}

TEST(StudyLimit, SeedsDiffer) { EXPECT_NE(few_trials(1, 7, 1).csv, few_trials(1, 8, 1).csv); }

TEST(StudyLimit, SummaryHasOneLineForEachModel) {
  std::vector<LimitRow> rows;
  for (const char* model : {"free", "known"})
    for (const double sigma : {0.1, 1.0}) {
      LimitRow row{12, sigma, model, "centre", true};
      row.trials = 100;
      row.failures = sigma > 0.5 ? 3 : 0;
      row.bound_mm = 1;
      row.error_mm = 1 + 0.1 * sigma;
      row.coverage = 0.95;
      rows.push_back(row);
    }
  const StudyFiles files = files_of(rows, {});
  EXPECT_EQ(std::count(files.summary.begin(), files.summary.end(), '\n'), 3);
  EXPECT_NE(files.summary.find("1.01 to 1.10"), std::string::npos) << files.summary;
  EXPECT_EQ(files.json.at("rows").size(), rows.size());
  EXPECT_EQ(files.svg.find("nan"), std::string::npos);
}

}  // namespace
}  // namespace helicarm::study
