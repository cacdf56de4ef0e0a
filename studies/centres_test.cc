// SPDX-License-Identifier: Apache-2.0
#include "studies/centres.h"

#include <cmath>

#include <gtest/gtest.h>

#include "studies/ball_scene.h"

namespace helicarm::study {
namespace {

double bound_of(Companion companion, double quanta) {
  const BallScene scene = ball_scene(2.5, companion, 2, 3, 0);
  simulation::Imaging imaging;
  imaging.quanta_per_pixel = quanta;
  imaging.electronic_noise = 0;
  imaging.logarithmic = true;
  return centre_bound_px(scene, scene.tiles[1], simulation::illuminate(scene.signal(), imaging), imaging, 3);
}

TEST(CentreBound, ScalesWithTheInverseRootOfTheQuanta) {
  const double bound = bound_of(Companion::none, 1000);
  EXPECT_GT(bound, 0.005);
  EXPECT_LT(bound, 0.05);
  EXPECT_NEAR(bound_of(Companion::none, 4000), bound / 2, 1e-4 * bound);
}

TEST(CentreBound, IsLargerBesideAnotherBall) {
  EXPECT_GT(bound_of(Companion::ball, 1000), 1.05 * bound_of(Companion::none, 1000));
}

TEST(StudyCentres, BytesDoNotDependOnThreads) {
  const CentreOptions options{10, 5, {"as it is"}, 3};
  const auto rows_by = [&](unsigned threads) {
    EngineOptions engine;
    engine.threads = threads;
    return study_centres(options, engine, Ranks()).value();
  };
  const std::vector<CentreRow> rows = rows_by(1);
  const StudyFiles files = files_of(rows, options), by_two = files_of(rows_by(2), options);
  EXPECT_EQ(files.csv, by_two.csv);
  EXPECT_EQ(files.svg, by_two.svg);
  EXPECT_EQ(files.svg.find("nan"), std::string::npos);
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].balls, 14);
  EXPECT_EQ(rows[0].refused, 0);
  EXPECT_LT(rows[0].ratio(), 2);
  EXPECT_LT(rows[0].z, 2);
}

TEST(StudyCentres, MeasuresWholeViews) {
  const CentreOptions options{1, 5, {"cone before a knee"}, 2};
  const std::vector<CentreRow> rows = study_centres(options, {}, Ranks()).value();
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_GT(rows[0].balls + rows[1].balls, 20);
  EXPECT_GT(rows[1].balls, 0);
  EXPECT_LT(rows[0].rms_px, 0.1);
  EXPECT_TRUE(std::isnan(rows[0].bound_px));
}

}  // namespace
}  // namespace helicarm::study
