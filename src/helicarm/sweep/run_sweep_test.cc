// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/exchange/itk_transform.h"
#include "helicarm/sweep/drawn_run_test.h"
#include "helicarm/sweep/sweep.h"
#include "helicarm/sweep/sweep_findings.h"

namespace helicarm::sweep {
namespace {

Sweep sweep_of(const DrawnRun& run, const SweepOptions& options = {}) {
  const TemporaryFolder folder;
  run.write(folder.path());
  return *run_sweep(*read_sweep_case(folder.path()), options);
}

double reprojection_px(const geometry::View& estimated, const geometry::View& truth) {
  double squares = 0;
  for (const Eigen::Vector3d& ball : DrawnRun::balls())
    squares += (estimated.project(ball) - truth.project(ball)).squaredNorm();
  return std::sqrt(squares / double(DrawnRun::balls().size()));
}

TEST(RunSweep, CamerasOfARunAreNearTheTruthAndBlankImagesAreNamed) {
  DrawnRun run;
  run.blank = {9};
  const Sweep sweep = sweep_of(run);
  ASSERT_FALSE(sweep.failure) << sweep.failure->message;
  ASSERT_EQ(sweep.frames.size(), 20u);
  int inside = 0, accepted = 0;
  for (const SweepFrame& frame : sweep.frames) {
    if (frame.number == 9) {
      ASSERT_TRUE(frame.failure);
      EXPECT_EQ(frame.failure->reason, Reason::blank_image);
      continue;
    }
    ASSERT_TRUE(frame.best) << frame.failure->message;
    const geometry::View truth = run.view(frame.number - 1);
    EXPECT_LT(reprojection_px(frame.best->view, truth), 0.1);
    const Eigen::Vector3d off = frame.best->view.source_in_world() - truth.source_in_world();
    EXPECT_LT(off.norm(), 3);
    inside += off.dot(calibration::source_covariance(*frame.best).ldlt().solve(off)) < 11.34;  // 99 %
    const CameraVector off_path = *frame.own - *frame.flex;
    EXPECT_LT(off_path.head<6>().norm(), 0.5) << frame.number;
    EXPECT_LT(off_path.tail<3>().norm(), 1e-3) << frame.number;
    ++accepted;
  }
  EXPECT_GE(inside, accepted - 2);
  ASSERT_TRUE(sweep.path);
  EXPECT_EQ(sweep.path->kind, PathKind::smooth);
  EXPECT_NEAR(sweep.path->arc_deg, 95, 0.3);
  EXPECT_NEAR(std::abs(sweep.path->axis->z()), 1, 1e-4);
  EXPECT_NEAR(sweep.path->source_to_axis_mm, 620, 2);
  EXPECT_NEAR(*sweep.path->source_to_detector_mm, 1000, 3);
}

TEST(RunSweep, AFileOfSomeOfTheBallsGivesNoWrongCamera) {
  DrawnRun run;
  run.frames = 6;
  const TemporaryFolder folder;
  run.write(folder.path());
  Json calibrator = read_json(folder.path() / "calibrator.json").value();
  calibrator["balls"].erase(calibrator["balls"].begin() + 6, calibrator["balls"].end());
  ASSERT_TRUE(write_file(folder.path() / "calibrator.json", calibrator.dump()));
  const Sweep sweep = *run_sweep(*read_sweep_case(folder.path()));
  for (const SweepFrame& frame : sweep.frames) {
    if (!frame.best) continue;
    EXPECT_LT(reprojection_px(frame.best->view, run.view(frame.number - 1)), 2) << frame.view;
  }
}

TEST(RunSweep, StatedDistanceThatTheImagesContradictIsWarnedOf) {
  DrawnRun run;
  run.stated_source_detector_mm = 1300;
  const Sweep sweep = sweep_of(run);
  ASSERT_FALSE(sweep.failure) << sweep.failure->message;
  EXPECT_TRUE(std::ranges::any_of(sweep.warnings, [](const Warning& warning) {
    return warning.reason == Reason::intrinsics_inconsistent && warning.figures.at("stated_mm") == 1300;
  }));
}

TEST(RunSweep, BallWhoseCoordinatesAreWrongIsNamed) {
  const TemporaryFolder folder;
  DrawnRun run;
  run.frames = 8;
  run.write(folder.path());
  Json calibrator = *read_json(folder.path() / "calibrator.json");
  calibrator["balls"][2]["xyz_mm"][0] = calibrator["balls"][2]["xyz_mm"][0].get<double>() + 5;
  ASSERT_TRUE(write_file(folder.path() / "calibrator.json", calibrator.dump()));
  const Sweep sweep = *run_sweep(*read_sweep_case(folder.path()));
  ASSERT_FALSE(sweep.failure) << sweep.failure->message;
  const auto named = std::ranges::find(sweep.warnings, Reason::ball_displaced, &Warning::reason);
  ASSERT_NE(named, sweep.warnings.end());
  EXPECT_NE(named->message.find("G3 "), std::string::npos);
  EXPECT_EQ(std::ranges::count(sweep.warnings, Reason::ball_displaced, &Warning::reason), 1);
}

TEST(RunSweep, MirroredImagesWithoutAStatementAreRefusedAsByRun) {
  const TemporaryFolder folder;
  DrawnRun run;
  run.frames = 6;
  run.write(folder.path());
  Json calibrator = *read_json(folder.path() / "calibrator.json");
  for (Json& ball : calibrator["balls"]) ball["xyz_mm"][0] = -ball["xyz_mm"][0].get<double>();
  ASSERT_TRUE(write_file(folder.path() / "calibrator.json", calibrator.dump()));
  const Sweep refused = *run_sweep(*read_sweep_case(folder.path()));
  ASSERT_TRUE(refused.failure);
  EXPECT_EQ(refused.failure->reason, Reason::ambiguous_handedness);
  for (const SweepFrame& frame : refused.frames) EXPECT_FALSE(frame.best);
  Json json = *read_json(folder.path() / "case.json");
  json["views"][0]["mirrored"] = true;
  ASSERT_TRUE(write_file(folder.path() / "case.json", json.dump()));
  const Sweep stated = *run_sweep(*read_sweep_case(folder.path()));
  ASSERT_FALSE(stated.failure) << stated.failure->message;
  EXPECT_EQ(std::ranges::count(stated.notes, Reason::ambiguous_handedness, &Warning::reason), 1);
}

TEST(RunSweep, CopiesOfAnImageAreNamedAndNotUsedTwice) {
  const TemporaryFolder folder;
  DrawnRun run;
  run.frames = 4;
  run.write(folder.path());
  for (const char* kind : {"png", "json"})
    for (const int copy : {3, 4})
      std::filesystem::copy_file(folder.path() / fmt::format("run_002.{}", kind),
                                 folder.path() / fmt::format("run_{:03d}.{}", copy, kind),
                                 std::filesystem::copy_options::overwrite_existing);
  const Sweep sweep = *run_sweep(*read_sweep_case(folder.path()));
  ASSERT_FALSE(sweep.failure) << sweep.failure->message;
  for (const SweepFrame& frame : sweep.frames) {
    ASSERT_EQ(frame.failure.has_value(), frame.number > 2) << frame.number;
    if (!frame.failure) continue;
    EXPECT_EQ(frame.failure->reason, Reason::views_too_close);
    EXPECT_NE(frame.failure->message.find("RUN/2"), std::string::npos);
  }
}

TEST(RunSweep, AWrongPixelSizeOfAllImagesIsNamedAsTheCause) {
  DrawnRun run;
  run.frames = 3;
  const TemporaryFolder folder;
  run.write(folder.path());
  for (int i = 1; i <= run.frames; ++i)
    ASSERT_TRUE(write_file(folder.path() / fmt::format("run_{:03d}.json", i),
                           Json({{"pixel_mm", 0.55}, {"source_detector_mm", 1000}}).dump()));
  const Sweep sweep = *run_sweep(*read_sweep_case(folder.path()));
  ASSERT_TRUE(sweep.failure);
  ASSERT_TRUE(sweep.failure->figures.contains("fitting_pixel_mm")) << sweep.failure->message;
  EXPECT_NEAR(sweep.failure->figures.at("fitting_pixel_mm"), 1, 0.05);
}

TEST(RunSweep, RadiiInPlaceOfDiametersAreNamedAsTheCause) {
  const TemporaryFolder folder;
  DrawnRun run;
  run.frames = 3;
  run.write(folder.path());
  Json calibrator = *read_json(folder.path() / "calibrator.json");
  for (Json& ball : calibrator["balls"]) ball["diameter_mm"] = ball["diameter_mm"].get<double>() / 2;
  ASSERT_TRUE(write_file(folder.path() / "calibrator.json", calibrator.dump()));
  const Sweep sweep = *run_sweep(*read_sweep_case(folder.path()));
  ASSERT_TRUE(sweep.failure);
  ASSERT_TRUE(sweep.failure->figures.contains("fitting_diameters")) << sweep.failure->message;
  EXPECT_NEAR(sweep.failure->figures.at("fitting_diameters"), 2, 0.15);
}

TEST(RunSweep, ABallOutsideTheFieldIsNotSaidToBeLost) {
  const phantom::Calibrator calibrator{"one", {{"G1", {0, 0, 40}, 4}}, {}};
  const auto warnings = [&](fiducials::FiducialStatus status) {
    std::vector<FrameEstimate> estimates(4);
    for (FrameEstimate& at : estimates) {
      at.fiducials.fiducials.resize(1);
      at.fiducials.fiducials.front().status = status;
    }
    Sweep sweep;
    warn_of_unused_balls(sweep, estimates, calibrator);
    return sweep.warnings;
  };
  EXPECT_TRUE(warnings(fiducials::FiducialStatus::outside).empty());
  const auto lost = warnings(fiducials::FiducialStatus::not_found);
  ASSERT_EQ(lost.size(), 1U);
  EXPECT_NE(lost[0].message.find("G1 fits in 0 of the 4 images"), std::string::npos);
}

TEST(RunSweep, ACalibratorOfAnotherSizeThanItsBallsShowIsWarnedOf) {
  const TemporaryFolder folder;
  DrawnRun run;
  run.frames = 8;
  run.write(folder.path());
  const auto is_of_scale = [](const Warning& warning) { return warning.reason == Reason::scale_disagrees; };
  const Sweep right = *run_sweep(*read_sweep_case(folder.path()));
  EXPECT_TRUE(std::ranges::none_of(right.warnings, is_of_scale));
  EXPECT_EQ(std::ranges::count(right.notes, Reason::scale_unverified, &Warning::reason), 1);
  Json calibrator = *read_json(folder.path() / "calibrator.json");
  for (Json& ball : calibrator["balls"])
    for (Json& coordinate : ball["xyz_mm"]) coordinate = 1.2 * coordinate.get<double>();
  ASSERT_TRUE(write_file(folder.path() / "calibrator.json", calibrator.dump()));
  const Sweep wrong = *run_sweep(*read_sweep_case(folder.path()));
  ASSERT_FALSE(wrong.failure) << wrong.failure->message;
  const auto warned = std::ranges::find_if(wrong.warnings, is_of_scale);
  ASSERT_NE(warned, wrong.warnings.end());
  EXPECT_NEAR(warned->figures.at("file_over_true"), 1.2, 0.06);
}

TEST(RunSweep, FromAMotionOfThePhantomOnTheImagesAreRefused) {
  DrawnRun run;
  run.frames = 26;
  run.step_deg = 3;
  run.moved_from = 18;
  const Sweep sweep = sweep_of(run);
  ASSERT_FALSE(sweep.failure);
  for (const SweepFrame& frame : sweep.frames) {
    EXPECT_EQ(frame.failure.has_value(), frame.number >= 18) << frame.number;
    if (frame.failure) {
      EXPECT_EQ(frame.failure->reason, Reason::phantom_changed);
    }
  }
  EXPECT_GT(sweep.acquisitions.size(), 0U);
  EXPECT_LE(sweep.acquisitions.size(), 17U) << "refused images stay out of the C-arm's record";
}

TEST(RunSweep, FewImagesAreCalibratedAloneUnlessAPathIsAskedFor) {
  DrawnRun run;
  run.frames = 9;
  const Sweep free = sweep_of(run);
  EXPECT_EQ(free.path->kind, PathKind::free);
  EXPECT_EQ(free.frames[4].best->view.projection(), free.frames[4].alone->view.projection());
  SweepOptions options;
  options.path = PathKind::smooth;
  EXPECT_EQ(sweep_of(run, options).path->kind, PathKind::smooth);
}

TEST(RunSweep, ARunWithoutAnyBallIsRefused) {
  DrawnRun run;
  run.frames = 2;
  run.blank = {1, 2};
  const Sweep sweep = sweep_of(run);
  ASSERT_TRUE(sweep.failure);
  EXPECT_EQ(sweep.failure->reason, Reason::blank_image);
  const TemporaryFolder folder;
  ASSERT_TRUE(write_sweep(sweep, folder.path()));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "geometry"));
}

