// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/load.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/volume/write_nrrd.h"
#include "helicarm/xray/dicom_builder.h"

namespace helicarm::case_registration {
namespace {

using testing::HasSubstr;

/// A dense block in x from 4 to 19 and, as labels 3 and 8, its halves.
class LoadLabelMap : public testing::Test {
 protected:
  LoadLabelMap() {
    std::vector<std::uint8_t> bone, labels;
    for (int i = 0; i < 24 * 24 * 24; ++i) {
      const int x = i % 24, y = i / 24 % 24, z = i / 576;
      const bool inside = std::min({x, y, z}) >= 4 && std::max({x, y, z}) < 20;
      bone.push_back(static_cast<std::uint8_t>(inside ? 250 : z));
      labels.push_back(!inside ? 0 : x < 12 ? 3 : 8);
    }
    model_.name = "femur";
    model_.volume = folder_.path() / "ct.nrrd";
    model_.mask.file = folder_.path() / "labels.nrrd";
    const Eigen::Affine3d place = Eigen::Affine3d::Identity();
    EXPECT_TRUE(write_file(*model_.volume, volume::to_nrrd({24, 24, 24}, place, bone)));
    EXPECT_TRUE(write_file(*model_.mask.file, volume::to_nrrd({24, 24, 24}, place, labels)));
  }

