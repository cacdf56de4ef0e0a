// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/label_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::volume {
namespace {

using testing::ElementsAre, testing::HasSubstr;

Volume row_of(std::vector<float> voxels) {
  return {{int(voxels.size()), 1, 1}, std::move(voxels), Eigen::Affine3d::Identity(), {}};
}

TEST(LabelMap, LabelsAreCounted) {
  const auto labels = labels_in(row_of({0, 2, 2, 0, 7, 2}));
  ASSERT_TRUE(labels);
  EXPECT_EQ(*labels, (std::map<int, std::size_t>{{2, 3}, {7, 1}}));
}

TEST(LabelMap, SeveralLabelsWithoutAChoiceAreRefused) {
  Volume map = row_of({0, 2, 2, 0, 7, 2});
  const auto refused = choose_label(map, std::nullopt, "femur: map.nrrd", "\"mask_label\"");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_EQ(refused.error().message,
            "femur: map.nrrd: holds 2 labels, 2 (3 voxels), 7 (1 voxels): choose one with \"mask_label\"");
}

TEST(LabelMap, OneLabelIsKept) {
  Volume map = row_of({0, 2, 2, 0, 7, 2});
  ASSERT_TRUE(choose_label(map, 7, "map", "key"));
  EXPECT_THAT(map.voxels, ElementsAre(0, 0, 0, 0, 1, 0));
}

TEST(LabelMap, AMissingLabelIsRefusedWithThoseThereAre) {
  Volume map = row_of({0, 2, 2, 0, 7, 2});
  EXPECT_THAT(choose_label(map, 3, "map", "key").error().message, HasSubstr("no label 3, but 2 (3 voxels)"));
  Volume empty = row_of({0, 0});
  EXPECT_THAT(choose_label(empty, 3, "map", "key").error().message, HasSubstr("only 0"));
}

TEST(LabelMap, AMaskOfOneValueNeedsNoChoice) {
  Volume mask = row_of({0, 255, 255, 0});
  ASSERT_TRUE(choose_label(mask, std::nullopt, "mask", "key"));
  EXPECT_THAT(mask.voxels, ElementsAre(0, 255, 255, 0));
}

TEST(LabelMap, AnInterpolatedMaskIsNoLabelMap) {
  Volume soft = row_of({0, 0.25F, 0.75F, 1});
  EXPECT_FALSE(labels_in(soft));
  EXPECT_TRUE(choose_label(soft, std::nullopt, "mask", "key"));
  EXPECT_EQ(choose_label(soft, 1, "mask", "key").error().reason, Reason::bad_value);
  std::vector<float> grey(256);
  for (std::size_t i = 0; i < grey.size(); ++i) grey[i] = float(i);
  EXPECT_FALSE(labels_in(row_of(grey)));
}

}  // namespace
}  // namespace helicarm::volume
