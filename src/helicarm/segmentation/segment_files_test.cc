// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/segment_files.h"

#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/image/png.h"
#include "helicarm/registration/model.h"
#include "helicarm/segmentation/scene_test.h"
#include "helicarm/volume/read_volume.h"
#include "helicarm/volume/write_nrrd.h"

namespace helicarm::segmentation {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// Bytes: 200 HU is 200, bone 250.
class SegmentFiles : public testing::Test {
 protected:
  SegmentFiles() {
    const TestCt ct = ct_of({upper, lower}, {2, 2, 2});
    std::vector<std::uint8_t> bytes, labels;
    for (const float voxel : ct.volume.voxels)
      bytes.push_back(static_cast<std::uint8_t>(std::min(voxel, 250.0F)));
    for (const int owner : ct.truth) labels.push_back(static_cast<std::uint8_t>(10 * owner));
    const auto& [size, voxels, place, warnings] = ct.volume;
    EXPECT_TRUE(write_file(folder_.path() / "ct.nrrd", volume::to_nrrd(size, place, bytes)));
    EXPECT_TRUE(write_file(folder_.path() / "map.nrrd", volume::to_nrrd(size, place, labels)));
    request_.ct = folder_.path() / "ct.nrrd";
    request_.seeds = {{"upper", {0, 0, 45}}};
    out_ = folder_.path() / "out";
  }

  Json written() {
    const auto made = answer(request_);
    EXPECT_TRUE(made) << made.error().message;
    const auto json = write_segmentation(*made, out_);
    EXPECT_TRUE(json) << json.error().message;
    return json ? *json : Json();
  }

  TemporaryFolder folder_;
  SegmentRequest request_;
  fs::path out_;
};

TEST_F(SegmentFiles, AreAMaskASurfaceAnImageAndFigures) {
  const Json json = written();
  EXPECT_EQ(*read_json(out_ / "segment.json"), json);
  EXPECT_EQ(json["format"], "helicarm-segmentation/1");
  EXPECT_EQ(json["volume"]["file"], "ct.nrrd");
  const Json& bone = json["bones"][0];
  EXPECT_GT(bone["left_out_percent"].get<double>(), 20);
  EXPECT_EQ(bone["left_out_cm3"], bone["contacts"][0]["with_cm3"]);
  EXPECT_EQ(bone["mask"], "upper.nrrd");
  EXPECT_GT(bone["surface_cm2"].get<double>(), 35);
  const auto ct = volume::read_volume(request_.ct), mask = volume::read_volume(out_ / "upper.nrrd");
  ASSERT_TRUE(mask) << mask.error().message;
  EXPECT_TRUE(registration::model_from("upper", *ct, *mask, std::nullopt));
  EXPECT_TRUE(registration::read_surface(out_ / "upper.stl"));
  EXPECT_TRUE(image::is_png(*read_file(out_ / "segment.png", 1 << 24)));
}

TEST_F(SegmentFiles, OfAnImageOfEightBitsWarn) {
  const Json warnings = written()["warnings"];
  ASSERT_FALSE(warnings.empty());
  EXPECT_EQ(warnings[0]["code"], "not_hounsfield");
}

TEST_F(SegmentFiles, OfAnEarlierRunAreRemoved) {
  written();
  forget_segmentation(out_, request_);
  EXPECT_TRUE(fs::is_empty(out_));
}

TEST_F(SegmentFiles, OfALabelMap) {
  request_.seeds.clear();
  request_.label_map = folder_.path() / "map.nrrd";
  request_.labels = {{"shin", {20}}};
  const Json json = written();
  EXPECT_EQ(json["bones"][0]["name"], "shin");
  EXPECT_TRUE(json["threshold_hu"].is_null());
  EXPECT_NEAR(json["bones"][0]["volume_cm3"].get<double>(), lower.volume_cm3(), 0.05 * lower.volume_cm3());
}

TEST_F(SegmentFiles, DoNotReplaceWhatIsRead) {
  request_.seeds[0].name = "ct";
  const auto made = answer(request_);
  ASSERT_TRUE(made);
  const auto refused = write_segmentation(*made, folder_.path());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::name_clash);
  EXPECT_TRUE(volume::read_volume(request_.ct));
}

TEST_F(SegmentFiles, SeedsOrALabelMapAreNeeded) {
  request_.label_map = folder_.path() / "map.nrrd";
  EXPECT_EQ(answer(request_).error().reason, Reason::usage);
  request_.label_map.reset();
  request_.seeds.clear();
  EXPECT_THAT(answer(request_).error().message, HasSubstr("--seed"));
  request_.labels = {{"a", {1}}};
  request_.seeds = {{"upper", {0, 0, 45}}};
  EXPECT_THAT(answer(request_).error().message, HasSubstr("--labels"));
}

}  // namespace
}  // namespace helicarm::segmentation
