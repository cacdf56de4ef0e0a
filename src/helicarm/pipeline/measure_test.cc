// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/measure.h"

#include <algorithm>

#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/pipeline/c_arm.h"
#include "helicarm/pipeline/diagnosis/causes.h"
#include "helicarm/pipeline/locate_case.h"
#include "helicarm/pipeline/outcome.h"
#include "helicarm/pipeline/stages.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::pipeline {
namespace {

Expected<Result> result_of(const Case& the_case, const RunOptions& options, const Progress& progress = {}) {
  return measure(the_case, options, progress);
}

/// One simulated case for all tests: 512 x 512 pixels, tunnels, tracker and tool lines.
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

TEST_F(SimulatedNavigation, TunnelThatHasLostAnEndsPicksIsRefused) {
  const auto calibration = calibrate_case(given_, {});
  ASSERT_TRUE(calibration);
  std::erase_if(given_.picks, [&](const Pick& pick) { return pick.name == given_.tunnels.front().end; });
  const auto located = locate_case(given_, std::make_shared<const CaseCalibration>(*calibration), {});
  ASSERT_FALSE(located);
  EXPECT_EQ(located.error().reason, Reason::bad_value);
}

TEST_F(SimulatedNavigation, TunnelsAreMeasuredWithinTheirConfidenceRegions) {
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  ASSERT_FALSE(result->failure) << result->failure->message;
  for (const simulation::TunnelPoint& real : truth_.navigation->points) {
    const auto point = std::ranges::find(result->points, real.name, &PointResult::name);
    ASSERT_TRUE(point->place) << real.name;
    EXPECT_LT((point->place->in_calibrator - real.in_calibrator).norm(), 0.3) << real.name;
    const Eigen::Vector3d off = point->place->in_tool->point() - real.in_tool;
    EXPECT_LT(off.dot(point->place->in_tool->covariance.ldlt().solve(off)), 16.3) << real.name;  // 99.9 %
  }
  ASSERT_EQ(result->verifications.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_NEAR(result->verifications[i].start->distance_mm, truth_.navigation->lines[i].start_error_mm, 0.3);
  EXPECT_TRUE(result->timing_ms.total);
}

const Finding* find_reason(const std::vector<Finding>& warnings, Reason reason) {
  const auto found = std::ranges::find(warnings, reason, &Warning::reason);
  return found == warnings.end() ? nullptr : &*found;
}

TEST_F(SimulatedNavigation, RecordOfAChangedCArmIsNotUsed) {
  const Result alone = result_of(given_, {}).value();
  RunOptions options;
  options.history.emplace();
  for (int day = 0; day < 5; ++day)
    for (calibration::HistoryEntry entry : alone.calibration->entries) {
      entry.image += std::to_string(day);
      entry.estimate_mm += Eigen::Vector3d(40, 30, 0);  // as if the receiver had been moved since
      options.history->entries.push_back(entry);
    }
  const Result result = result_of(given_, options).value();
  ASSERT_FALSE(result.failure) << result.failure->message;
  EXPECT_TRUE(find_reason(result.warnings, Reason::c_arm_changed));
  for (std::size_t i = 0; i < alone.points.size(); ++i)
    EXPECT_EQ(result.points[i].place->in_calibrator, alone.points[i].place->in_calibrator);
  const TemporaryFolder folder;
  EXPECT_EQ(add_to_record(folder.path() / "arm.json", result)->added, 0u);
}

TEST_F(SimulatedNavigation, WithoutAPlateTheRecordsMapsRectify) {
  const Result by_plate = result_of(given_, {}).value();
  RunOptions options;
  options.history.emplace();
  options.history->entries = by_plate.calibration->entries;
  ASSERT_EQ(options.history->entries.size(), 2u);
  ASSERT_TRUE(options.history->entries[0].plate);
  EXPECT_GT(options.history->entries[0].plate->field_radius_px, 150);
  given_.plate.reset();
  const Result by_record = result_of(given_, options).value();
  ASSERT_FALSE(by_record.failure) << by_record.failure->message;
  EXPECT_EQ(by_record.views[0].rectification->source, rectification::MapSource::record);
  EXPECT_GT(by_record.views[0].rectification->map.sigma_px({100, 100}), 0.01);
  for (const simulation::TunnelPoint& real : truth_.navigation->points) {
    const auto point = std::ranges::find(by_record.points, real.name, &PointResult::name);
    ASSERT_TRUE(point->place) << real.name;
    const Eigen::Vector3d off = point->place->in_calibrator - real.in_calibrator;
    EXPECT_LT(off.norm(), 0.5) << real.name;
  }
  // What the record told is not told to it again.
  for (const calibration::HistoryEntry& entry : by_record.calibration->entries) EXPECT_FALSE(entry.plate);
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

TEST_F(SimulatedNavigation, StagesAreAnnouncedInOrderAndMayBeStopped) {
  std::vector<std::string> stages;
  Progress progress;
  progress.stage = [&](std::string_view stage) { stages.emplace_back(stage); };
  ASSERT_TRUE(result_of(given_, {}, progress).has_value());
  EXPECT_EQ(stages, (std::vector<std::string>{"read", "detect", "rectify", "label", "calibrate", "locate"}));
  progress.stage = [&](std::string_view stage) {
    if (stage == "rectify") throw std::runtime_error("stopped");
  };
  EXPECT_THROW((void)result_of(given_, {}, progress), std::runtime_error);
}

Json without_timing(const Result& result) {
  Json json = to_json(result);
  json.erase("timing_ms");
  return json;
}

TEST_F(SimulatedNavigation, MeasuredAgainEqualsMeasuredAtOnce) {
  Case picked_later = given_;
  picked_later.picks.clear();
  picked_later.tunnels.clear();
  picked_later.tool_lines.clear();
  const auto earlier = measure(picked_later, {});
  ASSERT_TRUE(earlier);
  const auto again = measure_again(*earlier, given_, {});
  const auto whole = measure(given_, {});
  ASSERT_TRUE(again && whole);
  EXPECT_EQ(again->calibration, earlier->calibration);
  EXPECT_EQ(without_timing(*again), without_timing(*whole));
}

TEST_F(SimulatedNavigation, AnotherMethodIsCalibratedAgain) {
  const auto earlier = measure(given_, {});
  ASSERT_TRUE(earlier);
  RunOptions paper;
  paper.method = rectification::Method::paper;
  const auto again = measure_again(*earlier, given_, paper);
  ASSERT_TRUE(again);
  EXPECT_NE(again->calibration, earlier->calibration);
  EXPECT_EQ(without_timing(*again), without_timing(*measure(given_, paper)));
}

TEST_F(SimulatedNavigation, AHistoryIsCalibratedAgain) {
  const auto earlier = measure(given_, {});
  ASSERT_TRUE(earlier);
  RunOptions by_history;
  by_history.history = calibration::CArmHistory{};
  const auto again = measure_again(*earlier, given_, by_history);
  ASSERT_TRUE(again);
  EXPECT_NE(again->calibration, earlier->calibration);
  EXPECT_TRUE(again->calibration->history);
}

TEST_F(SimulatedNavigation, OneViewIsCalibratedAndLocatesNothing) {
  given_.views.resize(1);
  std::erase_if(given_.picks, [&](const Pick& pick) { return pick.view != given_.views[0].name; });
  const auto result = result_of(given_, {});
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_FALSE(result->failure) << result->failure->message;
  for (const PointResult& point : result->points) {
    EXPECT_FALSE(point.place) << point.name;
    EXPECT_EQ(point.reason->reason, Reason::not_seen) << point.name;
  }
  ASSERT_TRUE(result->views[0].calibrated);
  const calibration::CalibratedView& view = *result->views[0].calibrated;
  const Eigen::Vector3d off = view.view.source_in_world() - truth_.views[0].true_view.view.source_in_world();
  EXPECT_LT(off.dot(calibration::source_covariance(view).ldlt().solve(off)), 16.3);  // 99.9 %
  const Json parameters = to_json(*result)["views"][0]["parameters"];
  EXPECT_EQ(parameters["order"].size(), 11u);
  EXPECT_EQ(parameters["covariance"][10].size(), 11u);
  EXPECT_NEAR(parameters["sigma"]["fx_px"], std::sqrt(view.covariance(0, 0)), 1e-12);
  const auto note = std::ranges::find(result->notes, Reason::intrinsics_weak, &Warning::reason);
  ASSERT_NE(note, result->notes.end());
  EXPECT_GT(note->figures.at("source_mm"), off.norm() / 4);
}

TEST_F(SimulatedNavigation, KnownHandednessIsTheOnlyOneTried) {
  for (CaseView& view : given_.views) view.mirrored = false;
  const auto right = result_of(given_, {});
  ASSERT_TRUE(right.has_value());
  EXPECT_FALSE(right->failure);
  given_.views[0].mirrored = true;
  const auto wrong = result_of(given_, {});
  ASSERT_TRUE(wrong.has_value());
  ASSERT_TRUE(wrong->failure);
  EXPECT_EQ(wrong->failure->view, "AP");
}

TEST_F(SimulatedNavigation, ScaleErrorIsInEveryCovariance) {
  const auto exact = result_of(given_, {});
  given_.calibrator.scale_sigma = 0.01;
  const auto scaled = result_of(given_, {});
  ASSERT_TRUE(exact && scaled);
  for (std::size_t i = 0; i < exact->points.size(); ++i) {
    const auto& place = exact->points[i].place;
    ASSERT_TRUE(place);
    const Eigen::Vector3d by_scale = 0.01 * (place->in_calibrator - phantom::middle_of(given_.calibrator));
    const Eigen::Matrix3d added =
        scaled->points[i].place->covariance_in_calibrator - place->covariance_in_calibrator;
    EXPECT_LT((added - by_scale * by_scale.transpose()).norm(), 0.03 * by_scale.squaredNorm());
  }
  const double length = *scaled->tunnels[0].length_mm;
  EXPECT_GT(*scaled->tunnels[0].length_sigma_mm, 0.0099 * length);
}

TEST_F(SimulatedNavigation, ResultDoesNotDependOnTheThreads) {
  const auto one = result_of(given_, {rectification::Method::best, {}, 1});
  const auto two = result_of(given_, {rectification::Method::best, {}, 2});
  for (std::size_t i = 0; i < one->points.size(); ++i)
    EXPECT_EQ(one->points[i].place->in_calibrator, two->points[i].place->in_calibrator);
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