TEST(RunSweep, ForRtkTheAxisIsAlsoTurnedToY) {
  const Sweep sweep = sweep_of(DrawnRun{});
  const TemporaryFolder folder;
  ASSERT_TRUE(write_sweep(sweep, folder.path()));
  const auto cameras = exchange::import_cameras(folder.path() / "geometry/rtk_axis_y.xml");
  const auto turned = exchange::read_itk_transform(folder.path() / "geometry/rtk_axis_y.tfm");
  ASSERT_TRUE(cameras);
  ASSERT_TRUE(turned && *turned);
  ASSERT_EQ(cameras->size(), sweep.frames.size());
  const Eigen::Vector3d point(10, -20, 30);
  for (std::size_t i = 0; i < cameras->size(); ++i) {
    const geometry::View& view = (*cameras)[i].view;
    EXPECT_LT((view.project(**turned * point) - sweep.frames[i].best->view.project(point)).norm(), 1e-6);
    EXPECT_LT(std::abs(view.source_in_world().y()), 5) << i;
    EXPECT_LT(view.camera_from_world.rotation(1, 1), -0.95) << "upside down";
  }
}

TEST(RunSweep, FilesOfAnEarlierRunAreRemoved) {
  DrawnRun run;
  run.frames = 3;
  const Sweep sweep = sweep_of(run);
  const TemporaryFolder folder;
  ASSERT_TRUE(write_sweep(sweep, folder.path()));
  for (const char* name : {"sweep.json", "report.html", "geometry/rtk.xml", "geometry/plastimatch/0003.txt"})
    EXPECT_TRUE(std::filesystem::exists(folder.path() / name)) << name;
  const auto json = read_json(folder.path() / "sweep.json");
  ASSERT_TRUE(json);
  EXPECT_EQ((*json)["format"], "helicarm-sweep/1");
  EXPECT_EQ((*json)["frames"][2]["view"], "RUN/3");
  EXPECT_EQ((*json)["frames"][2]["parameters"]["order"].size(), 11u);
  forget_sweep(folder.path());
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace helicarm::sweep
