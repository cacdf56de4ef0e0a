// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/new_case.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::pipeline {
namespace {

namespace fs = std::filesystem;

/// A simulated case as loose files, with names that say nothing.
class NewCaseOf : public testing::Test {
 protected:
  void simulate(simulation::CaseKind kind) {
    simulation::SimulationOptions options;
    options.kind = kind;
    options.size = 512;
    options.seed = 4;
    ASSERT_TRUE(simulation::write_case(files(), *simulation::simulate_case(options)));
    fs::rename(files() / "AP.dcm", files() / "im1.dcm");
    fs::rename(files() / "LAT.dcm", files() / "im2.dcm");
  }

  fs::path files() const { return folder_.path() / "files"; }
  fs::path made() const { return folder_.path() / "made"; }

  std::vector<InspectedImage> images() const {
    std::vector<InspectedImage> all;
    for (const char* name : {"im1.dcm", "im2.dcm"}) all.push_back(*inspect_image({files() / name}));
    return all;
  }

  TemporaryFolder folder_;
};

TEST_F(NewCaseOf, AnIntensifierNamesViewsByAnglesAndFindsThePlate) {
  simulate(simulation::CaseKind::accuracy);
  const auto made_case = new_case(images(), {.calibrator = (files() / "calibrator.json").string()}, made());
  ASSERT_TRUE(made_case) << made_case.error().message;
  EXPECT_EQ(made_case->the_case.plate_name, "plate48");
  ASSERT_TRUE(write_new_case(*made_case, made()));
  const auto read_back = read_case(made());
  ASSERT_TRUE(read_back) << read_back.error().message;
  EXPECT_EQ(read_back->views[0].name, "AP");
  EXPECT_EQ(read_back->views[1].name, "LAT");
  EXPECT_EQ(*read_file(made() / "LAT.dcm", 1 << 24), *read_file(files() / "im2.dcm", 1 << 24));
  EXPECT_EQ(write_new_case(*made_case, made()).error().reason, Reason::cannot_write);
}

TEST_F(NewCaseOf, AFlatPanelHasNoPlate) {
  simulate(simulation::CaseKind::flat);
  const auto made_case = new_case(images(), {.calibrator = "udcsc"}, made());
  ASSERT_TRUE(made_case) << made_case.error().message;
  EXPECT_FALSE(made_case->the_case.plate_name);
  EXPECT_EQ(made_case->the_case.calibrator_name, "udcsc");
}

TEST_F(NewCaseOf, FilesInItsFolderNamesThemWhereTheyAre) {
  simulate(simulation::CaseKind::flat);
  fs::remove(files() / "case.json");
  const auto made_case = new_case(images(), {.calibrator = "udcsc"}, files());
  ASSERT_TRUE(made_case) << made_case.error().message;
  EXPECT_TRUE(made_case->copies.empty());
  EXPECT_EQ(to_json(made_case->the_case)["views"][1]["image"], "im2.dcm");
}

TEST_F(NewCaseOf, StatedPixelSizeStandsInItsViewsUnlessAnImageContradictsIt) {
  simulate(simulation::CaseKind::flat);
  std::vector<InspectedImage> bare = images();
  for (InspectedImage& image : bare) image.xray_image.acquisition.pixel_mm.reset();
  const auto made_case =
      new_case(bare, {.calibrator = "udcsc", .stated = {.pixel_mm = 0.25, .source_detector_mm = {}}}, made());
  ASSERT_TRUE(made_case) << made_case.error().message;
  for (const CaseView& view : made_case->the_case.views) {
    EXPECT_EQ(view.pixel_mm, 0.25);
    EXPECT_FALSE(view.source_detector_mm);
  }
  const Failure refused =
      new_case(bare, {.calibrator = "udcsc", .stated = {.pixel_mm = {}, .source_detector_mm = 500}}, made())
          .error();
  EXPECT_EQ(refused.reason, Reason::bad_value);
  EXPECT_THAT(refused.message, testing::HasSubstr("source_detector_mm"));
}

TEST_F(NewCaseOf, StatedAnglesStandInTheirView) {
  simulate(simulation::CaseKind::flat);
  std::vector<InspectedImage> bare = images();
  for (InspectedImage& image : bare) {
    image.xray_image.acquisition.primary_angle_deg.reset();
    image.xray_image.acquisition.secondary_angle_deg.reset();
  }
  bare[0].view = "front";
  const NewCaseOptions options{.calibrator = "udcsc", .angles_deg = {{"front", {12, -3}}}};
  const auto made_case = new_case(bare, options, made());
  ASSERT_TRUE(made_case) << made_case.error().message;
  EXPECT_EQ(made_case->the_case.views[0].primary_deg, 12);
  EXPECT_EQ(made_case->the_case.views[0].secondary_deg, -3);
  EXPECT_FALSE(made_case->the_case.views[1].primary_deg);
  bare[0].view = "side";
  EXPECT_EQ(new_case(bare, options, made()).error().reason, Reason::usage);
}

TEST_F(NewCaseOf, SidecarOfADicomFileIsCopiedWithIt) {
  simulate(simulation::CaseKind::flat);
  ASSERT_TRUE(write_file(files() / "im1.dcm.json", R"({"pixel_mm": null})"));
  const auto made_case = new_case(images(), {.calibrator = "udcsc"}, made());
  ASSERT_TRUE(made_case) << made_case.error().message;
  EXPECT_TRUE(std::ranges::any_of(made_case->copies, [](const NewCase::Copy& copy) {
    return copy.from.filename() == "im1.dcm.json" && copy.to.string().ends_with(".dcm.json");
  }));
}

TEST_F(NewCaseOf, WithoutCalibratorIsRefusedByTheOptionsName) {
  simulate(simulation::CaseKind::flat);
  const Failure failure = new_case(images(), {}, made()).error();
  EXPECT_EQ(failure.reason, Reason::usage);
  EXPECT_THAT(failure.message, testing::HasSubstr("--calibrator"));
}

TEST_F(NewCaseOf, OneImageTwiceIsRefused) {
  simulate(simulation::CaseKind::flat);
  std::vector<InspectedImage> twice = images();
  twice[1] = twice[0];
  EXPECT_EQ(new_case(twice, {.calibrator = "udcsc"}, made()).error().reason, Reason::views_too_close);
}

TEST_F(NewCaseOf, UnknownViewOfAMapIsRefused) {
  simulate(simulation::CaseKind::flat);
  EXPECT_EQ(new_case(images(), {.calibrator = "udcsc", .maps = {{"OBL", "map.json"}}}, made()).error().reason,
            Reason::usage);
}

TEST(ChoosePlate, RoundFieldWithoutAPlateIsNotDecided) {
  InspectedImage image;
  image.view = "AP";
  image.xray_image.pixels = image::Image<float>(200, 200, 500);
  image.field = rectification::RoundField{{100, 100}, {90, 90}};
  const PlateChoice choice = choose_plate({image});
  EXPECT_FALSE(choice.plate);
  EXPECT_THAT(choice.why, testing::HasSubstr("intensifier"));
}

TEST(NewImage, HasViewFileAndFrame) {
  const NewImage image = new_image_from("OBL=run/series.dcm:12");
  EXPECT_EQ(image.view, "OBL");
  EXPECT_EQ(image.file, "run/series.dcm");
  EXPECT_EQ(image.frame, 12);
  EXPECT_EQ(new_image_from("series.dcm").frame, std::nullopt);
}

TEST(NewImage, OfAnExistingFileIsTakenWhole) {
  const TemporaryFolder folder;
  const fs::path odd = folder.path() / "AP=x.dcm:3";
  std::ofstream(odd) << "x";
  const NewImage image = new_image_from(odd.string());
  EXPECT_EQ(image.file, odd);
  EXPECT_TRUE(image.view.empty());
}

}  // namespace
}  // namespace helicarm::pipeline
