// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/spatial_registration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/validated_test.h"

namespace helicarm::xray {
namespace spatial_registration_test {

using testing::HasSubstr;

constexpr std::array<double, 16> quarter_turn{0, -1, 0, 12.5, 1, 0, 0, -3, 0, 0, 1, 0.123456789, 0, 0, 0, 1};

DicomBuilder ct_slice() {
  DicomBuilder builder;
  return builder.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.2")
      .text(0x00080018, "UI", "1.2.3.4")
      .text(0x00100010, "PN", "Doe^Jane")
      .text(0x00100020, "LO", "42")
      .text(0x0020000D, "UI", "1.2.3.5")
      .text(0x00200052, "UI", "1.2.3.6");
}

struct Written {
  std::string bytes;
  DicomElements elements;
};

Written written(const SpatialRegistration& registration, const std::filesystem::path& path) {
  EXPECT_TRUE(write_spatial_registration(path, registration));
  Written file{*read_file(path, 1 << 20), {}};
  file.elements = *walk_dicom(file.bytes, "reg.dcm");
  return file;
}

TEST(SpatialRegistration, CarriesTheCtsFrameIntoTheOther) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_file(folder.path() / "1.dcm", ct_slice().bytes()));
  const auto frame = ct_frame_of(folder.path() / "1.dcm");
  ASSERT_TRUE(frame && *frame);
  EXPECT_EQ((*frame)->frame_of_reference_uid, "1.2.3.6");
  const auto file =
      written({**frame, "1.2.3.7", quarter_turn, "femur to calibrator"}, folder.path() / "reg.dcm");
  EXPECT_EQ(file.elements.text(tags::sop_class), "1.2.840.10008.5.1.4.1.1.66.1");
  EXPECT_EQ(file.elements.text(tags::frame_of_reference), "1.2.3.7");
  EXPECT_EQ(file.elements.text(tags::study), "1.2.3.5");
  EXPECT_EQ(file.elements.text({0x00100020, ""}), "42");
  const auto items = sequence_items(file.elements, {0x00700308, "Registration Sequence"});
  ASSERT_EQ(items.size(), 2U);
  EXPECT_EQ(items[0].text(tags::frame_of_reference), "1.2.3.6");
  EXPECT_EQ(items[1].text(tags::frame_of_reference), "1.2.3.7");
  const auto steps = sequence_items(items[0], {0x00700309, "Matrix Registration Sequence"});
  const auto matrices = sequence_items(steps.at(0), {0x0070030A, "Matrix Sequence"});
  EXPECT_EQ(matrices.at(0).text({0x0070030C, ""}), "RIGID");
  const auto numbers = matrices[0].numbers({0x300600C6, "Matrix"}, 16, -1e6, 1e6);
  ASSERT_TRUE(numbers);
  for (std::size_t i = 0; i < 16; ++i) EXPECT_NEAR((*numbers)[i], quarter_turn[i], 1e-9);
}

TEST(SpatialRegistration, ConformsToTheStandard) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_file(folder.path() / "1.dcm", ct_slice().bytes()));
  const auto frame = ct_frame_of(folder.path() / "1.dcm");
  written({**frame, "1.2.3.7", quarter_turn, "femur to calibrator"}, folder.path() / "reg.dcm");
  const auto errors = validated(folder.path() / "reg.dcm");
  if (!errors) GTEST_SKIP() << "dciodvfy (dicom3tools) is not installed";
  EXPECT_EQ(*errors, "");
}

TEST(SpatialRegistration, TheDescriptionIsOneValueOfWholeCharacters) {
  const TemporaryFolder folder;
  const std::string before(63, 'a');
  const auto file =
      written({{"1.2.3.6", {}}, "1.2.3.7", quarter_turn, before + "\u00fc\\b"}, folder.path() / "reg.dcm");
  EXPECT_EQ(file.elements.text({0x0008103E, ""}), before);
  const auto other =
      written({{"1.2.3.6", {}}, "1.2.3.7", quarter_turn, "left\\right"}, folder.path() / "reg.dcm");
  EXPECT_EQ(other.elements.text({0x00700081, ""}), "left/right");
}

TEST(SpatialRegistration, TheSameContentHasTheSameUid) {
  const TemporaryFolder folder;
  SpatialRegistration registration{{"1.2", {}}, "1.3", quarter_turn, ""};
  const auto uid = [&] {
    return std::string(written(registration, folder.path() / "reg.dcm").elements.text(tags::sop_instance));
  };
  const std::string first = uid();
  EXPECT_EQ(uid(), first);
  registration.frame_from_ct[3] = 12.6;
  EXPECT_NE(uid(), first);
}

TEST(SpatialRegistration, AMatrixThatIsNotRigidIsRefused) {
  const TemporaryFolder folder;
  SpatialRegistration registration{{"1.2", {}}, "1.3", quarter_turn, ""};
  registration.frame_from_ct[0] = 0.1;
  EXPECT_THAT(write_spatial_registration(folder.path() / "reg.dcm", registration).error().message,
              HasSubstr("not a rigid matrix"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "reg.dcm"));
}

TEST(SpatialRegistration, AFileThatIsNoCtSliceHasNoFrame) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_file(folder.path() / "note.txt", "no image"));
  ASSERT_TRUE(write_file(folder.path() / "ct.dcm", ct_slice().erase(0x00200052).bytes()));
  EXPECT_FALSE(*ct_frame_of(folder.path() / "note.txt"));
  EXPECT_FALSE(*ct_frame_of(folder.path() / "ct.dcm"));
  EXPECT_EQ(ct_frame_of(folder.path() / "none.dcm").error().reason, Reason::missing_file);
}

}  // namespace spatial_registration_test
}  // namespace helicarm::xray
