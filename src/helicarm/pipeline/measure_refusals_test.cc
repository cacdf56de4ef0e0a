// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/diagnosis/causes.h"
#include "helicarm/pipeline/locate_case.h"
#include "helicarm/pipeline/outcome.h"
#include "helicarm/pipeline/simulated_navigation_test.h"
#include "helicarm/pipeline/stages.h"

namespace helicarm::pipeline {
namespace {

TEST_F(SimulatedNavigation, TunnelThatHasLostAnEndsPicksIsRefused) {
  const auto calibration = calibrate_case(given_, {});
  ASSERT_TRUE(calibration);
  std::erase_if(given_.picks, [&](const Pick& pick) { return pick.name == given_.tunnels.front().end; });
  const auto located = locate_case(given_, std::make_shared<const CaseCalibration>(*calibration), {});
  ASSERT_FALSE(located);
  EXPECT_EQ(located.error().reason, Reason::bad_value);
}

TEST_F(SimulatedNavigation, MirroredCalibratorFileIsRefused) {
  for (phantom::CalibratorBall& ball : given_.calibrator.balls) ball.centre_in_calibrator.x() *= -1;
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result.has_value());
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::ambiguous_handedness);
  EXPECT_EQ(result->refused_at, Stage::calibrate);
  EXPECT_NE(result->failure->message.find("\"mirrored\": true"), std::string::npos);
}

TEST_F(SimulatedNavigation, MirroredCalibratorFileThatACaseStatesToBeMirroredImagesIsNoted) {
  for (phantom::CalibratorBall& ball : given_.calibrator.balls) ball.centre_in_calibrator.x() *= -1;
  for (CaseView& view : given_.views) view.mirrored = true;
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result.has_value());
  ASSERT_FALSE(result->failure) << result->failure->message;
  EXPECT_TRUE(find_reason(result->notes, Reason::ambiguous_handedness));
}

TEST_F(SimulatedNavigation, ImagesThatAreNotMirroredHaveNoNoteOfHandedness) {
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result.has_value());
  EXPECT_FALSE(find_reason(result->notes, Reason::ambiguous_handedness));
}

TEST_F(SimulatedNavigation, ScaledCalibratorIsWarnedOf) {
  const auto untouched = result_of(given_, {});
  ASSERT_TRUE(untouched.has_value());
  EXPECT_FALSE(find_reason(untouched->warnings, Reason::scale_disagrees));
  const Warning* note = find_reason(untouched->notes, Reason::scale_unverified);
  ASSERT_TRUE(note);
  EXPECT_NEAR(note->figures.at("file_over_true"), 1, 0.025);
  EXPECT_GT(note->figures.at("source_distance_mm AP"), 300);

  for (phantom::CalibratorBall& ball : given_.calibrator.balls) ball.centre_in_calibrator *= 1.07;
  const auto scaled = result_of(given_, {});
  ASSERT_TRUE(scaled.has_value());
  const Warning* warning = find_reason(scaled->warnings, Reason::scale_disagrees);
  ASSERT_TRUE(warning);
  EXPECT_NEAR(warning->figures.at("file_over_true") / note->figures.at("file_over_true"), 1.07, 0.01);

  given_.calibrator.scale_sigma = 0.001;
  const auto measured = result_of(given_, {});
  ASSERT_TRUE(measured.has_value());
  EXPECT_FALSE(find_reason(measured->notes, Reason::scale_unverified));
}

TEST_F(SimulatedNavigation, DisplacedBallIsWarnedOf) {
  phantom::CalibratorBall& ball = given_.calibrator.balls[4];
  const Eigen::Vector3d seen = ball.centre_in_calibrator;
  ball.centre_in_calibrator += Eigen::Vector3d(1.5, -1, 1.2);
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result.has_value());
  ASSERT_FALSE(result->failure) << result->failure->message;
  const Warning* warning = find_reason(result->warnings, Reason::ball_displaced);
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->message.find(ball.label), std::string::npos);
  EXPECT_NEAR(warning->figures.at("x_mm"), seen.x(), 0.2);
  EXPECT_NEAR(warning->figures.at("y_mm"), seen.y(), 0.2);
  EXPECT_NEAR(warning->figures.at("z_mm"), seen.z(), 0.2);
}

TEST_F(SimulatedNavigation, SameImageTwiceIsRefused) {
  given_.views[1].image = given_.views[0].image;
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result.has_value());
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::views_too_close);
  EXPECT_TRUE(result->views[0].xray_image);
}

std::shared_ptr<const xray::XrayImage> image_with(const std::string& instance_key,
                                                  const std::string& uid_key) {
  xray::XrayImage xray_image;
  xray_image.pixels = image::Image<float>(64, 64);
  xray_image.highest = 4095;
  xray_image.acquisition.instance_key = instance_key;
  xray_image.acquisition.uid_key = uid_key;
  return std::make_shared<const xray::XrayImage>(std::move(xray_image));
}

TEST(CheckImages, BlankImageTwiceIsRefusedAsBlank) {
  const ReadView view{{"AP"}, image_with("one", "")};
  const auto checked = check_images_belong_together({view, view});
  ASSERT_FALSE(checked.has_value());
  EXPECT_EQ(checked.error().reason, Reason::blank_image);
}

