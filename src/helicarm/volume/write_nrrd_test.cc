// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/write_nrrd.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/volume/read_volume.h"

namespace helicarm::volume {
namespace {

TEST(WriteNrrd, IsReadBackExactly) {
  const TemporaryFolder folder;
  Eigen::Affine3d place = Eigen::Translation3d(-12.1, 1.0 / 3, 977.25) *
                          Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()) *
                          Eigen::Scaling(0.4, -0.7, 1.25);
  std::vector<std::uint8_t> values(2 * 3 * 4);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = std::uint8_t(7 * i);
  ASSERT_TRUE(write_file(folder.path() / "a.nrrd", to_nrrd({2, 3, 4}, place, values)));
  const auto read = read_volume(folder.path() / "a.nrrd");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->size, Eigen::Vector3i(2, 3, 4));
  EXPECT_EQ(read->patient_from_voxel.matrix(), place.matrix());
  EXPECT_TRUE(read->warnings.empty());
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_EQ(read->voxels[i], float(values[i])) << i;
}

}  // namespace
}  // namespace helicarm::volume
