// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/case_of.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::operation {
namespace case_of_test {

namespace fs = std::filesystem;

class CaseOfOperation : public testing::Test {
 protected:
  CaseOfOperation() {
    plan_.bones = {"L4"};
    plan_.tracker.markers = {{"L4", "a"}};
    plan_.tunnels = {{"left", "L4", "in", "out"}, {"right", "L4", "in", "deep"}};
    for (const char* point : {"in", "out"})
      for (const char* view : {"AP", "LAT"})
        plan_.picks.push_back(
            {.name = point, .view = view, .uv_raw = {100, 200}, .sigma_px = {}, .moves_with = "L4"});
    for (const char* view : {"AP", "LAT"}) images_.push_back({view, {}, {}, poses()});
  }
  static guidance::Poses poses() {
    guidance::Poses poses;
    poses.tracker_from_calibrator = geometry::RigidTransform{Eigen::Matrix3d::Identity(), {0.1, 20, 900}};
    poses.tracker_from_bone["L4"] = {Eigen::Matrix3d::Identity(), {30, 1.0 / 3, 900}};
    return poses;
  }
  Expected<pipeline::Case> made() const {
    return files_of(plan_).and_then([&](const PlanFiles& files) {
      return operation_case(folder_.path(), plan_, files, images_, {}, {});
    });
  }
  std::string file(const std::string& name, const Json& json) const {
    fs::create_directories((folder_.path() / name).parent_path());
    EXPECT_TRUE(write_file(folder_.path() / name, to_text(json)));
    return (folder_.path() / name).string();
  }

  TemporaryFolder folder_;
  OperationPlan plan_;
  std::vector<CaseImage> images_;
};

TEST_F(CaseOfOperation, WrittenCaseIsTheOneThatIsMeasured) {
  const auto value = made();
  ASSERT_TRUE(value) << value.error().message;
  const auto read = pipeline::case_from_json(pipeline::to_json(*value), "case.json", folder_.path());
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(pipeline::to_json(*read), pipeline::to_json(*value));
  EXPECT_EQ(read->views[1].poses.tracker_from("L4")->translation, poses().tracker_from("L4")->translation);
}

TEST_F(CaseOfOperation, TunnelWithoutAPickedEndIsLeftOut) {
  const auto value = made();
  ASSERT_TRUE(value) << value.error().message;
  ASSERT_EQ(value->tunnels.size(), 1u);
  EXPECT_EQ(value->tunnels[0].name, "left");
}

TEST_F(CaseOfOperation, PickNamedAsATargetIsRefused) {
  phantom::Calibrator calibrator = phantom::udcsc();
  calibrator.targets.push_back({"in", {0, 0, 10}, phantom::TargetKind::ball, 3, {}});
  plan_.calibrator = file("own.json", phantom::to_json(calibrator));
  EXPECT_EQ(made().error().reason, Reason::name_clash);
}

TEST_F(CaseOfOperation, CalibratorAndPlateOfOneFileNameAreRefused) {
  plan_.calibrator = file("a/part.json", phantom::to_json(phantom::udcsc()));
  plan_.plate = file("b/part.json", phantom::to_json(phantom::plate48()));
  EXPECT_EQ(files_of(plan_).error().reason, Reason::name_clash);
}

TEST_F(CaseOfOperation, CalibratorThatIsMissingIsRefused) {
  plan_.calibrator = (folder_.path() / "none.json").string();
  EXPECT_FALSE(files_of(plan_));
}

TEST_F(CaseOfOperation, FilesAreFoundFromThePlansFolder) {
  file("plans/cone.json", phantom::to_json(phantom::udcsc()));
  plan_.calibrator = "cone.json";
  plan_.plate.reset();
  EXPECT_FALSE(files_of(plan_)) << "in the working directory";
  plan_.folder = folder_.path() / "plans";
  const auto files = files_of(plan_);
  ASSERT_TRUE(files) << files.error().message;
  EXPECT_EQ(files->calibrator.balls.size(), phantom::udcsc().balls.size());
}

TEST_F(CaseOfOperation, FilesOfThePlanAreFoundAgainInTheCasesFolder) {
  phantom::Calibrator calibrator = phantom::udcsc();
  calibrator.tolerance_mm = 0.03;
  plan_.calibrator = file("elsewhere/own.json", phantom::to_json(calibrator));
  const PlanFiles files = files_of(plan_).value();
  EXPECT_EQ(files.calibrator_name, "own.json");
  file("case-1/own.json", phantom::to_json(calibrator));
  const PlanFiles again = files_of_case(plan_, folder_.path() / "case-1").value();
  EXPECT_EQ(again.calibrator_name, "own.json");
  EXPECT_EQ(again.calibrator.tolerance_mm, 0.03);
  EXPECT_EQ(again.plate_name, "plate48");
}

}  // namespace case_of_test
}  // namespace helicarm::operation
