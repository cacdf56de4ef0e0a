// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/model.h"

#include <algorithm>

#include <gmock/gmock.h>

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;

std::size_t voxel(int x, int y, int z) {
  return std::size_t(x) + std::size_t{20} * (std::size_t(y) + std::size_t{16} * std::size_t(z));
}

/// A block of bone off the middle of a grid of soft tissue; `signs`: directions of the voxel axes in the
/// patient frame, as files in RAS or with a left-handed grid have them.
volume::Volume block(const Vector3d& signs) {
  volume::Volume volume;
  volume.size = {20, 16, 12};
  volume.voxels.assign(std::size_t{20} * 16 * 12, 40);
  const Vector3d spacing(1, 1.5, 2);
  volume.patient_from_voxel.linear() = signs.cwiseProduct(spacing).asDiagonal();
  volume.patient_from_voxel.translation() = Vector3d(100, -50, 20);
  for (int z = 0; z < 12; ++z)
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 20; ++x) {
        const Vector3d at = volume.patient_from_voxel * Vector3d(x, y, z);
        const Vector3d off = at - volume.patient_from_voxel * Vector3d(5, 10, 3);
        if (off.cwiseAbs().maxCoeff() <= 4) volume.voxels[voxel(x, y, z)] = 900;
      }
  return volume;
}

class GridDirections : public testing::TestWithParam<Vector3d> {};

TEST_P(GridDirections, KeepTheBodyAtItsPlaceInThePatient) {
  const volume::Volume volume = block(GetParam());
  const auto model = model_from("block", volume, std::nullopt, HuWindow{150, 3000});
  ASSERT_TRUE(model);
  EXPECT_LT((model->centre - volume.patient_from_voxel * Vector3d(5, 10, 3)).norm(), 0.6);
}

INSTANTIATE_TEST_SUITE_P(LpsRasLeftHanded, GridDirections,
                         testing::Values(Vector3d(1, 1, 1), Vector3d(-1, -1, 1), Vector3d(-1, 1, 1),
                                         Vector3d(1, 1, -1)));

TEST(ModelFrom, MaskOfAnotherGridIsRefused) {
  const volume::Volume volume = block({1, 1, 1});
  volume::Volume mask = volume;
  mask.patient_from_voxel.translation().x() += 5;
  const auto model = model_from("block", volume, mask, std::nullopt);
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().reason, Reason::bad_value);
}

TEST(ModelFrom, MaskOfAnotherGridIsRefusedFarFromTheOriginToo) {
  volume::Volume volume = block({1, 1, 1});
  volume.patient_from_voxel.translation() << -250, -250, -900;
  volume::Volume shifted = volume, stretched = volume;
  shifted.patient_from_voxel.translation().x() += 0.5;
  stretched.patient_from_voxel.linear().col(2) *= 1.5;
  for (const volume::Volume& mask : {shifted, stretched})
    EXPECT_THAT(model_from("block", volume, mask, std::nullopt).error().message,
                testing::HasSubstr("or they lie elsewhere"));
}

TEST(ModelFrom, ACtAsItsOwnMaskIsRefused) {
  const volume::Volume volume = block({1, 1, 1});
  EXPECT_THAT(model_from("block", volume, volume, std::nullopt).error().message,
              testing::HasSubstr("0 % of the mask's voxels are 0, which is outside: it is no mask"));
}

TEST(ModelFrom, AMaskOfSoftTissueIsRefused) {
  const volume::Volume volume = block({1, 1, 1});
  volume::Volume mask = volume;
  std::ranges::fill(mask.voxels, 0);
  mask.voxels[0] = 1;
  EXPECT_THAT(model_from("block", volume, mask, std::nullopt).error().message,
              testing::HasSubstr("nothing within the mask is denser than soft tissue"));
}

TEST(ModelFrom, AMaskedCtIsAMask) {
  const volume::Volume volume = block({1, 1, 1});
  volume::Volume mask = volume;
  for (float& value : mask.voxels) value = value > 500 ? value - 1100 : 0;
  EXPECT_TRUE(model_from("block", volume, mask, std::nullopt));
}

TEST(ModelFrom, AnEmptyWindowIsRefused) {
  EXPECT_FALSE(model_from("block", block({1, 1, 1}), std::nullopt, HuWindow{2000, 3000}));
}

TEST(ModelFrom, ABodyInMetresIsRefused) {
  volume::Volume volume = block({1, 1, 1});
  volume.patient_from_voxel = Eigen::Scaling(0.001) * volume.patient_from_voxel;
  const auto model = model_from("block", volume, std::nullopt, HuWindow{150, 3000});
  ASSERT_FALSE(model);
  EXPECT_THAT(model.error().message, testing::HasSubstr("is its file in mm?"));
}

TEST(ModelFrom, VoxelsOnTheBoundaryKeepTheirShare) {
  volume::Volume volume = block({1, 1, 1});
  const auto at = [](int x) { return voxel(x, 10, 3); };
  ASSERT_EQ(volume.voxels[at(9)], 900);
  volume.voxels[at(10)] = 120;  // a seventh of the voxel is bone
  volume.voxels[at(11)] = 120;  // beside no bone
  double mass = 0, least = 1;
  const auto model = model_from("block", volume, std::nullopt, HuWindow{150, 3000});
  for (const float value : model->density.values) {
    mass += value;
    if (value > 0) least = std::min(least, double(value));
  }
  EXPECT_NEAR(least, 0.07, 1e-6);
  const auto voxels = std::ranges::count(volume.voxels, 900.0F);
  EXPECT_NEAR(mass, 0.85 * double(voxels) + 0.07, 1e-3);
}

TEST(ModelFrom, OnlyBoneHardensTheBeam) {
  const volume::Volume volume = block({1, 1, 1});
  EXPECT_GT(model_from("block", volume, std::nullopt, HuWindow{150, 3000})->density.hardening, 0);
  EXPECT_EQ(model_from("block", volume, std::nullopt, std::nullopt)->density.hardening, 0);
}

TEST(ModelFrom, ABodyThatReachesTheEdgeHasCuts) {
  volume::Volume volume = block({1, 1, 1});
  EXPECT_TRUE(model_from("block", volume, std::nullopt, HuWindow{150, 3000})->cuts.empty());
  for (int x = 0; x < 20; ++x)
    for (int y = 4; y < 12; ++y) volume.voxels[voxel(x, y, 0)] = 900;
  EXPECT_FALSE(model_from("block", volume, std::nullopt, HuWindow{150, 3000})->cuts.empty());
}

}  // namespace
}  // namespace helicarm::registration
