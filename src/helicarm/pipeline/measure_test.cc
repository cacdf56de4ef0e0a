// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/measure.h"

#include "helicarm/core/temporary_folder.h"
#include "helicarm/pipeline/c_arm.h"
#include "helicarm/pipeline/outcome.h"
#include "helicarm/pipeline/simulated_navigation_test.h"

namespace helicarm::pipeline {
namespace {

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

}  // namespace
}  // namespace helicarm::pipeline
