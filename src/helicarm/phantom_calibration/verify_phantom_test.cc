// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/verify_phantom.h"

#include <gtest/gtest.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/phantom_calibration/simulated_phantom_test.h"

namespace helicarm::phantom_calibration {
namespace {

const simulation::SimulatedCase& three_views() {
  static const simulation::SimulatedCase simulated = simulated_phantom({0, 30, 75});
  return simulated;
}

std::vector<std::string> labels_of(const PhantomVerification& result, BallState state) {
  std::vector<std::string> labels;
  for (const VerifiedBall& ball : result.balls)
    if (ball.state == state) labels.push_back(ball.label);
  return labels;
}

TEST(VerifyPhantom, UnchangedPhantomPasses) {
  PhantomFolder folder(three_views());
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->failure) << result->failure->message;
  EXPECT_EQ(labels_of(*result, BallState::as_in_file).size(), 12u);
  EXPECT_LT(result->within_mm, 0.1);
}

TEST(VerifyPhantom, BallHalfAMillimetreOffIsNamed) {
  PhantomFolder folder(three_views());
  folder.ball("P4").centre_in_calibrator += Eigen::Vector3d(0.3, -0.4, 0);
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::calibrator_mismatch);
  EXPECT_EQ(labels_of(*result, BallState::moved), std::vector<std::string>{"P4"});
  EXPECT_NEAR(*result->balls[3].distance_mm, 0.5, 0.1);
}

TEST(VerifyPhantom, TwoDisplacedFiducialsAreBothNamed) {
  PhantomFolder folder(three_views());
  folder.ball("P5").centre_in_calibrator += Eigen::Vector3d(0, 0, 0.7);
  folder.ball("P9").centre_in_calibrator -= Eigen::Vector3d(0, 0, 0.7);
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(labels_of(*result, BallState::moved), (std::vector<std::string>{"P5", "P9"}));
}

TEST(VerifyPhantom, TwoViewsNameABallThreeMillimetresOff) {
  PhantomFolder folder(simulated_phantom({0, 75}));
  folder.ball("P4").centre_in_calibrator += Eigen::Vector3d(2, 1, -2);
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::calibrator_mismatch) << result->failure->message;
  EXPECT_EQ(labels_of(*result, BallState::moved), std::vector<std::string>{"P4"});
  EXPECT_NEAR(*result->balls[3].distance_mm, 3, 0.1);
}

// A ball that another object hides in part looks the same in two views.
TEST(VerifyPhantom, BallThatOneViewAloneShowsSlightlyOffIsNotVerified) {
  const simulation::SimulatedCase simulated = simulated_phantom({0, 90});
  PhantomFolder folder(simulated);
  Eigen::Vector3d& centre = folder.ball("P4").centre_in_calibrator;
  centre += 0.2 * (centre - simulated.views[0].true_view.view.source_in_world()).normalized();
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->failure) << result->failure->message;
  EXPECT_EQ(labels_of(*result, BallState::not_verified), std::vector<std::string>{"P4"});
  ASSERT_FALSE(result->warnings.empty());
  EXPECT_EQ(result->warnings.back().reason, Reason::residual_too_large);
}

TEST(VerifyPhantom, BallFarOffDoesNotTakeOthersWithIt) {
  PhantomFolder folder(three_views());
  folder.ball("P9").centre_in_calibrator += Eigen::Vector3d(0, 4, 0);
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(labels_of(*result, BallState::moved), std::vector<std::string>{"P9"});
}

TEST(VerifyPhantom, MirroredFileIsRefused) {
  PhantomFolder folder(three_views());
  for (phantom::CalibratorBall& ball : folder.the_case.calibrator.balls) ball.centre_in_calibrator.x() *= -1;
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::ambiguous_handedness) << result->failure->message;
}

/// The file's balls farther apart, as if the phantom were larger.
void grow(PhantomFolder& folder, double factor) {
  const Eigen::Vector3d middle = phantom::middle_of(folder.the_case.calibrator);
  for (phantom::CalibratorBall& ball : folder.the_case.calibrator.balls)
    ball.centre_in_calibrator = middle + factor * (ball.centre_in_calibrator - middle);
}

TEST(VerifyPhantom, ScaleIsStatedAsNotVerified) {
  PhantomFolder folder(three_views());
  grow(folder, 1.02);
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->failure) << result->failure->message;
  ASSERT_EQ(result->notes.size(), 1u);
  EXPECT_EQ(result->notes[0].reason, Reason::scale_unverified);
  EXPECT_NEAR(1 + result->scale.excess, 1.02, 3 * result->scale.sigma);
  const Json json = to_json(*result);
  EXPECT_EQ(json["scale"]["verified"], false);
  EXPECT_EQ(json["notes"].size(), 1u);
}

TEST(VerifyPhantom, FileThatTheDiametersContradictIsWarnedOf) {
  PhantomFolder folder(three_views());
  grow(folder, 1.07);
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  std::vector<Warning> found = result->warnings;
  if (result->failure) found.push_back(*result->failure);
  EXPECT_TRUE(std::ranges::count(found, Reason::scale_disagrees, &Warning::reason) > 0);
}

TEST(VerifyPhantom, BallOfAnotherSizeIsNamedAsSwapped) {
  PhantomFolder folder(three_views());
  folder.ball("P8").diameter_mm = 6;
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::calibrator_mismatch);
  EXPECT_EQ(labels_of(*result, BallState::swapped), std::vector<std::string>{"P8"});
}

TEST(VerifyPhantom, LostBallIsNamed) {
  PhantomFolder folder(simulated_phantom({0, 30, 75}, {"P8"}));
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::calibrator_mismatch);
  EXPECT_EQ(labels_of(*result, BallState::lost), std::vector<std::string>{"P8"});
}

TEST(VerifyPhantom, OneViewIsTooFew) {
  PhantomFolder folder(three_views());
  folder.the_case.views.resize(1);
  const auto result = verify_phantom(folder.the_case, 2);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::too_few_views) << result->failure->message;
}

TEST(VerifyPhantom, HistoryGrowsByOneEntryEachTime) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "history.json";
  PhantomVerification verification;
  verification.date = "2026-01-02";
  verification.balls.push_back({"P1", 0.01, 0.03, BallState::as_in_file, 2});
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(add_to_history(path, verification));
  const auto json = read_json(path);
  ASSERT_TRUE(json) << json.error().message;
  EXPECT_EQ((*json)["verifications"].size(), 2u);
}

}  // namespace
}  // namespace helicarm::phantom_calibration
