// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/tiff_stack.h"

#include <gmock/gmock.h>
#include <tiffio.h>

#include "helicarm/core/temporary_folder.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;

/// Two pages of 3 x 2 pixels, 0.5 mm apart as ImageJ describes them with this unit and 2 pixels per unit.
void write_stack(const std::filesystem::path& path, const std::string& unit, float per_unit) {
  TIFF* tiff = TIFFOpen(path.c_str(), "w");
  ASSERT_NE(tiff, nullptr);
  for (int page = 0; page < 2; ++page) {
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 3);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 2);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 16);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 2);
    TIFFSetField(tiff, TIFFTAG_XRESOLUTION, per_unit);
    TIFFSetField(tiff, TIFFTAG_YRESOLUTION, per_unit);
    if (!unit.empty())
      TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION,
                   ("ImageJ=1.53t\nimages=2\nspacing=0.5\nunit=" + unit + "\n").c_str());
    std::uint16_t row[3] = {1, 2, 3};
    for (std::uint32_t v = 0; v < 2; ++v) TIFFWriteScanline(tiff, row, v);
    TIFFWriteDirectory(tiff);
  }
  TIFFClose(tiff);
}

std::vector<Warning> warnings_of(const std::string& unit, float per_unit, const Vector3d& voxel_mm) {
  const TemporaryFolder folder;
  write_stack(folder.path() / "s.tif", unit, per_unit);
  const auto stack = tiff_stack(folder.path() / "s.tif", voxel_mm, -1024);
  EXPECT_TRUE(stack) << stack.error().message;
  if (!stack) return {};
  EXPECT_EQ(stack->size, Eigen::Vector3i(3, 2, 2));
  EXPECT_EQ(stack->voxels[1], 2 - 1024);
  return stack->warnings;
}

TEST(TiffStack, SizeThatImageJStatesIsCompared) {
  EXPECT_TRUE(warnings_of("mm", 4, {0.25, 0.25, 0.5}).empty());
  EXPECT_TRUE(warnings_of("cm", 40, {0.25, 0.25, 5}).empty());
  const auto warnings = warnings_of("mm", 4, {0.25, 0.25, 0.625});
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].reason, Reason::irregular_file);
  EXPECT_THAT(warnings[0].message, testing::HasSubstr("0.625 along z"));
}

TEST(TiffStack, ResolutionOfAScreenIsNoSize) {
  EXPECT_TRUE(warnings_of("", 72, {0.25, 0.25, 0.5}).empty());
  EXPECT_TRUE(warnings_of("pixel", 1, {0.25, 0.25, 0.5}).empty());
}

}  // namespace
}  // namespace helicarm::volume
