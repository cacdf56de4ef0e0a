// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/derived_image.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/read_dicom.h"

namespace helicarm::xray {
namespace {

/// A file whose elements name its patient.
DicomBuilder named_file(const std::string& patient) {
  DicomBuilder builder;
  builder.text(0x00080018, "UI", "1.2.34567.89").text(0x0020000D, "UI", "1.2.76543.21");
  builder.text(0x00080022, "DA", "19990507").text(0x00080032, "TM", "091355");
  builder.text(0x00100010, "PN", patient)
      .text(0x00100020, "LO", "PID-4711")
      .text(0x00100030, "DA", "19410203");
  builder.text(0x00081030, "LO", patient + " knee").text(0x00091010, "LO", patient);
  return builder;
}

class DeIdentified : public testing::Test {
 protected:
  std::string bytes_of(const DicomBuilder& builder) {
    const auto source = read_dicom(builder.bytes(), "test", {});
    EXPECT_TRUE(source) << source.error().message;
    EXPECT_TRUE(write_dicom(folder_.path() / "a.dcm", de_identify_(*source)));
    return *read_file(folder_.path() / "a.dcm", 1 << 20);
  }

  TemporaryFolder folder_;
  DeIdentification de_identify_;
};

TEST_F(DeIdentified, FileHoldsNothingOfThePatient) {
  const std::string bytes = bytes_of(named_file("DOE^JANE"));
  for (const char* word : {"DOE", "JANE", "4711", "1999", "1941", "091355", "34567", "76543"})
    EXPECT_EQ(bytes.find(word), bytes.npos) << word;
}

TEST_F(DeIdentified, FileHasThePixelsAndTheGeometry) {
  const DicomBuilder file = named_file("DOE^JANE");
  const auto before = read_dicom(file.bytes(), "test", {});
  const auto after = read_dicom(bytes_of(file), "test", {});
  ASSERT_TRUE(after) << after.error().message;
  EXPECT_TRUE(std::ranges::equal(before->pixels.pixels(), after->pixels.pixels()));
  EXPECT_EQ(after->highest, before->highest);
  EXPECT_EQ(after->acquisition.pixel_mm, before->acquisition.pixel_mm);
  EXPECT_EQ(after->acquisition.source_detector_mm, before->acquisition.source_detector_mm);
  EXPECT_EQ(after->acquisition.source_patient_mm, before->acquisition.source_patient_mm);
}

TEST_F(DeIdentified, SignedPixelsAreShifted) {
  DicomBuilder file = named_file("DOE^JANE");
  file.word(0x00280103, 1);
  const auto before = read_dicom(file.bytes(), "test", {});
  const auto after = read_dicom(bytes_of(file), "test", {});
  ASSERT_TRUE(before && after);
  EXPECT_EQ(after->pixels(3, 2) - after->lowest, before->pixels(3, 2) - before->lowest);
}

TEST_F(DeIdentified, ImagesOfTwoPatientsStayThoseOfTwo) {
  const auto key = [](const std::string& bytes) {
    return read_dicom(bytes, "test", {})->acquisition.patient_key;
  };
  const std::string first = key(bytes_of(named_file("DOE^JANE")));
  EXPECT_EQ(key(bytes_of(named_file("DOE^JANE"))), first);
  EXPECT_NE(key(bytes_of(named_file("ROE^RICHARD"))), first);
}

TEST_F(DeIdentified, FileIsTheSameEachTime) {
  const std::string first = bytes_of(named_file("DOE^JANE"));
  de_identify_ = {};
  EXPECT_EQ(bytes_of(named_file("DOE^JANE")), first);
}

}  // namespace
}  // namespace helicarm::xray