TEST(CheckImages, DifferentImagesOfOneUidAreAcceptedWithAWarning) {
  const ReadView ap{{"AP"}, image_with("one", "same")}, lat{{"LAT"}, image_with("other", "same")};
  EXPECT_TRUE(check_images_belong_together({ap, lat}).has_value());
  const auto warnings = reused_uids({reported(ap), reported(lat)});
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings.front().reason, Reason::uid_reused);
  EXPECT_TRUE(
      reused_uids({reported(ap), reported(ReadView{{"LAT"}, image_with("other", "another")})}).empty());
}

TEST_F(SimulatedNavigation, PlateOfTheOtherKindIsRefused) {
  given_.plate->kind = phantom::DotKind::holes;
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result.has_value());
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::plate_mismatch) << result->failure->message;
  EXPECT_EQ(result->refused_at, Stage::rectify);
}

TEST_F(SimulatedNavigation, ExchangedImagesAreWarnedOf) {
  const auto named = [](const Result& result) {
    return std::ranges::count(result.warnings, Reason::tag_disagrees, &Warning::reason);
  };
  EXPECT_EQ(named(*result_of(given_, {})), 0);
  std::swap(given_.views[0].image, given_.views[1].image);
  given_.picks.clear();
  given_.tunnels.clear();
  given_.tool_lines.clear();
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(named(*result), 2);
}

TEST_F(SimulatedNavigation, WrongSourceDistanceIsRefusedWithTheOneThatFits) {
  for (const double factor : {1.1, 1.3}) {
    double right_mm = 0;
    for (std::size_t i = 0; i < given_.views.size(); ++i) {
      xray::DerivedImage image = simulation::dicom_of(truth_, i);
      right_mm = *image.acquisition.source_detector_mm;
      *image.acquisition.source_detector_mm *= factor;
      given_.views[i].image = folder_ / (given_.views[i].name + "_wrong_distance.dcm");
      ASSERT_TRUE(xray::write_dicom(given_.views[i].image, image));
    }
    const auto result = result_of(given_, {});
    ASSERT_TRUE(result && result->failure) << factor;
    const Failure& failure = *result->failure;
    EXPECT_EQ(failure.reason, Reason::calibrator_mismatch) << failure.message;
    ASSERT_TRUE(failure.figures.contains("fitting_source_detector_mm")) << failure.message;
    EXPECT_NEAR(failure.figures.at("fitting_source_detector_mm") / right_mm, 1, 0.03);
    EXPECT_NEAR(failure.figures.at("file_source_detector_mm") / right_mm, factor, 1e-9);
  }
}

TEST_F(SimulatedNavigation, WrongPixelSizeIsRefusedWithTheOneThatFits) {
  auto read = read_views(given_, {});
  ASSERT_TRUE(read.has_value());
  xray::XrayImage changed = *read->front().xray_image;
  const double right_mm = changed.acquisition.pixel_mm->mean();
  *changed.acquisition.pixel_mm *= 1.15;
  read->front().xray_image = std::make_shared<const xray::XrayImage>(std::move(changed));
  const auto rectified = detect_in_views(*read, given_, {}).and_then([&](auto detected) {
    return rectify_views(std::move(detected), given_, {});
  });
  ASSERT_FALSE(rectified.has_value());
  EXPECT_EQ(rectified.error().failure.reason, Reason::plate_mismatch);
  const Failure failure = with_cause(rectified.error(), given_, {});
  ASSERT_TRUE(failure.figures.contains("fitting_pixel_mm")) << failure.message;
  EXPECT_NEAR(failure.figures.at("fitting_pixel_mm") / right_mm, 1, 0.01);
}

TEST_F(SimulatedNavigation, RefusalThatNoTagExplainsIsUnchanged) {
  given_.calibrator = *phantom::calibrator_named("udcsc", folder_);
  for (phantom::CalibratorBall& ball : given_.calibrator.balls) ball.centre_in_calibrator.x() *= -1;
  for (CaseView& view : given_.views) view.mirrored = false;
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result && result->failure);
  EXPECT_FALSE(result->failure->figures.contains("fitting_source_detector_mm")) << result->failure->message;
}

TEST_F(SimulatedNavigation, LimitOnTheErrorRefusesButKeepsThePoints) {
  const auto result = result_of(given_, {rectification::Method::best, 1e-4, 0});
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::uncertain);
  EXPECT_FALSE(result->points.empty());
}

TEST_F(SimulatedNavigation, TunnelFromAPointToItselfIsRefused) {
  given_.tunnels[0].end = given_.tunnels[0].start;
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result->failure);
  EXPECT_EQ(result->failure->reason, Reason::bad_tunnel);
  EXPECT_EQ(result->refused_at, Stage::locate);
}

TEST_F(SimulatedNavigation, ClickOutsideTheImageIsBadInput) {
  given_.picks[0].uv_raw = {700, 100};
  const auto result = result_of(given_, {});
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().reason, Reason::bad_value);
  EXPECT_EQ(result.error().view, given_.picks[0].view);
}

TEST_F(SimulatedNavigation, MissingImageIsBadInput) {
  given_.views[1].image = folder_ / "nowhere.dcm";
  const auto result = result_of(given_, {});
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().reason, Reason::missing_file);
  EXPECT_EQ(result.error().view, "LAT");
}

}  // namespace
}  // namespace helicarm::pipeline
