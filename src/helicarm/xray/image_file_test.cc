// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/image_file.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/read_xray_image.h"
#include "helicarm/xray/stated_size.h"

namespace helicarm::xray {
namespace {

/// Two frames of 8 x 6 pixels of a rotation.
std::string run_of_two(const std::string& increments) {
  DicomBuilder builder;
  builder.text(0x00280008, "IS", "2").text(0x00181510, "DS", "-30").text(0x00181520, "DS", increments);
  std::vector<std::uint16_t> values;
  for (std::uint16_t i = 0; i < 96; ++i) values.push_back(static_cast<std::uint16_t>(100 + i));
  builder.pixels(values);
  return builder.bytes();
}

class ImageFiles : public testing::Test {
 protected:
  std::shared_ptr<const ImageFile> opened(const std::string& bytes) {
    EXPECT_TRUE(write_file(file_, bytes));
    return *ImageFile::open(file_);
  }

  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "run.dcm";
};

TEST_F(ImageFiles, EachFrameIsThatOfTheFileReadAlone) {
  const auto file = opened(run_of_two("0\\2.5"));
  ASSERT_EQ(file->frames(), 2);
  EXPECT_TRUE(file->check_angles());
  for (const int frame : {1, 2}) {
    const auto image = file->read("RUN/1", frame), alone = read_xray_image(file_, "RUN/1", frame);
    ASSERT_TRUE(image && alone);
    EXPECT_EQ(image->acquisition.instance_key, alone->acquisition.instance_key);
    EXPECT_EQ(image->acquisition.primary_angle_deg, frame == 1 ? -30 : -27.5);
    EXPECT_EQ(image->name, "RUN/1");
  }
  EXPECT_EQ(file->read("RUN/3", 3).error().reason, Reason::bad_value);
}

TEST_F(ImageFiles, HeadersStateTheSize) {
  opened(run_of_two("0\\2.5"));
  EXPECT_EQ(stated_size(file_), Eigen::Vector2i(8, 6));
  ASSERT_TRUE(write_file(file_, "no image of any kind, but long enough"));
  EXPECT_FALSE(stated_size(file_));
  EXPECT_FALSE(stated_size(folder_.path() / "missing.dcm"));
}

TEST_F(ImageFiles, AnglesOfAnotherNumberOfFramesAreRefused) {
  const auto refused = opened(run_of_two("0\\2\\4"))->check_angles();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_NE(refused.error().message.find("(0018,1520) has 3 values for 2 frames"), std::string::npos);
  EXPECT_TRUE(opened(run_of_two("2"))->check_angles());
}

}  // namespace
}  // namespace helicarm::xray
