// SPDX-License-Identifier: Apache-2.0
#include "helicarm/study/centres.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/study/ball_scene.h"

namespace helicarm {
namespace {

double bound_of(Companion companion, double quanta) {
  const BallScene scene = ball_scene(2.5, companion, 2, 3, 0);
  simulation::Imaging imaging;
  imaging.quanta_per_pixel = quanta;
  imaging.electronic_noise = 0;
  imaging.logarithmic = true;
  return centre_bound_px(scene, scene.tiles[1], simulation::illuminate(scene.signal(), imaging), imaging, 3);
}

TEST(CentreBound, FallsWithTheRootOfTheQuanta) {
  const double bound = bound_of(Companion::none, 1000);
  EXPECT_GT(bound, 0.005);
  EXPECT_LT(bound, 0.05);
  EXPECT_NEAR(bound_of(Companion::none, 4000), bound / 2, 1e-4 * bound);
}

TEST(CentreBound, IsWorseBesideAnotherBall) {
  EXPECT_GT(bound_of(Companion::ball, 1000), 1.05 * bound_of(Companion::none, 1000));
}

CentreOptions few_balls(unsigned threads) { return {10, 5, threads, {"as it is"}, 3}; }

TEST(StudyCentres, BytesDoNotDependOnThreads) {
  const auto quiet = [](double) {};
  const std::vector<CentreRow> rows = study_centres(few_balls(1), quiet);
  EXPECT_EQ(files_of(rows, few_balls(1)).csv, files_of(study_centres(few_balls(2), quiet), few_balls(1)).csv);
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].balls, 14);
  EXPECT_EQ(rows[0].refused, 0);
  EXPECT_LT(rows[0].ratio(), 2);
  EXPECT_LT(rows[0].z, 2);
}

}  // namespace
}  // namespace helicarm
