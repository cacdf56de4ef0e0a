// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/calibrator.h"

#include <gtest/gtest.h>

namespace helicarm::phantom {
namespace {

/// The built-in calibrator with a ball, a cross and a line end as targets.
Json example() {
  Calibrator calibrator = udcsc();
  calibrator.name = "mine";
  calibrator.targets = {{"T1", {1.5, -2, 42}, TargetKind::ball, 3, {}, 0},
                        {"T2", {10, -50, 33}, TargetKind::cross, 2, {{1, 0, 0}, {0, 0.6, 0.8}}, 16},
                        {"T3", {14, 11, 91}, TargetKind::line_end, 2, {{0, 0, 1}}, 0}};
  return to_json(calibrator);
}

Failure refusal(const Json& json) {
  const auto calibrator = calibrator_from_json(json, "c.json");
  EXPECT_FALSE(calibrator.has_value());
  return calibrator ? Failure{Reason::usage, ""} : calibrator.error();
}

TEST(Udcsc, FirstAndLastBallAreOnTheHelix) {
  const Calibrator calibrator = udcsc();
  ASSERT_EQ(calibrator.balls.size(), 12u);
  EXPECT_EQ(calibrator.balls.front().label, "P1");
  EXPECT_EQ(calibrator.balls.back().label, "P12");
  EXPECT_LT((calibrator.balls.front().centre_in_calibrator - Eigen::Vector3d(51.106, 29.506, 2.083)).norm(),
            1e-3);
  EXPECT_LT((calibrator.balls.back().centre_in_calibrator - Eigen::Vector3d(17.057, -29.544, 70.836)).norm(),
            1e-3);
  EXPECT_EQ(calibrator.balls.front().diameter_mm, 4.0);
}

TEST(ReadCalibrator, RoundTripKeepsTheCalibrator) {
  const auto calibrator = calibrator_from_json(example(), "c.json");
  ASSERT_TRUE(calibrator.has_value()) << calibrator.error().message;
  EXPECT_EQ(to_json(*calibrator), example());
  EXPECT_EQ(calibrator->targets[1].kind, TargetKind::cross);
  EXPECT_EQ(calibrator->targets[1].length_mm, 16);
}

TEST(ReadCalibrator, NullLengthAndMissingTargetsAreAccepted) {
  Json json = example();
  json["targets"][2]["length_mm"] = nullptr;
  EXPECT_TRUE(calibrator_from_json(json, "c.json").has_value());
  json.erase("targets");
  EXPECT_TRUE(calibrator_from_json(json, "c.json").has_value());
}

TEST(ReadCalibrator, BuiltInIsFoundByNameAndAFileOnlyInsideTheFolder) {
  EXPECT_TRUE(calibrator_named("udcsc", "/nowhere").has_value());
  EXPECT_EQ(calibrator_named("../c.json", "/nowhere").error().reason, Reason::path_outside);
  EXPECT_EQ(calibrator_named("c.json", "/nowhere").error().reason, Reason::missing_file);
}

TEST(ReadCalibrator, UnknownKeysAreRefused) {
  Json json = example();
  json["colour"] = "red";
  EXPECT_EQ(refusal(json).reason, Reason::unknown_key);
  json = example();
  json["balls"][3]["radius_mm"] = 2;
  EXPECT_EQ(refusal(json).reason, Reason::unknown_key);
}

TEST(ReadCalibrator, MisspeltKeyIsAnsweredByAllKnownOnes) {
  Json json = example();
  json["tolerence_mm"] = 0.1;
  const Failure failure = refusal(json);
  for (const char* key : {"tolerance_mm", "joint_covariance", "scale_sigma"})
    EXPECT_NE(failure.message.find(key), std::string::npos) << failure.message;
}

TEST(ReadCalibrator, DiameterInMicrometresIsRefusedWithItsLimit) {
  Json json = example();
  json["balls"][0]["diameter_mm"] = 4000;
  EXPECT_EQ(refusal(json).message, "c.json: balls[0]: \"diameter_mm\": 4000 is outside 0.5 to 30");
  EXPECT_EQ(refusal(json).figures, (std::map<std::string, double>{{"value", 4000}, {"limit", 30}}));
}

TEST(ReadCalibrator, CoordinatesInMetresAreRefused) {
  Json json = example();
  for (Json& ball : json["balls"])
    for (Json& value : ball["xyz_mm"]) value = value.get<double>() / 1000;
  const Failure failure = refusal(json);
  EXPECT_EQ(failure.reason, Reason::bad_value);
  EXPECT_NE(failure.message.find("metres?"), std::string::npos) << failure.message;
}

TEST(ReadCalibrator, FiveBallsAreTooFew) {
  Json json = example();
  while (json["balls"].size() > 5) json["balls"].erase(5);
  EXPECT_EQ(refusal(json).reason, Reason::bad_value);
}

TEST(ReadCalibrator, EqualNamesClash) {
  Json json = example();
  json["balls"][1]["label"] = "P1";
  EXPECT_EQ(refusal(json).reason, Reason::name_clash);
  json = example();
  json["targets"][1]["name"] = "T1";
  EXPECT_EQ(refusal(json).reason, Reason::name_clash);
  json = example();
  json["targets"][1]["name"] = "P7";
  EXPECT_EQ(refusal(json).reason, Reason::name_clash);
}

TEST(ReadCalibrator, BallsAtEqualPositionsAreRefused) {
  Json json = example();
  json["balls"][1]["xyz_mm"] = json["balls"][0]["xyz_mm"];
  const Failure failure = refusal(json);
  EXPECT_EQ(failure.reason, Reason::bad_value);
  EXPECT_EQ(failure.message, "c.json: balls P1 and P2 are 0 mm apart, at least 0.1 mm are required");
}

TEST(ReadCalibrator, BallsInOnePlaneAreCoplanarWithTheFigure) {
  Json json = example();
  for (Json& ball : json["balls"]) {
    const auto xyz = ball["xyz_mm"].get<std::vector<double>>();
    ball["xyz_mm"] = {xyz[0], xyz[1], 0.3 * xyz[0] - 0.2 * xyz[1]};
  }
  const Failure failure = refusal(json);
  EXPECT_EQ(failure.reason, Reason::coplanar_fiducials);
  EXPECT_EQ(exit_code(failure.reason), 3);
  EXPECT_LT(failure.figures.at("plane_rms_mm"), 1e-5);
}

TEST(ReadCalibrator, DirectionsMustFitTheKindAndBeDistinctUnitVectors) {
  Json json = example();
  json["targets"][2].erase("directions");
  EXPECT_EQ(refusal(json).reason, Reason::bad_value);
  json = example();
  json["targets"][0]["directions"] = {{0, 0, 1}};
  EXPECT_EQ(refusal(json).reason, Reason::bad_value);
  json = example();
  json["targets"][1]["directions"][0] = {1.01, 0, 0};
  EXPECT_EQ(refusal(json).reason, Reason::bad_value);
  json = example();
  json["targets"][1]["directions"] = {{1, 0, 0}, {-1, 0, 0}};
  EXPECT_EQ(refusal(json).reason, Reason::bad_value);
}

TEST(ReadCalibrator, NearlyUnitDirectionIsNormalised) {
  Json json = example();
  json["targets"][2]["directions"] = {{0, 0, 1.0005}};
  EXPECT_NEAR(calibrator_from_json(json, "c.json")->targets[2].directions[0].norm(), 1, 1e-15);
}

TEST(ReadCalibrator, MeasuredFileRoundTrips) {
  Json json = example();
  json["scale_sigma"] = 0.0005;
  json["measured"] = {{"date", "2026-11-22"}, {"scale", "one distance"}};
  json["balls"][2]["covariance_mm2"] = {{4e-4, 1e-4, 0}, {1e-4, 9e-4, 0}, {0, 0, 1e-4}};
  const auto calibrator = calibrator_from_json(json, "c.json");
  ASSERT_TRUE(calibrator.has_value()) << calibrator.error().message;
  EXPECT_EQ(calibrator->scale_sigma, 0.0005);
  EXPECT_EQ((*calibrator->balls[2].covariance_mm2)(0, 1), 1e-4);
  const Json written = to_json(*calibrator);
  EXPECT_EQ(written["measured"], json["measured"]);
  EXPECT_EQ(written["balls"][2]["covariance_mm2"], json["balls"][2]["covariance_mm2"]);
}

/// Independent errors of 0.01 mm of all balls of a file, and of one more.
Json joint_covariance_of(const Json& file) {
  Json joint{{"balls", {"further"}}, {"mm2", Json::array()}};
  for (const Json& ball : file["balls"]) joint["balls"].push_back(ball["label"]);
  const std::size_t n = 3 * joint["balls"].size();
  for (std::size_t row = 0; row < n; ++row) {
    joint["mm2"].push_back(Json::array());
    for (std::size_t column = 0; column < n; ++column)
      joint["mm2"].back().push_back(row == column ? 1e-4 : 0.0);
  }
  return joint;
}

TEST(ReadCalibrator, JointCovarianceRoundTrips) {
  Json json = example();
  json["joint_covariance"] = joint_covariance_of(json);
  json["joint_covariance"]["mm2"][1][7] = json["joint_covariance"]["mm2"][7][1] = 5e-5;
  const auto calibrator = calibrator_from_json(json, "c.json");
  ASSERT_TRUE(calibrator.has_value()) << calibrator.error().message;
  EXPECT_EQ(calibrator->joint_covariance->mm2(7, 1), 5e-5);
  EXPECT_EQ(to_json(*calibrator)["joint_covariance"], json["joint_covariance"]);
}

TEST(ReadCalibrator, JointCovarianceThatContradictsTheBallsIsRefused) {
  Json json = example();
  json["joint_covariance"] = joint_covariance_of(json);
  json["balls"][2]["covariance_mm2"] = {{2e-4, 0, 0}, {0, 1e-4, 0}, {0, 0, 1e-4}};
  EXPECT_NE(refusal(json).message.find("differs from the covariance of"), std::string::npos)
      << refusal(json).message;
  json["balls"][2].erase("covariance_mm2");
  json["joint_covariance"]["balls"][1] = "other";
  EXPECT_NE(refusal(json).message.find("once"), std::string::npos) << refusal(json).message;
}

TEST(JointBallCovariance, HasNoGrowthAboutTheCentroidWhereTheScaleIsStated) {
  Calibrator calibrator = udcsc();
  EXPECT_EQ(joint_ball_covariance(calibrator).size(), 0);
  const Eigen::Vector3d middle = middle_of(calibrator);
  Eigen::VectorXd growth(36);
  JointCovariance joint;
  for (std::size_t i = 0; i < 12; ++i) {
    joint.labels.push_back(calibrator.balls[11 - i].label);
    growth.segment<3>(3 * Eigen::Index(i)) = calibrator.balls[11 - i].centre_in_calibrator - middle;
  }
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(36, 36);
  own(0, 0) = 0.04;  // of the last ball
  joint.mm2 = own + 1e-6 * growth * growth.transpose();
  calibrator.joint_covariance = joint;
  const Eigen::VectorXd reversed = growth.reshaped(3, 12).rowwise().reverse().reshaped();
  EXPECT_GT((joint_ball_covariance(calibrator) * reversed).norm(), 1e-6 * growth.squaredNorm());
  calibrator.scale_sigma = 1e-3;
  const Eigen::MatrixXd covariance = joint_ball_covariance(calibrator);
  EXPECT_LT((covariance * reversed).norm(), 1e-12);
  EXPECT_NEAR(covariance(33, 33), 0.04, 0.01);
  EXPECT_NEAR(covariance(0, 0), 0, 1e-3);
  EXPECT_EQ(ball_covariances(calibrator)[11], (covariance.block<3, 3>(33, 33)));
}

TEST(ReadCalibrator, InvalidCovarianceIsRefused) {
  Json json = example();
  json["balls"][2]["covariance_mm2"] = {{1, 2, 0}, {0, 1, 0}, {0, 0, 1}};
  EXPECT_NE(refusal(json).message.find("balls[2]: \"covariance_mm2\": is not symmetric"), std::string::npos)
      << refusal(json).message;
  json["balls"][2]["covariance_mm2"] = {{1, 2, 0}, {2, 1, 0}, {0, 0, 1}};
  EXPECT_NE(refusal(json).message.find("negative eigenvalue -1"), std::string::npos) << refusal(json).message;
}

TEST(BallCovariances, ScaleErrorIsRemovedAndTheToleranceAdded) {
  Calibrator calibrator = udcsc();
  EXPECT_TRUE(ball_covariances(calibrator).empty());
  calibrator.scale_sigma = 0.01;
  EXPECT_TRUE(ball_covariances(calibrator).empty());
  const Eigen::Matrix3d own = Eigen::Vector3d(0.01, 0.02, 0.03).asDiagonal();
  const Eigen::Vector3d by_scale = 0.01 * (calibrator.balls[4].centre_in_calibrator - middle_of(calibrator));
  calibrator.balls[4].covariance_mm2 = own + by_scale * by_scale.transpose();
  calibrator.tolerance_mm = 0.1;
  const auto covariances = ball_covariances(calibrator);
  ASSERT_EQ(covariances.size(), 12u);
  EXPECT_LT((covariances[4] - own - 0.01 * Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_LT((covariances[5] - 0.01 * Eigen::Matrix3d::Identity()).norm(), 1e-12);
}

TEST(SamePlaces, IgnoresOrderAndDetectsAShift) {
  Calibrator other = udcsc();
  std::swap(other.balls[0], other.balls[5]);
  EXPECT_TRUE(same_places(other, udcsc()));
  other.balls[3].centre_in_calibrator.x() += 0.05;
  EXPECT_FALSE(same_places(other, udcsc()));
}

}  // namespace
}  // namespace helicarm::phantom
