// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/write_case.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/simulation/truth_json.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::simulation {
namespace {

namespace fs = std::filesystem;

class WriteCase : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) /
              ("write_case_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  static SimulatedCase simulated(CaseKind kind, int bits) {
    SimulationOptions options;
    options.seed = 4;
    options.kind = kind;
    options.size = 512;
    options.bits = bits;
    options.knee = false;
    options.faults = {Fault::mirrored};
    return *simulate_case(options);
  }

  fs::path folder_;
};

TEST_F(WriteCase, DicomRoundTripKeepsPixelsAndTags) {
  for (int bits : {8, 12, 16}) {
    const SimulatedCase simulated_case = simulated(CaseKind::tunnels, bits);
    ASSERT_TRUE(write_case(folder_, simulated_case));
    for (const SimulatedView& view : simulated_case.views) {
      const auto xray_image =
          xray::read_xray_image(folder_ / (view.true_view.name + ".dcm"), view.true_view.name, {});
      ASSERT_TRUE(xray_image) << xray_image.error().message;
      EXPECT_TRUE(std::equal(view.pixels.pixels().begin(), view.pixels.pixels().end(),
                             xray_image->pixels.pixels().begin(), xray_image->pixels.pixels().end()));
      EXPECT_EQ(xray_image->highest, (1 << bits) - 1);
      EXPECT_NEAR(xray_image->acquisition.pixel_mm->x(), 235.0 / 512, 1e-9);
      EXPECT_EQ(xray_image->acquisition.source_detector_mm, 997);
      EXPECT_EQ(xray_image->acquisition.flip_hint, view.true_view.mirrored);
    }
  }
}

TEST_F(WriteCase, DifferentImagesHaveDifferentUidsForAnySeed) {
  const xray::DerivedImage one = dicom_of(simulated(CaseKind::accuracy, 12), 0);
  const xray::DerivedImage same = dicom_of(simulated(CaseKind::accuracy, 12), 0);
  const xray::DerivedImage other = dicom_of(simulated(CaseKind::tunnels, 12), 0);
  EXPECT_EQ(one.instance_uid, same.instance_uid);
  EXPECT_EQ(one.study_uid, same.study_uid);
  EXPECT_NE(one.instance_uid, other.instance_uid);
  EXPECT_NE(one.series_uid, other.series_uid);
  EXPECT_NE(one.study_uid, other.study_uid);
}

TEST_F(WriteCase, FilesAgreeWithTheSimulation) {
  const SimulatedCase simulated_case = simulated(CaseKind::accuracy, 12);
  ASSERT_TRUE(write_case(folder_, simulated_case));
  const auto calibrator = phantom::read_calibrator(folder_ / "calibrator.json");
  ASSERT_TRUE(calibrator) << calibrator.error().message;
  EXPECT_EQ(calibrator->balls.size(), 12u);
  EXPECT_EQ(calibrator->targets.size(), 5u);
  const auto plate = phantom::read_plate(folder_ / "plate.json");
  ASSERT_TRUE(plate) << plate.error().message;
  EXPECT_EQ(plate->dots_mm.size(), 48u);
}

TEST_F(WriteCase, TruthProjectsTheBallsToTheirIdealPixels) {
  const SimulatedCase simulated_case = simulated(CaseKind::accuracy, 12);
  const Json truth = truth_json(simulated_case);
  EXPECT_EQ(truth["format"], "helicarm-truth/1");
  for (const Json& view : truth["views"])
    for (const Json& ball : view["balls"]) {
      Eigen::Vector3d image = Eigen::Vector3d::Zero();
      for (std::size_t row = 0; row < 3; ++row) {
        const Json& p = view["camera"]["projection"][row];
        for (std::size_t i = 0; i < 3; ++i)
          image[static_cast<int>(row)] += p[i].get<double>() * ball["xyz_mm"][i].get<double>();
        image[static_cast<int>(row)] += p[3].get<double>();
      }
      EXPECT_NEAR(image.x() / image.z(), ball["ideal"][0].get<double>(), 1e-9);
      EXPECT_NEAR(image.y() / image.z(), ball["ideal"][1].get<double>(), 1e-9);
    }
}

TEST_F(WriteCase, TunnelCaseContainsPosesPicksTunnelsAndLines) {
  const Json json = case_json(simulated(CaseKind::tunnels, 12));
  EXPECT_EQ(json["picks"].size(), 8u);
  EXPECT_EQ(json["tunnels"].size(), 2u);
  EXPECT_EQ(json["tool_lines"].size(), 2u);
  EXPECT_TRUE(json["poses_now"].contains("tracker_from_tool"));
  EXPECT_EQ(json["views"][0]["poses"]["tracker_from_bone"], json["poses_now"]["tracker_from_bone"]);
}

TEST_F(WriteCase, EarlierSimulationIsReplacedWithoutLeftovers) {
  ASSERT_TRUE(write_case(folder_, simulated(CaseKind::accuracy, 12)));
  ASSERT_TRUE(write_case(folder_, simulated(CaseKind::flat, 16)));
  EXPECT_FALSE(fs::exists(folder_ / "plate.json"));
  EXPECT_TRUE((*read_json(folder_ / "case.json"))["plate"].is_null());
}

TEST_F(WriteCase, OtherFilesAreNotOverwritten) {
  fs::create_directories(folder_);
  ASSERT_TRUE(write_file(folder_ / "case.json", "{}"));
  const auto written = write_case(folder_, simulated(CaseKind::accuracy, 12));
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().reason, Reason::cannot_write);
  EXPECT_EQ(*read_file(folder_ / "case.json", 100), "{}");
}

}  // namespace
}  // namespace helicarm::simulation
