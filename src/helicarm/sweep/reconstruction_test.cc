// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/reconstruction.h"

#include <cmath>
#include <filesystem>

#include <gmock/gmock.h>

#include "helicarm/core/random.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/sweep/drawn_run_test.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::sweep {
namespace reconstruction_test {

using testing::HasSubstr;

/// Value `inside` where the distance from the middle, and along z by `stretch` less, is below the radius.
Reconstruction blob(double radius_mm, double stretch, double inside, double noise) {
  Reconstruction volume{{61, 61, 31}, 0.2, {}};
  RandomStream random{5, 0};
  for (int z = -15; z <= 15; ++z)
    for (int y = -30; y <= 30; ++y)
      for (int x = -30; x <= 30; ++x) {
        const double r = volume.voxel_mm * std::hypot(double(x), double(y), stretch * z);
        volume.values.push_back(float(100 + (r < radius_mm ? inside : 0) + noise * random.normal()));
      }
  return volume;
}

TEST(WidthAtHalfMaximum, OfABallIsItsDiameter) {
  EXPECT_NEAR(ball_width_mm(blob(1.6, 1, 1000, 30), 3.2).value_or(0), 3.2, 0.03);  // of voxels of 0.2 mm
}

TEST(WidthAtHalfMaximum, DarkMetalIsAsWideAsBright) {
  EXPECT_NEAR(ball_width_mm(blob(1.6, 1, -1000, 30), 3.2).value_or(0), 3.2, 0.03);  // of voxels of 0.2 mm
}

TEST(WidthAtHalfMaximum, OfAWireIsItsDiameter) {
  EXPECT_NEAR(wire_width_mm(blob(0.9, 0, 1000, 30)).value_or(0), 1.8, 0.1);
}

TEST(WidthAtHalfMaximum, TwoBallsAreWiderThanOne) {
  Reconstruction two = blob(1.2, 1, 1000, 30);
  const double one_mm = ball_width_mm(two, 2.4).value_or(0);
  const std::vector<float> other = two.values;
  for (std::size_t i = 20; i < two.values.size(); ++i)
    two.values[i] = std::max(two.values[i], other[i - 20]);  // 4 mm to the right
  EXPECT_GT(ball_width_mm(two, 2.4).value_or(0), 1.8 * one_mm);
}

TEST(WidthAtHalfMaximum, NoiseAloneHasNone) {
  EXPECT_FALSE(ball_width_mm(blob(1.6, 1, 0, 30), 3.2));
  EXPECT_FALSE(wire_width_mm(blob(1.6, 0, 0, 30)));
}

TEST(MiddleSlice, ShowsTheBallBright) {
  for (const double inside : {1000.0, -1000.0}) {
    const auto slice = middle_slice(blob(1.6, 1, inside, 0));
    EXPECT_EQ(slice(30, 30), 255);
    EXPECT_EQ(slice(0, 0), 0);
  }
}

TEST(WireEnds, AreReadOrRefused) {
  const auto wire = wire_from("1,2,-30;1,2.5,30");
  ASSERT_TRUE(wire);
  EXPECT_EQ(wire->from, Eigen::Vector3d(1, 2, -30));
  EXPECT_EQ(wire->to, Eigen::Vector3d(1, 2.5, 30));
  for (const char* text : {"", "1,2,3", "1,2,3;4,5,6,7", "0,0,0;0,0,1", "0,0,0;0,0,nan", "0,0,0;0,0,9000"}) {
    const auto refused = wire_from(text);
    ASSERT_FALSE(refused) << text;
    EXPECT_EQ(refused.error().reason, Reason::bad_value) << text;
  }
}

/// A drawn run whose detector flexes.
class CheckOfARun : public testing::Test {
 protected:
  void run(int frames, const CheckOptions& options) {
    DrawnRun drawn;
    drawn.frames = frames;
    drawn.flex_mm = 6;
    drawn.flex_harmonic = 3;
    drawn.write(folder_.path());
    the_case_ = value_or_throw(read_sweep_case(folder_.path()));
    sweep_ = value_or_throw(run_sweep(the_case_));
    ASSERT_FALSE(sweep_.failure) << sweep_.failure->message;
    value_or_throw(add_check(sweep_, the_case_, options));
  }
  TemporaryFolder folder_;
  SweepCase the_case_;
  Sweep sweep_;
};

TEST_F(CheckOfARun, MissingProgramIsAWarning) {
  CheckOptions options;
  options.program = "no-such-program-of-helicarm";
  ASSERT_NO_FATAL_FAILURE(run(8, options));
  EXPECT_FALSE(sweep_.check);
  ASSERT_FALSE(sweep_.warnings.empty());
  EXPECT_EQ(sweep_.warnings.back().reason, Reason::missing_file);
  EXPECT_THAT(sweep_.warnings.back().message, HasSubstr("left out: no-such-program-of-helicarm"));
}

TEST_F(CheckOfARun, TooSmallAnArcIsAWarning) {
  if (!version_of("plastimatch")) GTEST_SKIP() << "plastimatch is not installed";
  ASSERT_NO_FATAL_FAILURE(run(8, {}));
  EXPECT_FALSE(sweep_.check);
  EXPECT_EQ(sweep_.warnings.back().reason, Reason::too_few_views);
}

TEST_F(CheckOfARun, BallsAreNarrowerThanWithTheIdealCircleAndAsWideAsWithTheSameCameras) {
  if (!version_of("plastimatch")) GTEST_SKIP() << "plastimatch is not installed";
  ASSERT_NO_FATAL_FAILURE(run(40, {.program = "no-such-program-of-helicarm"}));
  CheckOptions options;
  for (const SweepFrame& frame : sweep_.frames)
    if (frame.best) options.against.push_back({frame.best->view, {}, {}, true, {}});
  ASSERT_TRUE(add_check(sweep_, the_case_, options));
  ASSERT_TRUE(sweep_.check) << sweep_.warnings.back().message;
  ASSERT_FALSE(sweep_.check->targets.empty());
  for (const CheckedTarget& target : sweep_.check->targets) {
    EXPECT_NEAR(target.own.width_mm.value_or(0), *target.diameter_mm, 0.15 * *target.diameter_mm)
        << target.name;
    EXPECT_FALSE(target.own.slice.empty());
  }
  EXPECT_GT(sweep_.check->circle_ratio().value_or(0), 1.05);
  EXPECT_DOUBLE_EQ(sweep_.check->other_ratio().value_or(0), 1);
  EXPECT_THAT(sweep_report(sweep_), HasSubstr("ideal circle"));
  EXPECT_EQ(to_json(sweep_)["check"]["targets"].size(), sweep_.check->targets.size());
  options.against.resize(3);
  const auto refused = add_check(sweep_, the_case_, options);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
}

}  // namespace reconstruction_test
}  // namespace helicarm::sweep
