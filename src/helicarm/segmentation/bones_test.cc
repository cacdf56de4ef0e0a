// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/bones.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::segmentation {
namespace {

using testing::ElementsAre, testing::HasSubstr;
using Chosen = std::map<std::string, std::vector<int>>;

volume::Volume map_of(std::vector<float> voxels) {
  return {{int(voxels.size()), 1, 1}, std::move(voxels), Eigen::Affine3d::Identity(), {}};
}

TEST(SegmentationFrom, ChosenLabelsBecomeBones) {
  const volume::Volume map = map_of({0, 5, 5, 9, 0, 7});
  const auto made = segmentation_from(map, map, Chosen{{"femur", {5}}, {"shank", {7, 9}}}, "map.nrrd");
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_THAT(made->labels, ElementsAre(0, 1, 1, 2, 0, 2));
  EXPECT_EQ(made->bones[0].name, "femur");
  EXPECT_NEAR(made->bones[1].volume_cm3, 0.002, 1e-12);
  EXPECT_FALSE(made->threshold_hu);
}

TEST(SegmentationFrom, AnOnlyLabelNeedsNoChoice) {
  const volume::Volume map = map_of({0, 255, 255});
  const auto made = segmentation_from(map, map, {}, "map.nrrd");
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ(made->bones.at(0).name, "bone");
}

TEST(SegmentationFrom, SeveralLabelsWithoutAChoiceAreRefused) {
  const volume::Volume map = map_of({0, 5, 5, 9});
  const auto refused = segmentation_from(map, map, {}, "map.nrrd");
  EXPECT_THAT(refused.error().message,
              HasSubstr("5 (2 voxels), 9 (1 voxels): choose one with --label NAME=N"));
}

TEST(SegmentationFrom, FaultsAreRefused) {
  const volume::Volume map = map_of({0, 5, 5, 9}), other = map_of({0, 5, 5});
  const auto reason = [](const auto& made) { return made ? Reason::usage : made.error().reason; };
  EXPECT_EQ(reason(segmentation_from(other, map, {}, "map.nrrd")), Reason::bad_value);
  EXPECT_EQ(reason(segmentation_from(map, map, Chosen{{"a", {4}}}, "map.nrrd")), Reason::bad_value);
  EXPECT_EQ(reason(segmentation_from(map, map, Chosen{{"a", {5}}, {"b", {5}}}, "map.nrrd")),
            Reason::name_clash);
  EXPECT_EQ(reason(segmentation_from(map, map, Chosen{{"../a", {5}}}, "map.nrrd")), Reason::bad_value);
  EXPECT_THAT(segmentation_from(map_of({0, 0}), map_of({0, 0}), {}, "map.nrrd").error().message,
              HasSubstr("only 0"));
}

TEST(ChoiceFrom, IsANameAndLabels) {
  const auto chosen = choice_from("femur=5,12");
  ASSERT_TRUE(chosen);
  EXPECT_EQ(chosen->first, "femur");
  EXPECT_THAT(chosen->second, ElementsAre(5, 12));
  for (const char* wrong : {"femur", "5", "a=", "a=0", "a=-1", "a=1.5", "a=x"})
    EXPECT_EQ(choice_from(wrong).error().reason, Reason::usage) << wrong;
}

}  // namespace
}  // namespace helicarm::segmentation
