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

TEST(OntoGrid, ReversedAndExchangedAxesAreReordered) {
  Volume ct{{3, 2, 4}, std::vector<float>(24), Eigen::Affine3d::Identity(), {}};
  ct.patient_from_voxel = Eigen::Translation3d(5, -7, 90) * Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()) *
                          Eigen::Scaling(0.5, 0.6, 2.0);
  for (std::size_t i = 0; i < 24; ++i) ct.voxels[i] = float(i);
  // Columns of the map run along the CT's slices, its rows against the CT's columns.
  Volume map{{4, 3, 2}, {}, {}, {}};
  Eigen::Affine3d ct_from_map = Eigen::Affine3d::Identity();
  ct_from_map.linear() << 0, -1, 0, 0, 0, 1, 1, 0, 0;
  ct_from_map.translation() << 2, 0, 0;
  map.patient_from_voxel = ct.patient_from_voxel * ct_from_map;
  for (int z = 0; z < 2; ++z)
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 4; ++x) map.voxels.push_back(float((2 - y) + 3 * (z + 2 * x)));
  ASSERT_TRUE(onto_grid(map, ct));
  EXPECT_EQ(map.size, ct.size);
  EXPECT_EQ(map.voxels, ct.voxels);
  EXPECT_EQ(map.patient_from_voxel.matrix(), ct.patient_from_voxel.matrix());
}

TEST(OntoGrid, AnotherGridIsLeftAsItIs) {
  const Volume ct{{3, 2, 4}, std::vector<float>(24), Eigen::Affine3d::Identity(), {}};
  Volume shifted = ct, finer = ct, shorter = ct;
  shifted.patient_from_voxel.translation().x() = 1;
  finer.patient_from_voxel.linear() *= 0.9;
  shorter.size = {3, 2, 3};
  EXPECT_FALSE(onto_grid(shifted, ct));
  EXPECT_FALSE(onto_grid(finer, ct));
  EXPECT_FALSE(onto_grid(shorter, ct));
  EXPECT_EQ(shifted.patient_from_voxel.translation().x(), 1);
}

TEST(OntoGrid, AMapOfAPartIsFilledUp) {
  const Volume ct{{3, 2, 4}, std::vector<float>(24), Eigen::Affine3d::Identity(), {}};
  Volume part{{2, 1, 2}, {5, 6, 7, 8}, Eigen::Affine3d(Eigen::Translation3d(1, 1, 2)), {}};
  const Volume given = part;
  ASSERT_TRUE(onto_grid(part, ct));
  EXPECT_EQ(part.size, ct.size);
  std::vector<float> expected(24);
  expected[16] = 5, expected[17] = 6, expected[22] = 7, expected[23] = 8;
  EXPECT_EQ(part.voxels, expected);
  part = given;
  part.patient_from_voxel.translation().z() = 3;  // beyond the CT's end
  EXPECT_FALSE(onto_grid(part, ct));
  part.patient_from_voxel.translation().setZero();
  EXPECT_FALSE(onto_grid(part, ct));
  EXPECT_TRUE(onto_grid(part, ct, true));
}

TEST(LabelMap, LabelsAreCounted) {
  const auto labels = labels_in(row_of({0, 2, 2, 0, 7, 2}));
  ASSERT_TRUE(labels);
  EXPECT_EQ(*labels, (std::map<int, std::size_t>{{2, 3}, {7, 1}}));
}

TEST(LabelMap, SeveralLabelsWithoutAChoiceAreRefused) {
  Volume map = row_of({0, 2, 2, 0, 7, 2});
  const auto refused = choose_mask(map, std::nullopt, std::nullopt, "femur: map.nrrd", "mask");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_EQ(refused.error().message,
            "femur: map.nrrd: holds 2 labels, 2 (3 voxels), 7 (1 voxels): choose one with \"mask_label\"");
}

TEST(LabelMap, OneLabelIsKept) {
  Volume map = row_of({0, 2, 2, 0, 7, 2});
  ASSERT_TRUE(choose_mask(map, 7, std::nullopt, "map", "key"));
  EXPECT_THAT(map.voxels, ElementsAre(0, 0, 0, 0, 1, 0));
}

TEST(LabelMap, AMissingLabelIsRefusedWithThoseThereAre) {
  Volume map = row_of({0, 2, 2, 0, 7, 2});
  EXPECT_THAT(choose_mask(map, 3, std::nullopt, "map", "key").error().message,
              HasSubstr("no label 3, but 2 (3 voxels)"));
  Volume empty = row_of({0, 0});
  EXPECT_THAT(choose_mask(empty, 3, std::nullopt, "map", "key").error().message, HasSubstr("only 0"));
}

TEST(LabelMap, AMaskOfOneValueNeedsNoChoice) {
  Volume mask = row_of({0, 255, 255, 0});
  ASSERT_TRUE(choose_mask(mask, std::nullopt, std::nullopt, "mask", "key"));
  EXPECT_THAT(mask.voxels, ElementsAre(0, 255, 255, 0));
}

TEST(LabelMap, SharesNeedAThreshold) {
  Volume soft = row_of({0, 0.25F, 0.75F, 1});
  EXPECT_FALSE(labels_in(soft));
  EXPECT_EQ(choose_mask(soft, 1, std::nullopt, "mask", "key").error().reason, Reason::bad_value);
  EXPECT_THAT(choose_mask(soft, std::nullopt, std::nullopt, "mask", "key").error().message,
              HasSubstr("\"key_threshold\""));
  ASSERT_TRUE(choose_mask(soft, std::nullopt, 0.5, "mask", "key"));
  EXPECT_THAT(soft.voxels, ElementsAre(0, 0, 1, 1));
  std::vector<float> values(256);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = float(i);
  Volume grey = row_of(values);
  EXPECT_FALSE(labels_in(grey));
  ASSERT_TRUE(choose_mask(grey, std::nullopt, 0.5, "mask", "key"));
  EXPECT_EQ(std::ranges::count(grey.voxels, 1.0F), 128);
}

TEST(LabelMap, LabelsTakeNoThreshold) {
  Volume mask = row_of({0, 255, 255, 0});
  EXPECT_EQ(choose_mask(mask, std::nullopt, 0.5, "mask", "key").error().reason, Reason::bad_value);
}

TEST(LabelMap, AnInterpolatedLabelMapIsRefused) {
  Volume blurred = row_of({0, 0.5F, 1, 1.5F, 2});
  for (const std::optional<double> threshold : {std::optional<double>(), std::optional(0.5)})
    EXPECT_THAT(choose_mask(blurred, std::nullopt, threshold, "mask", "key").error().message,
                HasSubstr("by its nearest voxel"));
}

}  // namespace
}  // namespace helicarm::volume