  TemporaryFolder folder_;
  pipeline::CaseModel model_;
};

TEST_F(LoadLabelMap, TheChosenLabelIsTheBody) {
  model_.mask.label = 3;
  const auto loaded = load_model(model_);
  ASSERT_TRUE(loaded) << loaded.error().message;
  EXPECT_NEAR(loaded->model->centre.x(), 7.5, 0.7);
  model_.mask.label = 8;
  EXPECT_NEAR(load_model(model_)->model->centre.x(), 15.5, 0.7);
}

TEST_F(LoadLabelMap, TheBodyInTheCtIsThatOfTheMaskOrTheWindow) {
  const volume::Volume ct = volume_of(model_).value();
  const auto voxels = [&] {
    const auto body = body_in(ct, model_).value();
    return std::ranges::count(body, 1);
  };
  model_.mask.label = 3;
  EXPECT_EQ(voxels(), 2048);
  model_.mask = {};
  EXPECT_EQ(voxels(), 0);
  model_.window_hu = {150, 3000};
  EXPECT_EQ(voxels(), 4096);
}

TEST_F(LoadLabelMap, SeveralLabelsWithoutAChoiceAreRefused) {
  const auto refused = load_model(model_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_THAT(refused.error().message,
              HasSubstr("\"femur\": labels.nrrd: holds 2 labels, 3 (2048 voxels), 8 (2048 voxels): choose "
                        "one with \"mask_label\""));
}

TEST_F(LoadLabelMap, ALabelThatIsNotThereIsRefused) {
  model_.mask.label = 4;
  EXPECT_THAT(load_model(model_).error().message, HasSubstr("holds no label 4"));
}

/// A tunnel of 2 mm in the second half, 3.5 mm from the first.
MarkupPlan plan_in_the_second_half() {
  MarkupPlan plan;
  plan.points = {{"start", {15, 11.5, 0}}, {"end", {15, 11.5, 23}}};
  plan.tunnels = {{"tunnel", 0, 1, 2.0, 0.5}};
  return plan;
}

TEST_F(LoadLabelMap, TunnelsAreComparedWithTheBoneThatHoldsThem) {
  model_.mask = {};
  model_.window_hu = {100, 3000};
  EXPECT_NEAR(*load_model(model_, plan_in_the_second_half())->bone_checks[0]->bridge_mm, 3.5, 0.4);
  model_.tunnel_mask.file = folder_.path() / "labels.nrrd";
  EXPECT_THAT(load_model(model_, plan_in_the_second_half()).error().message,
              HasSubstr("choose one with \"tunnel_mask_label\""));
  model_.tunnel_mask.label = 8;
  const auto loaded = load_model(model_, plan_in_the_second_half());
  ASSERT_TRUE(loaded) << loaded.error().message;
  EXPECT_NEAR(*loaded->bone_checks[0]->bridge_mm, 2.5, 0.4);
  EXPECT_NEAR(loaded->model->centre.x(), 11.5, 0.7) << "registered as a whole";
}

TEST_F(LoadLabelMap, ATunnelMaskOfAnotherGridIsRefused) {
  model_.mask.label = 8;
  model_.tunnel_mask.file = folder_.path() / "other.nrrd";
  EXPECT_TRUE(write_file(
      *model_.tunnel_mask.file,
      volume::to_nrrd({9, 9, 9}, Eigen::Affine3d(Eigen::Scaling(2.7)), std::vector<std::uint8_t>(729, 1))));
  EXPECT_THAT(load_model(model_).error().message, HasSubstr("femur: tunnel_mask"));
}

TEST_F(LoadLabelMap, AnEmptyMaskIsRefused) {
  EXPECT_TRUE(write_file(*model_.mask.file, volume::to_nrrd({24, 24, 24}, Eigen::Affine3d::Identity(),
                                                            std::vector<std::uint8_t>(24 * 24 * 24, 0))));
  EXPECT_THAT(load_model(model_).error().message, HasSubstr("femur: mask: the mask is empty"));
}

/// The halves as segments 3 and 8 of a DICOM segmentation, without the slices that are empty.
class LoadSegmentation : public LoadLabelMap {
 protected:
  using Builder = xray::DicomBuilder;

  LoadSegmentation() { model_.mask.file = folder_.path() / "seg.dcm"; }

  static std::string text(std::uint32_t tag, std::string value) {
    if (value.size() % 2 != 0) value += ' ';
    return Builder::element(tag, "DS", value, true);
  }
  static std::string word(std::uint32_t tag, int value) {
    return Builder::element(tag, "US", Builder::number(value, 2), true);
  }
  static std::string group(std::uint32_t tag, const std::string& content) {
    return Builder::element(tag, "SQ", Builder::item(content), true);
  }

  void write(double first_z) const {
    std::string frames, bits(32 * 24 * 24 / 8, '\0');
    int frame = 0;
    for (const int segment : {3, 8})
      for (int z = 4; z < 20; ++z, ++frame) {
        frames +=
            Builder::item(group(0x00209113, text(0x00200032, fmt::format("0\\0\\{}", first_z + z - 4))) +
                          group(0x0062000A, word(0x0062000B, segment)));
        for (int y = 4; y < 20; ++y)
          for (int x = segment == 3 ? 4 : 12; x < (segment == 3 ? 12 : 20); ++x) {
            const int bit = (frame * 24 + y) * 24 + x;
            bits[std::size_t(bit / 8)] = char(bits[std::size_t(bit / 8)] | 1 << bit % 8);
          }
      }
    Builder builder;
    builder.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.66.4").text(0x00620001, "CS", "BINARY");
    builder.word(0x00280010, 24).word(0x00280011, 24).word(0x00280100, 1).text(0x00280008, "IS", "32");
    builder.raw(0x00620002, "SQ",
                Builder::item(word(0x00620004, 3) + text(0x00620005, "Femur")) +
                    Builder::item(word(0x00620004, 8) + text(0x00620005, "Tibia")));
    builder.raw(0x52009229, "SQ",
                Builder::item(group(0x00209116, text(0x00200037, "1\\0\\0\\0\\1\\0")) +
                              group(0x00289110, text(0x00280030, "1\\1"))));
    builder.raw(0x52009230, "SQ", frames).raw(0x7FE00010, "OB", bits);
    EXPECT_TRUE(write_file(*model_.mask.file, builder.bytes()));
  }
};

TEST_F(LoadSegmentation, TheChosenSegmentIsTheBody) {
  write(4);
  model_.mask.label = 3;
  const auto loaded = load_model(model_);
  ASSERT_TRUE(loaded) << loaded.error().message;
  EXPECT_NEAR(loaded->model->centre.x(), 7.5, 0.7);
  model_.mask.label = 8;
  EXPECT_NEAR(load_model(model_)->model->centre.x(), 15.5, 0.7);
}

TEST_F(LoadSegmentation, ASegmentIsChosenByItsLabel) {
  write(4);
  model_.mask.segment = "Tibia";
  EXPECT_NEAR(load_model(model_)->model->centre.x(), 15.5, 0.7);
  model_.mask.threshold = 0.5;
  EXPECT_THAT(load_model(model_).error().message, HasSubstr("takes no \"mask_threshold\""));
}

TEST_F(LoadSegmentation, ATunnelMaskIsChosenByItsOwnKeys) {
  write(4);
  model_.tunnel_mask = model_.mask;
  model_.mask = {};
  model_.window_hu = {100, 3000};
  EXPECT_THAT(load_model(model_).error().message,
              HasSubstr("\"tunnel_mask_label\" or \"tunnel_mask_segment\"; its segments: 3"));
  model_.tunnel_mask.segment = "Tibia";
  const auto loaded = load_model(model_, plan_in_the_second_half());
  ASSERT_TRUE(loaded) << loaded.error().message;
  EXPECT_NEAR(*loaded->bone_checks[0]->bridge_mm, 2.5, 0.4);
  model_.tunnel_mask.threshold = 0.5;
  EXPECT_THAT(load_model(model_).error().message, HasSubstr("takes no \"tunnel_mask_threshold\""));
}

TEST_F(LoadLabelMap, ALabelMapTakesNoSegment) {
  model_.mask.segment = "Tibia";
  EXPECT_THAT(load_model(model_).error().message,
              HasSubstr("is no DICOM segmentation: it takes no \"mask_segment\""));
}

TEST_F(LoadSegmentation, SeveralSegmentsWithoutAChoiceAreNamed) {
  write(4);
  const auto refused = load_model(model_);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message,
              HasSubstr("\"mask_label\" or \"mask_segment\"; its segments: 3 \"Femur\", 8 \"Tibia\""));
}

TEST_F(LoadSegmentation, OneThatLeavesTheCtIsRefused) {
  write(10);  // to z = 25
  model_.mask.label = 3;
  const auto refused = load_model(model_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::case_registration
