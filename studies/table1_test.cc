// SPDX-License-Identifier: Apache-2.0
#include <filesystem>

#include <gtest/gtest.h>

#include "studies/biplane.h"
#include "studies/biplane_images.h"
#include "studies/calibration_study.h"

namespace helicarm::study {
namespace {

double error_at_centre(const BiplaneOptions& options) {
  const std::vector<BiplaneRow> rows = study_biplane(options, {}, Ranks()).value();
  for (const BiplaneRow& row : rows)
    if (row.calibrator == "biplane" && row.points == "centre") return row.figures.mean;
  return 0;
}

TEST(StudyBiplane, TrackerAndBallsMoveTheErrorFarFromThePlates) {
  BiplaneOptions options;
  options.groups = 64;
  const double usual = error_at_centre(options);
  options.tracker_sigma_deg = 0.6;
  EXPECT_GT(error_at_centre(options), 1.3 * usual);
  options = {};
  options.groups = 64;
  options.balls = 32;
  EXPECT_LT(error_at_centre(options), usual);
}

TEST(StudyBiplane, BallsThatFillNoLatticeAndLengthsOutOfOrderAreRefused) {
  for (const int balls : {6, 9, 14, 64}) {
    const auto refused = study_biplane({.balls = balls}, {}, Ranks());
    ASSERT_FALSE(refused) << balls;
    EXPECT_EQ(refused.error().reason, Reason::bad_value);
  }
  EXPECT_FALSE(study_biplane({.far_plate_mm = 800}, {}, Ranks()));
  EXPECT_FALSE(study_biplane({.tracker_sigma_mm = -1}, {}, Ranks()));
}

TEST(StudyCalibration, ToleranceOfTheBallsAppearsInTheTable) {
  CalibrationStudyOptions options{.groups = 1, .size_px = 512, .folder = testing::TempDir()};
  const auto ideal = study_calibration(options, {}, Ranks()).value().front();
  options.tolerance_mm = 0.3;
  options.click_sigma_px = 0.5;
  const auto bench = study_calibration(options, {}, Ranks()).value().front();
  EXPECT_EQ(ideal.case_seed, bench.case_seed);
  EXPECT_GT(bench.best.fre_mean, 3 * ideal.best.fre_mean);
  for (const double error : bench.best.targets) EXPECT_TRUE(error > 0 && error < 3) << error;
}

TEST(StudyBiplaneImages, ReceiverCalibratorIsFoundAndTracked) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "biplane_images";
  std::filesystem::create_directories(folder);
  BiplaneImagesOptions options{.groups = 1, .size_px = 512, .folder = folder};
  options.tracker_sigma_mm = options.tracker_sigma_deg = 0;
  const auto exact = study_biplane_images(options, {}, Ranks()).value().front();
  ASSERT_EQ(exact.best.refused, 0);
  EXPECT_EQ(exact.best.on_udcsc.n, 16);
  EXPECT_LT(exact.best.fre.mean, 0.1);
  EXPECT_TRUE(std::filesystem::exists(folder / kept_biplane_case / "case.json"));
  options.tracker_sigma_deg = 0.5;
  const auto turned = study_biplane_images(options, {}, Ranks()).value().front();
  EXPECT_GT(turned.best.on_udcsc.mean, 2 * exact.best.on_udcsc.mean);
  EXPECT_NEAR(turned.best.fre.mean, exact.best.fre.mean, 1e-6);  // the balls' own rays know no tracker
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace helicarm::study
