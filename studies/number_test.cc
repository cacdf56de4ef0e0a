// SPDX-License-Identifier: Apache-2.0
#include "studies/number.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "studies/biplane.h"
#include "studies/calibration_study.h"
#include "studies/design.h"
#include "studies/location.h"
#include "studies/uniformity_study.h"

namespace helicarm::study {
namespace {

const Ranks by_itself;

std::vector<NumberRow> rows_of(const NumberOptions& options, unsigned threads = 2) {
  EngineOptions engine;
  engine.threads = threads;
  return study_number(options, engine, by_itself).value();
}

const NumberRow& row(const std::vector<NumberRow>& rows, int balls, SigmaReading sigma, PixelReading reading,
                     GroupError error) {
  for (const NumberRow& r : rows)
    if (r.balls == balls && r.sigma == sigma && r.reading == reading && r.error == error) return r;
  throw std::out_of_range("no such row");
}

TEST(StudyNumber, AgreesWithKnownMedians) {
  NumberOptions options;
  options.balls = {6, 12, 20};
  const auto rows = rows_of(options);
  const struct {
    int balls;
    SigmaReading sigma;
    PixelReading reading;
    GroupError error;
    double median;
  } known[]{{6, SigmaReading::std, PixelReading::calibration_pixels, GroupError::fre, 0.0998},
            {12, SigmaReading::std, PixelReading::calibration_pixels, GroupError::fre, 0.336},
            {20, SigmaReading::std, PixelReading::calibration_pixels, GroupError::fre, 0.394},
            {12, SigmaReading::std, PixelReading::fresh_noise, GroupError::fre, 0.556},
            {20, SigmaReading::std, PixelReading::fresh_noise, GroupError::fre, 0.522}};
  for (const auto& k : known) {
    const ColumnStatistics& s = row(rows, k.balls, k.sigma, k.reading, k.error).of_groups;
    EXPECT_NEAR(s.median, k.median, 3 * s.median_se) << k.balls;
    EXPECT_LT(s.median_se, 0.012 * s.median);
    EXPECT_EQ(s.left_out, 0);
  }
}

TEST(StudyNumber, TreFallsWithTheNumberOfBallsInEveryReading) {
  NumberOptions options;
  options.groups = 1000;
  options.balls = {6, 9, 12, 20};
  const auto rows = rows_of(options);
  for (const SigmaReading sigma : sigma_readings)
    for (const PixelReading reading : {PixelReading::fresh_noise, PixelReading::exact})
      for (const GroupError error : {GroupError::tre_ball, GroupError::tre_cone, GroupError::tre_centre}) {
        double last = 1e9;
        for (const int balls : options.balls) {
          const double median = row(rows, balls, sigma, reading, error).of_groups.median;
          EXPECT_LT(median, last);
          last = median;
        }
      }
}

TEST(StudyNumber, OmittedSettingsDoNotChangeOthers) {
  NumberOptions all;
  all.groups = 300;
  all.balls = {6, 12};
  NumberOptions one = all;
  one.balls = {12};
  one.sigmas = {SigmaReading::rms_distance};
  one.readings = {PixelReading::fresh_noise};
  const auto rows = rows_of(all), few = rows_of(one);
  ASSERT_EQ(few.size(), 5u);
  for (const NumberRow& r : few)
    EXPECT_EQ(r.of_groups.mean, row(rows, 12, r.sigma, r.reading, r.error).of_groups.mean);
}

TEST(StudyNumber, BytesDoNotDependOnThreads) {
  NumberOptions options;
  options.groups = 1001;
  options.balls = {6, 13};
  const StudyFiles one = files_of(rows_of(options, 1), options),
                   three = files_of(rows_of(options, 3), options);
  EXPECT_EQ(one.csv, three.csv);
  EXPECT_EQ(one.json, three.json);
  EXPECT_EQ(one.svg, three.svg);
  EXPECT_THAT(one.csv, ::testing::StartsWith("n,sigma,reading,error,mean,median,trimmed,p99,se\n"
                                             "6,std,calibration_pixels,fre,"));
}

TEST(StudyNumber, NoNoiseGivesNoError) {
  NumberOptions options;
  options.groups = 200;
  options.balls = {12};
  options.fle = 0;
  for (const NumberRow& r : rows_of(options)) EXPECT_LT(r.of_groups.median, 1e-7);
}

TEST(StudyNumber, RefusesTooFewBallsDuplicatesAndNoGroups) {
  NumberOptions options;
  options.balls = {12, 5};
  EXPECT_EQ(study_number(options, {}, by_itself).error().reason, Reason::bad_value);
  options.balls = {12, 8, 12};
  EXPECT_EQ(study_number(options, {}, by_itself).error().reason, Reason::bad_value);
  options.balls = {12};
  options.groups = 0;
  EXPECT_EQ(study_number(options, {}, by_itself).error().reason, Reason::bad_value);
}

TEST(StudyNumber, FilesOfASingleNumberAreWritten) {
  NumberOptions options;
  options.groups = 1;
  options.balls = {12};
  const StudyFiles files = files_of(rows_of(options), options);
  EXPECT_THAT(files.svg, ::testing::StartsWith("<svg"));
  EXPECT_EQ(files.svg.find("nan"), std::string::npos);
  EXPECT_EQ(files.csv.find("nan"), std::string::npos);
}

TEST(StudyUniformity, UniformityCorrelatesWithSmallErrors) {
  UniformityOptions options;
  options.groups = 150;
  options.draws = 20;
  EngineOptions one, three;
  one.threads = 1;
  three.threads = 3;
  const StudyFiles files = files_of(study_uniformity(options, one, by_itself).value(), options);
  EXPECT_EQ(files.csv, files_of(study_uniformity(options, three, by_itself).value(), options).csv);
  for (const Json& entry : files.json["correlations"]) {
    const std::string tre = entry["tre"];
    if (tre.starts_with("mean_tre_ball")) {
      EXPECT_GT(entry["spearman"], 0.5) << tre;
    }
  }
  options.balls = 5;
  EXPECT_EQ(study_uniformity(options, one, by_itself).error().reason, Reason::bad_value);
}

TEST(StudyLocation, TreIncreasesWithTheDistanceFromTheBalls) {
  LocationOptions options;
  options.groups = 203;
  options.step_mm = 50;
  EngineOptions one, three;
  one.threads = 1;
  three.threads = 3;
  const LocationMap map = study_location(options, one, by_itself).value();
  EXPECT_EQ(files_of(map, options).csv,
            files_of(study_location(options, three, by_itself).value(), options).csv);
  ASSERT_EQ(map.side, 7);
  ASSERT_EQ(map.points.size(), 98u);
  const LocationPoint &middle = map.points[24], &corner = map.points[48];
  EXPECT_LT((middle.place - map.centre).norm(), 1e-9);
  EXPECT_LT(middle.tre_exact, middle.tre_fresh);
  EXPECT_GT(corner.tre_fresh, 2 * middle.tre_fresh);
  EXPECT_GT(middle.se_fresh, 0);
  EXPECT_EQ(middle.seen_in, SeenIn::both);
  EXPECT_EQ(corner.seen_in, SeenIn::none);
  const StudyFiles files = files_of(map, options);
  const Json& seen = files.json["seen_in"];
  EXPECT_EQ(int(seen["none"]) + int(seen["AP"]) + int(seen["LAT"]) + int(seen["both"]), 98);
  EXPECT_EQ(seen["both"], std::ranges::count(map.points, SeenIn::both, &LocationPoint::seen_in));
  EXPECT_THAT(files.csv, ::testing::HasSubstr(",seen_in\n"));
  EXPECT_THAT(files.svg, ::testing::HasSubstr("outside the lateral image"));
  options.balls = {{0, 0, 0}};
  EXPECT_EQ(study_location(options, one, by_itself).error().reason, Reason::bad_value);
}

TEST(StudyBiplane, HasTheOrderOfTable1) {
  BiplaneOptions options;
  options.groups = 30;
  EngineOptions one, three;
  one.threads = 1;
  three.threads = 3;
  const auto rows = study_biplane(options, one, by_itself).value();
  EXPECT_EQ(files_of(rows, options).csv,
            files_of(study_biplane(options, three, by_itself).value(), options).csv);
  const auto mean = [&](std::string_view calibrator, std::string_view points, std::string_view measure) {
    for (const BiplaneRow& r : rows)
      if (r.calibrator == calibrator && r.points == points && r.measure == measure) return r.figures.mean;
    throw std::out_of_range("no such row");
  };
  for (const char* points : {"centre", "on_udcsc"})
    EXPECT_LT(3 * mean("udcsc", points, "intersection"), mean("biplane", points, "intersection"));
  EXPECT_LT(3 * mean("biplane", "on_biplane", "ray"), mean("udcsc", "on_biplane", "intersection"));
  EXPECT_LT(mean("biplane", "on_biplane", "ray"), mean("udcsc", "on_biplane", "ray"));
  for (const BiplaneRow& r : rows) {
    EXPECT_LT(r.figures.min, r.figures.mean);
    EXPECT_LT(r.figures.rms, r.figures.max);
  }
  options.far_plate_mm = options.near_plate_mm;
  EXPECT_EQ(study_biplane(options, one, by_itself).error().reason, Reason::bad_value);
}

TEST(StudyDesign, HasLessTreThanUdcscAndRandomSetsUnderTheRules) {
  DesignOptions options;
  options.groups = 300;
  options.restarts = 2;
  options.steps = 300;
  EngineOptions one, three;
  one.threads = 1;
  three.threads = 3;
  const DesignAnswer answer = study_design(options, one, by_itself).value();
  EXPECT_TRUE(answer.design.keeps_rules);
  EXPECT_EQ(answer.design.calibrator.balls.size(), 12u);
  EXPECT_LT(answer.design.tre_mm, 0.95 * answer.udcsc.tre_mm);
  EXPECT_LT(answer.design.tre_mm, answer.median_random_mm);
  const StudyFiles files = files_of(answer, options);
  EXPECT_EQ(files.csv, files_of(study_design(options, three, by_itself).value(), options).csv);
  EXPECT_TRUE(phantom::calibrator_from_json(files.json["calibrator"], "design"));
  options.balls = 5;
  EXPECT_EQ(study_design(options, one, by_itself).error().reason, Reason::bad_value);
}

TEST(StudyCalibration, MeasuresSimulatedImagesByBothMethods) {
  CalibrationStudyOptions options;
  options.groups = 2;
  options.size_px = 512;
  options.folder = std::filesystem::path(::testing::TempDir()) / "study_calibration";
  EngineOptions engine, by_two;
  engine.threads = 1;
  by_two.threads = 2;
  const auto tests = study_calibration(options, engine, by_itself).value();
  ASSERT_EQ(tests.size(), 2u);
  EXPECT_EQ(files_of(tests, options).csv,
            files_of(study_calibration(options, by_two, by_itself).value(), options).csv);
  EXPECT_EQ(tests[0].best.refused, 0);
  EXPECT_GE(tests[0].best.balls, 10);
  for (const double error : tests[0].best.targets) EXPECT_LT(error, 0.3);
  EXPECT_LT(tests[0].best.fre_mean, tests[0].paper.fre_mean);
  EXPECT_TRUE(std::filesystem::is_empty(options.folder));
  std::filesystem::remove_all(options.folder);
  options.groups = 0;
  EXPECT_EQ(study_calibration(options, engine, by_itself).error().reason, Reason::bad_value);
}

TEST(StudyCalibration, RefusedTestsAreCountedAndLeftOut) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const CalibrationTest good{0, 12, 0.2, 0.4, 0.1, 0.25, {0.1, 0.2, 0.3, 0.4, nan}};
  const CalibrationTest none{1, 0, nan, nan, nan, nan, {nan, nan, nan, nan, nan}};
  const StudyFiles files = files_of({{7, none, good}, {8, none, none}}, {});
  EXPECT_EQ(files.json["refused"]["paper"], 2);
  EXPECT_EQ(files.json["refused"]["best"], 1);
  EXPECT_NEAR(files.json["rows"][1]["best_mm"]["mean"], 0.1, 1e-15);
  EXPECT_NEAR(files.json["rows"][2]["best_mm"]["mean"], (12 * 0.2 + 0.9) / 15, 1e-15);
  EXPECT_EQ(files.csv.find("nan"), std::string::npos);
  EXPECT_EQ(files.svg.find("nan"), std::string::npos);
}

}  // namespace
}  // namespace helicarm::study
