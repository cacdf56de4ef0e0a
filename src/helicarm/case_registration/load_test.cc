// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/load.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/volume/write_nrrd.h"

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
      bone.push_back(inside ? 250 : 0);
      labels.push_back(!inside ? 0 : x < 12 ? 3 : 8);
    }
    model_.name = "femur";
    model_.volume = folder_.path() / "ct.nrrd";
    model_.mask = folder_.path() / "labels.nrrd";
    const Eigen::Affine3d place = Eigen::Affine3d::Identity();
    EXPECT_TRUE(write_file(*model_.volume, volume::to_nrrd({24, 24, 24}, place, bone)));
    EXPECT_TRUE(write_file(*model_.mask, volume::to_nrrd({24, 24, 24}, place, labels)));
  }

  TemporaryFolder folder_;
  pipeline::CaseModel model_;
};

TEST_F(LoadLabelMap, TheChosenLabelIsTheBody) {
  model_.mask_label = 3;
  const auto loaded = load_model(model_);
  ASSERT_TRUE(loaded) << loaded.error().message;
  EXPECT_NEAR(loaded->model->centre.x(), 7.5, 0.7);
  model_.mask_label = 8;
  EXPECT_NEAR(load_model(model_)->model->centre.x(), 15.5, 0.7);
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
  model_.mask_label = 4;
  EXPECT_THAT(load_model(model_).error().message, HasSubstr("holds no label 4"));
}

}  // namespace
}  // namespace helicarm::case_registration
