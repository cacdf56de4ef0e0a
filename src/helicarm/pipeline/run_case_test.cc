// SPDX-License-Identifier: Apache-2.0
#include "helicarm/navigation/run_case.h"

#include <algorithm>

#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/navigation/view_stages.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm {
namespace {

/// One simulated navigation for all tests: 512 pixels, tunnels' balls, tracker and tool lines.
class SimulatedNavigation : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::filesystem::temp_directory_path() / ("helicarm_run_" + std::to_string(::getpid()));
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    options.size = 512;
    options.seed = 5;
    truth_ = *simulation::simulate_case(options);
    ASSERT_TRUE(simulation::write_case(folder_, truth_).has_value());
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(folder_); }

  void SetUp() override { given_ = *read_case(folder_); }

  static std::filesystem::path folder_;
  static simulation::SimulatedCase truth_;
  Case given_;
};

std::filesystem::path SimulatedNavigation::folder_;
simulation::SimulatedCase SimulatedNavigation::truth_;

TEST_F(SimulatedNavigation, TunnelsAreMeasuredWithinTheirErrorBars) {
  const auto result = run_case(given_, {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  ASSERT_FALSE(result->failure) << result->failure->message;
  for (const simulation::TunnelPoint& real : truth_.navigation->points) {
    const auto point = std::ranges::find(result->points, real.name, &PointResult::name);
    ASSERT_TRUE(point->place) << real.name;
    EXPECT_LT((point->place->in_calibrator - real.in_calibrator).norm(), 0.3) << real.name;
    const Eigen::Vector3d off = *point->place->in_tool - real.in_tool;
    EXPECT_LT(off.dot(point->place->covariance_in_tool->ldlt().solve(off)), 16.3) << real.name;  // 99.9 %
  }
  ASSERT_EQ(result->verifications.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_NEAR(result->verifications[i].start->distance_mm, truth_.navigation->lines[i].start_error_mm, 0.3);
  EXPECT_TRUE(result->timing_ms.total);
}

TEST_F(SimulatedNavigation, AnswerDoesNotDependOnTheThreads) {
  const auto one = run_case(given_, {Method::best, {}, 1});
  const auto two = run_case(given_, {Method::best, {}, 2});
  for (std::size_t i = 0; i < one->points.size(); ++i)
    EXPECT_EQ(one->points[i].place->in_calibrator, two->points[i].place->in_calibrator);
}

TEST_F(SimulatedNavigation, SamePictureTwiceIsRefused) {
  given_.views[1].image = given_.views[0].image;
  const auto result = run_case(given_, {});
  ASSERT_TRUE(result.has_value());
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::views_too_close);
  EXPECT_TRUE(result->views[0].exposure);
}

TEST_F(SimulatedNavigation, BlankPictureTwiceIsBlankFirst) {
  ViewResult view{"AP", Exposure{}, {}, {}, {}};
  view.exposure->pixels = Image<float>(64, 64);
  view.exposure->highest = 4095;
  view.exposure->acquisition.instance_key = "one";
  const auto checked = check_pictures_belong_together({view, view});
  ASSERT_FALSE(checked.has_value());
  EXPECT_EQ(checked.error().reason, Reason::blank_image);
}

TEST_F(SimulatedNavigation, DifferentPicturesOfOneUidAreTwoWithAWarning) {
  ViewResult ap{"AP", Exposure{}, {}, {}, {}}, lat{"LAT", Exposure{}, {}, {}, {}};
  ap.exposure->acquisition.instance_key = "one";
  lat.exposure->acquisition.instance_key = "other";
  ap.exposure->acquisition.uid_key = "same";
  lat.exposure->acquisition.uid_key = "same";
  const auto checked = check_pictures_belong_together({ap, lat});
  ASSERT_TRUE(checked.has_value()) << checked.error().message;
  ASSERT_EQ(checked->size(), 1u);
  EXPECT_EQ(checked->front().reason, Reason::uid_reused);
  lat.exposure->acquisition.uid_key = "another";
  EXPECT_TRUE(check_pictures_belong_together({ap, lat})->empty());
}

TEST_F(SimulatedNavigation, PlateOfTheOtherKindIsAMismatch) {
  given_.plate->kind = DotKind::holes;
  const auto result = run_case(given_, {});
  ASSERT_TRUE(result.has_value());
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::plate_mismatch) << result->failure->message;
}

TEST_F(SimulatedNavigation, LimitOnTheErrorRefusesButKeepsThePoints) {
  const auto result = run_case(given_, {Method::best, 1e-4, 0});
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::uncertain);
  EXPECT_FALSE(result->points.empty());
}

TEST_F(SimulatedNavigation, TunnelFromAPointToItselfIsRefused) {
  given_.tunnels[0].end = given_.tunnels[0].start;
  const auto result = run_case(given_, {});
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::bad_tunnel);
}

TEST_F(SimulatedNavigation, ClickOutsideThePictureIsBadInput) {
  given_.picks[0].uv_raw = {700, 100};
  const auto result = run_case(given_, {});
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().reason, Reason::bad_value);
  EXPECT_EQ(result.error().view, given_.picks[0].view);
}

TEST_F(SimulatedNavigation, MissingPictureIsBadInput) {
  given_.views[1].image = folder_ / "nowhere.dcm";
  const auto result = run_case(given_, {});
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().reason, Reason::missing_file);
  EXPECT_EQ(result.error().view, "LAT");
}

}  // namespace
}  // namespace helicarm
